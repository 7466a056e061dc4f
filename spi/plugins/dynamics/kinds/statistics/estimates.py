"""Estimates from the sums over paths, with standard errors by the jackknife over groups of paths."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from spi.ensemble.loop import thread_count
from spi.ensemble.protocol import dimension, structure
from spi.kinds.functions import PathFunction, origin_of
from spi.numerics.rng import LANES
from spi.numerics.types import Array
from spi.plugins.dynamics.statistics.cells import share_stderr
from spi.plugins.dynamics.statistics.quantiles import quantiles_of
from spi.statistics.estimators import GROUPS, group_counts, jackknife_stderr, kurtosis_of_groups, mean_over_paths
from spi.statistics.intervals import student_factor, student_of_paths, zero_share_bound
from spi.statistics.rounding import is_rounding, rounding, size_of_values, with_rounding
from spi.storage.records import INTERVAL

from .passages import LookTimes, corrected
from .results import LEAST_GROUPS, Histogram, Passages, Quantiles

# ---------------------------------------------------------------------------------------------------------------------
# The columns that are summed up: functions of the state or of the path, and others beside them.
#
# The functions of the case, and for each autocorrelation the value at its first time.
# ---------------------------------------------------------------------------------------------------------------------

Map = Callable[..., Iterator[Any]]  #: as the function ``map``


@contextmanager
def in_threads() -> Iterator[Map]:
    """Within it a map whose calls are made by all threads."""
    if thread_count() == 1:
        yield map
    else:
        with ThreadPoolExecutor(thread_count()) as threads:
            yield threads.map


class Columns(NamedTuple):
    """Columns of a case."""

    functions: tuple[PathFunction, ...]  #: those of the case
    origins: np.ndarray  #: (F, 1) their values at t = 0, subtracted so that variances do not cancel
    since: list[tuple[int, int]]  #: the functions with autocorrelations, and the times from which these count
    places: np.ndarray  #: (T,) which of the stored states have statistics
    between: float  #: the time between two stored states
    stored: int  #: states of a path, with the initial one
    passages: list[int]  #: the functions that are passages

    @classmethod
    def of(cls, case: Any) -> "Columns":
        """Columns of a case."""
        functions, names = case.path_functions, list(case.functions)
        return cls(
            functions=functions,
            origins=np.array([[origin_of(function, case.initial)] for function in functions]),
            since=[(names.index(name), case.place(t)) for name, t in case.autocorrelation.items()],
            places=case.places,
            between=case.stride * case.step,
            stored=round(case.final_time / case.step) // case.stride + 1,
            passages=[f for f, function in enumerate(functions) if function.conditions],
        )

    @property
    def number(self) -> int:
        """Number of columns."""
        return len(self.functions) + len(self.since)

    def states(self, y: np.ndarray) -> np.ndarray:
        """States (d, blocks, stored, LANES) of blocks, from (blocks, stored, d * LANES)."""
        return np.moveaxis(y.reshape(len(y), self.stored, -1, LANES), 2, 0)

    def evaluate(
        self, each: Map, looks: Sequence[LookTimes], y: np.ndarray, values: np.ndarray
    ) -> dict[str, np.ndarray]:
        """Put the functions of the states y of blocks into values (blocks, T, columns, LANES).

        Paths are looked at for passages by `looks`, one for each.  Returns of passages by looks twice as far apart
        `coarse` (blocks, T, passages, LANES), and the mean first times by both (blocks, 2, passages, LANES).
        """
        blocks, times, _, lanes = values.shape
        coarse = np.empty((blocks, times, len(looks), lanes))
        first_times = np.empty((blocks, 2, len(looks), lanes))
        size = -(-len(y) // thread_count())
        pieces = [slice(begin, begin + size) for begin in range(0, len(y), size)]

        def evaluated(at: slice) -> None:
            states = self.states(y[at])
            for f, function in enumerate(self.functions):
                if f not in self.passages:
                    values[at, :, f] = self._along(function, states)
            for p, f in enumerate(self.passages):
                of_looks = looks[p], self.functions[f], states, coarse[at, :, p], first_times[at, :, p]
                values[at, :, f] = self._passed(*of_looks)

        list(each(evaluated, pieces))
        return {"coarse": coarse, "first_times": first_times}

    def _passed(
        self, looks: LookTimes, function: PathFunction, states: np.ndarray, coarse: np.ndarray, first_times: np.ndarray
    ) -> np.ndarray:
        """The probability to have passed, with looks twice as far apart in `coarse`, and the mean first times."""
        with np.errstate(all="ignore"):
            f = [np.broadcast_to(condition(states), states.shape[1:]) for condition in function.conditions]
            fine, every_other = looks.passed(f, 1), looks.passed(f, 2)
        coarse[:] = every_other[:, self.places]
        for i, (passed, every) in enumerate(((fine, 1), (every_other, 2))):
            first_times[:, i] = looks.first_time(f[0], passed, every) if len(f) == 1 else np.nan
        return fine[:, self.places]

    def centre(self, values: np.ndarray) -> None:
        """Subtract their origins from evaluated functions, and put the columns of autocorrelations behind them."""
        values[:, :, : len(self.functions)] -= self.origins
        for column, (f, place) in enumerate(self.since, len(self.functions)):
            values[:, :, column] = values[:, place : place + 1, f]

    def _along(self, function: PathFunction, states: np.ndarray) -> np.ndarray:
        """A function at the times of the statistics, (blocks, T, LANES)."""
        every = len(self.places) == self.stored
        with np.errstate(all="ignore"):
            t = self.between * np.arange(self.stored)[:, np.newaxis]
            if not function.functional:
                return function.at(states, t) if every else function.at(states[:, :, self.places], t[self.places])
            values = np.broadcast_to(function.at(states, t), states.shape[1:])
            return function.along(values, self.between)[:, self.places]


# ---------------------------------------------------------------------------------------------------------------------
# Counts, which add up exactly: in bins that suit the law quantiles, in bins and cells of equal size densities.
# ---------------------------------------------------------------------------------------------------------------------


class Unchanged(NamedTuple):
    """Which of F functions have at T times the value that they had at t = 0, on all paths and up to rounding."""

    exact: np.ndarray  #: (F, T) bool, not where nothing is random
    alike: np.ndarray  #: (F, T) bool: nearly or wholly so, though it need not be, as for tails that no path has reached
    change: np.ndarray  #: (F, T) root mean square change
    size: np.ndarray  #: (F, T) for :mod:`spi.statistics.rounding`
    steps: np.ndarray  #: (T,)

    @classmethod
    def of(cls, case: Any, columns: Columns, estimated: "PathMoments", sure: np.ndarray) -> "Unchanged":
        """From means over paths; not where the value is `sure` (F, T).

        A function that hardly changes where the state does tells nothing: it may be flat there, and not elsewhere.
        """
        each, steps, count = columns.functions, case.t / case.step, len(columns.functions)
        change, origins = estimated.changes()[:count], columns.origins
        of_values = np.array([[not function.conditions] for function in each])
        slope = np.array([[_slope(*pair, case)] for pair in zip(each, origins[:, 0], strict=True)])
        size = np.maximum(np.maximum(slope, np.abs(origins)), np.abs(estimated.mean[:count] + origins))
        kept = np.array([[function.is_casimir] for function in each])
        small = is_rounding(change, size, steps) & of_values & ~sure
        exact = small & (kept | (slope > _FLAT * size))
        alike = (estimated.same()[:count] | small) & ~sure & ~kept & ~exact
        return cls(exact, alike, change, size, steps)

    def stderr(self, stderr: np.ndarray) -> np.ndarray:
        """Standard errors (F, T) of means, not below rounding."""
        return np.where(self.exact, with_rounding(stderr, self.change, self.size, self.steps), stderr)

    def of_products(self) -> np.ndarray:
        """(F, F, T) the least standard errors of covariances with functions that are constant, 0 of others."""
        most = np.where(self.exact, rounding(self.size, self.steps), self.change)
        with np.errstate(invalid="ignore", over="ignore"):
            return np.where(self.exact | self.exact[:, np.newaxis], most * most[:, np.newaxis] / INTERVAL, 0.0)

    def quantiles(self, found: Quantiles, mean: np.ndarray) -> Quantiles:
        """Quantiles of which those of constant functions are that constant."""
        exact, half = self.exact[..., np.newaxis], rounding(self.size, self.steps)
        with np.errstate(invalid="ignore"):
            low, high = ((mean + sign * half)[..., np.newaxis] for sign in (-1, 1))
        return Quantiles(
            level=found.level,
            quantile=np.where(exact, mean[..., np.newaxis], found.quantile),
            quantile_low=np.where(exact, low, found.quantile_low),
            quantile_high=np.where(exact, high, found.quantile_high),
        )


_FLAT = 1e-8  # change of a function, by its size, where the state changes by its own


def _slope(function: PathFunction, origin: float, case: Any) -> float:
    """How much a function changes where the state changes by its size."""
    if function.conditions:
        return 0.0
    return size_of_values(lambda y: function.at(y, case.final_time) - origin, case.initial)


class Bins(NamedTuple):
    """Bins of equal width for each of F functions at each of T times."""

    low: np.ndarray  #: (T, F) the lower end of the first
    width: np.ndarray  #: (T, F)
    number: int


def quantiles(
    counts: np.ndarray, lost: np.ndarray, edges: np.ndarray, of_values: np.ndarray, levels: tuple[float, ...]
) -> Quantiles:
    """Quantiles from counts (T, F, EDGES + 1), of which `lost` (T, F, 2) are of minus infinity, and of infinity or NaN.

    NaN where a function has no values but 0 and 1, unlike `of_values`, or no value is finite.
    """
    counts = counts.copy()
    counts[..., [0, -1]] -= lost
    results = np.full((3, *counts.shape[1::-1], len(levels)), np.nan)
    for t, f in np.ndindex(*counts.shape[:2]):
        if of_values[f]:
            results[:, f, t] = quantiles_of(counts[t, f], edges[t, f], levels)
    quantile, low, high = results
    return Quantiles(level=np.array(levels), quantile=quantile, quantile_low=low, quantile_high=high)


def histogram(counts: np.ndarray, samples: int, bins: Bins, of_values: np.ndarray, exact: np.ndarray) -> Histogram:
    """Densities in the bins of counts; NaN as for :func:`quantiles`, and where functions are constant (F, T)."""
    share, width = np.moveaxis(counts[..., 1:-1] / samples, 0, 1), bins.width.T
    scale = 1 / width[..., np.newaxis]
    fields = {
        "bin_low": bins.low.T,
        "bin_width": width,
        "density": share * scale,
        "density_stderr": share_stderr(share, samples) * scale,
        "outside": ((counts[..., 0] + counts[..., -1]) / samples).T,
    }
    known = of_values & ~exact.T  # (T, F), as the last axes of what is turned over
    return Histogram(**{name: np.where(known, values.T, np.nan).T for name, values in fields.items()})


SPHERE = "sphere"


SPHERE = "sphere"
_POINTS = 5  # at which B(y) y is evaluated


def on_sphere(model: Any) -> bool:
    """Whether |y|^2 is a Casimir function of three components: B(y) y = 0."""
    if dimension(model) != 3:
        return False
    y = np.random.default_rng(1).standard_normal((_POINTS, 3))
    return all(np.abs(structure(model, tuple(point), tuple(point))).max() < 1e-12 for point in y)


_DRAWS = 4000  # for the factor of simultaneous bands
_SAME = 1e-12  # relative: values that differ by less differ by rounding


class TimeEstimate(NamedTuple):
    """A number at each of T times, of one function or more."""

    value: Array
    stderr: Array


class PathMoments(NamedTuple):
    """Means over paths of C columns, of their squares and of products of pairs, and the same without each group."""

    samples: int
    groups: Array  #: (GROUPS,) the paths of each
    mean: Array  #: (C, T)
    mean_without: Array  #: (groups, C, T)
    square: Array
    square_without: Array
    product: Array  #: (pairs, T)
    product_without: Array

    @classmethod
    def of(cls, values: Array, products: Array, samples: int) -> "PathMoments":
        """The means from sums of values (2, T, C, GROUPS) and of products (1, T, pairs, GROUPS)."""
        groups = group_counts(samples)
        means = [np.swapaxes(mean, -1, -2) for sums in (*values, *products) for mean in mean_over_paths(sums, groups)]
        return cls(samples, groups, *means)

    def stderr(self, value: Array, without: Array) -> Array:
        """Standard error of a value from its leave-one-out values; NaN where there are too few groups."""
        if np.count_nonzero(self.groups) < LEAST_GROUPS:
            return np.full(np.shape(value), np.nan)
        return jackknife_stderr(value, without, self.groups)

    def same(self) -> Array:
        """(C, T) of which columns all paths have the same value, but for rounding."""
        error = self.stderr(self.mean, self.mean_without)
        return error <= _SAME * np.abs(self.mean)  # false for NaN

    def changes(self) -> Array:
        """(C, T) the root mean squares of the columns: how far functions are from their values at t = 0."""
        return np.asarray(np.sqrt(self.square))

    def _unbiased(self, value: Array, without: Array) -> TimeEstimate:
        """The unbiased estimate from a second moment about the mean; NaN for one path."""
        factor = self.samples / (self.samples - 1) if self.samples > 1 else np.nan
        return TimeEstimate(factor * value, factor * self.stderr(value, without))

    def variances(self, count: int) -> TimeEstimate:
        """(count, T) the variances of the first columns."""
        with np.errstate(invalid="ignore", over="ignore"):
            value = self.square - self.mean**2
            without = self.square_without - self.mean_without**2
        return self._unbiased(value[:count], without[:, :count])

    def kurtosis(self, count: int) -> Array:
        """(count, T) of the first columns; NaN where the variance is lost among roundings, and for too few groups."""
        if np.count_nonzero(self.groups) < LEAST_GROUPS:
            return np.full(self.mean[:count].shape, np.nan)
        with np.errstate(all="ignore"):
            value, without = self.square - self.mean**2, self.square_without - self.mean_without**2
            known = value[:count] > _SAME * self.square[:count]
        return np.where(known, kurtosis_of_groups(value[:count], without[:, :count], self.groups), np.nan)

    def _covariance(self, pairs: slice, left: Array, right: Array) -> tuple[Array, Array]:
        with np.errstate(invalid="ignore", over="ignore"):
            value = self.product[pairs] - self.mean[left] * self.mean[right]
            return value, self.product_without[:, pairs] - self.mean_without[:, left] * self.mean_without[:, right]

    def covariances(self, left: Array, right: Array, count: int) -> TimeEstimate:
        """(count, count, T) of the first columns, the pairs (left, right) of which are the first products."""
        of_pairs = self._unbiased(*self._covariance(slice(len(left)), left, right))
        whole = np.empty((count, count), int)
        whole[left, right] = whole[right, left] = np.arange(len(left))
        return TimeEstimate(of_pairs.value[whole], of_pairs.stderr[whole])

    def autocorrelations(self, left: Array, right: Array, since: Array) -> TimeEstimate:
        """Cov(f(s), f(t)) / Var f(s) of the columns `left`, (pairs, T); the columns `right` are f(s) at all times.

        The pairs are the last products; NaN before the times number `since`.
        """
        value, without = self._covariance(slice(self.product.shape[0] - len(left), None), left, right)
        with np.errstate(all="ignore"):
            value = value / (self.square[right] - self.mean[right] ** 2)
            without = without / (self.square_without[:, right] - self.mean_without[:, right] ** 2)
        before = np.arange(value.shape[1]) < since[:, np.newaxis]
        return TimeEstimate(*(np.where(before, np.nan, each) for each in (value, self.stderr(value, without))))

    def passages(
        self, functions: list[int], count: int, t: Array, first_times: Array, bridged: bool, random: bool, bins: int
    ) -> Passages:
        """First times at which conditions are met, for `functions` of `count`; NaN for others, and of two conditions.

        The mean of the first time, or of the last t if it has not come, follows from `first_times` (2, passages,
        GROUPS), sums by looks at a path and by such twice as far apart.  With `bins` also the density of the first
        time, in at most that number of intervals of t, from the means, which are shares.
        """
        time, time_stderr, time_half = np.full((3, count), np.nan)
        edges = np.unique(np.linspace(0, len(t) - 1, bins + 1).round().astype(int)) if bins else np.zeros(0, int)
        density, density_stderr = np.full((2, count, max(len(edges) - 1, 0)), np.nan)
        (fine, coarse), without = mean_over_paths(first_times, self.groups)
        found = corrected(fine, coarse, without[:, 0], without[:, 1], bridged)
        error = self.stderr(found.value, found.without)
        alike = error <= _SAME * np.abs(found.value)
        time[functions] = found.value
        time_stderr[functions] = np.where(alike, self.unseen * np.ptp(t) if random else 0.0, error)
        factor = student_of_paths(self.samples, LEAST_GROUPS)
        time_half[functions] = np.where(time_stderr[functions] == 0, 0.0, factor * time_stderr[functions]) + found.left
        fields: dict[str, Any] = {"time": time, "time_stderr": time_stderr, "time_half": time_half}
        if len(edges) > 1:
            width = np.diff(t[edges])
            share = np.diff(self.mean[functions][:, edges])
            density[functions] = share / width
            density_stderr[functions] = share_stderr(np.clip(share, 0.0, 1.0), self.samples) / width
            fields |= {"from_t": t[edges[:-1]], "until_t": t[edges[1:]]}
            fields |= {"density": density, "density_stderr": density_stderr}
        return Passages(**fields)

    @property
    def unseen(self) -> float:
        """Standard error of a share of the paths that is 0 or 1, by the rule of three."""
        return float(zero_share_bound(self.samples) / student_of_paths(self.samples, LEAST_GROUPS))


def simultaneous(without: Array) -> Array:
    """(F,) the factor c by which mean -+ c stderr holds all true means (F, T) at once in 95 % of cases.

    The largest of correlated Student variables, of which the correlations are those of the leave-one-out values
    `without` (groups, F, T); with normal weights for these over one spread, drawn from a fixed seed.  For fewer than
    GROUPS groups it is that of as many independent times.
    """
    groups = len(without)
    if groups < LEAST_GROUPS:
        return np.full(without.shape[1], np.nan)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        spread = without - without.mean(axis=0)
        units = spread / np.sqrt((spread**2).sum(axis=0))
    units[~np.isfinite(units)] = 0.0
    if groups < GROUPS:  # too few for correlations: Bonferroni's factor
        return np.full(without.shape[1], student_factor(groups, 1 - 0.05 / without.shape[2]))
    random = np.random.default_rng(1)
    weights = random.standard_normal((_DRAWS, groups))
    weights /= np.sqrt(random.chisquare(groups - 1, (_DRAWS, 1)) / (groups - 1))
    largest = [np.abs(weights @ units[:, f]).max(axis=1) for f in range(units.shape[1])]
    return np.maximum(np.quantile(largest, 0.95, axis=1), student_factor(groups))
