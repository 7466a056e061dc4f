"""The sums of a multilevel estimator over the samples of its levels, and their moments, Giles' table and rates."""

from typing import NamedTuple

import numpy as np

from spi.numerics.rng import LANES
from spi.statistics.estimators import GROUPS, PARTS, fit_order, group_counts
from spi.statistics.powers import kurtosis, mean_over_paths
from spi.statistics.tallies import sum_of_fields
from spi.storage.records import Order

from ...results import Levels as LevelTable
from .levels import CONTROL, DIFFERENCE, PRODUCT, VALUE

EQUAL = np.full(GROUPS, PARTS)  #: all groups of a level are equally large, so any equal counts will do

_CLEAR = 4.0  # a mean difference counts for the rate of means if it is so many times its standard error


class Totals(NamedTuple):
    """The sums over some samples of one level, for F test functions."""

    paths: int  #: samples, each of them all paths of the level
    seconds: float  #: wall clock
    cpu_seconds: float
    sums: np.ndarray  #: (powers, quantities, F, GROUPS), the quantities as in levels.py
    nonfinite: int

    def plus(self, later: "Totals") -> "Totals":
        """These samples and some later ones."""
        return sum_of_fields(self, later)


class Moments(NamedTuple):
    """Of each level, all (levels, F)."""

    mean: np.ndarray  #: of what is averaged, which with a control is Y - beta (Y_0 - E Y_0)
    stderr: np.ndarray  #: of the same
    variance: np.ndarray  #: of the same
    kurtosis: np.ndarray  #: of the difference Y itself, at the last level of the value


