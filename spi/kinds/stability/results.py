"""The records of stability: properties that a scheme keeps at a step size and a value of a parameter."""

from collections.abc import Iterable, Iterator
from typing import Annotated, Any

import numpy as np

from spi.kinds.blocks import Acceptance, Solver
from spi.statistics.claims import Quantity, each_step, lost_is_infinite
from spi.storage.stored import Array, Described, Stored, array, axis, fact, nested

#: From good to bad; a scheme is in the worst regime that applies.
REGIMES = (
    *("accurate", "bounded, not accurate", "not positive"),
    *("Casimir lost", "not bounded", "solver fails", "paths diverged"),
)

FAILING = 1e-3  #: share of the solves: with more failures it is another scheme that is integrated
CASIMIR_LOST = 1e-2  #: relative error of a Casimir
CASIMIR_KEPT = 1e-8  #: the same where it is preserved but for rounding and the solver's tolerance
GROWTH = 2.0  #: of the largest |y|, compared with that at the smallest step size


class CasimirErrors(Described):
    """The largest relative error of each Casimir function along each path."""

    worst: Annotated[Array, array("value h casimir", "largest relative error of the Casimir, of the worst path")]
    median: Annotated[Array, array("value h casimir", "largest relative error of the Casimir, of the median path")]

    @property
    def largest_worst(self) -> np.ndarray:
        """(V, S) the error on the worst path of the Casimir where it is largest; NaN counts as the largest."""
        return self.worst.max(axis=-1)

    @property
    def largest_median(self) -> np.ndarray:
        """(V, S) the error on the median path of the Casimir where it is largest."""
        return self.median.max(axis=-1)


class Law(Described):
    """Expectations of test functions at the final time against their true values, NaN where these are unknown."""

    names: Annotated[tuple[str, ...], axis("test function", name="function")]
    expectation: Annotated[
        Array, array("value h function", "expectation of the test function", "value", "E phi(y_h(T))")
    ]
    expectation_stderr: Annotated[Array, array("value h function", "standard error of the expectation", "value")]
    truth: Annotated[Array, array("value function", "expectation for the equation itself", "value", "E phi(y(T))")]
    truth_bound: Annotated[Array, array("value function", "bound of the numerical error of that expectation", "value")]
    distance: Annotated[
        Array, array("value h", "largest distance of an expectation from the truth", "value", name="law_distance")
    ]
    distance_stderr: Annotated[
        Array, array("value h", "sampling and numerical error of the distance", "value", name="law_distance_stderr")
    ]


class Stability(Stored):
    """Properties that one scheme keeps at each value of the swept parameter and step size, from large to small."""

    headline = ("error",)

    values: Annotated[Array, axis("value of the swept parameter", name="value")]
    h: Annotated[Array, axis("step size", "time")]
    finite: Annotated[Array, array("value h", "fraction of the paths that are finite at the final time")]
    largest_norm: Annotated[Array, array("value h", "largest |y| over paths and times, relative to |y_0|")]
    error: Annotated[Array, array("value h", "root mean square error at the final time, relative to |y_0|")]
    error_stderr: Annotated[Array, array("value h", "standard error of the error")]
    casimirs: Annotated[CasimirErrors | None, nested(prefix="casimir_")] = None  # of a model that has any
    law: Law | None = None  # where there are test functions
    positive: Annotated[Array | None, array("value h", "fraction of the paths whose populations stay positive")] = None
    largest_angle: Annotated[Array | None, array("value h", "largest angle of a rotation; 0 up to pi/4", "rad")] = None
    solver: Annotated[Solver | None, array("value h", "what an implicit scheme reports")] = None
    acceptance: Annotated[Acceptance | None, array("value h", "how often flows were accepted")] = None
    word: Annotated[str, fact("swept parameter of the spec", name="sweep", column=True)]
    functions: Annotated[tuple[str, ...], fact("formulas of the test functions")]
    accurate: Annotated[float, fact("error up to which a scheme counts as accurate")]
    samples: Annotated[int, fact("number of paths", column=True)]
    reference_step: Annotated[float, fact("step size of the reference", "time", column=True)]
    reference_scheme: Annotated[str | None, fact("scheme of the reference, if not each is its own")] = None
    panels: Annotated[tuple[str, ...], fact("what the figure shows")]

    def known(self, field: str) -> Any:
        """The value of a field such as ``law.distance``; None if there is none."""
        value: Any = self
        for name in field.split("."):
            value = getattr(value, name, None)
        return value

    @property
    def all_finite(self) -> np.ndarray:
        """(V, S) whether all paths are finite at the final time."""
        return self.finite >= 1.0

    @property
    def is_accurate(self) -> np.ndarray:
        """(V, S) whether the error counts as accurate; NaN does not."""
        return self.error <= self.accurate

    @property
    def regimes(self) -> np.ndarray:
        """(V, S) number of the regime in :data:`REGIMES`.

        A scheme is not bounded where |y| becomes more than GROWTH times as large as at the smallest step size, since
        the true solution may grow as well.  NaN is never good.
        """
        norm = np.where(np.isnan(self.largest_norm), np.inf, self.largest_norm)
        finest = norm[:, [np.argmin(self.h)]]
        never = np.zeros(norm.shape, bool)
        worst_first = [
            ~self.all_finite,
            self.solver.failing_fraction > FAILING if self.solver else never,
            ~(norm <= GROWTH * finest) | np.isinf(norm),
            ~(self.casimirs.largest_worst <= CASIMIR_LOST) if self.casimirs else never,
            never if self.positive is None else ~(self.positive >= 1.0),
            ~self.is_accurate,
            ~never,
        ]
        return np.select(worst_first, range(len(REGIMES))[::-1])


def largest_step(h: np.ndarray, good: np.ndarray) -> tuple[float, bool]:
    """The largest step size that is good together with all smaller ones, and whether that is all of them; NaN if none.

    `h` (S,) in any order, `good` (S,).
    """
    order = np.argsort(h)
    count = int(np.logical_and.accumulate(np.asarray(good, bool)[order]).sum())
    return (float(h[order][count - 1]) if count else float("nan")), count == len(order) > 0


Record = Stability


# ---------------------------------------------------------------------------------------------------------------------
# Quantities of stability that a spec may expect.
# ---------------------------------------------------------------------------------------------------------------------

#: The field of a record for each quantity, whose standard error stands beside it if it has one.
_FIELDS = {
    "finite": "finite",
    "largest_norm": "largest_norm",
    "positive": "positive",
    "casimir_worst": "casimirs.largest_worst",
    "casimir_median": "casimirs.largest_median",
    "failing_fraction": "solver.failing_fraction",
    "error": "error",
    "law_distance": "law.distance",
}


def quantities(readings: Iterable[Stability]) -> Iterator[Quantity]:
    """The fields of :class:`~.results.Stability` at each step size and value; NaN counts as infinite except in laws."""
    for reading in readings:
        for name, field in _FIELDS.items():
            if (values := reading.known(field)) is None:
                continue
            values = values if name == "law_distance" else lost_is_infinite(values)
            stderr = reading.known(f"{field}_stderr")
            for i, value in enumerate(reading.values.tolist()):
                for at_h in each_step(name, reading.about, reading.h, values[i], None if stderr is None else stderr[i]):
                    yield at_h._replace(swept=(reading.word, value))
