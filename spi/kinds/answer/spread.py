"""What sums over samples tell of a mean, also where all values are equal, or few differ."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from spi.statistics.estimators import GROUPS
from spi.statistics.intervals import skewed_half_width, zero_share_bound
from spi.statistics.powers import kurtosis

_CANCELLED = 1e-10  # of the mean square: a variance below has lost its digits


class Spread(NamedTuple):
    """Of the values of a quantity, arrays (F,)."""

    mean: np.ndarray
    variance: np.ndarray  #: of a sample; where all are equal the most that it may be, 0 where nothing is known of it
    third: np.ndarray  #: third central moment
    kurtosis: np.ndarray
    equal: np.ndarray  #: whether all values are equal, and might not be
    unknown: np.ndarray  #: whether nothing is known either of how far apart they may be

    @classmethod
    def of(cls, sums: np.ndarray, paths: int, span: np.ndarray) -> "Spread":
        """From sums (POWERS, F, GROUPS) over so many samples, of values that are at most `span` (F,) apart.

        Where all values are equal, the share of others is at most that of the rule of three, and so the variance at
        most that times span^2.  Equal values have equal sums in all groups, to the last bit.
        """
        with np.errstate(all="ignore"):
            moments = sums.sum(axis=-1) / np.float64(paths)
            m1, m2, m3, _ = moments
            equal = (sums[0].max(axis=-1) == sums[0].min(axis=-1)) & np.isfinite(m1)
            variance = np.maximum(m2 - m1**2, 0.0)
            of_groups = paths / GROUPS * (sums[0] * (GROUPS / np.float64(paths))).var(axis=-1, ddof=1)
            variance = np.where(variance < _CANCELLED * m2, of_groups, variance)
            bounded = np.where(np.isfinite(span), span, 0.0) ** 2 * zero_share_bound(paths)
            third = np.where(equal, 0.0, m3 - 3.0 * m1 * m2 + 2.0 * m1**3)
            tails = np.where(equal, np.nan, kurtosis(moments, variance))
            known = m1, np.where(equal, bounded, variance), third, tails
            return cls(*known, equal & (span > 0.0), equal & np.isinf(span))

    def range_seen(self, paths: int) -> np.ndarray:
        """(F,) at least as much as the values that were seen are apart, infinity where all are equal.

        |x - m|^4 <= sum of |x - m|^4 = n kurtosis variance^2 for each x.
        """
        with np.errstate(all="ignore"):
            fourth = paths * np.maximum(self.kurtosis, 1.0) * self.variance**2
            return np.where(self.equal | ~(fourth > 0.0), np.inf, 2.0 * fourth**0.25)

    @classmethod
    def along(cls, sums: np.ndarray, paths: int, span: np.ndarray) -> "Spread":
        """The same along points, whose groups are scrambles: the variance is `paths` times that of their mean."""
        found = cls.of(sums, paths, span)
        with np.errstate(all="ignore"):
            of_mean = (sums[0] * (GROUPS / np.float64(paths))).var(axis=-1, ddof=1) / GROUPS
            return found._replace(variance=np.where(found.equal, found.variance, paths * of_mean))

    @classmethod
    def together(cls, each: "Sequence[Spread]") -> "Spread":
        """Those of several path sets, arrays (path sets, F)."""
        return cls(*(np.array(values) for values in zip(*each, strict=True)))


class Term(NamedTuple):
    """A mean that is part of a sum of independent means."""

    share: float
    spread: Spread
    paths: int
    scrambles: bool = False  #: whether the variance is that over scrambles of points


def sampling_error(terms: Sequence[Term]) -> tuple[np.ndarray, np.ndarray]:
    """(F,) the standard error of a sum of means, and half the width of its 95 % interval.

    The degrees of freedom are those of Welch and Satterthwaite: the variance of a variance is (kurtosis - 1) / n.
    """
    variance: Any = 0.0
    doubt: Any = 0.0
    third: Any = 0.0
    with np.errstate(all="ignore"):
        for share, spread, paths, scrambles in terms:
            own = share**2 * spread.variance / paths
            tails = 2.0 / (GROUPS - 1) if scrambles else np.nan_to_num((spread.kurtosis - 1.0) / paths)
            variance, doubt = variance + own, doubt + own**2 * tails
            third = third + (0.0 if scrambles else share**3 * spread.third / paths**2)
        stderr = np.sqrt(variance)
        return stderr, skewed_half_width(stderr, np.broadcast_to(third, stderr.shape), 2.0 * variance**2 / doubt)
