"""What is stored of weak errors."""

import json
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import numpy as np

from spi.printing.rows import rows_of
from spi.printing.tables import Column, Table
from spi.printing.text import fraction, joined, order_text, power_of_two, readable, short, with_interval
from spi.statistics.claims import Quantity, lost_among, order, quantity
from spi.statistics.intervals import student_factor
from spi.storage.records import HEAVY_TAILS, INTERVAL, Order, in_standard_errors
from spi.storage.stored import Array, Claimed, Described, Stored, array, axis, derived, fact, nested

CONSISTENCY = 1.0  #: beyond that means of neighbouring levels disagree, but for 0.3 % of the time
PAPER = 1e9  #: samples of the paper's weak errors
TOO_FAR = 4.0  #: standard errors
_ORDER_AMISS = 0.5  # by so much an extrapolated order must lie below the one expected


class Sampled(Described):
    """What only estimates from samples have."""

    error_stderr: Annotated[Array, array("function h", "standard error of the weak error", "value")]
    error_without: Annotated[
        Array | None, array("left_out function h", "weak error without each group of paths in turn", "value")
    ] = None  # for what is fitted across schemes and eps
    expectation_stderr: Annotated[Array, array("function h", "standard error of the expectation", "value")]
    reference: Annotated[Array, array("function", "expectation at the reference step", "value", "E phi(y_ref(T))")]
    sd: Annotated[Array | None, array("function", "standard deviation of phi at the largest step", "value")] = None
    samples: Annotated[int, fact("number of paths", column=True)]
    ns_per_step: Annotated[float, fact("processor time of a step and path", "ns", column=True)]


class Unsampled(Described):
    """What only the solvers without sampling have."""

    error_bound: Annotated[Array, array("function h", "bound of the numerical error of the weak error", "value")]
    expectation_bound: Annotated[Array, array("function h", "bound of the numerical error of the expectation", "value")]
    limit: Annotated[Array, array("function", "expectation for the equation itself", "value", "E phi(y(T))")]
    limit_bound: Annotated[Array, array("function", "bound of the numerical error of that expectation", "value")]
    notes: Annotated[str, fact("how it was computed, JSON: resolution, ...")] = "{}"

    @property
    def noted(self) -> dict[str, Any]:
        """The notes; nothing where they cannot be read."""
        try:
            return dict(json.loads(self.notes))
        except ValueError:
            return {}


class Stages(Described):
    """Estimates of the same errors from less work."""

    error: Annotated[Array, array("function h", "weak error from less work", "value")]
    error_stderr: Annotated[Array, array("function h", "standard error of the weak error from less work", "value")]
    cpu_seconds: Annotated[Array, array("", "processor time by then", "s")]

    @property
    def resolved(self) -> np.ndarray:
        """(N, F, S) bool, whether the error stands clear of its standard error."""
        from spi.statistics.estimators import is_resolved  # takes a while

        return is_resolved(np.abs(self.error), self.error_stderr)


class Prefixes(Stages):
    """Estimates from the first so many paths."""

    samples: Annotated[Array, axis("number of first paths", name="samples")]


class History(Stages):
    """Estimates of the allocations of a multilevel estimator."""

    allocations: Annotated[Array, axis("number of the allocation", name="allocation")]


