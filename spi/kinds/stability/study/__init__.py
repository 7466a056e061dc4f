"""Stability: what schemes keep of the equation where steps are large or parameters extreme.

For each value of the swept word the same Brownian paths are run at all step sizes.  Of every path the study keeps the
largest relative error of each Casimir and the largest |y| over all times, and the last state; from these come the
fraction of paths that stay finite, the distance from the scheme's own path at the reference step, and, where there are
test functions and the law of the equation is known without sampling, the distance of expectations from the truth.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from spi.ensemble import in_batches, nested_grid
from spi.kinds.plans import Cost, Done, KernelCall, PathsPlan
from spi.protocol import REPORT, casimirs
from spi.records import Group, Part
from spi.schemes import SCHEMES, reference_record, typical_ns

from .law import TRUTH_SECONDS, has_truth, with_truth
from .paths import State, advance_state, extremes_of, paths_of_a_value
from .results import group

_MOST_BLOCKS = 64


def parts(case: Any) -> list[Part]:
    """What is run one after the other: each scheme, whatever its eps if that is what is swept."""
    return [Part(scheme) for scheme in case.schemes]


def plan(case: Any, part: Part) -> "StabilityPlan":
    """The plan for one scheme of a case."""
    return StabilityPlan(case=case, part=part, points=tuple(_point(one, part.scheme) for one in case.sweep.cases))


def _point(case: Any, scheme: str) -> PathsPlan:
    """The paths of one scheme for a case without the swept word."""
    eps = case.eps[0] if SCHEMES[scheme].multiscale else None
    reference = reference_record(case.reference_scheme, eps)
    times = nested_grid(case.final_time, case.reference_step, case.steps, case.truncate_noise, reference)
    return PathsPlan(case=case, part=Part(scheme, eps=eps), grid=times, samples=case.samples)


@dataclass(frozen=True, kw_only=True)
class StabilityPlan:
    """One scheme at all step sizes for all values of the swept word."""

    case: Any  #: ``spi.kinds.stability.keys.Case``
    part: Part
    points: tuple[PathsPlan, ...]  #: the paths for each value; only models, initial states and eps differ

    @property
    def first(self) -> PathsPlan:
        """The paths for the first value, which tell what is the same for all."""
        return self.points[0]

    @property
    def functions(self) -> tuple:
        """The trees of the test functions."""
        return self.case.expressions

    @property
    def levels(self) -> int:
        """How many step sizes there are, the reference included."""
        return len(self.first.steps)

    def cost(self) -> Cost:
        """Steps of paths, seconds of one thread at typical speed, and bytes of memory."""
        steps = int(self.first.steps.sum()) * self.first.samples * len(self.points)
        seconds = steps * 1e-9 * typical_ns(self.part.scheme, self.first.model)
        if has_truth(self) and self.part.scheme == self.case.schemes[0]:  # which the other schemes then know
            seconds += TRUTH_SECONDS * len(self.points)
        return Cost(steps, seconds, sum(v.nbytes for v in self.start() if isinstance(v, np.ndarray)))

    def start(self) -> State:
        """The state before the first block."""
        values, steps, functions = len(self.points), self.levels - 1, len(self.functions)
        conserved = len(casimirs(self.first.model, self.first.initial))
        return State(
            done=0,
            blocks=0,
            seconds=0.0,
            **paths_of_a_value(self),
            report=np.zeros((values, self.levels, len(REPORT))),
            finite=np.zeros((values, steps)),
            casimir_worst=np.zeros((values, steps, conserved)),
            casimir_median=np.zeros((values, steps, conserved)),
            largest_norm=np.zeros((values, steps)),
            positive=np.zeros((values, steps)),
            error=np.zeros((values, steps)),
            error_stderr=np.zeros((values, steps)),
            expectation=np.zeros((values, steps, functions)),
            expectation_stderr=np.zeros((values, steps, functions)),
            truth=np.full((values, functions), np.nan),
            truth_bound=np.full((values, functions), np.nan),
        )

    def kernel_calls(self) -> list[KernelCall]:
        """One step of one block for each value."""
        least = [point.least for point in self.points]
        return [point.integration(extremes_of(point, 1)) for point in least]

    def batches(self, state: State) -> Iterator[State]:
        """Run all values that are left, then find the true expectations; yields the state after each batch."""
        for after in in_batches(state, partial(advance_state, self), self._blocks_left, _MOST_BLOCKS):
            yield (state := after)
        for i in np.flatnonzero(np.isnan(state.truth).any(axis=1)).tolist() if has_truth(self) else ():
            state = with_truth(self, state, i)
            yield state

    def _blocks_left(self, state: State) -> int:
        """Of the value at hand."""
        return self.first.blocks - state.blocks if state.done < len(self.points) else 0

    def progress(self, state: State) -> Done:
        """Paths done of all values, all of them, and no standard error."""
        done = state.done * self.first.samples + self.first.paths_done(state)
        return Done(done, len(self.points) * self.first.samples, float("nan"))

    def description(self) -> dict[str, Any]:
        """The attributes that say what was integrated, whatever the value of the swept word."""
        first, *others = (point.description() for point in self.points)
        return {name: value for name, value in first.items() if all(other[name] == value for other in others)}

    def group(self, state: State) -> Group:
        """The results of one scheme of a case, from its final state."""
        return group(self, state)
