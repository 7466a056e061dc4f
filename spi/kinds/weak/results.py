"""Record of weak errors by one estimator, with its tables and remarks."""

import json
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from spi.numerics.groups import filled_groups
from spi.printing.tables import Column, Table
from spi.printing.text import HEAVY, duration, fraction, joined, order_text, power_of_two, readable, short
from spi.statistics.claims import Quantity, lost_among, order, quantity
from spi.storage.records import HEAVY_TAILS, Order, Variables, in_standard_errors, student
from spi.storage.stored import (
    CLAIMED_ORDER,
    DIVERGED,
    Array,
    Claimed,
    Described,
    Stored,
    array,
    axis,
    derived,
    fact,
    nested,
)

CONSISTENCY = 1.0  #: beyond that means of neighbouring levels disagree, but for 0.3 % of the time
_DISAGREE = "the estimates disagree"
_NOT_AS_ASSUMED = (
    "the order is not the one assumed: extrapolated errors should fall like {}; the function may have a jump or a "
    "kink, or the steps may be too large; compare extrapolate: 0"
)
_NOT_YET = (
    "the reference's own error, {} by the smallest step, would be {} by the next: errors are not yet C {}, and may be "
    "off by about that; try a smaller reference_step"
)
TOO_FAR = 4.0  #: standard errors
_ORDER_AMISS = 0.5  # by so much an extrapolated order must lie below the one expected


class SampledFields(Described):
    """Fields of estimates from samples."""

    error_stderr: Array = array("function h", "standard error of the weak error", "value")
    error_without: Array | None = array(
        "left_out function h", "weak error without each group of paths in turn", "value", default=None
    )  # for what is fitted across schemes and eps
    expectation_stderr: Array = array("function h", "standard error of the expectation", "value")
    reference: Array = array("function", "expectation at the reference step", "value", "E phi(y_ref(T))")
    sd: Array | None = array("function", "standard deviation of phi at the largest step", "value", default=None)
    samples: int = fact("number of paths", column=True)
    ns_per_step: float = fact("processor time of a step and path", "ns", column=True)


class Unsampled(Described):
    """Fields of the solvers without sampling."""

    error_bound: Array = array("function h", "bound of the numerical error of the weak error", "value")
    expectation_bound: Array = array("function h", "bound of the numerical error of the expectation", "value")
    limit: Array = array("function", "expectation for the equation itself", "value", "E phi(y(T))")
    limit_bound: Array = array("function", "bound of the numerical error of that expectation", "value")
    notes: str = fact("how it was computed, JSON: resolution, ...", default="{}")

    @property
    def noted(self) -> dict[str, Any]:
        """Notes; nothing where they cannot be read."""
        try:
            return dict(json.loads(self.notes))
        except ValueError:
            return {}


class StageEstimates(Described):
    """Estimates of the same errors from less work."""

    error: Array = array("function h", "weak error from less work", "value")
    error_stderr: Array = array("function h", "standard error of the weak error from less work", "value")
    cpu_seconds: Array = array("", "processor time by then", "s")

    @property
    def resolved(self) -> Array:
        """(N, F, S) bool, whether the error stands clear of its standard error."""
        from spi.statistics.estimators import is_resolved  # takes a while

        return is_resolved(np.abs(self.error), self.error_stderr)


class Prefixes(StageEstimates):
    """Estimates from the first so many paths."""

    samples: Array = axis("number of first paths", name="samples")


class History(StageEstimates):
    """Estimates of the allocations of a multilevel estimator."""

    allocations: Array = axis("number of the allocation", name="allocation")


def _half_of_mean(table: Any) -> Array:
    with np.errstate(divide="ignore", invalid="ignore"):
        half = student(table.samples - 1) * np.sqrt(table.variance / table.samples)
        return np.where((table.variance > 0) & (table.samples > 0), half, 0.0)


