"""What is stored of weak errors."""

import json
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import numpy as np

from spi.printing.text import joined, short
from spi.statistics.claims import Quantity, at_steps, each_step, lost_among, order, quantity
from spi.statistics.intervals import student_factor
from spi.storage.records import INTERVAL, Order, in_standard_errors
from spi.storage.stored import Array, Described, Stored, array, axis, fact, nested


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


class Quasi(Described):
    """What only estimates from quasi-random points have."""

    gain: Annotated[
        Array, array("function h", "variance of the expectation by independent paths over that by as many points")
    ]
    scrambles: Annotated[int, fact("number of independent scrambles", name="scrambles")]
    points: Annotated[int, fact("points of a scramble", name="points")]
    dimensions: Annotated[int, fact("dimensions of the points", name="dimensions")]


class WeakErrors(Stored):
    """Weak errors of one scheme by one estimator, of test functions phi at several step sizes, from large to small."""

    headline = ("order", "error", "expectation")

    functions: Annotated[tuple[str, ...], axis("test function", name="function")]
    h: Annotated[Array, axis("step size", "time")]
    error: Annotated[Array, array("function h", "weak error", "value", "E phi(y_h(T)) - E phi(y(T))")]
    expectation: Annotated[Array, array("function h", "expectation of the test function", "value", "E phi(y_h(T))")]
    resolved: Annotated[Array, array("function h", "whether the error stands clear of its own uncertainty")]
    orders: Annotated[tuple[Order, ...], array("function", "", name="order")]
    nonfinite: Annotated[Array | None, array("h", "diverged paths (NaN or infinity)")] = None
    expected_order: Annotated[float | None, fact("order that theory states", column=True)] = None
    sampled: Sampled | None = None
    unsampled: Unsampled | None = None
    prefixes: Annotated[Prefixes | None, nested("samples", "prefix_")] = None
    history: Annotated[History | None, nested("allocation", "history_")] = None
    levels: Annotated[Levels | None, nested(prefix="level_")] = None  # where there are differences, of the other scheme
    differences: Annotated[Differences | None, nested(prefix="difference_")] = None
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

    @property
    def half(self) -> np.ndarray:
        """(F, S) half the 95 % interval of the error, or the bound of its numerical error."""
        return self._half("error")

    @property
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
# What a spec may expect of weak errors.
# ---------------------------------------------------------------------------------------------------------------------


def quantities(readings: Sequence[WeakErrors]) -> Iterator[Quantity]:
    """For each test function its order, errors without their sign, their distances from others, and expectations.

    The distances from deterministic errors (``agreement``) are in standard errors.  ``uniform_order`` is that of the
    largest error over eps.
    """
    for one in readings:
        for f, function in enumerate(one.functions):
            yield order(one.about, one.orders[f], function=function, expected=one.expected_order)
            yield from at_steps("error", one.about, one.h, np.abs(one.error[f]), one.half[f], function)
            limit = one.unsampled.limit[f] if one.unsampled else np.nan  # which a solver knows
            for i, h in enumerate(one.h.tolist()):
                told = one.expectation[f, i], one.expectation_half[f, i], function, h, limit
                yield quantity("expectation", one.about, *told)
        if near := agreement(one, readings):
            exact = np.zeros(len(one.h))
            for f, function in enumerate(one.functions):
                yield from at_steps("agreement", one.about, one.h, np.abs(near.deviation[f]), exact, function)
        if one.nonfinite is not None:
            yield from each_step("nonfinite", one.about, one.h, one.nonfinite)
    for members in comparable_sweeps(readings).values():
        about = members[0].about._replace(eps=None, variant=members[0].about.scheme)
        for f, function in enumerate(members[0].functions):
            largest = largest_over_eps(members, f)
            found = order(about, largest.order, "uniform_order", function)
            yield found._replace(lost=lost_among(largest.value + largest.stderr, "errors"))