class Levels(Described):
    """The levels of a multilevel estimate, each the difference between a step and half of it."""

    h: Annotated[Array, axis("larger step size of the level", "time", name="level")]
    mean: Annotated[Array, array("function level", "mean of the difference", "value")]
    variance: Annotated[Array, array("function level", "variance of the difference")]
    kurtosis: Annotated[Array, array("function level", "kurtosis of the difference")]
    consistency: Annotated[Array, array("function level", "Giles' check, above 1 with probability 0.3 %")]
    samples: Annotated[Array, array("level", "samples of the level")]
    nonfinite: Annotated[Array, array("level", "diverged samples (NaN or infinity)")]
    seconds: Annotated[Array, array("level", "processor time of a sample", "s")]
    mean_rate: Annotated[
        tuple[Order, ...] | None, array("function", "rate of the means", formula="p in |mean| = C h^p")
    ] = None
    variance_rate: Annotated[
        tuple[Order, ...] | None, array("function", "rate of the variances", formula="p in variance = C h^p")
    ] = None
    cost_rate: Annotated[float, fact("p in seconds = C h^-p")]
    antithetic: Annotated[bool, fact("whether sampled with antithetic paths", name="antithetic")]
    control: Annotated[str, fact("what is subtracted to reduce the variance", name="control")] = ""
    control_bound: Annotated[float, fact("numerical error of its expectations", "value", name="control_bound")] = 0.0

    @derived("function level", "half the interval of the mean")
    def mean_half(self) -> np.ndarray:
        """Half the 95 % intervals of the means."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(
                (self.variance > 0) & (self.samples > 0), INTERVAL * np.sqrt(self.variance / self.samples), 0.0
            )

    @derived("level", "diverged samples, where there are any")
    def lost(self) -> np.ndarray | None:
        """Their numbers; None where there are none."""
        return self.nonfinite if self.nonfinite.any() else None


class Differences(Described):
    """The differences of a multilevel estimate to the scheme of weak order 2, one at each step size."""

    scheme: Annotated[str, fact("scheme to which differences are taken", name="compared_with")]
    mean: Annotated[Array, array("function h", "mean of the difference", "value")]
    variance: Annotated[Array, array("function h", "variance of the difference")]
    kurtosis: Annotated[Array, array("function h", "kurtosis of the difference")]
    consistency: Annotated[
        Array, array("function h", "distance from the expectations of the levels, above 1 with probability 0.3 %")
    ]
    samples: Annotated[Array, array("h", "samples of the difference")]
    nonfinite: Annotated[Array, array("h", "diverged samples (NaN or infinity)")]
    seconds: Annotated[Array, array("h", "processor time of a sample", "s")]
    variance_rate: Annotated[
        tuple[Order, ...], array("function", "rate of the variances", formula="p in variance = C h^p")
    ]
    symmetrised: Annotated[Array | None, array("h", "whether both halves of the difference were sampled apart")] = None

    @derived("function h", "half the interval of the mean")
    def mean_half(self) -> np.ndarray:
        """Half the 95 % intervals of the means."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(
                (self.variance > 0) & (self.samples > 0), INTERVAL * np.sqrt(self.variance / self.samples), 0.0
            )

    @derived("h", "diverged samples, where there are any")
    def lost(self) -> np.ndarray | None:
        """Their numbers; None where there are none."""
        return self.nonfinite if self.nonfinite.any() else None

    @derived("h", "whether in halves, where any are")
    def halved(self) -> np.ndarray | None:
        """(S,) yes or nothing; None where none is."""
        if self.symmetrised is None or not self.symmetrised.any():
            return None
        return np.where(self.symmetrised, "yes", "")


class Quasi(Described):
    """What only estimates from quasi-random points have."""

    gain: Annotated[
        Array, array("function h", "variance of the expectation by independent paths over that by as many points")
    ]
    scrambles: Annotated[int, fact("number of independent scrambles", name="scrambles")]
    points: Annotated[int, fact("points of a scramble", name="points")]
    dimensions: Annotated[int, fact("dimensions of the points", name="dimensions")]


def _sampled(name: str) -> list[Column]:
    """The columns of the differences of a multilevel estimate."""
    return [
        Column(f"{name}_mean", "mean of the\ndifference (95 %)"),
        Column(f"{name}_variance", "variance", form=".2e"),
        Column(f"{name}_kurtosis", "kurtosis", form=".3g", red=HEAVY_TAILS),
        Column(f"{name}_consistency", "consis-\ntency", form=".2f", red=CONSISTENCY),
        Column(f"{name}_samples", "samples"),
        Column(f"{name}_seconds", "µs per\nsample", form=lambda seconds: f"{1e6 * seconds:.3g}"),
        Column(f"{name}_lost", "di-\nverged", red=0),
        Column(f"{name}_halved", "in\nhalves"),
    ]


def distinct_levels(readings: Sequence["WeakErrors"]) -> list["WeakErrors"]:
    """The records with levels of their own: those of a scheme serve all its levels of extrapolation."""
    distinct: dict[tuple, WeakErrors] = {}
    for one in readings:
        if one.levels:
            key = one.about.scheme, one.about.eps, one.levels.samples.tobytes(), one.levels.mean.tobytes()
            distinct.setdefault(key, one)
    return list(distinct.values())