class LevelEstimates(Described):
    """Levels of a multilevel estimate, each the difference between a step and half of it."""

    h: Array = axis("larger step size of the level", "time", name="level")
    mean: Array = array("function level", "mean of the difference", "value")
    variance: Array = array("function level", "variance of the difference")
    kurtosis: Array = array("function level", "kurtosis of the difference")
    consistency: Array = array("function level", "Giles' check, above 1 with probability 0.3 %")
    samples: Array = array("level", "samples of the level")
    nonfinite: Array = array("level", "diverged samples (NaN or infinity)")
    seconds: Array = array("level", "processor time of a sample", "s")
    mean_rate: tuple[Order, ...] | None = array(
        "function", "rate of the means", formula="p in |mean| = C h^p", default=None
    )
    variance_rate: tuple[Order, ...] | None = array(
        "function", "rate of the variances", formula="p in variance = C h^p", default=None
    )
    cost_rate: float = fact("p in seconds = C h^-p")
    antithetic: bool = fact("whether sampled with antithetic paths", name="antithetic")
    control: str = fact("what is subtracted to reduce the variance", name="control", default="")
    control_bound: float = fact("numerical error of its expectations", "value", name="control_bound", default=0.0)

    @derived("function level", "half the interval of the mean")
    def mean_half(self) -> Array:
        """Half the 95 % intervals of the means."""
        return _half_of_mean(self)

    @derived("level", "diverged samples, where there are any")
    def lost(self) -> Array | None:
        """Their numbers; None where there are none."""
        return self.nonfinite if self.nonfinite.any() else None


class Differences(Described):
    """Differences of a multilevel estimate to the scheme of weak order 2, one at each step size."""

    scheme: str = fact("scheme to which differences are taken", name="compared_with")
    mean: Array = array("function h", "mean of the difference", "value")
    variance: Array = array("function h", "variance of the difference")
    kurtosis: Array = array("function h", "kurtosis of the difference")
    consistency: Array = array(
        "function h", "distance from the expectations of the levels, above 1 with probability 0.3 %"
    )
    samples: Array = array("h", "samples of the difference")
    nonfinite: Array = array("h", "diverged samples (NaN or infinity)")
    seconds: Array = array("h", "processor time of a sample", "s")
    variance_rate: tuple[Order, ...] = array("function", "rate of the variances", formula="p in variance = C h^p")

    @derived("function h", "half the interval of the mean")
    def mean_half(self) -> Array:
        """Half the 95 % intervals of the means."""
        return _half_of_mean(self)

    @derived("h", "diverged samples, where there are any")
    def lost(self) -> Array | None:
        """Their numbers; None where there are none."""
        return self.nonfinite if self.nonfinite.any() else None


class Quasi(Described):
    """Fields of estimates from quasi-random points."""

    gain: Array = array("function h", "variance of the expectation by independent paths over that by as many points")
    scrambles: int = fact("number of independent scrambles", name="scrambles")
    points: int = fact("points of a scramble", name="points")
    dimensions: int = fact("dimensions of the points", name="dimensions")


def _sampled(name: str, inconsistent: str) -> list[Column]:
    """Columns of the differences of a multilevel estimate."""
    return [
        Column(f"{name}_mean", "mean of the\ndifference (95 %)"),
        Column(f"{name}_variance", "variance", form=".2e"),
        Column(f"{name}_kurtosis", "kurtosis", form=".3g", red=HEAVY_TAILS, why=HEAVY),
        Column(f"{name}_consistency", "consis-\ntency", form=".2f", red=CONSISTENCY, why=inconsistent),
        Column(f"{name}_samples", "samples"),
        Column(f"{name}_seconds", "µs per\nsample", form=lambda seconds: short(1e6 * seconds, ".3g")),
        Column(f"{name}_lost", "di-\nverged", red=0),
    ]


def _agreement(name: str, reading: "WeakErrors", readings: Sequence["WeakErrors"]) -> Array | None:
    """(F, S) a field of the agreement of a sampled estimate with the one without sampling; None if there is none."""
    near = agreement(reading, readings)
    return None if near is None else getattr(near, name)


#: The order of the largest error over eps, and distances of sampled errors from those without sampling.
UNIFORM_ORDER = CLAIMED_ORDER._replace(name="uniform_order", further="largest over eps")
AGREEMENT = Claimed("at most", per_step=True)
_ERROR, _EXPECTATION = Claimed("at most", absolute=True), Claimed("equal", expected="limit", symbol=r"\mathrm{E}\,")


