"""What is cheapest: from means, variances and costs of levels to a choice of levels, and from a choice to a bound.

Level l has the step T / 2^l; P_l is phi at the end of its paths, Y_l = P_l - P_(l-1) on common paths.  An estimate is

    R = sum_i w_i E P_(L-i) = E P_b + sum_{l = b+1}^{L} s_l E Y_l,   s_l = sum_{i <= L - l} w_i,

with the weights w of j levels of extrapolation (w = 1 for j = 0), each mean sampled by itself.  Without levels above b
that is plain Monte Carlo.  For an error of the order q the bias of R(L) is (R(L - 1) - R(L)) / (2^q - 1) up to higher
powers of h, a sum of the means of the same differences.  Costs are in seconds of typical speed, known before anything
is timed: so choices are the same on every machine.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spi.statistics.richardson import weights
from spi.storage.records import INTERVAL

from .spread import Spread

BIAS_SHARE = 0.1  #: of the accuracy, which the bias may have where levels are chosen
CHECK_SHARE = 0.15  #: of the accuracy, the standard error with which one step finer is compared
#: Paths of a level at least, in units of its kurtosis: below, its standard error is not to be trusted.
TAILS = 8.0
MOST_TAILS = 2**17
#: Levels that are asked what the bias is, counted from the one with the smallest step.
_ASKED = 3
_CLEAR = 3.0  # a mean stands clear of its standard error
_FALLS = 1 / 8, 1.0  # the least and the most that a variance is assumed to fall from level to level


class Measured(NamedTuple):
    """What is known of the levels 0, ..., K of a scheme; arrays (K + 1, F), costs (K + 1,); row 0 has no difference."""

    mean: np.ndarray  #: of Y_l
    stderr: np.ndarray
    variance: np.ndarray
    kurtosis: np.ndarray
    value_variance: np.ndarray  #: of P_l
    cost: np.ndarray  #: of a sample of Y_l
    value_cost: np.ndarray
    known: int  #: up to which level there are samples
    along: np.ndarray  #: (K + 1,) paths of P_l along quasi-random points, 0 where it does not follow them
    value_kurtosis: np.ndarray  #: of P_l

    @classmethod
    def of(
        cls,
        differences: Spread,
        samples: np.ndarray,
        values: Spread,
        cost: np.ndarray,
        value_cost: np.ndarray,
        along: Sequence[int] = (),
    ) -> "Measured":
        """From what is known of Y_l, of P_l, arrays (K + 1, F), and how many samples of each there are.

        The variances of levels without samples go on as they fell before; a level that is not finite has an infinite
        one, so that it is not chosen.
        """
        known = int(np.flatnonzero(samples)[-1])
        with np.errstate(all="ignore"):
            tails, of_values = (np.nan_to_num(one.kurtosis, nan=0.0, posinf=0.0) for one in (differences, values))
            variance = np.where(np.isfinite(differences.variance), differences.variance, np.inf)
            variance[0] = 0.0
            last = [variance[k][np.newaxis] for k in (known, max(known - 1, 1))]
            fall = np.clip(np.nan_to_num(last[0] / last[1], nan=0.5), *_FALLS)
            beyond = np.arange(len(samples) - known - 1)[:, np.newaxis] + 1
            variance[known + 1 :] = last[0] * fall**beyond
            value_variance = np.where(np.isfinite(values.variance), values.variance, np.inf)
            value_variance[known + 1 :] = value_variance[known]
            stderr = np.sqrt(variance / samples[:, np.newaxis])
        followed = np.asarray(along or [0] * len(cost))
        seconds = cost, value_cost
        return cls(differences.mean, stderr, variance, tails, value_variance, *seconds, known, followed, of_values)


class Choice(NamedTuple):
    """Which levels an answer has."""

    levels: int  #: of extrapolation
    base: int  #: the level of the largest step
    finest: int
    work: float  #: predicted seconds of typical speed
    bias: float  #: predicted


def shares(w: np.ndarray, base: int, finest: int, count: int) -> np.ndarray:
    """(count,) how much of each Y_l is in R."""
    level = np.arange(count)
    up_to = np.cumsum(w)[np.clip(finest - level, 0, len(w) - 1)]
    return np.where((level > base) & (level <= finest), up_to, 0.0)


def changed(measured: Measured, w: np.ndarray, finest: int) -> tuple[np.ndarray, np.ndarray]:
    """R(finest) - R(finest - 1) as it was found, and its standard error, (F,); it needs finest >= len(w)."""
    count = len(measured.cost)
    t = shares(w, 0, finest, count) - shares(w, 0, finest - 1, count)
    used = np.flatnonzero(t)
    mean, stderr = measured.mean[used], measured.stderr[used]
    return t[used] @ mean, np.sqrt(t[used] ** 2 @ stderr**2)


def order_of(exponents: Sequence[float], levels: int) -> float:
    """The order of R with so many levels of extrapolation; 1 where theory says nothing."""
    return exponents[levels] if exponents else 1.0


def bound(measured: Measured, exponents: Sequence[float], levels: int, finest: int, lowest: int = 0) -> np.ndarray:
    """(F,) the bias at most, by the changes of R from step to step, each carried on to `finest` by its order.

    The largest counts, so that one change that is small by chance does not; levels up to `lowest` have no say.
    """
    w = weights(exponents[:levels])
    q, last = order_of(exponents, levels), min(finest, measured.known)
    found = np.zeros(measured.mean.shape[1])
    for level in range(max(last - _ASKED + 1, lowest + levels + 1), last + 1):
        off, stderr = changed(measured, w, level)
        off, scale = np.abs(off), 2.0 ** (q * (level - finest)) / (2.0**q - 1.0)
        # of larger steps only what stands clear counts, for noise is carried on as little as theirs
        clear = stderr if level == last else np.where(off > _CLEAR * stderr, 0.0, -off)
        found = np.fmax(found, scale * (off + clear))
    return np.where(np.isnan(found), np.inf, found)


def choose(
    measured: Measured,
    exponents: Sequence[float],
    allowed: Sequence[int],
    accuracy: float,
    steps: Sequence[int] = (),
    bases: Sequence[int] = (),
) -> Choice:
    """The least work by which bias and sampling together stay below the accuracy.

    Of all `allowed` numbers of levels of extrapolation, of all levels, or those of `steps`, and of all largest steps,
    or those of `bases`.  If the bias is too large even at the smallest step, the choice has that.
    """
    steps = steps or range(len(measured.cost) - 1)  # one level more is kept for the check
    most, found = max(steps), []
    for levels in allowed:
        if levels and len(exponents) <= levels:
            continue
        for base in bases or [step for step in steps if step < measured.known]:
            for finest in [step for step in steps if step > base + levels]:
                bias = float(bound(measured, exponents, levels, finest, base).max())
                if bias <= BIAS_SHARE * accuracy or finest == most:
                    one = Choice(levels, base, finest, 0.0, bias)
                    samples = allocation(measured, exponents, one, accuracy)
                    work = float(np.dot(samples, _costs(measured)))
                    found.append(one._replace(work=work if math.isfinite(work) else math.inf))
                    break
    good = [one for one in found if one.bias <= BIAS_SHARE * accuracy]
    if good:
        return min(good, key=lambda one: (one.work, one.finest))
    return min(found, key=lambda one: (one.bias, one.work))


def _costs(measured: Measured) -> np.ndarray:
    return np.concatenate([measured.cost, measured.value_cost])


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
    check; paths are not fewer than the tails of a level ask for.  Half of the interval has `factor` standard errors.
    """
    count, w = len(measured.cost), weights(exponents[: choice.levels])
    target = (accuracy - min(choice.bias if bias is None else bias, accuracy / 2)) / factor
    s = shares(w, choice.base, choice.finest, count)
    of_differences, of_values = (each.max(axis=1) for each in (measured.variance, measured.value_variance))
    variance = np.append(np.where(s != 0.0, s**2 * np.where(s != 0.0, of_differences, 0.0), 0.0), np.zeros(count))
    variance[count + choice.base] = of_values[choice.base]
    cost = _costs(measured)
    with np.errstate(invalid="ignore"):  # a level that is not finite has no work that is
        samples = np.nan_to_num(
            np.sqrt(variance * cost).sum() * np.sqrt(variance / cost) / target**2, nan=np.inf, posinf=np.inf
        )
    if measured.along[choice.base]:
        samples = _in_powers_of_two(
            samples, variance, cost, target**2, count + choice.base, measured.along[choice.base]
        )
    check = choice.finest + 1
    samples[check] = w[0] ** 2 * of_differences[check] / (CHECK_SHARE * accuracy) ** 2
    tails = TAILS * np.concatenate([measured.kurtosis, measured.value_kurtosis]).max(axis=1)
    used = np.append(s != 0.0, np.zeros(count, bool))
    used[[check, count + choice.base]] = True
    return np.where(used, np.maximum(np.maximum(samples, np.minimum(tails, MOST_TAILS)), 1.0), 0.0)


