"""Record of errors and of the times of paths, and the cost of a requested error: the step size that reaches it."""

import math
import re
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from spi.kinds.weak.results import cannot_do
from spi.printing.tables import Column, OwnTable, StyledText, Table, TextTable
from spi.printing.text import duration, readable, short
from spi.storage.records import Order
from spi.storage.stored import DIVERGED, Array, Claimed, Stored, array, axis, derived, fact

#: The panels of the figure.
PANELS = ("errors", "casimirs")


class WorkCurve(NamedTuple):
    """Errors of one scheme and what they cost at each step size; all arrays have shape (steps,)."""

    h: np.ndarray
    error: np.ndarray  #: without its sign, not finite where paths diverged
    half: np.ndarray  #: half the 95 % interval of the error, or the bound of its numerical error
    resolved: np.ndarray
    seconds: np.ndarray  #: for one path
    low: np.ndarray  #: the 95 % interval of the seconds
    high: np.ndarray


class WorkPoint(NamedTuple):
    """Time and the step size at which a scheme reaches a requested error."""

    seconds: float  #: for one path
    low: float  #: its 95 % interval
    high: float
    h: float  #: the step size
    at_most: bool = False  #: whether a larger step might do, so that the time is an upper bound


class Factor(NamedTuple):
    """Time of another scheme over that of the cheapest, with its 95 % interval."""

    value: float
    low: float  #: 0 where the time of the other is an upper bound
    high: float  #: infinite where that of the cheapest is one

    @property
    def tie(self) -> bool:
        """Whether it may as well be the other way round."""
        return self.low <= 1.0 <= self.high


def interval_of_median(
    median: np.ndarray, low: np.ndarray, high: np.ndarray, repeats: int
) -> tuple[np.ndarray, np.ndarray]:
    """95 % interval of a median of times whose quartiles are `low` and `high`, all of shape (...).

    The median of n normal values has the standard deviation 1.253 n^(-1/2), and their quartiles are 1.349 apart: hence
    the half width 1.82 n^(-1/2) ln(high / low) in logarithms, times 1 + 4/n because quartiles of few values are
    uncertain (fitted to simulations; at n = 5 about 90 % are reached).  The interval contains the quartiles themselves,
    for slow phases of a machine last longer than one repeat.
    """
    n = max(repeats, 1)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        factor = (high / low) ** (1.82 / np.sqrt(n) * (1.0 + 4.0 / n))
        return np.minimum(low, median / factor), np.maximum(high, median * factor)


def work_for(target: float, curve: WorkCurve) -> WorkPoint | None:
    """Seconds per path at which a scheme reaches the error `target`; None if at no step size that was run.

    Between neighbours a and b with error_a > target >= error_b it is a power of the error: with the weight
    w = ln(error_a / target) / ln(error_a / error_b), ln s = (1 - w) ln s_a + w ln s_b, and likewise the step size.
    Errors need not fall from step to step: b is the largest step from which on, towards smaller ones, all are at most
    `target`, and error_b is the largest of these, so that no luck is rewarded.  A point that is not resolved counts
    with the upper end of its interval, and is passed over where that lies above `target` and the lower end does not.
    If there is no a, or none with a finite error, b itself is an upper bound.  So is a time that takes error_b from a
    point that is not resolved: the true error may be far smaller.

    The interval of ln s has the half widths ((k e)^2 + t^2)^(1/2).  Its slope is k = ln(s_b / s_a) / ln(error_a /
    error_b), e = (1 - w) half_a / error_a + w half_b / error_b is as for errors that depend on one another, as they do
    if they share their paths, and t is the same mean of the logarithmic distances from s to the ends of its interval.
    """
    curve = WorkCurve(*(np.asarray(values)[np.argsort(curve.h)] for values in curve))
    resolved = curve.resolved.astype(bool)
    against = ~(curve.error - np.where(resolved | ~np.isfinite(curve.half), 0.0, curve.half) <= target)  # of nan too
    curve = curve._replace(error=np.where(resolved, curve.error, curve.error + curve.half))
    usable = (resolved | (curve.error <= target)) & (curve.error > 0) & (curve.seconds > 0)
    usable &= np.isfinite(curve.error) & np.isfinite(curve.half) & np.isfinite(curve.seconds)
    first = int(np.argmax(against)) if against.any() else len(against)
    met = np.flatnonzero(usable[:first])
    if not len(met):
        return None
    b = met[-1]
    if first == len(against) or not usable[first]:
        seconds, low, high, h = (float(values[b]) for values in (curve.seconds, curve.low, curve.high, curve.h))
        return WorkPoint(seconds, low, high, h, at_most=True)
    pair, worst = np.array([first, b]), np.array([first, met[np.argmax(curve.error[met])]])
    errors, logs = curve.error[worst], np.log(curve.seconds[pair])
    weight = np.log(errors[0] / target) / np.log(errors[0] / errors[1])
    weights = np.array([1.0 - weight, weight])
    slope = (logs[1] - logs[0]) / np.log(errors[0] / errors[1])
    spread = slope * (weights @ (curve.half[worst] / errors))
    with np.errstate(divide="ignore", over="ignore"):
        down, up = (weights @ np.abs(logs - np.log(ends[pair])) for ends in (curve.low, curve.high))
        interval = weights @ logs + np.array([0.0, -np.hypot(spread, down), np.hypot(spread, up)])
        seconds, low, high = np.exp(interval).tolist()
    h, at_most = float(np.exp(weights @ np.log(curve.h[pair]))), not resolved[worst[1]]
    return WorkPoint(seconds, low, high, h, at_most)