class WeakErrors(Stored):
    """Weak errors of one scheme by one estimator, of test functions phi at several step sizes, from large to small."""

    headline = ("order", "error", "expectation")
    measures = (
        r"The weak error of a test function $\varphi$ at the step size $h$ is "
        r"$\mathbb{E}\, \varphi(y_h(T)) - \mathbb{E}\, \varphi(y(T))$; "
        "the order is the power of $h$ with which it falls."
    )
    row_axes = ("function", "h")
    tables = (
        Table(
            "function h",
            [
                Column("error", "weak error\n(95 % or bound)", resolved="resolved", missing="nan"),
                Column("expectation", "expectation\n(95 % or bound)"),
                Column("quasi_gain", "times the\nvariance", form=".3g"),
                Column("lost", "di-\nverged", red=0),
            ],
        ),
        Table(
            "function",
            [
                Column("order", "order (95 %)", form=".3f", interval="[]", missing="not resolved"),
                Column("expected_order", "expected", form=fraction),
                Column("points_in_fit", "step\nsizes"),
                Column("limit", "limit\n(bound)"),
            ],
            "orders",
        ),
        Table(
            "function",
            [
                Column("cpu_seconds", "processor\ntime", form=duration),
                Column("level_cost_rate", "cost of\nlevels h^-", form=".2f"),
            ],
            "cost",
        ),
        Table(
            "function",
            [
                Column("level_mean_rate", "mean of\nlevels h^", form=".2f", interval="[]"),
                Column("level_variance_rate", "variance of\nlevels h^", form=".2f", interval="[]"),
                Column("difference_variance_rate", "variance of\ndifferences h^", form=".2f", interval="[]"),
            ],
            "powers of h",
        ),
        Table(
            "function h",
            [
                Column(partial(_agreement, "deviation"), "in std.\nerrors", form=".1f", red=TOO_FAR, why=_DISAGREE),
                Column(partial(_agreement, "share"), "standard error\nby error", form=".2g"),
            ],
            "sampled errors less those without sampling",
        ),
        Table(
            "function level",
            _sampled("level", "the means of neighbouring levels disagree"),
            "levels",
            lines=lambda one: one.from_large_steps,
        ),
        Table(
            "function h",
            _sampled("difference", "the expectation is not that of its levels"),
            "differences to a scheme of weak order 2",
        ),
    )

    functions: tuple[str, ...] = axis("test function", name="function")
    h: Array = axis("step size", "time")
    error: Array = array("function h", "weak error", "value", "E phi(y_h(T)) - E phi(y(T))", claim=_ERROR)
    expectation: Array = array(
        "function h", "expectation of the test function", "value", "E phi(y_h(T))", claim=_EXPECTATION
    )
    resolved: Array = array("function h", "whether the error stands clear of its own uncertainty")
    orders: tuple[Order, ...] = array("function", "", name="order")
    nonfinite: Array | None = array("h", "diverged paths (NaN or infinity)", claim=DIVERGED, default=None)
    expected_order: float | None = fact("order that theory states", column=True, default=None)
    sampled: SampledFields | None = None
    unsampled: Unsampled | None = None
    prefixes: Prefixes | None = nested("samples", "prefix_", default=None)
    history: History | None = nested("allocation", "history_", default=None)
    levels: LevelEstimates | None = nested(prefix="level_", default=None)
    differences: Differences | None = nested(prefix="difference_", default=None)
    quasi: Quasi | None = nested(prefix="quasi_", default=None)
    formulas: tuple[str, ...] = fact("formulas of the test functions in y1, y2, ...", name="functions")
    cpu_seconds: float = fact("processor time", "s", column=True)
    reference_step: float = fact("step size of the reference", "time")
    reference_scheme: str | None = fact("scheme of the reference, if not each is its own", default=None)
    reference_nonfinite: int = fact("diverged paths of the reference (NaN or infinity)", default=0)
    panels: tuple[str, ...] = fact("what the figure shows", default=("errors",))
    accuracy: float | None = fact("requested numerical error", "value", default=None)
    left_out: tuple[str, ...] = fact("schemes of the case that the estimator cannot do", default=())
    note: str = fact("which errors are exact up to rounding", default="")

    def __post_init__(self) -> None:
        if self.sampled is None and self.unsampled is None:
            raise KeyError("error_stderr")
        if len(self.formulas) < len(self.functions):
            raise ValueError(f"{len(self.formulas)} formulas for {len(self.functions)} functions")

    @classmethod
    def quantities_of_case(cls, readings: Sequence["WeakErrors"]) -> Iterator[Quantity]:
        """Distances of sampled from deterministic errors, and the order of the largest error over eps.

        The distances (``agreement``) are in standard errors and without their sign.
        """
        for one in readings:
            if near := agreement(one, readings):
                for (f, i), value in np.ndenumerate(np.abs(near.deviation)):
                    function, h = one.functions[f], float(one.h[i])
                    yield quantity("agreement", one.about, value, 0.0, function, h, claim=AGREEMENT)
        for members in comparable_sweeps(readings).values():
            about = replace(members[0].about, eps=None, variant=members[0].about.scheme)
            for f, function in enumerate(members[0].functions):
                largest = largest_over_eps(members, f)
                fitted = order(about, largest.order, UNIFORM_ORDER, function, members[0].expected_order)
                yield fitted._replace(lost=lost_among(largest.value + largest.stderr, "errors"))

    def beside(self, readings: Iterable["WeakErrors"]) -> Variables:
        """``agreement``: the error less that without sampling, in standard errors."""
        near = agreement(self, readings)
        return {"agreement": (self.row_axes, near.deviation)} if near else {}

    @derived("h", "diverged paths, where there are any")
    def lost(self) -> Array | None:
        """(S,) their numbers; None where there are none."""
        return self.nonfinite if self.nonfinite is not None and self.nonfinite.any() else None

    @property
    def from_large_steps(self) -> Iterator[tuple[int, int]]:
        """(function, level) of all levels, from large to small steps."""
        assert self.levels is not None
        for f in range(len(self.functions)):
            yield from ((f, i) for i in self.levels.h.argsort()[::-1].tolist())

    @derived("function h", "half the interval of the error, or its bound", name="error_half")
    def half(self) -> Array:
        """(F, S) half the 95 % interval of the error, or the bound of its numerical error."""
        return self._half("error")

    @derived("function h", "half the interval of the expectation, or its bound")
    def expectation_half(self) -> Array:
        """(F, S) the same of the expectation."""
        return self._half("expectation")

    def freedom(self, name: str) -> float:
        """That of the jackknife groups, which quasi-random points and levels fill in their own ways."""
        if self.sampled is None:
            return math.inf
        without = self.sampled.error_without
        return (filled_groups(self.sampled.samples) if without is None else len(without)) - 1

    def _half(self, name: str) -> Array:
        if self.sampled:
            return np.asarray(self.interval(name) * getattr(self.sampled, f"{name}_stderr"))
        return np.asarray(getattr(self.unsampled, f"{name}_bound"))

    @property
    def paths(self) -> int | None:
        """Number of paths, where it is one for all; None of levels, and where nothing is sampled."""
        return self.sampled.samples if self.sampled and not self.levels else None

    @property
    def stages(self) -> StageEstimates | None:
        """Estimates from less work, where there are any."""
        return self.prefixes or self.history

    @property
    def reference_shows_limit(self) -> bool:
        """Whether eps^2 < h_ref: the reference does not resolve the fast processes and shows a limit instead."""
        eps = self.about.eps
        return eps is not None and 0.0 < eps**2 < self.reference_step

    def remarks(self) -> Iterator[str]:
        """Doubts about orders and references, points, resolutions, accuracies that are not reached, limits."""
        yield from self._remarks_on_orders()
        if self.sampled and self.sampled.samples == 1 and np.isnan(self.sampled.error_stderr).any():
            yield f"{self.about.subject()}: one path has no standard error: not resolved"
        if quasi := self.quasi:
            points = f"{quasi.scrambles} scrambles of {quasi.points} points in {quasi.dimensions} dimensions"
            yield f"{self.about.subject()}: {points}; times the variance: of as many independent paths"
        if self.unsampled and (resolution := _resolution(self.unsampled.noted)):
            yield f"{self.about.subject()}: {resolution}"
        if poor := not_reached(self):
            yield f"{self.about.subject()}: {poor}"
        if self.reference_shows_limit:
            limit = f"the limit of {self.reference_scheme}" if self.reference_scheme else "the scheme's own limit"
            root = short(math.sqrt(self.reference_step), ".2g")
            yield f"{self.about.subject()}: eps < sqrt(h_ref) = {root}: the reference shows {limit}"

    def _remarks_on_orders(self) -> Iterator[str]:
        """Doubts whether errors behave as theory says at these step sizes, for each test function."""
        own, power = own_error(self), _power(self.expected_order or math.nan, "h")
        for f, function in enumerate(self.functions):
            name = self.about.subject(function)
            if self.about.extrapolate and self.orders[f].high < (self.expected_order or -math.inf) - _ORDER_AMISS:
                yield f"{name}: {_NOT_AS_ASSUMED.format(power)}"
            if own and own.differ[f]:
                off = own.by_next[f] - own.value[f]
                less = f"{short(abs(off))} {'more' if off > 0 else 'less'}"
                yield f"{name}: {_NOT_YET.format(short(own.value[f]), less, power)}"

    @classmethod
    def remarks_of_case(cls, readings: Sequence["WeakErrors"]) -> Iterator[str]:
        """Test functions, orders of the largest errors over eps, references, schemes without results."""
        for name, formula in zip(readings[0].functions, readings[0].formulas, strict=True):
            yield f"{name} = {readable(formula, readings[0].about.variables)}"
        for one in cls.quantities_of_case(readings):
            if one.claim.is_order:
                yield f"{one.subject}, {one.claim.further}: {order_text(one.value, one.low, one.high, one.expected)}"
        yield from dict.fromkeys(_reference(reading) for reading in readings if reading.sampled)
        for estimator, schemes in dict.fromkeys((reading.about.estimator, reading.left_out) for reading in readings):
            if schemes:
                yield cannot_do(estimator, schemes)


