"""Record of long paths: the errors of the Casimir functions after several numbers of steps."""

import math
from collections.abc import Sequence

import numpy as np

from spi.kinds.blocks import Acceptance, Solver
from spi.printing.tables import Column, Table
from spi.printing.text import decimal, power_of_two, short
from spi.storage.records import in_standard_errors
from spi.storage.stored import DIVERGED, WIDEST, Array, Claimed, Stored, array, axis, derived, fact

_WORST = Claimed("at most", infinite=True)
#: Growth and bias of the errors.
CASIMIRS = Table(
    "h casimir",
    [
        Column("nonfinite", "di-\nverged", red=0),
        Column("casimir_rms", "rms error\nat the end"),
        Column("casimir_worst", "worst"),
        Column("growth", "growth of rms,\nexponent (95 %)", form=".2f", interval="[]", missing="not fitted"),
        Column("bias", "bias/step", interval=""),
        Column("bias_deviation", "in std.\nerrors", form=decimal),
    ],
)


class LongRecord(Stored):
    """Paths of one scheme over very many steps at several step sizes, from large to small.

    Errors of the Casimirs are C(y_n) / C(y_0) - 1, or absolute ones if C(y_0) = 0, after several numbers of steps.
    """

    h: Array = axis("step size", "time")
    n: Array = axis("number of steps")
    casimir_mean: Array = array("h n casimir", "mean error of the Casimir over the paths")
    casimir_rms: Array = array("h n casimir", "root mean square error of the Casimir")
    casimir_worst: Array = array("h n casimir", "largest modulus of the error of the Casimir", claim=_WORST)
    casimir_one: Array = array("h n casimir", "error of the Casimir on path 0")
    nonfinite: Array = array("h", "diverged paths (NaN or infinity)", claim=DIVERGED)
    growth: Array = array(
        "h casimir",
        "growth of the error; NaN where not fitted",
        formula="p in rms = C n^p",
        claim=Claimed("equal", widest=WIDEST, ends=".3f", is_fit=True),
    )
    growth_low: Array = array("h casimir", "lower end of the 95 % interval of the growth")
    growth_high: Array = array("h casimir", "upper end of the 95 % interval of the growth")
    bias: Array = array("h casimir", "mean error of the Casimir at the end, per step", claim="equal")
    bias_stderr: Array = array("h casimir", "standard error of the bias")
    rounding: Array | None = array(
        "h casimir", "largest modulus of the error at the end where that is rounding; NaN elsewhere", default=None
    )
    solver: Solver | None = array("h", "what an implicit scheme reports", default=None)
    acceptance: Acceptance | None = array("h", "how often flows were accepted", default=None)
    largest_angle: Array | None = array("h", "largest angle of a rotation, where any exceeds pi/4", "rad", default=None)
    samples: int = fact("number of paths", column=True)
    steps_each: int = fact("number of steps of each path, at the largest step size")
    panels: tuple[str, ...] = fact("what the figure of the case shows")

    @derived("h casimir", "mean error of the Casimir in standard errors")
    def bias_deviation(self) -> Array:
        """(S, C) the bias by its standard error; NaN where that is 0, and where the errors are rounding."""
        known = self.bias_stderr > 0
        known = known if self.rounding is None else known & np.isnan(self.rounding)
        return in_standard_errors(self.bias, np.where(known, self.bias_stderr, np.nan))

    @property
    def largest_finite(self) -> int | None:
        """Number of the largest step size at which all paths are finite; None if there is none."""
        finite = np.flatnonzero(self.nonfinite == 0)
        return int(finite[np.argmax(self.h[finite])]) if len(finite) else None


def count(steps: int) -> str:
    """A number of steps, powers of two also as such."""
    return f"{power_of_two(steps)} = {steps:,}" if steps > 1 and math.frexp(steps)[0] == 0.5 else f"{steps:,}"


def kept_casimirs(readings: Sequence[LongRecord]) -> str:
    """Line that all Casimir functions are kept up to rounding, as by construction; "" if some are not, or diverged."""
    errors = [one.rounding for one in readings if one.rounding is not None and not one.nonfinite.any()]
    if len(errors) < len(readings) or not all(np.isfinite(error).all() for error in errors):
        return ""
    largest = max((float(error.max()) for error in errors if error.size), default=math.nan)
    return "" if math.isnan(largest) else f"Casimir functions: constant up to rounding ({short(largest, '.0e')})"