def is_undecided(target: float, curve: WorkCurve) -> bool:
    """Whether a point that is not resolved has `target` in its interval, so that it may have that error or not."""
    with np.errstate(invalid="ignore"):
        inside = np.abs(curve.error - target) <= curve.half
    return bool(np.any(inside & ~curve.resolved.astype(bool)))


def time_factor(best: WorkPoint, other: WorkPoint) -> Factor:
    """Time of the work point `other` over that of `best`.

    The two are taken for independent of one another: the logarithmic distances to the ends of their intervals are added
    in squares.  Where the time of `other` is an upper bound the factor may be anything below, and the other way round.
    """
    value = other.seconds / best.seconds
    with np.errstate(divide="ignore", over="ignore"):
        down = np.hypot(np.log(other.seconds / np.float64(other.low)), np.log(best.high / np.float64(best.seconds)))
        up = np.hypot(np.log(other.high / np.float64(other.seconds)), np.log(best.seconds / np.float64(best.low)))
        low = 0.0 if other.at_most else float(value * np.exp(-down))
        high = np.inf if best.at_most else float(value * np.exp(up))
    return Factor(value, low, high)


def cheapest(works: dict[str, WorkPoint | None]) -> tuple[str | None, dict[str, Factor]]:
    """Scheme that needs the least time, and the :class:`Factor` of each of the others, from the cheapest on.

    `works` are work points by name, None where a scheme does not reach the error.  Returns a name, None if no scheme
    reaches it, and a dictionary; the first of its factors says whether the cheapest is clear of the second.
    """
    reached = {name: point for name, point in works.items() if point is not None}
    if not reached:
        return None, {}
    best, *others = sorted(reached, key=lambda name: (reached[name].seconds, name))
    return best, {name: time_factor(reached[best], reached[name]) for name in others}