Record = WeakErrors


# ---------------------------------------------------------------------------------------------------------------------
# What readings tell beside their errors: how far those of a case agree, the largest over eps, the reference's own.
# ---------------------------------------------------------------------------------------------------------------------

if TYPE_CHECKING:
    from spi.statistics.estimators import Largest


class Agreement(NamedTuple):
    """A sampled estimate beside the deterministic one; arrays (F, S), NaN where nothing is known."""

    deviation: Array  #: sampled minus deterministic error, in standard errors
    share: Array  #: the standard error over the deterministic error


def agreement(reading: WeakErrors, readings: Iterable[WeakErrors]) -> Agreement | None:
    """Compare a sampled estimate with the one without sampling among `readings`; None if there is none."""
    whose = reading.about.case, reading.about.variant
    same = [one for one in readings if (one.about.case, one.about.variant) == whose]
    exact, bounds = next(((one, one.unsampled) for one in same if one.unsampled), (None, None))
    if reading.sampled is None or exact is None or bounds is None:
        return None
    stderr = reading.sampled.error_stderr
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        off = in_standard_errors(reading.error - exact.error, np.hypot(stderr, bounds.error_bound))
        return Agreement(off, stderr / np.abs(exact.error))


class OwnError(NamedTuple):
    """Reference's own error, which all errors of a reading contain; arrays (F,)."""

    value: Array  #: C h_ref^p by the smallest step, as it was added
    by_next: Array  #: by the step after it, as if that were the smallest
    differ: Array  #: whether the two differ, and by more than some of the standard errors


