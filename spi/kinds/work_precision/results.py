"""What is stored of errors and the times of paths."""

from collections.abc import Iterable, Iterator
from typing import Annotated

import numpy as np

from spi.statistics.claims import Quantity, at_steps, drifts, each_step, order
from spi.storage.records import INTERVAL, Order
from spi.storage.stored import Array, Stored, array, axis, fact

from .work_points import WorkCurve, interval_of_median


class WorkPrecision(Stored):
    """Errors of one scheme at several step sizes, from large to small, and the processor time of one path at each.

    Of weak errors, which have one test function, the modulus.
    """

    headline = ("order", "error")

    h: Annotated[Array, axis("step size", "time")]
    error: Annotated[Array, array("h", "error without its sign", "state or value")]
    error_stderr: Annotated[Array | None, array("h", "standard error of the error", "state or value")] = None
    error_bound: Annotated[Array | None, array("h", "bound of the numerical error, without sampling", "value")] = None
    resolved: Annotated[Array, array("h", "whether the error stands clear of its standard error or bound")]
    casimir_drift: Annotated[
        Array | None,
        array("h casimir", "largest change of a Casimir", formula="max over paths and n of |C(y_n) - C(y_0)|"),
    ] = None
    nonfinite: Annotated[Array | None, array("h", "diverged paths (NaN or infinity)")] = None
    ns_per_step: Annotated[Array, array("h", "time of a step and path, by the median", "ns")]
    seconds_per_path: Annotated[Array, array("h", "processor time of a path, the median of the repeats", "s")]
    seconds_per_path_low: Annotated[Array, array("h", "lower quartile of the processor time of a path", "s")]
    seconds_per_path_high: Annotated[Array, array("h", "upper quartile of the processor time of a path", "s")]
    order: Order
    expected_order: Annotated[float | None, fact("order that theory states", column=True)] = None
    measure: Annotated[str, fact("kind of the errors, strong or weak", column=True)]
    estimator: Annotated[str, fact("estimator of weak errors")] = ""
    functions: Annotated[tuple[str, ...], fact("formula of the test function of weak errors")] = ()
    samples: Annotated[int | None, fact("number of paths, where it is given beforehand", column=True)] = None
    repeats: Annotated[int, fact("how often each step size is timed")]
    targets: Annotated[tuple[float, ...], fact("errors for which the cheapest scheme is asked", "state or value")]
    reference_step: Annotated[float, fact("step size of the reference", "time")]
    reference_scheme: Annotated[str | None, fact("scheme of the reference, if not each is its own")] = None
    reference_nonfinite: Annotated[int, fact("diverged paths of the reference (NaN or infinity)")] = 0
    left_out: Annotated[tuple[str, ...], fact("schemes of the case that no estimator of it can do")] = ()
    note: Annotated[str, fact("what is to be said of the errors")] = ""

    def __post_init__(self) -> None:
        if self.error_stderr is None and self.error_bound is None:
            raise KeyError("error_stderr")

    @property
    def exact(self) -> bool:
        """Whether nothing was sampled."""
        return self.error_bound is not None

    @property
    def half(self) -> np.ndarray:
        """(S,) half the 95 % interval of the error, or the bound of its numerical error."""
        return INTERVAL * self.error_stderr if self.error_stderr is not None else np.asarray(self.error_bound)

    @property
    def largest_drift(self) -> np.ndarray | None:
        """(S,) of several Casimirs the largest drift; None where there is none."""
        known = self.casimir_drift is not None and self.casimir_drift.size > 0
        return self.casimir_drift.max(axis=1) if known and self.casimir_drift is not None else None

    @property
    def curve(self) -> WorkCurve:
        """Errors and times of the scheme, from which the cost of a requested error is interpolated."""
        times = self.seconds_per_path, self.seconds_per_path_low, self.seconds_per_path_high
        low, high = interval_of_median(*times, self.repeats)
        return WorkCurve(self.h, self.error, self.half, self.resolved, self.seconds_per_path, low, high)


def requested(readings: Iterable[WorkPrecision]) -> list[float]:
    """The errors that are asked for in a case, from small to large."""
    return sorted({target for reading in readings for target in reading.targets})


Record = WorkPrecision


# ---------------------------------------------------------------------------------------------------------------------
# What a spec may expect of errors and times; not the times, which are others on every machine.
# ---------------------------------------------------------------------------------------------------------------------


def quantities(readings: Iterable[WorkPrecision]) -> Iterator[Quantity]:
    """The fitted order; for each step size the error and, where it is known, Casimir drift and diverged paths."""
    for one in readings:
        yield order(one.about, one.order, expected=one.expected_order)
        yield from at_steps("error", one.about, one.h, one.error, one.half)
        if one.casimir_drift is not None:
            yield from drifts(one.about, one.h, one.casimir_drift)
        if one.nonfinite is not None:
            yield from each_step("nonfinite", one.about, one.h, one.nonfinite)
