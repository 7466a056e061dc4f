"""The paths of a study of strong errors: what is summed along them, and the time of a step."""

import time
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from spi.compiler.dispatch import unrolled
from spi.ensemble.areas import fourier_terms
from spi.ensemble.fields import squared_distance
from spi.ensemble.invariants import watch_casimirs, watched_casimirs
from spi.ensemble.lanes import load_lane
from spi.ensemble.loop import Grid, add_reports, empty_report, grid, integrate, limited_threads, step_sizes_of, steps_of
from spi.ensemble.protocol import conserved, large
from spi.numerics.rng import LANES
from spi.schemes import typical_ns
from spi.statistics.estimators import GROUPS, PARTS

if TYPE_CHECKING:
    from . import StrongPlan

BLOCKS_PER_ROUND = GROUPS // PARTS  #: after so many blocks all groups have had equally many paths
_TIMED_STEPS = 2048  # of one block, for the time of a step


class StrongSums(NamedTuple):
    """What one batch of blocks contributes; a row per block.

    `squares[row, offsets[l] + n - 1, part]` is the sum of |y_h - y_ref|^2 at time n h over the lanes of a part, for
    step size number l > 0; `drift[row, l, c, lane]` the largest |C_c(y) - C_c(y_0)| so far (for the reference: at the
    end; with damping see ``spi.ensemble.invariants``); `nonfinite[row, l]` the number of paths that are not finite at
    the end.
    """

    squares: np.ndarray
    drift: np.ndarray
    nonfinite: np.ndarray
    offsets: np.ndarray  #: (levels,) int64
    steps: np.ndarray  #: (levels,) int64, how many steps each step size takes
    initial_casimirs: tuple

    def observe(observer, model, row, paths, level, n, y, reference):
        if level > 0:
            squares = observer.squares[row, observer.offsets[level] + n - 1]
            for first in range(0, LANES, PARTS):
                for part in range(PARTS):
                    lane = first + part
                    square = squared_distance(load_lane(model, y, lane), load_lane(model, reference, lane))
                    squares[part] += square if lane < paths else 0.0
        last = n == observer.steps[level]
        if level > 0 or last:
            watch_casimirs(model, observer.drift[row, level], observer.initial_casimirs, level, n, paths, y)
        if last:
            for lane in range(paths):
                observer.nonfinite[row, level] += 0 if _zero_if_finite(load_lane(model, y, lane)) == 0.0 else 1


@unrolled(total="a[i] - a[i]")
def _zero_if_finite(a):
    """0, or NaN if a component is not finite."""


def sums_of(model: Any, initial: tuple[float, ...], times: Grid, rows: int) -> StrongSums:
    """Empty sums for `rows` blocks of paths on a grid."""
    steps = steps_of(times)
    levels = len(steps)
    return StrongSums(
        np.zeros((rows, max(int(steps[1:].sum()), 1), PARTS)),
        np.zeros((rows, levels, conserved(model), LANES)),
        np.zeros((rows, levels), np.int64),
        np.concatenate(([0, 0], np.cumsum(steps[1:-1])))[:levels].astype(np.int64),
        steps,
        watched_casimirs(model, initial, step_sizes_of(times)),
    )


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

    sums: StrongSums
    report: np.ndarray  #: (blocks, levels, len(REPORT))


def rows_of(p: "StrongPlan", first: int, blocks: int, end: int) -> Rows:
    """Integrate the blocks from block `first` on; paths from number `end` on are idle."""
    rows = Rows(sums_of(p.model, p.initial, p.grid, blocks), empty_report(blocks, len(p.steps)))
    integrate(p.scheme, p.model, p.initial, p.grid, p.stream, rows.sums, rows.report, first, blocks, end)
    return rows


def added(p: "StrongPlan", known: Totals, rows: Rows, at: slice, first: int, end: int) -> Totals:
    """The totals with the rows `at`, of which the first is that of block `first`."""
    squares = known.squares.reshape(BLOCKS_PER_ROUND, PARTS, -1).copy()
    drift = known.drift.copy()
    for block, row in enumerate(range(at.start, at.stop), first):
        squares[block % BLOCKS_PER_ROUND] += rows.sums.squares[row, : p.points].T
        lanes = min(LANES, end - block * LANES)
        # a diverged path has no last drift but NaN: it is infinitely far
        worst = np.nan_to_num(rows.sums.drift[row, :, :, :lanes], nan=np.inf, posinf=np.inf).max(axis=-1)
        drift = np.maximum(drift, worst)
    return known._replace(
        squares=squares.reshape(GROUPS, -1),
        drift=drift,
        nonfinite=known.nonfinite + rows.sums.nonfinite[at].sum(axis=0),
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
            sums, report = sums_of(p.model, p.initial, times, 1), empty_report(1, 1)
            began = time.perf_counter()
            integrate(p.scheme, p.model, p.initial, times, p.stream, sums, report, 0, 1, LANES)
            best = min(best, time.perf_counter() - began)
    return 1e9 * best / (steps * LANES)
