"""The paths of a study of long times, from one snapshot to the next."""

import time
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from spi.ensemble.areas import fourier_terms
from spi.ensemble.invariants import casimirs_of_states, growth
from spi.ensemble.loop import add_reports, grid, integrated, paths_of, states_at
from spi.ensemble.protocol import REPORT, casimirs
from spi.exact.sphere_law import BINS, SphereLaw
from spi.numerics.rng import LANES, STEPS_PER_TOSS
from spi.statistics.tallies import Chunk

if TYPE_CHECKING:
    from . import LongTimePlan

_WARM_UP = 1 / 16  # of the time, before snapshots count for the law


class Paths(NamedTuple):
    """What is known of the paths of some blocks, which stand along the last axes, after `n` steps of one step size.

    Until all steps are done there is nothing to say of whole paths, and `paths` is 0.
    """

    paths: int
    seconds: float  #: wall clock
    n: int
    y: np.ndarray  #: (blocks, d * LANES + memory), no blocks once all steps are done
    casimir: np.ndarray  #: (records, C, paths), relative error
    report: np.ndarray  #: (len(REPORT),)
    nonfinite: int  #: of the paths
    snapshots: int  #: how many count for the law
    moments: np.ndarray  #: (moments, paths), sums over snapshots
    counts: np.ndarray  #: (variables, bins, paths)

    def plus(self, later: "Paths") -> "Paths":
        """These paths and some later ones, all steps done."""
        joined: dict[str, Any] = {
            name: np.concatenate((getattr(self, name), getattr(later, name)), axis=-1) for name in OF_PATHS
        }
        return self._replace(
            paths=self.paths + later.paths,
            seconds=self.seconds + later.seconds,
            report=add_reports(self.report[np.newaxis], later.report[np.newaxis, np.newaxis])[0],
            nonfinite=self.nonfinite + later.nonfinite,
            **joined,
        )


OF_PATHS = ("casimir", "moments", "counts")  #: the fields in which the paths stand along the last axis


def paths_at_start(p: "LongTimePlan", blocks: int) -> Paths:
    """So many blocks before their first step."""
    paths, conserved = blocks * LANES, len(casimirs(p.model, p.initial))
    moments, variables = (len(p.law.moments), len(p.law.variables)) if p.law else (0, 0)
    return Paths(
        paths=0,
        seconds=0.0,
        n=0,
        y=states_at(p.initial, p.scheme, p.model, grid(p.case.steps[0], 1), blocks)[:, 0],
        casimir=np.full((len(p.records), conserved, paths), np.nan),
        report=np.zeros(len(REPORT)),
        nonfinite=0,
        snapshots=0,
        moments=np.zeros((moments, paths)),
        counts=np.zeros((variables, BINS, paths)),
    )


def next_stop(p: "LongTimePlan", n: int) -> int:
    """The number of steps until which paths are run next that have done n."""
    if n < p.spacing:
        return min(max(2 * n, STEPS_PER_TOSS), p.case.step_count)
    return min((n // p.spacing + 1) * p.spacing, p.case.step_count)


def advanced(p: "LongTimePlan", chunk: Chunk, known: Paths) -> Paths:
    """The paths of a chunk at the next snapshot."""
    began = time.perf_counter()
    stop = next_stop(p, known.n)
    h = p.case.steps[chunk.path_set]
    terms = fourier_terms(p.model, [p.scheme], h)
    times = grid(h, stop - known.n, truncate=p.case.truncate_noise, area_terms=terms, first_step=known.n)
    what = p.scheme, p.model, known.y[:, np.newaxis], times, p.stream, chunk.first, chunk.blocks, chunk.end
    rows, report = integrated(*what)
    y, (states,) = rows[:, 0], paths_of(rows, len(p.initial))
    known = known._replace(n=stop, y=y, report=add_reports(known.report[np.newaxis], report)[0])
    with np.errstate(all="ignore"):
        if stop in p.records:
            known = _recorded(p, known, times.reference_step, states)
        if p.law and stop > _WARM_UP * p.case.step_count:
            known = _counted(p.law, known, states)
    if stop == p.case.step_count:
        known = known._replace(
            paths=chunk.paths,
            y=y[:0],
            nonfinite=int((~np.isfinite(states[:, : chunk.paths]).all(axis=0)).sum()),
            **{name: getattr(known, name)[..., : chunk.paths] for name in OF_PATHS},
        )
    return known._replace(seconds=known.seconds + time.perf_counter() - began)


def _recorded(p: "LongTimePlan", known: Paths, h: float, states: np.ndarray) -> Paths:
    """With the relative errors of the Casimirs at this time, after steps of size h."""
    if not known.casimir.shape[1]:
        return known
    first = np.array(casimirs(p.model, p.initial))[:, None]
    grown = np.reshape(growth(p.model, known.n * h), (-1, 1))
    change = casimirs_of_states(p.model, states) * grown - first
    casimir = known.casimir.copy()
    casimir[np.searchsorted(p.records, known.n)] = change / np.where(first == 0.0, 1.0, np.abs(first))
    return known._replace(casimir=casimir)


def _counted(law: SphereLaw, known: Paths, states: np.ndarray) -> Paths:
    """With one more snapshot in the sums."""
    counts = known.counts.copy()
    law.count(states, counts)
    return known._replace(moments=known.moments + law.moments_of(states), counts=counts, snapshots=known.snapshots + 1)
