"""Stability: what schemes keep of the equation where steps are large or parameters extreme.

For each value of the parameter the same Brownian paths are run at all step sizes.  Of every path the study keeps the
largest relative error of each Casimir and the largest |y| over all times, and the last state; from these come the
fraction of paths that stay finite, the distance from the scheme's own path at the reference step, and, where there are
test functions and the law of the equation is known without sampling, the distance of expectations from the truth.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from spi.ensemble.areas import fourier_terms
from spi.ensemble.loop import nested_grid
from spi.ensemble.protocol import casimirs
from spi.kinds.blocks import BlocksPlan, Blockwise
from spi.kinds.plans import Cost, Done, KernelCall, State
from spi.schemes import typical_ns
from spi.statistics.tallies import PathSet
from spi.storage.records import Description, Part

from ..results import Stability
from .law import TRUTH_SECONDS, Truth, has_truth, unknown_truth, with_truth
from .outcome import results
from .paths import Paths, Rows, added, no_paths, rows_of

_MOST_BLOCKS = 64


def parts(case: Any) -> list[Part]:
    """What is run one after the other: each scheme, whatever its eps if that is what is swept."""
    return [Part(scheme) for scheme in case.schemes]


def plan(case: Any, part: Part) -> "StabilityPlan":
    """The plan for one scheme of a case."""
    return StabilityPlan(case=case, part=part, points=tuple(_point(one, part.scheme) for one in case.sweep.cases))


def _point(case: Any, scheme: str) -> BlocksPlan:
    """The paths of one scheme for a case without the swept parameter."""
    eps = case.eps[0] if case.row(scheme).multiscale else None
    reference = case.reference_record(eps)
    schemes = [case.row(scheme, eps).record, reference]
    terms = fourier_terms(case.model, schemes, case.reference_step, min(case.steps))
    times = nested_grid(case.final_time, case.reference_step, case.steps, case.truncate_noise, reference, terms)
    return BlocksPlan(case=case, part=Part(scheme, eps=eps), grid=times, samples=case.samples)


@dataclass(frozen=True, kw_only=True)
class StabilityPlan(Blockwise):
    """One scheme at all step sizes for all values of the swept parameter."""

    case: Any  #: ``spi.kinds.stability.keys.Case``
    part: Part
    points: tuple[BlocksPlan, ...]  #: the paths for each value; only models, initial states and eps differ

    @property
    def first(self) -> BlocksPlan:
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
        seconds = steps * 1e-9 * typical_ns(self.first.row, self.first.model)
        if has_truth(self) and self.part.scheme == self.case.schemes[0]:  # which the other schemes then know
            seconds += TRUTH_SECONDS * len(self.points)
        of_a_path = self.levels * (len(casimirs(self.first.model, self.first.initial)) + 2 + len(self.first.initial))
        return Cost(steps, seconds, 8 * of_a_path * self.first.samples * len(self.points))

    def begin(self) -> Truth:
        """No expectation is known."""
        return unknown_truth(self)

    def path_sets(self, more: Truth) -> Sequence[PathSet]:
        """All paths for each value."""
        return tuple(stream for point in self.points for stream in point.path_sets(more))

    def empty(self, number: int) -> Paths:
        """No paths for a value."""
        return no_paths(self.points[number])

    def kernel_calls(self) -> list[KernelCall]:
        """One step of one block for each value."""
        return [call for point in self.points for call in point.kernel_calls()]

    def most_blocks(self, number: int) -> int:
        """How many blocks a batch may have, because of memory."""
        return _MOST_BLOCKS

    def rows(self, number: int, first: int, blocks: int, end: int) -> Rows:
        """What some blocks of a value contribute, see ``paths``."""
        return rows_of(self.points[number], first, blocks, end)

    def added(self, sums: Paths, rows: Rows, at: slice, first: int, end: int) -> Paths:
        """The paths of a value with some more, see ``paths``."""
        return added(sums, rows, at, first, end)

    def settle(self, state: State) -> None:
        """Nothing is left."""

    def finish(self, state: State) -> Iterator[Truth]:
        """Find the true expectations for each value."""
        for i in np.flatnonzero(np.isnan(state.more.truth).any(axis=1)).tolist() if has_truth(self) else ():
            yield with_truth(self, state.more, i)

    def progress(self, state: State) -> Done:
        """Paths done of all values, all of them, and no standard error."""
        done = sum(state.tally(i).paths for i in range(len(self.points)))
        return Done(done, len(self.points) * self.first.samples, float("nan"))

    def description(self) -> Description:
        """What is integrated, without what differs from value to value of the swept parameter."""
        first, *others = (point.description() for point in self.points)
        same = {
            name: value for name, value in first._asdict().items() if all(getattr(o, name) == value for o in others)
        }
        alike = [item for item in first.parameters.items() if all(item in o.parameters.items() for o in others)]
        own = {
            "case": self.case.name,
            "variant": self.part.variant,
            "truncate_noise": same.get("truncate_noise", False),
        }
        return first._replace(**dict.fromkeys(first._fields) | same | own | {"parameters": dict(alike)})

    def results(self, state: State) -> Stability:
        """The results of one scheme of a case, from its final state."""
        return results(self, state)