def own_error(reading: WeakErrors) -> OwnError | None:
    """Reference's own error by the two smallest steps; None where it was not added, or there is one step only.

    Where errors are C h^p + D h^q there, 2^q >= 2, and the steps differ by a factor of 2, what was added is off by at
    most about as much as the two differ.
    """
    from spi.statistics.estimators import PARTS, is_resolved, jackknife_stderr  # takes a while

    sampled, order = reading.sampled, reading.expected_order
    if sampled is None or sampled.error_without is None or not order or len(reading.h) < 2:
        return None
    if reading.reference_scheme or reading.differences:
        return None
    without = sampled.error_without
    share = (reading.reference_step / reading.h[:-3:-1]) ** order  # of the two smallest steps, the smallest first

    def by_both(errors: Array) -> tuple[Array, Array]:
        added = errors[..., -1] * share[0]
        return added, (errors[..., -2] - added) * share[1] / (1.0 - share[1])

    value, by_next = by_both(reading.error)
    off, off_without = value - by_next, np.subtract(*by_both(without))
    clear = is_resolved(np.abs(off), jackknife_stderr(off, off_without, np.full(len(without), PARTS)))
    return OwnError(value, by_next, clear & (np.abs(off) > sampled.error_stderr.min(axis=-1)))


def cannot_do(estimators: str, schemes: Sequence[str]) -> str:
    """That there are no results of some schemes."""
    return f"{estimators} cannot do {joined(schemes)}: there are no such results"


