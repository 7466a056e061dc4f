"""The conditions of randomised quasi-Monte Carlo."""

from typing import Any

from spi.ensemble.increments import dimensions_of
from spi.numerics.sobol import LEAST_PATHS, MOST_DIMENSIONS
from spi.specs.checks import need
from spi.specs.keys import Keys as BaseKeys
from spi.specs.keys import wrong

LABEL = "quasi-Monte Carlo"
LOOK = ("s", "#009E73")


class Keys(BaseKeys):
    """It has no keys of its own."""


def check(case: Any) -> None:
    """Raise the error about a number of paths that is no power of two, or too many dimensions."""
    need(case, "quasi", "samples")
    if case.samples < LEAST_PATHS or case.samples & (case.samples - 1):
        right = f"must be a power of two for the estimator 'quasi', {LEAST_PATHS} or more"
        raise wrong(f"is {case.samples}", right, "samples")
    steps, right = round(case.final_time / case.reference_step), "use a reference_step that makes it"
    for scheme in case.schemes:
        dimensions = dimensions_of(case.row(scheme).record, case.reference_record(None), case.model, steps)[1]
        if dimensions > MOST_DIMENSIONS:
            mistake = f"has 'quasi', whose points would have {dimensions} dimensions for '{scheme}'"
            raise wrong(mistake, f"{right} {MOST_DIMENSIONS} or fewer, or plain", "estimators")
