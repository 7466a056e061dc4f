"""Which plan serves a scheme: levels of its own, or differences to the scheme of weak order 2."""

from typing import Any

from spi.storage.records import Part

from .differences import DifferencesPlan, can_compare
from .plans import MultilevelPlan


def plan(case: Any, part: Part) -> MultilevelPlan:
    """The plan for one scheme of a case: by differences where that is better."""
    return (DifferencesPlan if can_compare(case, part) else MultilevelPlan).of(case, part)