class WorkPrecision(Stored):
    """Errors of one scheme at several step sizes, from large to small, and the processor time of one path at each.

    Of weak errors, which have one test function, the modulus.
    """

    headline = ("order", "error")
    measures = (
        "The work of a scheme at a requested error is the processor time of one path with the step size at which "
        "the scheme has that error."
    )
    row_axes, row_largest = ("h",), ("casimir",)
    tables = (
        Table(
            "h",
            [
                Column("error", "error\n(95 % or bound)", resolved="resolved", missing="nan"),
                Column("seconds_per_path", "time per\npath", form=duration, interval=""),
                Column("ns_per_step", "ns per\nstep", form=".1f"),
                Column("casimir_drift", "Casimir\ndrift"),
                Column("nonfinite", "di-\nverged", red=0),
            ],
        ),
        OwnTable(lambda title, readings, everything: _requested(readings)),
    )

    h: Array = axis("step size", "time")
    error: Array = array("h", "error without its sign", "state or value", claim="at most")
    error_stderr: Array | None = array("h", "standard error of the error", "state or value", default=None)
    error_bound: Array | None = array("h", "bound of the numerical error, without sampling", "value", default=None)
    resolved: Array = array("h", "whether the error stands clear of its standard error or bound")
    casimir_drift: Array | None = array(
        "h casimir",
        "largest change of a Casimir",
        formula="max over paths and n of |C(y_n) - C(y_0)|",
        claim=Claimed("at most", infinite=True),
        default=None,
    )
    nonfinite: Array | None = array("h", "diverged paths (NaN or infinity)", claim=DIVERGED, default=None)
    ns_per_step: Array = array("h", "time of a step and path, by the median", "ns")
    seconds_per_path: Array = array("h", "processor time of a path, the median of the repeats", "s")
    seconds_per_path_low: Array = array("h", "lower quartile of the processor time of a path", "s")
    seconds_per_path_high: Array = array("h", "upper quartile of the processor time of a path", "s")
    order: Order
    expected_order: float | None = fact("order that theory states", column=True, default=None)
    measure: str = fact("kind of the errors, strong or weak", column=True)
    estimator: str = fact("estimator of weak errors", default="")
    functions: tuple[str, ...] = fact("formula of the test function of weak errors", default=())
    samples: int | None = fact("number of paths, where it is given beforehand", column=True, default=None)
    repeats: int = fact("how often each step size is timed")
    targets: tuple[float, ...] = fact("errors for which the cheapest scheme is asked", "state or value")
    reference_step: float = fact("step size of the reference", "time")
    reference_scheme: str | None = fact("scheme of the reference, if not each is its own", default=None)
    reference_nonfinite: int = fact("diverged paths of the reference (NaN or infinity)", default=0)
    left_out: tuple[str, ...] = fact("schemes of the case that no estimator of it can do", default=())
    note: str = fact("what is to be said of the errors", default="")
    panels: tuple[str, ...] = fact("what the figure of the case shows", default=PANELS)

    def __post_init__(self) -> None:
        if self.error_stderr is None and self.error_bound is None:
            raise KeyError("error_stderr")

    @derived("h", "half the interval of the error, or its bound", name="error_half")
    def half(self) -> Array:
        """(S,) half the 95 % interval of the error, or the bound of its numerical error."""
        if self.error_stderr is None:
            return np.asarray(self.error_bound)
        return np.asarray(self.interval("error") * self.error_stderr)

    @property
    def curve(self) -> WorkCurve:
        """Errors and times of the scheme, from which the cost of a requested error is interpolated."""
        times = self.seconds_per_path, self.seconds_per_path_low, self.seconds_per_path_high
        low, high = interval_of_median(*times, self.repeats)
        return WorkCurve(self.h, self.error, self.half, self.resolved, self.seconds_per_path, low, high)

    @classmethod
    def answers(cls, readings: Sequence["WorkPrecision"]) -> Iterator[str]:
        """Cheapest scheme for the largest and for the smallest requested error that any scheme reaches."""
        labels, reached = {one.about.variant: one.about.label for one in readings}, []
        for target in requested(readings):
            best, point, _ = _fastest(target, readings)
            h, time = _needs(point)
            if best:
                reached.append(
                    f"An error of {short(target, '.3g')} costs least with {labels[best]}: {time} a path, h = {h}."
                )
        yield from dict.fromkeys(reached[-1:] + reached[:1])

    @classmethod
    def remarks_of_case(cls, readings: Sequence["WorkPrecision"]) -> Iterator[str]:
        """Meaning of errors and times, and schemes without results."""
        first = readings[0]
        functions = ", ".join(readable(function, first.about.variables) for function in first.functions)
        yield f"{first.measure} error" + (f" of the expectation of {functions}" if functions else "")
        time = f"processor core for one path to T = {first.about.final_time:g}, the median of {first.repeats} repeats"
        yield f"time: of one {time}"
        if first.left_out:
            yield cannot_do("the estimators", first.left_out)