def _in_powers_of_two(
    samples: np.ndarray, variance: np.ndarray, cost: np.ndarray, target: float, base: int, there: int
) -> np.ndarray:
    """The allocation where the `base` has a power of two of points, of which so many are `there`.

    What these leave of the variance wanted is shared by the differences, whose work decides between powers.
    """
    others = np.where(np.arange(len(cost)) == base, 0.0, np.sqrt(variance * cost))
    found = []
    for power in range(60) if np.isfinite(samples[base]) else ():
        points = max(2.0**power, float(there))
        left = target - variance[base] / points
        if 2.0**power >= samples[base] / 2 and left > 0.0:
            work = cost[base] * (points - there) + others.sum() ** 2 / left
            found.append((work, points, others.sum() / left))
        if 2.0**power > 4 * samples[base] and found:
            break
    if not found:
        return samples
    _, points, share = min(found)
    with np.errstate(invalid="ignore"):
        each = share * np.sqrt(variance / cost)
    each[base] = points
    return each


def contradicted(measured: Measured, exponents: Sequence[float], lowest: int, accuracy: float) -> float | None:
    """The order that the means of the finest resolved levels show, if it is not that of theory; None otherwise.

    Only where both of two neighbouring means stand clear of their standard errors, and matter.
    """
    if not exponents:
        return None
    mean, stderr = np.abs(measured.mean), measured.stderr
    for level in range(measured.known, lowest + 2, -1):
        with np.errstate(all="ignore"):
            clear = (mean[level - 1 : level + 1] > 2 * _CLEAR * stderr[level - 1 : level + 1]).all(axis=0)
            clear &= mean[level] > BIAS_SHARE * accuracy
            orders = np.log2(mean[level - 1] / mean[level])
            doubt = np.hypot(*(stderr[level - 1 : level + 1] / mean[level - 1 : level + 1])) / math.log(2.0)
        if clear.any():
            low = np.where(clear & (orders + 2 * doubt < exponents[0] - 0.5), orders, np.inf).min()
            return max(float(low), 0.25) if math.isfinite(low) else None
    return None
