"""Which plan serves a scheme: levels of its own, or differences to the scheme of weak order 2."""

from typing import Any

from spi.storage.records import Part

from .differences import DifferencesPlan, can_compare
from .plans import MultilevelPlan


def together(case: Any, part: Part) -> list[tuple[int, ...]]:
    """One set of levels serves all levels of extrapolation, except those that are found by differences."""
    alone = [n for n in case.extrapolate if can_compare(case, part._replace(extrapolate=n))]
    others = tuple(n for n in case.extrapolate if n not in alone)
    return [*((n,) for n in alone), *[others] * bool(others)]


def plan(case: Any, part: Part) -> MultilevelPlan:
    """The plan for one scheme of a case: by differences where that is better."""
    return (DifferencesPlan if can_compare(case, part) else MultilevelPlan).of(case, part)