def requested(readings: Iterable[WorkPrecision]) -> list[float]:
    """Errors that are asked for in a case, from small to large."""
    return sorted({target for reading in readings for target in reading.targets})


Record = WorkPrecision


# ---------------------------------------------------------------------------------------------------------------------
# The table of requested errors: the cheapest scheme, and the times of the others as multiples of its time.
# ---------------------------------------------------------------------------------------------------------------------

_HEADING = 10  # characters of the label of a scheme over a column of factors

#: The meaning of the marks of a factor.
_MARKS = {
    "tie": "tie: the 95 % interval of the factor contains 1",
    "≤": "≤: the largest step that was run does already, paths diverged at the next one, or its error is not resolved",
    "≥": "≥: so it is for the cheapest scheme",
    "()": "( ): so it is for both, which leaves open which is cheaper",
    "?": "?: whether it is reached is not resolved",
    "-": "-: not reached at the steps that were run",
}


def _requested(readings: Sequence[WorkPrecision]) -> Iterator[TextTable | StyledText]:
    """Table, and the lines that explain its marks."""
    labels = {reading.about.variant: reading.about.label for reading in readings}
    headings = ["error", "cheapest", "h", "time", *map(_heading, labels.values())]
    lines: list[list[StyledText]] = []
    marks: set[str] = set()
    for target in reversed(requested(readings)):
        best, point, cells = _fastest(target, readings)
        marks.update(re.sub(r"[\d. ]", "", cell) for cell in cells.values())
        if point is not None and point.at_most:
            marks.add("≤")
        factors = [StyledText(cell, "bold" if variant == best else "") for variant, cell in cells.items()]
        texts = (_plainly(target), labels[best] if best else "none", *_needs(point))
        lines.append([*map(StyledText, texts), *factors])
    title = "cheapest scheme for a requested error, times of the others as multiples"
    yield TextTable(title, headings, [lines], left=3)
    yield from (StyledText(text, "dim") for mark, text in _MARKS.items() if mark in marks)


def _fastest(target: float, readings: Sequence[WorkPrecision]) -> tuple[str | None, WorkPoint | None, dict[str, str]]:
    """For a requested error the cheapest scheme, its work point, and for each scheme the text of its factor."""
    curves = {reading.about.variant: reading.curve for reading in readings}
    works = {variant: work_for(target, curve) for variant, curve in curves.items()}
    best, factors = cheapest(works)
    cells = {variant: "?" if is_undecided(target, curve) else "-" for variant, curve in curves.items()}
    cells |= {best: "1"} if best else {}
    cells |= {variant: _factor(factor) for variant, factor in factors.items()}
    return best, works[best] if best else None, cells


def step_text(h: float) -> str:
    """``2^-4.5``: a step size between those that were run."""
    exponent = f"{math.log2(h):z.1f}".removesuffix(".0")
    return f"2^{exponent}"


def _needs(point: WorkPoint | None) -> tuple[str, str]:
    """Step size and time of a work point."""
    if point is None:
        return "", ""
    return step_text(point.h), f"{'≤ ' if point.at_most else ''}{duration(point.seconds)}"


def _factor(factor: Factor) -> str:
    """``2.3``, with what is to be known of its interval."""
    digits = 2 if factor.value < 1.995 else 1 if factor.value < 9.95 else 0
    value = f"{factor.value:.{digits}f}"
    if factor.low == 0.0:
        return f"({value})" if math.isinf(factor.high) else f"≤ {value}"
    return f"tie {value}" if factor.tie else f"≥ {value}" if math.isinf(factor.high) else value


def _plainly(x: float) -> str:
    """``0.025``, with a power of ten where others have one as well, ``2.5e-4``."""
    digits, _, exponent = f"{x:.2e}".partition("e")
    return f"{float(f'{x:.2e}'):g}" if 1e-3 <= x < 1e5 else f"{float(digits):g}e{int(exponent)}"


def _heading(label: str) -> str:
    """A label in lines of few characters."""
    lines = textwrap.wrap(label.replace("order ", "order\xa0"), _HEADING, break_long_words=False)
    return "\n".join(lines).replace("\xa0", " ")
