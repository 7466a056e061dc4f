"""Strong errors: how far the paths of a scheme at step h are from its own paths at the reference step.

The error at h is sup_n (E |y_h(t_n) - y_ref(t_n)|^2)^(1/2) over the grid of h, as in Theorem thm-general; the value at
the final time is kept as well.  The reference is the scheme itself, as in the paper, or one scheme for all
(``reference_scheme``), which shows whether schemes have the same limit.
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from spi.ensemble.loop import nested_grid
from spi.ensemble.protocol import REPORT, casimirs
from spi.kinds.blocks import BlocksPlan
from spi.kinds.plans import Cost, Done, State
from spi.schemes import typical_ns
from spi.statistics.estimators import GROUPS, PARTS, group_counts, jackknife_stderr, root_mean_square
from spi.storage.records import Part

from ..results import StrongErrors
from .errors import results
from .paths import BLOCKS_PER_ROUND, Rows, Totals, added, nanoseconds_per_step, rows_of

_BATCH_BYTES = 64e6


def parts(case: Any) -> list[Part]:
    """What is run one after the other: each scheme."""
    return [Part(scheme, eps=eps) for scheme, eps in case.runs]


def plan(case: Any, part: Part) -> "StrongPlan":
    """The plan for one scheme of a case."""
    reference = case.reference_record(part.eps)
    times = nested_grid(case.final_time, case.reference_step, case.steps, case.truncate_noise, reference)
    return StrongPlan(case=case, part=part, grid=times, samples=case.samples)


class Times(NamedTuple):
    """What is measured once all paths are done."""

    seconds: float  #: wall clock
    ns_per_step: np.ndarray  #: (levels - 1,) from large to small steps, NaN until measured


@dataclass(frozen=True, kw_only=True)
class StrongPlan(BlocksPlan):
    """Strong errors of one scheme; `timed_steps` says whether the time of a step is measured at the end."""

    timed_steps: bool = True

    @property
    def points(self) -> int:
        """Grid points of all step sizes but the reference."""
        return int(self.steps[1:].sum())

    def cost(self) -> Cost:
        """Steps of paths, seconds of one thread at typical speed, and bytes of memory."""
        steps = int(self.steps.sum()) * self.samples
        seconds = steps * 1e-9 * typical_ns(self.row, self.model)
        return Cost(steps, seconds, int(_BATCH_BYTES) + 8 * GROUPS * self.points)

    def begin(self) -> Times:
        """No time has been measured."""
        return Times(0.0, np.full(len(self.steps) - 1, np.nan))

    def empty(self, number: int) -> Totals:
        """The totals over no paths."""
        levels = len(self.steps)
        return Totals(
            paths=0,
            seconds=0.0,
            cpu_seconds=0.0,
            squares=np.zeros((GROUPS, self.points)),
            drift=np.zeros((levels, len(casimirs(self.model, self.initial)))),
            nonfinite=np.zeros(levels, np.int64),
            report=np.zeros((levels, len(REPORT))),
        )

    def most_blocks(self, number: int) -> int:
        """How many blocks a batch may have, because of memory."""
        return max(1, min(BLOCKS_PER_ROUND * 8, int(_BATCH_BYTES / (8 * PARTS * max(self.points, 1)))))

    def rows(self, number: int, first: int, blocks: int, end: int) -> Rows:
        """What some blocks contribute, see ``paths``."""
        return rows_of(self, first, blocks, end)

    def added(self, sums: Totals, rows: Rows, at: slice, first: int, end: int) -> Totals:
        """The totals with some rows, see ``paths``."""
        return added(self, sums, rows, at, first, end)

    def finish(self, state: State) -> Iterator[Times]:
        """Measure the time of a step at each step size."""
        for i in np.flatnonzero(np.isnan(state.more.ns_per_step)) if self.timed_steps else ():
            began, ns = time.perf_counter(), state.more.ns_per_step.copy()
            ns[i] = nanoseconds_per_step(self, self.case.steps[i])
            yield Times(state.more.seconds + time.perf_counter() - began, ns)

    def progress(self, state: State) -> Done:
        """Paths done, all paths, and the standard error at the final time of the largest step."""
        known = state.tally()
        if not known.paths:
            return Done(0, self.samples, float("nan"))
        counts = group_counts(known.paths)
        # of one time alone: sums over all of them are large, and this is asked after each batch
        value, without = root_mean_square(np.sum([sums.squares[:, -1] for sums in known.each], axis=0), counts)
        return Done(known.paths, self.samples, float(jackknife_stderr(value, without, counts)))

    def results(self, state: State) -> StrongErrors:
        """The results of one scheme of a case, from its final state."""
        return results(self, state)
