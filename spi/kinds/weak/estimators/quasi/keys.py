"""What randomised quasi-Monte Carlo adds to a spec."""

from collections.abc import Sequence
from typing import Any, Literal

from spi.ensemble.given import CONSTRUCTIONS, dimensions_of
from spi.numerics.sobol import LEAST_PATHS, MOST_DIMENSIONS
from spi.specs.checks import need
from spi.specs.keys import Keys as BaseKeys
from spi.specs.keys import key_of, wrong

LABEL = "quasi-Monte Carlo"
LOOK = ("s", "#009E73")

_NAMES = tuple(CONSTRUCTIONS)


class Keys(BaseKeys):
    """How increments are made of points."""

    construction: key_of(Literal[_NAMES], f"how quasi makes increments of its points: {', '.join(_NAMES)}") = "bridge"


def check(case: Any) -> None:
    """The number of paths must be a power of two, and there must not be too many dimensions."""
    need(case, "quasi", "samples")
    if case.samples < LEAST_PATHS or case.samples & (case.samples - 1):
        right = f"must be a power of two for the estimator 'quasi', {LEAST_PATHS} or more"
        raise wrong(f"is {case.samples}", right, "samples")
    steps, right = round(case.final_time / case.reference_step), "use a reference_step that makes it"
    check_dimensions(case, case.schemes, case.reference_record(None), steps, "estimators", f"{right} {{}}, or plain")


def check_dimensions(case: Any, schemes: Sequence[str], reference: Any, steps: int, key: str, right: str) -> None:
    """Points must not have too many dimensions for paths of so many steps; `right` has room for how many they may."""
    for scheme in schemes:
        dimensions = dimensions_of(case.row(scheme).record, reference, case.model, steps)[1]
        if dimensions > MOST_DIMENSIONS:
            what = f"has 'quasi', whose points would have {dimensions} dimensions for '{scheme}'"
            raise wrong(what, right.format(f"{MOST_DIMENSIONS} or fewer"), key)
