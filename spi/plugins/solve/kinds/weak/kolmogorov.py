"""Weak errors without sampling, from ``spi.exact.expectations``."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from spi.ensemble.loop import thread_count
from spi.ensemble.protocol import has_friction
from spi.ensemble.random_states import RandomState
from spi.exact.expectations import can_solve
from spi.kinds.plans import Done, PartCost, State, Task
from spi.kinds.weak.plans import WeakPlan
from spi.kinds.weak.results import Unsampled, WeakErrors
from spi.kinds.weak.solved import check_demands, demands_of, demands_of_schemes, solution
from spi.models import MODELS
from spi.schemes.stages import has_loops, has_shared
from spi.specs.keys import wrong
from spi.statistics.tallies import PathSet
from spi.storage.records import Order

_SOLUTION = "solution"  # the name of the task
_CLEAR = 20.0  # multiples of its numerical error from which on a weak error counts as resolved


@dataclass(frozen=True, kw_only=True)
class KolmogorovPlan(WeakPlan):
    """Weak errors of one splitting scheme from its backward operators."""

    LABEL, LOOK = "Kolmogorov, no sampling", ("*", "#000000")
    of_others: ClassVar[frozenset[str]] = frozenset(("standard_error", "seconds", "prefixes"))

    @classmethod
    def check(cls, case: Any) -> None:
        """Raise the error about a case that the solvers without sampling cannot do."""
        if case.damping:
            reason = "follows paths on a Casimir surface, which they leave with damping"
        elif has_friction(case.model):
            reason = "knows no friction"
        elif not can_solve(case.model):
            able = [name for name, cls in MODELS.items() if can_solve(cls)]
            reason = f"is for {' and '.join(able)}, also in YAML, whose Casimir surfaces are two-dimensional"
        elif isinstance(case.initial, RandomState):
            reason = "follows one initial state, and here each path has its own"
        elif not any(case.row(s).solvable_without_sampling for s in case.schemes):
            rows = case.row(case.schemes[0]).composition
            without = " without loops and shared increments" if rows and (has_loops(rows) or has_shared(rows)) else ""
            reason = f"is for splitting schemes{without}, which '{case.schemes[0]}' is not"
        elif case.truncate_noise:
            reason = "has no truncate_noise"
        elif case.reference_scheme:
            reason = "has no reference_scheme"
        else:
            check_demands(case, "kolmogorov", multiscale=False)
            return
        raise wrong(f"has 'kolmogorov', which {reason}", "use plain or multilevel or quasi instead", "estimators")

    @classmethod
    def can_do(cls, case: Any, scheme: str) -> bool:
        """Whether a scheme is a splitting scheme whose noise flows have increments of their own."""
        return bool(case.row(scheme).solvable_without_sampling)

    @classmethod
    def remarks(cls, case: Any) -> Iterator[str]:
        """A warning if the accuracy is below rounding errors; whether a larger one is reached only the results say."""
        least = max((need.least for _, need in demands_of_schemes(case, multiscale=False)), default=0.0)
        if case.accuracy is not None and case.accuracy < least:
            yield f"accuracy {case.accuracy:g} will not be reached: rounding errors are about {least:.1g}"

    def deciding(self, number: int | None) -> dict[str, Any]:
        """One solution serves all levels of extrapolation."""
        return super().deciding(number) | {"part": self.part._replace(extrapolate=0)}

    def cost(self) -> PartCost:
        """No steps of paths; seconds (times threads, as it uses all of them) and bytes are rough."""
        need = demands_of(self.case, self.row.composition, self.case.steps)
        first = self.part.extrapolate == min(self.case.extrapolate)  # whose solution serves the others
        return PartCost(0, need.seconds * thread_count() * first, int(need.bytes))

    def path_sets(self, extra: Any) -> Sequence[PathSet]:
        """None."""
        return ()

    def tasks(self, state: State) -> list[Task]:
        """All in one piece."""
        return [Task(_SOLUTION, self._solved)]

    def _solved(self) -> dict[str, Any]:
        """Expectations of the F test functions at S step sizes, (F, S), and in the limit, (F,), with their bounds."""
        exact, cpu_seconds = solution(self.case, self.row.composition, self.case.steps)
        return {
            "value": exact.value,
            "value_bound": exact.value_bound,
            "limit": exact.limit,
            "limit_bound": exact.limit_bound,
            "error": exact.weak_error,
            "error_bound": exact.weak_error_bound,
            "notes": json.dumps(exact.notes, default=lambda value: value.tolist()),
            "solver_seconds": cpu_seconds,  # of whoever solved first, which serves the other levels
        }

    def progress(self, state: State) -> Done:
        """0 or 1 of 1; no standard error."""
        return Done(len(state.answers), 1, float("nan"))

    def results(self, state: State) -> WeakErrors:
        """Weak errors and expectations."""
        combine, solved = self.extrapolation, state.answers[_SOLUTION]
        error, bound = combine.combined(solved["error"]), combine.combined_bounds(solved["error_bound"])
        h, resolved = self.h, np.abs(error) >= _CLEAR * bound
        unsampled = Unsampled(
            error_bound=bound,
            expectation_bound=combine.combined_bounds(solved["value_bound"]),
            limit=solved["limit"],
            limit_bound=solved["limit_bound"],
            notes=solved["notes"],
        )
        each = zip(error, bound, resolved, strict=True)
        estimated = {
            "error": error,
            "resolved": resolved,
            "expectation": combine.combined(solved["value"]),
            "orders": tuple(_order(h[r], np.abs(e[r]), b[r]) for e, b, r in each),
            "unsampled": unsampled,
            "accuracy": self.case.accuracy,
            "cpu_seconds": solved["solver_seconds"],
        }
        return WeakErrors(**(self.whole(state) | estimated))


def _order(h: np.ndarray, error: np.ndarray, bound: np.ndarray) -> Order:
    """Slope between the two finest steps; half its interval is 1.5 times the difference from the slope before.

    Where the error is C h^p + D h^q, slopes tend to p by at least a factor of 2 each time h is halved.
    """
    if len(h) < 3:
        return Order(np.nan, np.nan, np.nan, len(h))
    with np.errstate(divide="ignore", invalid="ignore"):  # an error of 0 has no order
        slope = np.diff(np.log(error)) / np.diff(np.log(h))
        trust = (bound / error)[-2:].sum() / np.log(h[-2] / h[-1])
    half = 1.5 * abs(slope[-1] - slope[-2]) + trust
    return Order(slope[-1], slope[-1] - half, slope[-1] + half, len(h))
