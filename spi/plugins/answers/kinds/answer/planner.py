"""The cheapest choice of levels from their means, variances and costs, and the bound of its bias.

Level l has the step T / 2^l; P_l is phi at the end of its paths, Y_l = P_l - P_(l-1) on common paths.  An estimate is

    R = sum_i w_i E P_(L-i) = E P_b + sum_{l = b+1}^{L} s_l E Y_l,   s_l = sum_{i <= L - l} w_i,

with the weights w of j levels of extrapolation (w = 1 for j = 0), each mean sampled by itself.  Without levels above b
that is plain Monte Carlo.  For an error of the order q the bias of R(L) is (R(L - 1) - R(L)) / (2^q - 1) up to higher
powers of h, a sum of the means of the same differences.  Costs are in seconds of typical speed, known before anything
is timed: so choices are the same on every machine.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from spi.statistics.estimators import GROUPS, TAILS, kurtosis, weights
from spi.statistics.intervals import skewed_half_width, zero_share_bound
from spi.storage.records import INTERVAL

# ---------------------------------------------------------------------------------------------------------------------
# Moments from sums over samples, also where all values are equal, or few differ.
# ---------------------------------------------------------------------------------------------------------------------

_CANCELLED = 1e-10  # of the mean square: a variance below has lost its digits
_FEW = 4.0  # values that have the variance of a difference: with fewer there may be larger ones that no sample shows
#: Values that must have the variance of a function whose range is not known: with fewer its mean is not resolved.
ENOUGH = 16.0


class Spread(NamedTuple):
    """Moments of the values of a quantity, arrays (F,)."""

    mean: np.ndarray
    variance: np.ndarray  #: of a sample, with that of rare values that no sample shows
    third: np.ndarray  #: third central moment
    kurtosis: np.ndarray  #: by which the variance is uncertain: of what no sample shows it is an upper bound
    equal: np.ndarray  #: whether all values are equal, and might not be, or most of the variance was not seen
    unknown: np.ndarray  #: whether all values are equal, and their range is infinite
    unseen: np.ndarray | float = 0.0  #: the part of the variance that no sample shows, at most; 0 where there is none
    few: np.ndarray | bool = False  #: whether a few values have the variance, and the range is infinite

    @classmethod
    def of(
        cls,
        sums: np.ndarray,
        paths: int,
        span: np.ndarray,
        scrambles: bool = False,
        bounds: np.ndarray | None = None,
        steep: np.ndarray | bool = False,
        bounded: np.ndarray | bool = True,
    ) -> "Spread":
        """Moments from sums (POWERS, F, GROUPS) over some paths, of values that are at most `span` (F,) apart.

        By the rule of three a share of at most 3/n of all values may lie where none of n samples does, as far from the
        mean as the `bounds` (F, 2) allow, or by the span.  That counts where all values are equal, and of functions
        that are `bounded` (F,) also where fewer than _FEW of them have the variance, or they may be `steep` (F,).  Of
        it is taken off how far values that were seen are off: the largest square of a deviation is at least
        E (x - m)^4 / E (x - m)^2.

        Equal values have equal sums in all groups, to the last bit.  Where groups are `scrambles` of points the
        variance is `paths` times that of their mean.
        """
        with np.errstate(all="ignore"):
            moments = sums.sum(axis=-1) / np.float64(paths)
            m1, m2, m3, _ = moments
            equal = (sums[0].max(axis=-1) == sums[0].min(axis=-1)) & np.isfinite(m1)
            variance = np.maximum(m2 - m1**2, 0.0)
            of_groups = paths / GROUPS * (sums[0] * (GROUPS / np.float64(paths))).var(axis=-1, ddof=1)
            lost = variance < _CANCELLED * m2
            variance = np.where(lost, of_groups, variance)
            tails = kurtosis(moments, variance)
            farthest = span if bounds is None else np.maximum(bounds[:, 1] - m1, m1 - bounds[:, 0])
            known = ~lost & (tails >= 1.0)  # which it is, unless powers underflow
            farther = np.maximum(farthest**2 - np.where(known, tails * variance, 0.0), 0.0)
            rare = bounded & (steep | ~known | (paths < _FEW * tails))
            farther = np.where(equal, span**2, np.where(rare, farther, 0.0))
            unseen = np.where(np.isfinite(farther), farther, 0.0) * zero_share_bound(paths)
            seen = np.where(equal, 0.0, of_groups if scrambles else variance)
            share = np.where(unseen > 0.0, seen / (seen + unseen), 1.0)
            return cls(
                mean=m1,
                variance=seen + unseen,
                third=np.where(equal, 0.0, m3 - 3.0 * m1 * m2 + 2.0 * m1**3),
                kurtosis=np.where(equal, np.nan, np.where(share < 1.0, 1.0 + (tails - 1.0) * share**2, tails)),
                equal=(equal & (span > 0.0)) | (unseen > seen),
                unknown=equal & np.isinf(span),
                unseen=unseen,
                few=~equal & ~lost & np.isinf(span) & ~(paths >= ENOUGH * tails),
            )

    def range_seen(self, paths: int) -> np.ndarray:
        """(F,) an upper bound of the range of the values that were seen, infinity where all are equal.

        |x - m|^4 <= sum of |x - m|^4 = n kurtosis variance^2 for each x.
        """
        with np.errstate(all="ignore"):
            fourth = paths * np.maximum(self.kurtosis, 1.0) * self.variance**2
            return np.where(self.equal | ~(fourth > 0.0), np.inf, 2.0 * fourth**0.25)

    def with_hidden(self, owners: np.ndarray) -> "Spread":
        """Moments of functions, from these with those of summands behind them, which belong to the `owners`.

        What no sample shows of a summand, the function may have, too.
        """
        count = len(self.mean) - len(owners)
        own = Spread(*(np.asarray(values)[:count] for values in self))
        if not len(owners):
            return own
        of_summands, unknown = (
            np.bincount(owners, np.asarray(values, float)[count:], count) for values in (self.unseen, self.unknown)
        )
        with np.errstate(all="ignore"):
            share = np.where(of_summands > 0.0, own.variance / (own.variance + of_summands), 1.0)
            return own._replace(
                variance=own.variance + of_summands,
                kurtosis=np.where(share < 1.0, 1.0 + (own.kurtosis - 1.0) * share**2, own.kurtosis),
                equal=own.equal | (of_summands > own.variance),
                unknown=own.unknown | (unknown > 0.0),
                unseen=own.unseen + of_summands,
            )

    @classmethod
    def together(cls, each: "Sequence[Spread]") -> "Spread":
        """Moments of several path sets, arrays (path sets, F)."""
        return cls(*(np.array(values) for values in zip(*each, strict=True)))


class MeanTerm(NamedTuple):
    """A mean that is part of a sum of independent means."""

    share: float
    spread: Spread
    paths: int
    scrambles: bool = False  #: whether the variance is that over scrambles of points


def sampling_error(terms: Sequence[MeanTerm]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(F,) the standard error of a sum of means, half the width of its 95 % interval, and its degrees of freedom.

    These are those of Welch and Satterthwaite: the variance of a variance is (kurtosis - 1) / n.
    """
    variance: Any = 0.0
    doubt: Any = 0.0
    third: Any = 0.0
    with np.errstate(all="ignore"):
        for share, spread, paths, scrambles in terms:
            own = share**2 * spread.variance / paths
            tails = np.nan_to_num((spread.kurtosis - 1.0) / paths)
            tails = np.maximum(2.0 / (GROUPS - 1), tails) if scrambles else tails
            variance, doubt = variance + own, doubt + own**2 * tails
            third = third + (0.0 if scrambles else share**3 * spread.third / paths**2)
        stderr, degrees = np.sqrt(variance), 2.0 * variance**2 / doubt
        return stderr, skewed_half_width(stderr, np.broadcast_to(third, stderr.shape), degrees), degrees