class WeakErrors(Stored):
    """Weak errors of one scheme by one estimator, of test functions phi at several step sizes, from large to small."""

    headline = ("order", "error", "expectation")
    row_axes = ("function", "h")
    tables = (
        Table(
            "function h",
            [
                Column("error", "weak error\n(95 % or bound)", resolved="resolved"),
                Column("expectation", "expectation\n(95 % or bound)"),
                Column("lost", "di-\nverged", red=0),
            ],
        ),
        Table(
            "function level", _sampled("level"), "levels", lines=lambda one: one.from_large_steps, of=distinct_levels
        ),
        Table("function h", _sampled("difference"), "differences to a scheme of weak order 2"),
    )

    functions: Annotated[tuple[str, ...], axis("test function", name="function")]
    h: Annotated[Array, axis("step size", "time")]
    error: Annotated[
        Array,
        array(
            "function h",
            "weak error",
            "value",
            "E phi(y_h(T)) - E phi(y(T))",
            claim=Claimed("at most", absolute=True),
        ),
    ]
    expectation: Annotated[
        Array,
        array(
            "function h",
            "expectation of the test function",
            "value",
            "E phi(y_h(T))",
            claim=Claimed("equal", expected="limit"),
        ),
    ]
    resolved: Annotated[Array, array("function h", "whether the error stands clear of its own uncertainty")]
    orders: Annotated[tuple[Order, ...], array("function", "", name="order")]
    nonfinite: Annotated[Array | None, array("h", "diverged paths (NaN or infinity)", claim="at most")] = None
    expected_order: Annotated[float | None, fact("order that theory states", column=True)] = None
    sampled: Sampled | None = None
    unsampled: Unsampled | None = None
    prefixes: Annotated[Prefixes | None, nested("samples", "prefix_")] = None
    history: Annotated[History | None, nested("allocation", "history_")] = None
    levels: Annotated[Levels | None, nested(prefix="level_", apart=True)] = (
        None  # where there are differences, of the other scheme
    )
    differences: Annotated[Differences | None, nested(prefix="difference_", apart=True)] = None
    quasi: Annotated[Quasi | None, nested(prefix="quasi_")] = None
    formulas: Annotated[tuple[str, ...], fact("formulas of the test functions in y1, y2, ...", name="functions")]
    cpu_seconds: Annotated[float, fact("processor time", "s", column=True)]
    reference_step: Annotated[float, fact("step size of the reference", "time")]
    reference_scheme: Annotated[str | None, fact("scheme of the reference, if not each is its own")] = None
    reference_nonfinite: Annotated[int, fact("diverged paths of the reference (NaN or infinity)")] = 0
    panels: Annotated[tuple[str, ...], fact("what the figure shows")] = ("errors",)
    accuracy: Annotated[float | None, fact("numerical error that was asked for", "value")] = None
    left_out: Annotated[tuple[str, ...], fact("schemes of the case that the estimator cannot do")] = ()

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
                    yield quantity("agreement", one.about, value, 0.0, one.functions[f], float(one.h[i]))
        for members in comparable_sweeps(readings).values():
            about = replace(members[0].about, eps=None, variant=members[0].about.scheme)
            for f, function in enumerate(members[0].functions):
                largest = largest_over_eps(members, f)
                fitted = order(about, largest.order, "uniform_order", function, members[0].expected_order)
                yield fitted._replace(lost=lost_among(largest.value + largest.stderr, "errors"))

    @derived("h", "diverged paths, where there are any")
    def lost(self) -> np.ndarray | None:
        """(S,) their numbers; None where there are none."""
        return self.nonfinite if self.nonfinite is not None and self.nonfinite.any() else None

    @property
    def from_large_steps(self) -> Iterator[tuple[int, int]]:
        """(function, level) of all levels, from large to small steps."""
        assert self.levels is not None
        for f in range(len(self.functions)):
            yield from ((f, i) for i in self.levels.h.argsort()[::-1].tolist())

    @derived("function h", "half the interval of the error, or its bound", name="error_half")
    def half(self) -> np.ndarray:
        """(F, S) half the 95 % interval of the error, or the bound of its numerical error."""
        return self._half("error")

    @derived("function h", "half the interval of the expectation, or its bound")
    def expectation_half(self) -> np.ndarray:
        """(F, S) the same of the expectation."""
        return self._half("expectation")

    def _half(self, name: str) -> np.ndarray:
        if self.sampled:
            without = self.sampled.error_without
            factor = INTERVAL if without is None else student_factor(len(without))
            return np.asarray(factor * getattr(self.sampled, f"{name}_stderr"))
        return np.asarray(getattr(self.unsampled, f"{name}_bound"))

    @property
    def paths(self) -> int | None:
        """The number of paths, where it is one for all; None of levels, and where nothing is sampled."""
        return self.sampled.samples if self.sampled and not self.levels else None

    @property
    def stages(self) -> Stages | None:
        """Estimates from less work, where there are any."""
        return self.prefixes or self.history

    @property
    def reference_shows_limit(self) -> bool:
        """Whether eps^2 < h_ref: the reference does not resolve the fast processes and shows a limit instead."""
        eps = self.about.eps
        return eps is not None and 0.0 < eps**2 < self.reference_step

    def remarks(self) -> Iterator[str]:
        """The order of each test function, what it rests on, and what speaks against it."""
        points, own = len(self.h), own_error(self)
        for f, function in enumerate(self.functions):
            order, low, high, used = self.orders[f]
            through = f", through {used} of {points} step sizes" if math.isfinite(order) and used < points else ""
            yield f"{self._name(f)}: {order_text(order, low, high, self.expected_order)}{through}"
            if self.about.extrapolate and high < (self.expected_order or -math.inf) - _ORDER_AMISS:
                yield f"    {_not_as_assumed(self)}"
            if self.sampled and (accuracy := _accuracy(self, self.sampled, f)):
                yield f"    {accuracy}"
            if self.quasi:
                yield f"    {_points(self.quasi, f)}"
            if own and own.differ[f]:
                yield f"    {_assumed(self, float(own.value[f]), float(own.by_next[f]))}"
            if self.unsampled:
                limit, bound = (values[f].item() for values in (self.unsampled.limit, self.unsampled.limit_bound))
                yield f"    E {function}(y(T)) = {with_interval(limit, bound)} (bound)"
            if self.differences:
                yield from (f"    {line}" for line in _of_differences(self.differences, self.h, f))
            if self.levels:
                yield from (f"    {line}" for line in _of_levels(self.levels, f))
        if self.unsampled and (resolution := _resolution(self.unsampled.noted)):
            yield f"    {resolution}"
        if poor := not_reached(self):
            yield f"    {poor}"

    @classmethod
    def remarks_of_case(cls, readings: Sequence["WeakErrors"]) -> Iterator[str]:
        """Test functions, the largest errors over eps, references, and how far estimators agree."""
        for name, formula in zip(readings[0].functions, readings[0].formulas, strict=True):
            yield f"{name} = {readable(formula, readings[0].about.variables)}"
        yield from _over_eps(readings)
        yield from _references(readings)
        yield from _limits_shown(readings)
        for estimator, schemes in dict.fromkeys((reading.about.estimator, reading.left_out) for reading in readings):
            if schemes:
                yield cannot_do(estimator, schemes)
        for reading in readings:
            if near := agreement(reading, readings):
                for f in np.flatnonzero(np.isfinite(near.deviation).any(axis=1)).tolist():
                    yield f"{reading._name(f)}: {near.line(f, reading.h)}"

    def _name(self, f: int) -> str:
        """The scheme, the estimator and, if there are several, the test function."""
        return self.about.subject(self.functions[f] if len(self.functions) > 1 else "")


