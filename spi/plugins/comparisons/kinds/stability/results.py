"""Records of stability: properties that a scheme keeps at a step size and a value of a parameter."""

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Self

import numpy as np

from spi.kinds.blocks import Acceptance, Solver
from spi.printing.tables import Column, Table
from spi.printing.text import power_of_two, short
from spi.storage.stored import Array, Claimed, Described, Description, Stored, array, axis, derived, fact, nested

#: From good to bad; a scheme is in the worst regime that applies.
REGIMES = (
    *("accurate", "bounded, not accurate", "not positive"),
    *("Casimir lost", "not bounded", "solver fails", "paths diverged"),
)

FAILING = 1e-3  #: share of the solves: with more failures it is another scheme that is integrated
CASIMIR_LOST = 1e-2  #: relative error of a Casimir
CASIMIR_KEPT = 1e-8  #: the same where it is preserved but for rounding and the solver's tolerance
GROWTH = 2.0  #: of the largest |y|, compared with that at the smallest step size


_SMALL, _LARGE = Claimed("at most", infinite=True), Claimed("at least", infinite=True)
_FINITE = _LARGE._replace(none_diverged=1.0)


class CasimirErrors(Described):
    """Largest relative error of each Casimir function along each path."""

    worst: Array = array("value h casimir", "largest relative error of the Casimir, of the worst path", claim=_SMALL)
    median: Array = array("value h casimir", "largest relative error of the Casimir, of the median path", claim=_SMALL)

    @property
    def largest_worst(self) -> Array:
        """(V, S) the error on the worst path of the Casimir where it is largest; NaN counts as the largest."""
        return self.worst.max(axis=-1)


class ExpectationErrors(Described):
    """Expectations of test functions at the final time against their true values, NaN where these are unknown."""

    names: tuple[str, ...] = axis("test function", name="function")
    expectation: Array = array("value h function", "expectation of the test function", "value", "E phi(y_h(T))")
    expectation_stderr: Array = array("value h function", "standard error of the expectation", "value")
    truth: Array = array("value function", "expectation for the equation itself", "value", "E phi(y(T))")
    truth_bound: Array = array("value function", "bound of the numerical error of that expectation", "value")
    distance: Array = array(
        "value h",
        "largest distance of an expectation from the truth",
        "value",
        name="law_distance",
        claim="at most",
    )
    distance_stderr: Array = array(
        "value h", "sampling and numerical error of the distance", "value", name="law_distance_stderr"
    )


def _steps(reading: "Stability", good: Array) -> list[str]:
    """For each value the largest step size up to which all is good; with >= if all were, as the true one may be larger.

    `good` is (V, S).
    """
    largest = (largest_step(reading.h, at_value) for at_value in good)
    return ["none" if math.isnan(h) else f"{'>= ' if is_all else ''}{power_of_two(h)}" for h, is_all in largest]


def _percent(shares: Array | None, worst: Callable[..., Array]) -> list[str] | None:
    """For each value the worst share over the step sizes in per cent, with two digits; 0 and 100 only if it is that."""
    if shares is None:
        return None
    texts = []
    for share in worst(shares, axis=1).tolist():
        if share in (0.0, 1.0) or not math.isfinite(share):
            digits = f"{100 * share:g}"
        else:
            digits = f"{100 * share:.2g}" if share < 0.99 else f"{100 - float(f'{100 - 100 * share:.1g}'):.10g}"
        texts.append(f"{digits} %")
    return texts


def _iterations(reading: "Stability", readings: Sequence["Stability"]) -> list[str] | None:
    """For each value the least and the most iterations of a solve over the step sizes; None of explicit schemes."""
    if (numbers := reading.iterations_per_solve) is None:
        return None
    finite = (row[np.isfinite(row)] for row in numbers)
    ends = ([f"{end:.1f}" for end in (row.min(), row.max())] if row.size else [] for row in finite)
    return ["-".join(dict.fromkeys(texts)) for texts in ends]


