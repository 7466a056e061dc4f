"""Stored errors and the times of paths as a record."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from spi.storage.records import INTERVAL, Description, Group, Order

from .work_points import WorkCurve, interval_of_median


class WorkPrecision(NamedTuple):
    """Errors of one scheme at S step sizes, from large to small, and the processor time of one path at each."""

    about: Description
    measure: str  #: of what kind the errors are, "strong" or "weak"
    estimator: str  #: of weak errors, "" for strong ones
    functions: tuple[str, ...]  #: the test function of weak errors as text; empty for strong ones
    exact: bool  #: whether nothing was sampled
    h: np.ndarray  #: (S,)
    error: np.ndarray  #: (S,) without its sign, not finite where paths diverged
    error_stderr: np.ndarray  #: (S,) standard errors or, where `exact`, bounds of the numerical error
    resolved: np.ndarray  #: (S,) bool, whether the error stands clear of its standard error or bound
    nonfinite: np.ndarray | None  #: (S,) diverged paths (NaN or infinity); None where nothing was sampled
    casimir_drift: np.ndarray | None  #: (S,) largest |C(y_h(t_n)) - C(y_0)| over paths, times and Casimirs, or None
    seconds_per_path: np.ndarray  #: (S,) processor seconds from 0 to T, the median of the repeats
    seconds_per_path_low: np.ndarray  #: (S,) their lower quartile
    seconds_per_path_high: np.ndarray  #: (S,) and their upper one
    ns_per_step: np.ndarray  #: (S,) nanoseconds per step and path, by the median
    repeats: int
    targets: tuple[float, ...]  #: the errors for which the cheapest scheme is asked
    order: Order
    expected_order: float | None  #: None where theory says nothing
    samples: int | None  #: None where their number is not given beforehand
    reference_step: float
    reference_scheme: str | None  #: None where each scheme is its own reference
    note: str  #: on points that are not resolved

    @property
    def half(self) -> np.ndarray:
        """(S,) half the 95 % interval of the error, or the bound of its numerical error."""
        return self.error_stderr * (1.0 if self.exact else INTERVAL)

    @property
    def curve(self) -> WorkCurve:
        """Errors and times as the :class:`~spi.kinds.work_precision.reading.work_points.WorkCurve` of the scheme."""
        times = self.seconds_per_path, self.seconds_per_path_low, self.seconds_per_path_high
        low, high = interval_of_median(*times, self.repeats)
        return WorkCurve(self.h, self.error, self.half, self.resolved, self.seconds_per_path, low, high)


def read(group: Group) -> WorkPrecision:
    """The errors and times in a stored group."""
    v, a = group.arrays, group.attributes
    times = ("seconds_per_path", "seconds_per_path_low", "seconds_per_path_high", "ns_per_step")
    drift = v.get("casimir_drift")
    return WorkPrecision(
        about=Description.of(group),
        measure=a["measure"],
        estimator=a.get("estimator", ""),
        functions=a.get("functions", ()),
        exact=a["exact"],
        h=group.coordinates["h"],
        error=v["error"],
        error_stderr=v["error_stderr"],
        resolved=v["resolved"].astype(bool),
        nonfinite=v.get("nonfinite"),
        casimir_drift=drift.max(axis=1) if drift is not None and drift.size else None,
        **{name: v[name] for name in times},
        repeats=a["repeats"],
        targets=a["targets"],
        order=Order.of(a),
        expected_order=a.get("expected_order"),
        samples=a.get("samples"),
        reference_step=a["reference_step"],
        reference_scheme=a.get("reference_scheme"),
        note=a.get("note", ""),
    )


def requested(readings: Iterable[WorkPrecision]) -> list[float]:
    """The errors that are asked for in a case, from small to large."""
    return sorted({target for reading in readings for target in reading.targets})