Record = WeakErrors


# ---------------------------------------------------------------------------------------------------------------------
# What readings tell beside their errors: how far those of a case agree, the largest over eps, the reference's own.
# ---------------------------------------------------------------------------------------------------------------------

if TYPE_CHECKING:
    from spi.statistics.estimators import Largest


class Agreement(NamedTuple):
    """A sampled estimate beside the deterministic one; arrays (F, S), NaN where nothing is known."""

    deviation: np.ndarray  #: sampled minus deterministic error, in standard errors
    share: np.ndarray  #: the standard error over the deterministic error

    def line(self, f: int, h: np.ndarray) -> str:
        """Both for one test function at the step sizes `h`, and where they disagree."""
        far = [power_of_two(step) for step, value in zip(h, self.deviation[f], strict=True) if abs(value) > TOO_FAR]
        deviations, shares = _each(h, self.deviation[f], "z.1f"), _each(h, self.share[f], ".2g")
        agree = f"sampled minus deterministic, in standard errors: {deviations}; standard error / weak error: {shares}"
        return agree + f"; DISAGREE at {', '.join(far)}" * bool(far)


def agreement(reading: WeakErrors, readings: Iterable[WeakErrors]) -> Agreement | None:
    """How a sampled estimate compares with the one without sampling among `readings`; None if there is none."""
    whose = reading.about.case, reading.about.variant
    same = [one for one in readings if (one.about.case, one.about.variant) == whose]
    exact, bounds = next(((one, one.unsampled) for one in same if one.unsampled), (None, None))
    if reading.sampled is None or exact is None or bounds is None:
        return None
    found = Agreement(*np.full((2, *reading.error.shape), np.nan))
    for f, name in enumerate(reading.functions):
        for i, h in enumerate(reading.h):
            if name not in exact.functions or h not in exact.h:
                continue
            at = exact.functions.index(name), int(np.flatnonzero(exact.h == h)[0])
            stderr = reading.sampled.error_stderr[f, i]
            with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
                difference = reading.error[f, i] - exact.error[at]
                found.deviation[f, i] = in_standard_errors(difference, np.hypot(stderr, bounds.error_bound[at]))
                found.share[f, i] = stderr / np.abs(exact.error[at])
    return found


