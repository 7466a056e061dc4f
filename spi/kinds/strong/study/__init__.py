"""Strong errors: how far the paths of a scheme at step h are from its own paths at the reference step.

The error at h is sup_n (E |y_h(t_n) - y_ref(t_n)|^2)^(1/2) over the grid of h, as in Theorem thm-general; the value at
the final time is kept as well.  The reference is the scheme itself, as in the paper, or one scheme for all
(``reference_scheme``), which shows whether schemes have the same limit.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from spi.ensemble import in_batches, nested_grid
from spi.estimators import GROUPS, PARTS, group_counts, jackknife_stderr, root_mean_square
from spi.kinds.plans import Cost, Done, KernelCall, PathsPlan
from spi.protocol import REPORT, casimirs
from spi.records import Group, Part
from spi.schemes import reference_record, typical_ns

from .errors import group
from .paths import BLOCKS_PER_ROUND, State, advance_state, nanoseconds_per_step, sums_of

_BATCH_BYTES = 64e6


def parts(case: Any) -> list[Part]:
    """What is run one after the other: each scheme."""
    return [Part(scheme, eps=eps) for scheme, eps in case.runs]


def plan(case: Any, part: Part) -> "StrongPlan":
    """The plan for one scheme of a case."""
    reference = reference_record(case.reference_scheme, part.eps)
    times = nested_grid(case.final_time, case.reference_step, case.steps, case.truncate_noise, reference)
    return StrongPlan(case=case, part=part, grid=times, samples=case.samples)


@dataclass(frozen=True, kw_only=True)
class StrongPlan(PathsPlan):
    """Strong errors of one scheme; `timed` says whether the time of a step is measured once all paths are done."""

    timed: bool = True

    @property
    def points(self) -> int:
        """Grid points of all step sizes but the reference."""
        return int(self.steps[1:].sum())

    def cost(self) -> Cost:
        """Steps of paths, seconds of one thread at typical speed, and bytes of memory."""
        steps = int(self.steps.sum()) * self.samples
        seconds = steps * 1e-9 * typical_ns(self.part.scheme, self.model)
        return Cost(steps, seconds, int(_BATCH_BYTES) + 8 * GROUPS * self.points)

    def start(self) -> State:
        """The state before the first block."""
        levels = len(self.steps)
        return State(
            blocks=0,
            seconds=0.0,
            squares=np.zeros((GROUPS, self.points)),
            drift=np.zeros((levels, len(casimirs(self.model, self.initial)))),
            nonfinite=np.zeros(levels, np.int64),
            report=np.zeros((levels, len(REPORT))),
            ns_per_step=np.full(levels - 1, np.nan),
        )

    def kernel_calls(self) -> list[KernelCall]:
        """One step of one block, which also serves the measurement of times."""
        least = self.least
        return [least.integration(sums_of(least.model, least.initial, least.steps, 1))]

    def batches(self, state: State) -> Iterator[State]:
        """Run all blocks that are left, then measure the time of a step; yields the state after each batch."""
        most = max(1, min(BLOCKS_PER_ROUND * 8, int(_BATCH_BYTES / (8 * PARTS * max(self.points, 1)))))
        for state in in_batches(state, partial(advance_state, self), lambda state: self.blocks - state.blocks, most):
            yield state
        for i in np.flatnonzero(np.isnan(state.ns_per_step)) if self.timed else ():
            ns = state.ns_per_step.copy()
            ns[i] = nanoseconds_per_step(self, self.case.steps[i])
            state = state._replace(ns_per_step=ns)
            yield state

    def progress(self, state: State) -> Done:
        """Paths done, all paths, and the standard error at the final time of the largest step."""
        done = self.paths_done(state)
        if not done:
            return Done(0, self.samples, float("nan"))
        value, without = root_mean_square(state.squares[:, -1], group_counts(done))
        return Done(done, self.samples, float(jackknife_stderr(value, without, group_counts(done))))

    def group(self, state: State) -> Group:
        """The results of one scheme of a case, from its final state."""
        return group(self, state)