BIAS_SHARE = 0.1  #: of the accuracy, the most that the bias may have where levels are chosen
CHECK_SHARE = 0.15  #: of the accuracy, the standard error with which one step finer is compared
MOST_TAILS = 2**17
#: The share of the variance of an answer up to which the variance of a level may be uncertain, and the factor by which
#: it may be larger than it seems: a rare value that occurred once may be that much likelier.
_LITTLE, _UNSURE = 1 / 16, 5.0
_REPEATED = 4  # how often samples and a variance that depends on them are computed in turn
_RARE = 3.0  # by which a variance of one value among n is as large as where none was seen
#: Levels whose changes bound the bias, counted from the one with the smallest step.
_BOUNDING = 3
_CLEAR = 3.0  # standard errors from which on a mean is resolved
_FALLS = 1 / 8, 1.0  # the least and the most that a variance is assumed to fall from level to level


class Measured(NamedTuple):
    """Estimates of the levels 0, ..., K of a scheme; arrays (K + 1, F), costs (2 (K + 1),); row 0 has no difference."""

    mean: np.ndarray  #: of Y_l
    stderr: np.ndarray
    variance: np.ndarray
    kurtosis: np.ndarray
    value_variance: np.ndarray  #: of P_l
    cost: np.ndarray  #: of samples of Y_l, and behind them of P_l
    last: int  #: the last level with samples
    along: np.ndarray  #: (K + 1,) paths of P_l along quasi-random points, 0 where it does not follow them
    value_kurtosis: np.ndarray  #: of P_l
    unseen: np.ndarray  #: samples that there are where all values of Y_l are equal, infinity elsewhere
    value_unseen: np.ndarray  #: of the variance of P_l what no sample shows, times their number
    value_seen: np.ndarray  #: the rest of the variance of P_l

    @classmethod
    def of(
        cls,
        differences: Spread,
        samples: np.ndarray,
        values: Spread,
        cost: np.ndarray,
        along: Sequence[int] = (),
        value_samples: Sequence[int] = (),
    ) -> "Measured":
        """Estimates from the moments of Y_l and P_l, arrays (K + 1, F), and the numbers of samples.

        The variances of levels without samples go on as they fell before; a level that is not finite has an infinite
        one, so that it is not chosen.  One with too few samples for its tails has a larger one, so that a rare value
        that occurred once makes no level look better than those where it did not.
        """
        last = int(np.flatnonzero(samples)[-1])
        with np.errstate(all="ignore"):
            tails, of_values = (np.nan_to_num(each.kurtosis, nan=0.0, posinf=0.0) for each in (differences, values))
            variance = np.where(np.isfinite(differences.variance), differences.variance, np.inf)
            variance[0] = 0.0
            doubt = np.nan_to_num(np.sqrt(tails / samples[:, np.newaxis]), nan=0.0, posinf=0.0)
            variance = variance * (1.0 + _RARE * np.maximum(doubt - TAILS**-0.5, 0.0))
            fine, coarse = (variance[k][np.newaxis] for k in (last, max(last - 1, 1)))
            measurable = ~(differences.equal[last] | differences.equal[max(last - 1, 1)])
            fall = np.clip(np.nan_to_num(np.where(measurable, fine / coarse, np.nan), nan=0.5), *_FALLS)
            beyond = np.arange(len(samples) - last - 1)[:, np.newaxis] + 1
            variance[last + 1 :] = fine * fall**beyond
            value_variance = np.where(np.isfinite(values.variance), values.variance, np.inf)
            value_variance[last + 1 :] = value_variance[last]
            stderr = np.sqrt(variance / samples[:, np.newaxis])
            of_each = np.reshape(value_samples or [0] * len(samples), (-1, 1))
            value_unseen = np.nan_to_num(np.broadcast_to(values.unseen, value_variance.shape) * of_each)
            value_unseen[last + 1 :] = value_unseen[last]
        unseen = np.where(differences.equal, samples[:, np.newaxis], np.inf)
        unseen[last + 1 :] = unseen[last]
        return cls(
            mean=differences.mean,
            stderr=stderr,
            variance=variance,
            kurtosis=tails,
            value_variance=value_variance,
            cost=cost,
            last=last,
            along=np.asarray(along or [0] * len(samples)),
            value_kurtosis=of_values,
            unseen=unseen,
            value_unseen=value_unseen,
            value_seen=value_variance - value_unseen / np.maximum(of_each, 1),
        )

    def alone(self, base: int, variance_of_mean: float) -> float:
        """Samples of P_base whose mean has a variance, s / N + b / N^2 with what no sample shows."""
        of_seen = self.value_seen[base]
        b = self.value_unseen[base]
        return float(((of_seen + np.sqrt(of_seen**2 + 4.0 * b * variance_of_mean)) / (2.0 * variance_of_mean)).max())