class OwnError(NamedTuple):
    """The reference's own error, which all errors of a reading contain; arrays (F,)."""

    value: np.ndarray  #: C h_ref^p by the smallest step, as it was added
    by_next: np.ndarray  #: by the step after it, as if that were the smallest
    differ: np.ndarray  #: whether the two differ, and by more than some of the standard errors


def own_error(reading: WeakErrors) -> OwnError | None:
    """The reference's own error by the two smallest steps; None where it was not added, or there is one step only.

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

    def by_both(errors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
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
    """The sweeps of several eps at the same step sizes, of which :func:`largest_over_eps` can be asked."""
    return {
        key: members
        for key, members in sweeps(readings).items()
        if len(members) > 1
        and all(one.sampled and one.sampled.error_without is not None for one in members)
        and all(np.array_equal(one.h, members[0].h) for one in members)
    }


def largest_over_eps(members: Sequence[WeakErrors], f: int) -> "Largest":
    """The ``spi.statistics.estimators.Largest`` over the readings of a comparable sweep, of test function number f."""
    from spi.statistics.estimators import largest_over  # takes a while

    errors = np.array([one.error[f] for one in members])
    withouts = [one.sampled.error_without for one in members if one.sampled]
    return largest_over(members[0].h, errors, np.array([without[:, f] for without in withouts if without is not None]))


# ---------------------------------------------------------------------------------------------------------------------
# The rows of CSV and JSON: also those of fewer paths, and the agreement with deterministic errors.
# ---------------------------------------------------------------------------------------------------------------------

#: What the rows of fewer paths have in common with those of all.
_OF_ALL = ("case", "scheme", "eps", "extrapolate", "estimator", "function", "h", "expected_order")


def rows(readings: Sequence[WeakErrors]) -> Iterator[dict[str, Any]]:
    """A record per test function and step size; after them those of the first so many paths, where they are kept.

    ``agreement`` is the error less the deterministic one, in standard errors.
    """
    for reading in readings:
        near = agreement(reading, readings)
        yield from rows_of(reading, {"agreement": (reading.row_axes, near.deviation)} if near else None)
        if reading.prefixes and reading.sampled:
            yield from _prefix_rows(reading, reading.prefixes, reading.sampled.samples)


def _prefix_rows(reading: WeakErrors, prefixes: Prefixes, all_samples: int) -> Iterator[dict[str, Any]]:
    """Of fewer paths than all; expectations and orders are known of all only."""
    resolved = prefixes.resolved
    for n, samples in enumerate(prefixes.samples.tolist()):
        if samples == all_samples:
            continue
        fewer = {"samples": samples, "cpu_seconds": prefixes.cpu_seconds[n].item()}
        values = {"error": prefixes.error[n], "error_stderr": prefixes.error_stderr[n], "resolved": resolved[n]}
        for place, row in zip(np.ndindex(reading.error.shape), rows_of(reading), strict=True):
            same = {name: row[name] for name in _OF_ALL if name in row}
            yield same | {name: of_all[place].item() for name, of_all in values.items()} | fewer


# ---------------------------------------------------------------------------------------------------------------------
# Lines under the tables: orders, standard errors, levels (Giles, Operations Research 56, 2008), references, agreement.
# ---------------------------------------------------------------------------------------------------------------------


def _of_levels(levels: Levels, f: int) -> Iterator[str]:
    """The rates by which mean, variance and cost of the levels change, and what speaks against them."""
    rates = {"mean": levels.mean_rate, "variance": levels.variance_rate}
    told = [f"{what} {_rate(values[f])}" for what, values in rates.items() if values is not None]
    if math.isfinite(levels.cost_rate):
        told.append(f"cost h^{-levels.cost_rate:z.2f}")
    if told:
        yield f"levels: {', '.join(told)}{'; with antithetic paths' if levels.antithetic else ''}"
    yield from _doubts(levels.h, levels, f, "the means of neighbouring levels disagree")


def _of_differences(differences: Differences, h: np.ndarray, f: int) -> Iterator[str]:
    """The rate by which the variance of the differences at the step sizes h changes, and what speaks against them."""
    yield f"differences to {differences.scheme}: variance {_rate(differences.variance_rate[f])}"
    yield from _doubts(h, differences, f, "the expectation is not that of its levels")


def _doubts(h: np.ndarray, rows: Levels | Differences, f: int, inconsistency: str) -> Iterator[str]:
    heavy = [(k, power_of_two(step)) for step, k in zip(h, rows.kurtosis[f], strict=True) if k > HEAVY_TAILS]
    if heavy:
        each = joined([f"kurtosis {kurtosis:.3g} at {step}" for kurtosis, step in heavy])
        yield f"heavy tails: {each}; few samples carry the variance, so that intervals may be too narrow"
    for step, consistency in zip(h, rows.consistency[f], strict=True):
        if consistency > CONSISTENCY:
            yield f"consistency {consistency:.2f} at {power_of_two(step)}: {inconsistency}"


def _rate(rate: Order) -> str:
    """A fitted power of h with its interval, which is not known where a group of the jackknife has no variance left."""
    known = all(map(math.isfinite, (rate.order, rate.low, rate.high)))
    return f"h^{rate.order:.2f} [{rate.low:.2f}, {rate.high:.2f}]" if known else "not resolved"


def _accuracy(reading: WeakErrors, sampled: Sampled, f: int) -> str:
    """The standard error at the largest step beside that of so many independent samples as the paper has."""
    largest, seconds = int(reading.h.argmax()), reading.cpu_seconds
    stderr = float(sampled.error_stderr[f, largest])
    if math.isnan(stderr):
        return "one path has no standard error: not resolved" if sampled.samples == 1 else ""
    told = f"standard error {short(stderr)} at {power_of_two(reading.h[largest])}"
    told += f" in {seconds:.3g} s of processor time"
    paper = math.nan if sampled.sd is None else float(sampled.sd[f]) / math.sqrt(PAPER)
    if 0 < paper < math.inf and not reading.quasi:  # whose standard errors fall faster than by the root
        told += f"; 10^9 independent samples would give {short(paper)}"
        if stderr > paper > 0 and math.isfinite(stderr):
            needed = float(f"{seconds * (stderr / paper) ** 2:.2g}")
            told += f", which would take about {short(needed, 'g')} s here"
    return told


def _not_as_assumed(reading: WeakErrors) -> str:
    """That extrapolated errors do not fall as they would if the powers of h removed were those that there are."""
    power = _power(reading.expected_order or math.nan, "h")
    told = f"the order found is not the one assumed: extrapolated errors should fall like {power}"
    return f"{told}; the function may have a jump or a kink, or the steps may be too large; compare extrapolate: 0"


def _points(quasi: Quasi, f: int) -> str:
    """What points there were, and what they were worth."""
    low, high = (short(float(one), ".3g") for one in (quasi.gain[f].min(), quasi.gain[f].max()))
    points = f"{quasi.scrambles} scrambles of {quasi.points} points in {quasi.dimensions} dimensions"
    if not (np.isfinite(quasi.gain[f]) & (quasi.gain[f] > 0)).all():
        return points  # all paths of some step size are alike
    return f"{points}; as many independent paths have {low} to {high} times the variance of the expectation"


def _assumed(reading: WeakErrors, added: float, by_next: float) -> str:
    """That the reference's own error, as it was added, is not what the next step makes it."""
    power = _power(reading.expected_order or math.nan, "h")
    off = f"{short(abs(by_next - added))} {'more' if by_next > added else 'less'}"
    told = f"the reference's own error, {short(added)} by the smallest step, would be {off} by the next"
    return f"{told}: errors are not yet C {power}, and may be off by about that; try a smaller reference_step"


