"""What follows from the sums over paths, with standard errors by the jackknife over groups of paths."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from spi.statistics.estimators import GROUPS, group_counts, jackknife_stderr
from spi.statistics.intervals import student_factor, student_of_paths, zero_share_bound
from spi.statistics.powers import mean_over_paths

from .results import LEAST_GROUPS, Passages

Array = np.ndarray

#: Passages are also looked for at every so many of the times, which tells the bias of looking at some times only.
COARSER = 2, 4
_DRAWS = 4000  # for the factor of simultaneous bands
_SAME = 1e-12  # relative: values that differ by less differ by rounding


class Estimate(NamedTuple):
    """A number at each of T times, of one function or more."""

    value: Array
    stderr: Array


class Moments(NamedTuple):
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
    def of(cls, values: Array, products: Array, samples: int) -> "Moments":
        """Those of sums of values (2, T, C, GROUPS) and of products (1, T, pairs, GROUPS)."""
        groups = group_counts(samples)
        found = [np.swapaxes(one, -1, -2) for sums in (*values, *products) for one in mean_over_paths(sums, groups)]
        return cls(samples, groups, *found)

    def stderr(self, value: Array, without: Array) -> Array:
        """Standard error of what has these leave-one-out values; NaN where there are too few groups."""
        if np.count_nonzero(self.groups) < LEAST_GROUPS:
            return np.full(np.shape(value), np.nan)
        return jackknife_stderr(value, without, self.groups)

    def same(self) -> Array:
        """(C, T) of which columns all paths have the same value, but for rounding."""
        error = self.stderr(self.mean, self.mean_without)
        return error <= _SAME * np.abs(self.mean)  # false for NaN

    def _unbiased(self, value: Array, without: Array) -> Estimate:
        """Of a second moment about the mean; one path has none."""
        factor = self.samples / (self.samples - 1) if self.samples > 1 else np.nan
        return Estimate(factor * value, factor * self.stderr(value, without))

    def variances(self, count: int) -> Estimate:
        """(count, T) those of the first columns."""
        with np.errstate(invalid="ignore", over="ignore"):
            value = self.square - self.mean**2
            without = self.square_without - self.mean_without**2
        return self._unbiased(value[:count], without[:, :count])

    def _covariance(self, pairs: slice, one: Array, other: Array) -> tuple[Array, Array]:
        with np.errstate(invalid="ignore", over="ignore"):
            value = self.product[pairs] - self.mean[one] * self.mean[other]
            return value, self.product_without[:, pairs] - self.mean_without[:, one] * self.mean_without[:, other]

    def covariances(self, one: Array, other: Array, count: int) -> Estimate:
        """(count, count, T) of the first columns, the pairs (one, other) of which are the first products."""
        found = self._unbiased(*self._covariance(slice(len(one)), one, other))
        whole = np.empty((count, count), int)
        whole[one, other] = whole[other, one] = np.arange(len(one))
        return Estimate(found.value[whole], found.stderr[whole])

    def autocorrelations(self, one: Array, other: Array, since: Array) -> Estimate:
        """Cov(f(s), f(t)) / Var f(s) of the columns `one`, (pairs, T); the columns `other` are f(s) at all times.

        The pairs are the last products; NaN before the times number `since`.
        """
        value, without = self._covariance(slice(self.product.shape[0] - len(one), None), one, other)
        with np.errstate(all="ignore"):
            value = value / (self.square[other] - self.mean[other] ** 2)
            without = without / (self.square_without[:, other] - self.mean_without[:, other] ** 2)
        before = np.arange(value.shape[1]) < since[:, np.newaxis]
        return Estimate(*(np.where(before, np.nan, each) for each in (value, self.stderr(value, without))))

    def passages(self, functions: list[int], count: int, t: Array, looks: Array, bins: int, random: bool) -> Passages:
        """What the shares of paths tell that have met a condition, (F, T) or (F,), NaN for other functions.

        Looking at some times only makes shares too small by an amount of order 1/2 in the time between two looks, of
        which those that look at every second and fourth time, the columns from `count` on, show the order.  `looks`
        are the numbers of looks at a path until t, at t = 0 not counted.  With `bins` also the density of the first
        times, in so many intervals or fewer.  `random` says whether initial states are.

        Where all paths tell the same, an error is the most that one is wrong by if as many paths as the rule of three
        allows tell something else.
        """
        even, fourth = np.flatnonzero(looks % 2 == 0), np.flatnonzero(looks % 4 == 0)
        share, share_stderr = np.full((2, count, len(t)), np.nan)
        order, order_stderr, mean, mean_stderr = np.full((4, count), np.nan)
        edges = even[np.unique(np.linspace(0, len(even) - 1, bins + 1).round().astype(int))] if bins else even[:0]
        density, density_stderr = np.full((2, count, max(len(edges) - 1, 0)), np.nan)
        unseen, width = _LARGEST * self.unseen, np.diff(t[edges])
        for i, f in enumerate(functions):
            columns = [f, count + i, count + len(functions) + i]

            def told(
                of_shares: Callable[[Array], Array], most: Array | float, columns: list[int] = columns
            ) -> Estimate:
                value = of_shares(self.mean[columns])
                error = self.stderr(value, of_shares(self.mean_without[:, columns]))
                return Estimate(value, np.where(error <= _SAME * np.abs(value), most, error))

            most = np.where((looks[even] == 0) & (not random), 0.0, unseen)
            share[f, even], share_stderr[f, even] = told(lambda shares: _extrapolated(shares[..., even]), most)
            if len(fourth):
                order[f], order_stderr[f] = told(lambda shares: _order(shares[..., fourth[-1]]), np.nan)
            if len(even) > 1:
                mean[f], mean_stderr[f] = told(
                    lambda shares: _mean_time(_extrapolated(shares[..., even]), t[even]), unseen * t[even[-1]]
                )
            if len(edges) > 1:
                density[f], density_stderr[f] = told(
                    lambda shares: np.diff(_extrapolated(shares[..., edges]), axis=-1) / width, unseen / width
                )
        return Passages(
            share=share,
            share_stderr=share_stderr,
            order=order,
            order_stderr=order_stderr,
            time=mean,
            time_stderr=mean_stderr,
            **({"from_t": t[edges[:-1]], "until_t": t[edges[1:]]} if len(edges) > 1 else {}),
            **({"density": density, "density_stderr": density_stderr} if len(edges) > 1 else {}),
        )

    @property
    def unseen(self) -> float:
        """The standard error of a share of the paths that is 0 or 1, by the rule of three."""
        return float(zero_share_bound(self.samples) / student_of_paths(self.samples, LEAST_GROUPS))

    def band(self, count: int) -> Array:
        """(count,) of the first columns the factor of :func:`simultaneous`."""
        return simultaneous(self.mean_without[:, :count])


_LARGEST = 2 + math.sqrt(2)  #: the largest weight of :func:`_extrapolated`


def _extrapolated(shares: Array) -> Array:
    """Shares without time between two looks, (..., T), from those with some, with 2 and 4 times that, (..., 3, T)."""
    return shares[..., 0, :] + (1 + math.sqrt(2)) * (shares[..., 0, :] - shares[..., 1, :])


def _order(shares: Array) -> Array:
    """The order of the bias, (...,), of such shares (..., 3) at a time that all look at."""
    fine, middle, rough = np.moveaxis(shares, -1, 0)
    with np.errstate(all="ignore"):
        return np.log2((middle - rough) / (fine - middle))


def _mean_time(share: Array, t: Array) -> Array:
    """The mean of the first time or, where that is later, of the last: the integral of 1 - share from 0 to there."""
    return t[0] * (1 - 0.5 * share[..., 0]) + np.trapezoid(1 - share, t, axis=-1)


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
    if groups < GROUPS:  # which say too little of correlations: Bonferroni's factor
        return np.full(without.shape[1], student_factor(groups, 1 - 0.05 / without.shape[2]))
    random = np.random.default_rng(1)
    weights = random.standard_normal((_DRAWS, groups))
    weights /= np.sqrt(random.chisquare(groups - 1, (_DRAWS, 1)) / (groups - 1))
    found = [np.abs(weights @ units[:, f]).max(axis=1) for f in range(units.shape[1])]
    return np.maximum(np.quantile(found, 0.95, axis=1), student_factor(groups))