class Stability(Stored):
    """Properties that one scheme keeps at each value of the swept parameter and step size, from large to small."""

    headline = ("error",)
    measures = (
        r"A scheme counts as accurate at a step size where its root mean square error at $T$, relative to $|y_0|$, is "
        "below a bound, there and at all smaller steps of the run."
    )
    over_swept, row_axes, row_largest = "value", ("value", "h"), ("casimir",)
    tables = (
        Table(
            "value",
            [
                Column(lambda one, _: _steps(one, one.all_finite), "all paths\nfinite, h"),
                Column(
                    lambda one, _: _steps(one, one.casimirs.largest_worst < CASIMIR_KEPT) if one.casimirs else None,
                    "Casimir\nkept, h",
                ),
                Column(lambda one, _: _steps(one, one.is_accurate), "accurate,\nh"),
                Column("casimir_worst", "worst\nCasimir"),
                Column(lambda one, _: _percent(one.failing_fraction, np.max), "solver\nfailures"),
                Column(_iterations, "iter-\nations"),
                Column(lambda one, _: _percent(one.positive, np.min), "positive\npaths"),
                Column("largest_angle", "largest\nangle", form=lambda angle: f"{angle:.2g}" if angle else "< pi/4"),
            ],
        ),
    )

    values: Array = axis("value of the swept parameter", name="value")
    h: Array = axis("step size", "time")
    finite: Array = array("value h", "fraction of the paths that are finite at the final time", claim=_FINITE)
    largest_norm: Array = array("value h", "largest |y| over paths and times, relative to |y_0|", claim=_SMALL)
    error: Array = array("value h", "root mean square error at the final time, relative to |y_0|", claim=_SMALL)
    error_stderr: Array = array("value h", "standard error of the error")
    casimirs: CasimirErrors | None = nested(prefix="casimir_", default=None)  # of a model that has any
    law: ExpectationErrors | None = None  # where there are test functions
    positive: Array | None = array(
        "value h", "fraction of the paths whose populations stay positive", claim=_LARGE, default=None
    )
    largest_angle: Array | None = array("value h", "largest angle of a rotation; 0 up to pi/4", "rad", default=None)
    solver: Solver | None = array("value h", "what an implicit scheme reports", default=None)
    acceptance: Acceptance | None = array("value h", "how often flows were accepted", default=None)
    word: str = fact("swept parameter of the spec", name="sweep", column=True)
    functions: tuple[str, ...] = fact("formulas of the test functions")
    accurate: float = fact("error up to which a scheme counts as accurate")
    samples: int = fact("number of paths", column=True)
    reference_step: float = fact("step size of the reference", "time", column=True)
    reference_scheme: str | None = fact("scheme of the reference, if not each is its own", default=None)
    panels: tuple[str, ...] = fact("what the figure shows")

    def freedom(self, name: str) -> float:
        """That of means over the paths."""
        return self.samples - 1

    @classmethod
    def over_values(cls, each: Sequence["Stability"]) -> Self:
        """See :class:`Stored`."""
        about, seconds = Description.common([one.about for one in each]), sum(one.wall_seconds for one in each)
        return cls(**_stacked(cls.over_swept, each) | {"about": about, "wall_seconds": seconds})

    @classmethod
    def answers(cls, readings: Sequence["Stability"]) -> Iterator[str]:
        """Largest accurate step size of each scheme, at the first and the last value of the parameter."""
        first = readings[0]
        ends = (f"{first.word} = {short(float(value), '.3g')}" for value in first.values[[0, -1]])
        steps = ((one.about.label, _steps(one, one.is_accurate)) for one in readings)
        each = "; ".join(f"{at[0]} to {at[-1]} with {label}" for label, at in steps)
        yield f"Largest accurate h (error <= {first.accurate:g} |y_0|) from {' to '.join(ends)}: {each}."

    @classmethod
    def remarks_of_case(cls, readings: Sequence["Stability"]) -> Iterator[str]:
        """Meaning of the columns, paths and times."""
        first, seconds = readings[0], sum(reading.wall_seconds for reading in readings)
        kept = f"Casimir kept: relative error < {short(CASIMIR_KEPT, '.0e')} on the worst path; "
        yield (
            f"h: the largest step size at which this holds, as at all smaller ones; {kept if first.casimirs else ''}"
            f"accurate: root mean square error at T <= {first.accurate:g} |y_0|; all else: worst over h"
        )
        yield (
            f"{first.samples} paths each; errors against the scheme at {power_of_two(first.reference_step)}; "
            f"{seconds:.3g} s on {first.threads} threads"
        )

    @derived("value h", "share of the solves that fail", claim=_SMALL)
    def failing_fraction(self) -> Array | None:
        """(V, S) of an implicit scheme; None of others."""
        return self.solver.failing_fraction if self.solver else None

    @derived("value h", "iterations of a solve")
    def iterations_per_solve(self) -> Array | None:
        """(V, S) of an implicit scheme; None of others."""
        return self.solver.iterations_per_solve if self.solver else None

    @derived("value h", "the worst regime that applies", column="regime")
    def regime(self) -> Array:
        """(V, S) its name, one of :data:`REGIMES`."""
        return np.array(REGIMES)[self.regimes]

    @property
    def all_finite(self) -> Array:
        """(V, S) whether all paths are finite at the final time."""
        return self.finite >= 1.0

    @property
    def is_accurate(self) -> Array:
        """(V, S) whether the error counts as accurate; NaN does not."""
        return self.error <= self.accurate

    @property
    def regimes(self) -> Array:
        """(V, S) number of the regime in :data:`REGIMES`.

        A scheme is not bounded where |y| becomes more than GROWTH times as large as at the smallest step size, since
        the true solution may grow as well.  NaN is never good.
        """
        norm = np.where(np.isnan(self.largest_norm), np.inf, self.largest_norm)
        finest = norm[:, -1:]
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


def _stacked(axis: str, each: Sequence[Any], outer: tuple[str, ...] = ()) -> dict[str, Any]:
    """Fields of records, those over the axis stacked; others are the same in all."""
    fields = {}
    for field in each[0].described:
        values, axes = [getattr(one, field.name) for one in each], (*outer, *field.meaning.axes, field.meaning.name)
        fields[field.name] = values[0]
        if values[0] is not None and field.is_record:
            fields[field.name] = field.type(**_stacked(axis, values, axes))
        elif values[0] is not None and axis in axes:
            fields[field.name] = np.stack(values)
    return fields


def largest_step(h: Array, good: Array) -> tuple[float, bool]:
    """Largest step size that is good together with all smaller ones, and whether that is all of them; NaN if none.

    `h` (S,) from large to small, `good` (S,).
    """
    count = int(np.logical_and.accumulate(good[::-1]).sum())
    return (float(h[-count]) if count else math.nan), count == len(h) > 0


Record = Stability