def _power(order: float, base: str) -> str:
    """``h``, ``h^2`` or ``(h_ref/h)^(3/2)``."""
    return base if order == 1 else f"{base}^{fraction(order)}"


def _resolution(notes: dict[str, Any]) -> str:
    """The short ones of the notes of a solver without sampling."""
    short_ones = {key: json.dumps(value) for key, value in notes.items() if not key.startswith("seconds")}
    return ", ".join(f"{key.replace('_', ' ')} {text}" for key, text in short_ones.items() if len(text) <= 12)


def _references(readings: Sequence[WeakErrors]) -> Iterator[str]:
    """How much of the errors the references of a case lack."""
    sampled = [reading for reading in readings if reading.sampled]
    own = ((r.expected_order, "") if not r.differences else (2.0, r.differences.scheme) for r in sampled)
    each = ((r.reference_step, r.h.min(), *of, r.reference_scheme) for r, of in zip(sampled, own, strict=True))
    for reference, finest, power, compared, scheme in dict.fromkeys(each):
        where = f"the reference at h_ref = {power_of_two(reference)}"
        if scheme:
            yield f"{where} is {scheme}: errors are not corrected for what it lacks"
        elif power:
            share = 100 * (reference / finest) ** power
            ratio = "h_ref/h" if power == 1 else _power(power, "(h_ref/h)")
            whose = f"the error of {compared} at the finest step" if compared else "the finest error"
            lacks = f"lacks {ratio} = {share:.2g} % of {whose} (order {fraction(power)})"
            yield f"{where} {lacks}, which is added to all errors"
        else:
            yield f"{where}: errors are not corrected for what it lacks, as theory states no order"


