"""An estimator of weak errors as one may be added: each error is guessed to be c h, without computing anything."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from spi.kinds.plans import Done, PartCost, State
from spi.kinds.weak.plans import WeakPlan
from spi.kinds.weak.results import Unsampled, WeakErrors
from spi.specs.checks import need
from spi.statistics.tallies import Chunk, PathSet
from spi.storage import Order


class Guess(NamedTuple):
    """Nothing (0 paths) or a guess (1)."""

    paths: int
    seconds: float = 0.0

    def plus(self, later: "Guess") -> "Guess":
        """There is only one."""
        raise TypeError("a guess is made at once")


@dataclass(frozen=True, kw_only=True)
class GuessPlan(WeakPlan):
    """Errors of one scheme, guessed."""

    LABEL: ClassVar = "guess"
    LOOK: ClassVar = ("s", "#000000")

    @classmethod
    def check(cls, case: Any) -> None:
        """There must be a guess."""
        need(case, "guess", "accuracy")

    def cost(self) -> PartCost:
        """Nothing."""
        return PartCost(0, 0.0, 0)

    def path_sets(self, extra: Any) -> Sequence[PathSet]:
        """All at once, as if it were one path."""
        return (PathSet(1, 1),)

    def empty(self, number: int) -> Guess:
        """Nothing is guessed."""
        return Guess(0)

    def advance(self, chunks: Sequence[Chunk], known: Guess | None) -> Iterator[list[tuple[Chunk, Guess]]]:
        """Guess."""
        yield [(chunks[0], Guess(1))]

    def progress(self, state: State) -> Done:
        """0 or 1 of 1."""
        return Done(state.tally().paths, 1, float("nan"))

    def results(self, state: State) -> WeakErrors:
        """The same error for each test function."""
        count = len(self.case.functions)
        error = np.outer(np.ones(count), self.case.accuracy * self.h)
        nothing, ones = np.zeros(count), np.ones_like(error)
        bounds: Any = {"error_bound": 0 * ones, "expectation_bound": ones}
        unsampled = Unsampled(**bounds, limit=nothing, limit_bound=nothing + 1)
        estimated = {
            "error": error,
            "expectation": error,
            "resolved": ones > 0,
            "orders": (Order(1.0, 1.0, 1.0, error.shape[1]),) * count,
            "unsampled": unsampled,
            "cpu_seconds": 0.0,
        }
        return WeakErrors(**(self.whole(state) | estimated))
