"""The paths of a study of strong errors: what is summed along them, and the time of a step."""

import time
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from spi.ensemble.areas import fourier_terms
from spi.ensemble.loop import add_reports, arguments_of, grid, integrate, integrated, limited_threads
from spi.ensemble.observer import path_observer
from spi.ensemble.protocol import large
from spi.numerics.rng import LANES
from spi.schemes import typical_ns
from spi.statistics.estimators import GROUPS, PARTS

if TYPE_CHECKING:
    from . import StrongPlan

BLOCKS_PER_ROUND = GROUPS // PARTS  #: after so many blocks all groups have had equally many paths
_TIMED_STEPS = 2048  # of one block, for the time of a step


class Totals(NamedTuple):
    """What is known of some paths."""

    paths: int
    seconds: float  #: wall clock
    cpu_seconds: float
    squares: np.ndarray  #: (GROUPS, points)
    drift: np.ndarray  #: (levels, casimirs)
    nonfinite: np.ndarray  #: (levels,)
    report: np.ndarray  #: (levels, len(REPORT))

    def plus(self, later: "Totals") -> "Totals":
        """These paths and some later ones."""
        return Totals(
            paths=self.paths + later.paths,
            seconds=self.seconds + later.seconds,
            cpu_seconds=self.cpu_seconds + later.cpu_seconds,
            squares=self.squares + later.squares,
            drift=np.maximum(self.drift, later.drift),
            nonfinite=self.nonfinite + later.nonfinite,
            report=add_reports(self.report, later.report[np.newaxis]),
        )


class Rows(NamedTuple):
    """What some blocks contribute, a row for each."""

    squares: np.ndarray  #: (blocks, points, PARTS) sums of |y_h - y_ref|^2
    drift: np.ndarray  #: (blocks, levels, C, LANES)
    nonfinite: np.ndarray  #: (blocks, levels)
    report: np.ndarray  #: (blocks, levels, len(REPORT))


def rows_of(p: "StrongPlan", first: int, blocks: int, end: int) -> Rows:
    """Integrate the blocks from block `first` on; paths from number `end` on are idle."""
    observer = path_observer(p.model, p.initial, p.grid, blocks, squares=True)
    what = p.scheme, p.model, p.initial, p.grid, p.stream
    states, report = integrated(*what, first, blocks, end, observer)
    y = states[..., : len(p.initial) * LANES].reshape(*states.shape[:2], -1, LANES)
    idle = np.arange(first * LANES, (first + blocks) * LANES).reshape(-1, 1, LANES) >= end
    nonfinite = (~(np.isfinite(y).all(axis=2) | idle)).sum(axis=-1)
    return Rows(observer.rows, observer.extremes, nonfinite, report)


def added(p: "StrongPlan", known: Totals, rows: Rows, at: slice, first: int, end: int) -> Totals:
    """The totals with the rows `at`, of which the first is that of block `first`."""
    squares = known.squares.reshape(BLOCKS_PER_ROUND, PARTS, -1).copy()
    drift = known.drift.copy()
    for block, row in enumerate(range(at.start, at.stop), first):
        squares[block % BLOCKS_PER_ROUND] += rows.squares[row].T
        lanes = min(LANES, end - block * LANES)
        # a diverged path has no last drift but NaN: it is infinitely far
        worst = np.nan_to_num(rows.drift[row, :, :, :lanes], nan=np.inf, posinf=np.inf).max(axis=-1)
        drift = np.maximum(drift, worst)
    return known._replace(
        squares=squares.reshape(GROUPS, -1),
        drift=drift,
        nonfinite=known.nonfinite + rows.nonfinite[at].sum(axis=0),
        report=add_reports(known.report, rows.report[at]),
    )


def nanoseconds_per_step(p: "StrongPlan", h: float) -> float:
    """Time of one step of one path at step size h, alone on one thread: the best of three runs of one block."""
    steps = _TIMED_STEPS
    if large(p.model):  # about 0.2 s
        steps = min(steps, max(1, int(2e8 / (LANES * typical_ns(p.row, p.model)))))
    times = grid(
        h,
        steps,
        truncate=p.grid.truncate,
        reference_scheme=p.grid.reference_scheme,
        by_reference=(0,),
        area_terms=fourier_terms(p.model, [p.scheme], h),
    )
    best = np.inf
    with limited_threads(1):
        for _ in range(3):
            observer = path_observer(p.model, p.initial, times, 1)
            arguments = arguments_of(p.scheme, p.model, p.initial, times, p.stream, 0, 1, LANES, observer)
            began = time.perf_counter()
            integrate(*arguments)
            best = min(best, time.perf_counter() - began)
    return 1e9 * best / (steps * LANES)