def _over_eps(readings: Sequence[WeakErrors]) -> Iterator[str]:
    """The largest errors over eps of each scheme and estimator with several eps: their order, and what they are."""
    for members in comparable_sweeps(readings).values():
        first, names = members[0], members[0].functions
        for f, name in enumerate(names):
            top = largest_over_eps(members, f)
            told = ", ".join([first.about.scheme_label, first.about.estimator, *[name] * (len(names) > 1)])
            order, low, high, _ = top.order
            yield f"{told}, largest over eps: {order_text(order, low, high, first.expected_order)}"
            points = (
                f"{power_of_two(h)}: {with_interval(value, INTERVAL * stderr)} (eps = {members[i].about.eps:g})"
                for h, value, stderr, i in zip(first.h, top.value, top.stderr, top.which, strict=True)
            )
            yield f"    {', '.join(points)}"


def _limits_shown(readings: Sequence[WeakErrors]) -> Iterator[str]:
    """For which eps a reference does not resolve the fast processes, and what it shows then."""
    told: dict[tuple, set] = {}
    for reading in readings:
        if reading.reference_shows_limit:
            told.setdefault((reading.reference_step, reading.reference_scheme), set()).add(reading.about.eps)
    for (reference, scheme), small in told.items():
        few = ", ".join(f"{eps:g}" for eps in sorted(small, reverse=True))
        whose = f"the limit of {scheme}" if scheme else "the scheme's own limit"
        edge = f"eps < sqrt(h_ref) = {short(math.sqrt(reference), '.2g')}"
        yield f"{edge} (eps = {few}): the reference shows {whose}"


def _each(h: np.ndarray, values: np.ndarray, form: str) -> str:
    pairs = zip(h, values, strict=True)
    return ", ".join(
        f"{power_of_two(step)}: {short(float(value), form)}" for step, value in pairs if math.isfinite(value)
    )