def not_reached(reading: WeakErrors) -> str:
    """That numerical errors are larger than was asked for; empty if they are not, or if nothing was asked for."""
    known: dict[str, float] = {}
    if reading.unsampled:
        bounds = {"errors": reading.unsampled.error_bound, "expectations": reading.unsampled.expectation_bound}
        known |= {name: float(bound.max()) for name, bound in bounds.items()}
    if reading.levels and reading.levels.control:
        known["expectations of the control"] = reading.levels.control_bound
    if reading.accuracy is None:
        return ""
    poor = [f"{name} are known to {short(bound)}" for name, bound in known.items() if not bound <= reading.accuracy]
    return f"accuracy {short(reading.accuracy, 'g')} is not reached: {joined(poor)}" if poor else ""


def sweeps(readings: Iterable[WeakErrors]) -> dict[tuple[str, str], list[WeakErrors]]:
    """(scheme, estimator) -> readings of a scheme for the multiscale system, from large to small eps."""
    found: dict[tuple[str, str], list] = {}
    for reading in sorted(readings, key=lambda reading: -(reading.about.eps or 0.0)):
        if reading.about.eps is not None:
            found.setdefault((reading.about.scheme, reading.about.estimator), []).append(reading)
    return found


def comparable_sweeps(readings: Iterable[WeakErrors]) -> dict[tuple[str, str], list[WeakErrors]]:
    """Sweeps of several eps at the same step sizes, of which :func:`largest_over_eps` can be asked."""
    return {
        key: members
        for key, members in sweeps(readings).items()
        if len(members) > 1
        and all(one.sampled and one.sampled.error_without is not None for one in members)
        and all(np.array_equal(one.h, members[0].h) for one in members)
    }


def largest_over_eps(members: Sequence[WeakErrors], f: int) -> "Largest":
    """``spi.statistics.estimators.Largest`` over the readings of a comparable sweep, of test function number f."""
    from spi.statistics.estimators import largest_over  # takes a while

    errors = np.array([one.error[f] for one in members])
    withouts = [one.sampled.error_without for one in members if one.sampled]
    return largest_over(members[0].h, errors, np.array([without[:, f] for without in withouts if without is not None]))


# ---------------------------------------------------------------------------------------------------------------------
# Lines under the tables
# ---------------------------------------------------------------------------------------------------------------------


def _power(order: float, base: str) -> str:
    """``h``, ``h^2`` or ``(h_ref/h)^(3/2)``."""
    return base if order == 1 else f"{base}^{fraction(order)}"


def _resolution(notes: dict[str, Any]) -> str:
    """Short ones of the notes of a solver without sampling."""
    texts = {key.replace("_", " "): json.dumps(value) for key, value in notes.items() if not key.startswith("seconds")}
    return ", ".join(f"{key} {text}" for key, text in texts.items() if len(text) <= 12)


def _reference(reading: WeakErrors) -> str:
    """Share of the errors of a record that its reference lacks."""
    reference, differences = reading.reference_step, reading.differences
    order = 2.0 if differences else reading.expected_order
    where = f"the reference at h_ref = {power_of_two(reference)}"
    if reading.reference_scheme:
        return f"{where} is {reading.reference_scheme}: errors are not corrected for what it lacks"
    if not order:
        return f"{where}: errors are not corrected for what it lacks, as theory states no order"
    share = f"{100 * (reference / reading.h.min()) ** order:.2g} %"
    ratio = "h_ref/h" if order == 1 else _power(order, "(h_ref/h)")
    error = f"the error of {differences.scheme} at the finest step" if differences else "the finest error"
    return f"{where} lacks {ratio} = {share} of {error} (order {fraction(order)}), which is added to all errors"