class Choice(NamedTuple):
    """Levels of an answer."""

    levels: int  #: of extrapolation
    base: int  #: the level of the largest step
    finest: int
    work: float  #: predicted seconds of typical speed
    bias: float  #: predicted


def shares(w: np.ndarray, base: int, finest: int, count: int) -> np.ndarray:
    """(count,) the weights s_l of the Y_l in R."""
    level = np.arange(count)
    up_to = np.cumsum(w)[np.clip(finest - level, 0, len(w) - 1)]
    return np.where((level > base) & (level <= finest), up_to, 0.0)


def changed(measured: Measured, w: np.ndarray, finest: int) -> tuple[np.ndarray, np.ndarray]:
    """R(finest) - R(finest - 1) by the means, and its standard error, (F,); it needs finest >= len(w)."""
    count = len(measured.mean)
    t = shares(w, 0, finest, count) - shares(w, 0, finest - 1, count)
    used = np.flatnonzero(t)
    mean, stderr = measured.mean[used], measured.stderr[used]
    return t[used] @ mean, np.sqrt(t[used] ** 2 @ stderr**2)


def order_of(exponents: Sequence[float], levels: int) -> float:
    """Order of R with some levels of extrapolation; 1 where theory states none."""
    return exponents[levels] if exponents else 1.0