class LevelSums(NamedTuple):
    """The totals of several levels."""

    blocks: np.ndarray  #: (levels,)
    sums: np.ndarray  #: (levels, powers, quantities, F, GROUPS)
    nonfinite: np.ndarray  #: (levels,)
    cpu_seconds: np.ndarray  #: (levels,), that of the control in the last one
    known: np.ndarray  #: (levels, F) expectations of the control
    used: np.ndarray  #: (levels,) bool, which of them are in the errors

    def only(self, levels: slice) -> "LevelSums":
        """Those of some levels."""
        return LevelSums(*(values[levels] for values in self))

    @property
    def samples(self) -> np.ndarray:
        """(levels,) samples done."""
        return self.blocks * LANES

    @property
    def controlled(self) -> bool:
        """Whether there is a control."""
        return self.sums.shape[2] > CONTROL

    def means_of_powers(self) -> np.ndarray:
        """Means of the powers of each quantity, (quantities, powers, levels, F)."""
        return (self.sums.sum(axis=-1) / self.samples.reshape(-1, 1, 1, 1)).transpose(2, 1, 0, 3)

    def beta(self) -> np.ndarray:
        """cov(Y, Y_0) / var(Y_0), (levels, F); 0 without control."""
        if not self.controlled:
            return np.zeros((len(self.blocks), self.sums.shape[3]))
        y, y0, product = self.means_of_powers()[[DIFFERENCE, CONTROL, PRODUCT]]
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.nan_to_num((product[0] - y[0] * y0[0]) / (y0[1] - y0[0] ** 2))

    def averages(self) -> tuple[np.ndarray, np.ndarray]:
        """Means of what is averaged at each level, (levels, F), and leave-one-out values (groups, levels, F)."""
        beta, means, withouts = self.beta(), [], []
        for j, (sums, blocks) in enumerate(zip(self.sums, self.blocks, strict=True)):
            mean, without = mean_over_paths(sums[0, DIFFERENCE], _counts(blocks))
            if self.controlled:
                of_control, control_without = mean_over_paths(sums[0, CONTROL], _counts(blocks))
                mean = mean - beta[j] * (of_control - self.known[j])
                without = without - beta[j] * (control_without - self.known[j])
            means.append(mean)
            withouts.append(without)
        return np.array(means), np.stack(withouts, axis=1)

    def moments(self) -> Moments:
        """The moments of each level."""
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            powers = self.means_of_powers()
            m1, m2 = powers[DIFFERENCE][:2]
            variance = np.maximum(m2 - m1 * m1, 0.0)
            tails = kurtosis(powers[DIFFERENCE], variance)
            if self.controlled:
                covariance = powers[PRODUCT][0] - m1 * powers[CONTROL][0]
                variance = np.maximum(variance - self.beta() * covariance, 0.0)
            return Moments(self.averages()[0], np.sqrt(variance / self.samples.reshape(-1, 1)), variance, tails)

    def consistency(self) -> np.ndarray:
        """Giles' check |a - b - d| / (3 (sd a + sd b + sd d)), above 1 with probability 0.3 %, (levels - 1, F).

        d is the mean difference of a level, b the mean at its fine step, a that at its coarse step from the level
        above.
        """
        moments = self.moments()
        with np.errstate(invalid="ignore", divide="ignore"):
            fine, square = self.means_of_powers()[VALUE][:2]
            sd_fine = np.sqrt(np.maximum(square - fine**2, 0.0) / self.samples.reshape(-1, 1))
            off = fine[1:] - fine[:-1] - moments.mean[:-1]
            return np.abs(off) / (3.0 * (sd_fine[1:] + sd_fine[:-1] + moments.stderr[:-1]))

    def variance_rates(self, h: np.ndarray) -> tuple[Order, ...]:
        """The rates p in V = O(h^p), with their intervals, of the variances of levels at the steps h."""
        rates = []
        for f, beta in enumerate(self.beta().T):
            each = [mean_over_paths(one[:2, :, f], _counts(n)) for one, n in zip(self.sums, self.blocks, strict=True)]
            value = np.array([_variance(mean, factor) for (mean, _), factor in zip(each, beta, strict=True)])
            withouts = [_variance(np.moveaxis(one, 0, -1), factor) for (_, one), factor in zip(each, beta, strict=True)]
            rates.append(fit_order(h, value, np.array(withouts).T, EQUAL, value > 0))
        return tuple(rates)

    def table(self, h: np.ndarray, antithetic: bool, control_bound: float) -> LevelTable:
        """Giles' table of the levels that are differences, and how fast means and variances fall with the steps h."""
        differences, moments = self.only(slice(-1)), self.moments()
        mean, without = differences.averages()
        clear = (np.abs(mean) > _CLEAR * moments.stderr[:-1]).T
        per_sample = differences.cpu_seconds / differences.samples
        each = zip(np.abs(mean).T, np.abs(without).transpose(2, 0, 1), clear, strict=True)
        return LevelTable(
            h=h,
            mean=mean.T,
            variance=moments.variance[:-1].T,
            kurtosis=moments.kurtosis[:-1].T,
            consistency=self.consistency().T,
            samples=differences.samples,
            nonfinite=differences.nonfinite,
            seconds=per_sample,
            mean_rate=tuple(fit_order(h, value, left_out, EQUAL, used) for value, left_out, used in each),
            variance_rate=differences.variance_rates(h),
            cost_rate=float(-np.polyfit(np.log(h), np.log(per_sample), 1)[0]) if len(h) > 1 else float("nan"),
            antithetic=antithetic,
            control="the limit without sampling" if self.controlled else "",
            control_bound=control_bound,
        )


def _counts(blocks: int) -> np.ndarray:
    return group_counts(int(blocks) * LANES)


def _variance(m: np.ndarray, beta: np.ndarray) -> np.ndarray:
    """The variance of Y - beta Y_0 from means of powers (2, quantities, ...)."""
    variance = m[1, DIFFERENCE] - m[0, DIFFERENCE] ** 2
    if m.shape[1] <= CONTROL:
        return variance
    covariance = m[0, PRODUCT] - m[0, DIFFERENCE] * m[0, CONTROL]
    return variance - 2 * beta * covariance + beta**2 * (m[1, CONTROL] - m[0, CONTROL] ** 2)
