"""What follows from the sums over paths, with standard errors by the jackknife over groups of paths."""

import math
from typing import NamedTuple

import numpy as np

from spi.statistics.estimators import group_counts, jackknife_stderr
from spi.statistics.powers import mean_over_paths

from .results import Corrected

Array = np.ndarray

_DRAWS = 4000  # for the factor of simultaneous bands


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
        """Standard error of what has these leave-one-out values."""
        return jackknife_stderr(value, without, self.groups)

    def _unbiased(self, value: Array, without: Array) -> Estimate:
        """Of a second moment about the mean."""
        factor = self.samples / max(self.samples - 1, 1)
        return Estimate(factor * value, factor * self.stderr(value, without))

    def variances(self, count: int) -> Estimate:
        """(count, T) those of the first columns."""
        value = self.square - self.mean**2
        without = self.square_without - self.mean_without**2
        return self._unbiased(value[:count], without[:, :count])

    def _covariance(self, pairs: slice, one: Array, other: Array) -> tuple[Array, Array]:
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

    def corrected(self, passages: list[int], coarser: list[int], count: int) -> Corrected:
        """Shares of passages (F, T) without the bias of looking at some times only, which is of order 1/2 in them."""
        value, error = np.full((2, count, self.mean.shape[1]), np.nan)
        factor = 1 + math.sqrt(2)
        for f, c in zip(passages, coarser, strict=True):
            value[f] = self.mean[f] + factor * (self.mean[f] - self.mean[c])
            without = self.mean_without
            error[f] = self.stderr(value[f], without[:, f] + factor * (without[:, f] - without[:, c]))
            value[f, 1::2] = error[f, 1::2] = np.nan  # where every second time is the one before
        return Corrected(share=value, share_stderr=error)

    def band(self, count: int) -> Array:
        """(count,) the factor c by which mean -+ c stderr holds all true means at once in 95 % of cases."""
        mean, without = self.mean[:count], self.mean_without[:, :count]
        return simultaneous(mean, without)


def simultaneous(mean: Array, without: Array) -> Array:
    """(F,) the factor c by which mean -+ c stderr holds all true means (F, T) at once in 95 % of cases.

    The largest of correlated normal variables, of which the correlations are those of the leave-one-out values; with
    normal weights for these, drawn from a fixed seed.
    """
    spread = without - without.mean(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        units = spread / np.sqrt((spread**2).sum(axis=0))
    units[~np.isfinite(units)] = 0.0
    weights = np.random.default_rng(1).standard_normal((_DRAWS, len(units)))
    found = [np.abs(weights @ units[:, f]).max(axis=1) for f in range(len(mean))]
    return np.maximum(np.quantile(found, 0.95, axis=1), 1.96)