def bound(measured: Measured, exponents: Sequence[float], levels: int, finest: int, lowest: int = 0) -> np.ndarray:
    """(F,) a bound of the bias, by the changes of R from step to step, each extrapolated to `finest` by its order.

    It is the largest of them, so that one that is small by chance does no harm; levels up to `lowest` do not count.
    """
    w = weights(exponents[:levels])
    q, last = order_of(exponents, levels), min(finest, measured.last)
    largest = np.zeros(measured.mean.shape[1])
    for level in range(max(last - _BOUNDING + 1, lowest + levels + 1), last + 1):
        off, stderr = changed(measured, w, level)
        off, scale = np.abs(off), 2.0 ** (q * (level - finest)) / (2.0**q - 1.0)
        # at larger steps only a resolved change counts, as noise does not fall by the order
        clear = stderr if level == last else np.where(off > _CLEAR * stderr, 0.0, -off)
        largest = np.fmax(largest, scale * (off + clear))
    return np.where(np.isnan(largest), np.inf, largest)


def choose(
    measured: Measured,
    exponents: Sequence[float],
    allowed: Sequence[int],
    accuracy: float,
    steps: Sequence[int] = (),
    bases: Sequence[int] = (),
) -> Choice:
    """Least work by which bias and sampling together stay below the accuracy.

    Of all `allowed` numbers of levels of extrapolation, of all levels, or those of `steps`, and of all largest steps,
    or those of `bases`.  If the bias is too large even at the smallest step, the choice has that.
    """
    steps = steps or range(len(measured.mean) - 1)  # one level more is for the check
    most, choices = max(steps), []
    bases = bases or [step for step in steps if step < measured.last]
    for levels in (levels for levels in allowed if not levels or levels < len(exponents)):
        for base in bases:
            for finest in [step for step in steps if step > base + levels]:
                bias = float(bound(measured, exponents, levels, finest, base).max())
                if bias <= BIAS_SHARE * accuracy or finest == most:
                    choice = Choice(levels, base, finest, 0.0, bias)
                    samples = allocation(measured, exponents, choice, accuracy)
                    work = float(np.dot(samples, measured.cost))
                    choices.append(choice._replace(work=work if math.isfinite(work) else math.inf))
                    break
    good = [choice for choice in choices if choice.bias <= BIAS_SHARE * accuracy]
    least = min(good, key=lambda choice: (choice.work, choice.finest), default=None)
    return least or min(choices, key=lambda choice: (choice.bias, choice.work))


def allocation(
    measured: Measured,
    exponents: Sequence[float],
    choice: Choice,
    accuracy: float,
    bias: float | None = None,
    factor: float = INTERVAL,
) -> np.ndarray:
    """(2 (K + 1),) paths of each difference, and behind them those of each value, for an answer to the accuracy.

    N_l is proportional to |s_l| (V_l / C_l)^(1/2), so that the work is least; the level above the finest is for the
    check; a level has at least :data:`TAILS` times its kurtosis of paths.  Half of the
    interval has `factor` standard errors.
    """
    count, w = len(measured.mean), weights(exponents[: choice.levels])
    target = (accuracy - min(choice.bias if bias is None else bias, accuracy / 2)) / factor
    s = shares(w, choice.base, choice.finest, count)
    of_differences, of_values = (each.max(axis=1) for each in (measured.variance, measured.value_variance))
    cost, base, there = measured.cost, count + choice.base, measured.along[choice.base]
    with np.errstate(invalid="ignore"):  # a level that is not finite has no work that is
        variance = np.append(np.where(s != 0.0, s**2 * of_differences, 0.0), np.zeros(count))
        variance[base] = of_values[choice.base]
        samples = np.sqrt(variance * cost).sum() * np.sqrt(variance / cost) / target**2
        if measured.value_unseen[choice.base].any() and not there:
            for _ in range(_REPEATED):  # the variance falls as samples are added
                share = variance[base] / samples[base]
                variance[base] = share * measured.alone(choice.base, share)
                samples = np.sqrt(variance * cost).sum() * np.sqrt(variance / cost) / target**2
    samples = np.nan_to_num(samples, nan=np.inf, posinf=np.inf)
    if there:
        samples = _in_powers_of_two(samples, variance, cost, target**2, base, there)
    check = choice.finest + 1
    samples[check] = w[0] ** 2 * of_differences[check] / (CHECK_SHARE * accuracy) ** 2
    tails = TAILS * np.concatenate([measured.kurtosis, measured.value_kurtosis]).max(axis=1)
    s[check], allowed = w[0], np.full((count, 1), math.sqrt(_LITTLE) * target)
    allowed[check] = CHECK_SHARE * accuracy
    samples[:count], tails[:count] = _enough(measured, samples[:count], tails[:count], s[:, np.newaxis] / allowed)
    s[check] = 0.0
    used = np.append(s != 0.0, np.zeros(count, bool))
    used[[check, base]] = True
    return np.where(used, np.maximum(np.maximum(samples, np.minimum(tails, MOST_TAILS)), 1.0), 0.0)


def _enough(
    measured: Measured, samples: np.ndarray, tails: np.ndarray, weight: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(K + 1,) samples of differences and those for their tails, at most as many as uncertain variances justify.

    `weight` (K + 1, 1) is the reciprocal of a standard error that is allowed.  Where all n values are equal, the
    variance is at most b / n by the rule of three, that of the mean of N more b / N^2, and N = b^(1/2) times `weight`.
    """
    with np.errstate(all="ignore"):
        own = samples[:, np.newaxis] * np.sqrt(measured.variance / measured.variance.max(axis=1, keepdims=True))
        rare = weight * np.sqrt(measured.variance * measured.unseen)
        most = np.where(np.isfinite(measured.unseen), rare, np.nan_to_num(own, nan=np.inf)).max(axis=1)
        little = (_UNSURE * weight**2 * measured.variance).max(axis=1)
    return np.fmin(samples, most), np.fmin(tails, little)


def _in_powers_of_two(
    samples: np.ndarray, variance: np.ndarray, cost: np.ndarray, target: float, base: int, there: int
) -> np.ndarray:
    """Allocation where the `base` has a power of two of points, of which `there` are computed.

    The differences share the rest of the `target` variance, and their work decides between powers.
    """
    others = np.where(np.arange(len(cost)) == base, 0.0, np.sqrt(variance * cost))
    possible = []
    for power in range(60) if np.isfinite(samples[base]) else ():
        points = max(2.0**power, float(there))
        left = target - variance[base] / points
        if 2.0**power >= samples[base] / 2 and left > 0.0:
            work = cost[base] * (points - there) + others.sum() ** 2 / left
            possible.append((work, points, others.sum() / left))
        if 2.0**power > 4 * samples[base] and possible:
            break
    if not possible:
        return samples
    _, points, share = min(possible)
    with np.errstate(invalid="ignore"):
        each = share * np.sqrt(variance / cost)
    each[base] = points
    return each


def contradicted(measured: Measured, exponents: Sequence[float], lowest: int, accuracy: float) -> float | None:
    """Order that the means of the finest resolved levels show, if it is not that of theory; None otherwise.

    Only where both of two neighbouring means are resolved, and larger than the bias may be.
    """
    if not exponents:
        return None
    mean, stderr = np.abs(measured.mean), measured.stderr
    for level in range(measured.last, lowest + 2, -1):
        with np.errstate(all="ignore"):
            clear = (mean[level - 1 : level + 1] > 2 * _CLEAR * stderr[level - 1 : level + 1]).all(axis=0)
            clear &= mean[level] > BIAS_SHARE * accuracy
            orders = np.log2(mean[level - 1] / mean[level])
            doubt = np.hypot(*(stderr[level - 1 : level + 1] / mean[level - 1 : level + 1])) / math.log(2.0)
        if clear.any():
            low = np.where(clear & (orders + 2 * doubt < exponents[0] - 0.5), orders, np.inf).min()
            return max(float(low), 0.25) if math.isfinite(low) else None
    return None
