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

from spi.ensemble.areas import fourier_terms
from spi.ensemble.increments import RandomStream, dimensions_of
from spi.ensemble.loop import grid
from spi.kinds.blocks import Sample, two_steps
from spi.numerics.rng import ANSWERS, LANES
from spi.numerics.sobol import LEAST_PATHS, MOST_DIMENSIONS
from spi.schemes import typical_ns
from spi.schemes.splitting import has_antithetic_path
from spi.statistics.estimators import GROUPS, ROUND, kurtosis, weights
from spi.statistics.intervals import skewed_half_width, zero_share_bound
from spi.storage.records import INTERVAL

from .keys import FINEST, PILOT_LEVELS, PILOT_SAMPLES

# ---------------------------------------------------------------------------------------------------------------------
# The paths of an answer: those of a difference between neighbouring levels, and those of one level alone.
# ---------------------------------------------------------------------------------------------------------------------

LEVELS = FINEST + 1  #: levels 0, ..., FINEST
ALONG = 2 * LEVELS  #: behind differences and values, the path sets of values along quasi-random points
AGAINST = 3 * LEVELS  #: behind these, those of differences from the reference scheme on the same noise
SETS = 4 * LEVELS  #: path sets of a scheme

#: What a path costs besides its steps, its beginning and phi at its end, and the sums over a quantity of a function;
#: measured, of typical speed.
PATH_NS, SUM_NS = 25.0, 15.0


def paths_of_set(case: Any, row: Any, number: int) -> Sample:
    """The paths of set number `number` of all: of scheme number // SETS, whose row of the table is `row`.

    VALUE is that of one path, of a level alone the only quantity.  Against a reference scheme DIFFERENCE is that at the
    fine step, VALUE that at the fine step less that at the coarse one.
    """
    own, record = number % SETS, row.record
    level, alone = own % LEVELS, own >= LEVELS  # along points or not
    shape: dict[str, Any] = {"doublings": (0,)}
    weights = [[1.0]]
    if own >= AGAINST:
        shape, weights = two_steps(False)[0], [[0.0, 1.0, 0.0, -1.0], [-1.0, 1.0, 1.0, -1.0]]
    elif not alone:
        shape, difference = two_steps(has_antithetic_path(record))
        weights = [difference, [1.0 * (i == len(difference) // 2) for i in range(len(difference))]]
    steps, h = 2**level, case.final_time / 2.0**level
    records = [record, case.row(case.reference_scheme).record] if own >= AGAINST and case.reference_scheme else [record]
    terms = fourier_terms(case.model, records, h, areas=case.areas)
    times = grid(h, steps, by_reference=(0,) * len(shape["doublings"]), area_terms=terms, **shape)
    stream = RandomStream(np.uint64(case.seed), np.uint64(ANSWERS + 2 * number))
    return Sample.of(times, stream, weights)


def seconds_of(case: Any, row: Any, sample: Sample) -> float:
    """The seconds of one sample of a path set, by one thread of typical speed."""
    quantities, count = sample.weights.shape
    besides = PATH_NS * count + SUM_NS * quantities * len(case.functions)
    return 1e-9 * (typical_ns(row, case.model) * sample.steps + besides)


def most_points(row: Any, model: Any) -> int:
    """The largest level at which a scheme can follow quasi-random points."""
    return sum(dimensions_of(row.record, None, model, 2**level)[1] <= MOST_DIMENSIONS for level in range(LEVELS)) - 1


def power_of_two(paths: float) -> int:
    """The least power of two, a number of paths along points, that is at least `paths`."""
    return max(LEAST_PATHS, 1 << math.ceil(math.log2(max(paths, 1.0))))


def whole_blocks(paths: np.ndarray, least: int) -> np.ndarray:
    """Numbers of paths as multiples of `least` blocks, 0 where there are none."""
    size = least * LANES
    return (np.ceil(np.minimum(paths, 1e15) / size) * size).astype(np.int64)


# ---------------------------------------------------------------------------------------------------------------------
# Moments from sums over samples, also where all values are equal, or few differ.
# ---------------------------------------------------------------------------------------------------------------------

_CANCELLED = 1e-10  # of the mean square: a variance below has lost its digits


class Spread(NamedTuple):
    """Moments of the values of a quantity, arrays (F,)."""

    mean: np.ndarray
    variance: np.ndarray  #: of a sample; where all are equal an upper bound, 0 where there is none
    third: np.ndarray  #: third central moment
    kurtosis: np.ndarray
    equal: np.ndarray  #: whether all values are equal, and might not be
    unknown: np.ndarray  #: whether their range is infinite, too

    @classmethod
    def of(cls, sums: np.ndarray, paths: int, span: np.ndarray) -> "Spread":
        """The moments from sums (POWERS, F, GROUPS) over some paths, of values that are at most `span` (F,) apart.

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
            variance = np.where(equal, bounded, variance)
            return cls(m1, variance, third, tails, equal & (span > 0.0), equal & np.isinf(span))

    def range_seen(self, paths: int) -> np.ndarray:
        """(F,) an upper bound of the range of the values that were seen, infinity where all are equal.

        |x - m|^4 <= sum of |x - m|^4 = n kurtosis variance^2 for each x.
        """
        with np.errstate(all="ignore"):
            fourth = paths * np.maximum(self.kurtosis, 1.0) * self.variance**2
            return np.where(self.equal | ~(fourth > 0.0), np.inf, 2.0 * fourth**0.25)

    @classmethod
    def along(cls, sums: np.ndarray, paths: int, span: np.ndarray) -> "Spread":
        """The moments along points, whose groups are scrambles: the variance is `paths` times that of their mean."""
        spread = cls.of(sums, paths, span)
        with np.errstate(all="ignore"):
            of_mean = (sums[0] * (GROUPS / np.float64(paths))).var(axis=-1, ddof=1) / GROUPS
            return spread._replace(variance=np.where(spread.equal, spread.variance, paths * of_mean))

    @classmethod
    def together(cls, each: "Sequence[Spread]") -> "Spread":
        """The moments of several path sets, arrays (path sets, F)."""
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


BIAS_SHARE = 0.1  #: of the accuracy, the most that the bias may have where levels are chosen
CHECK_SHARE = 0.15  #: of the accuracy, the standard error with which one step finer is compared
#: Paths of a level at least, in units of its kurtosis: below, its standard error is not to be trusted.
TAILS = 8.0
MOST_TAILS = 2**17
#: The share of the variance of an answer up to which the variance of a level may be uncertain, and the factor by which
#: it may be larger than it seems: a rare value that occurred once may be that much likelier.
_LITTLE, _UNSURE = 1 / 16, 5.0
_RARE = 3.0  # by which a variance of one value among n is as large as where none was seen
#: Levels whose changes bound the bias, counted from the one with the smallest step.
_BOUNDING = 3
_CLEAR = 3.0  # standard errors from which on a mean is resolved
_FALLS = 1 / 8, 1.0  # the least and the most that a variance is assumed to fall from level to level


class Measured(NamedTuple):
    """Estimates of the levels 0, ..., K of a scheme; arrays (K + 1, F), costs (K + 1,); row 0 has no difference."""

    mean: np.ndarray  #: of Y_l
    stderr: np.ndarray
    variance: np.ndarray
    kurtosis: np.ndarray
    value_variance: np.ndarray  #: of P_l
    cost: np.ndarray  #: of a sample of Y_l
    value_cost: np.ndarray
    last: int  #: the last level with samples
    along: np.ndarray  #: (K + 1,) paths of P_l along quasi-random points, 0 where it does not follow them
    value_kurtosis: np.ndarray  #: of P_l
    unseen: np.ndarray  #: samples that there are where all values of Y_l are equal, infinity elsewhere

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
        """The estimates from the moments of Y_l and P_l, arrays (K + 1, F), and the numbers of samples.

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
        unseen = np.where(differences.equal, samples[:, np.newaxis], np.inf)
        unseen[last + 1 :] = unseen[last]
        return cls(
            mean=differences.mean,
            stderr=stderr,
            variance=variance,
            kurtosis=tails,
            value_variance=value_variance,
            cost=cost,
            value_cost=value_cost,
            last=last,
            along=np.asarray(along or [0] * len(cost)),
            value_kurtosis=of_values,
            unseen=unseen,
        )


class Choice(NamedTuple):
    """The levels of an answer."""

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
    count = len(measured.cost)
    t = shares(w, 0, finest, count) - shares(w, 0, finest - 1, count)
    used = np.flatnonzero(t)
    mean, stderr = measured.mean[used], measured.stderr[used]
    return t[used] @ mean, np.sqrt(t[used] ** 2 @ stderr**2)


def order_of(exponents: Sequence[float], levels: int) -> float:
    """The order of R with some levels of extrapolation; 1 where theory states none."""
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
    """The least work by which bias and sampling together stay below the accuracy.

    Of all `allowed` numbers of levels of extrapolation, of all levels, or those of `steps`, and of all largest steps,
    or those of `bases`.  If the bias is too large even at the smallest step, the choice has that.
    """
    steps = steps or range(len(measured.cost) - 1)  # one level more is for the check
    most, choices = max(steps), []
    for levels in allowed:
        if levels and len(exponents) <= levels:
            continue
        for base in bases or [step for step in steps if step < measured.last]:
            for finest in [step for step in steps if step > base + levels]:
                bias = float(bound(measured, exponents, levels, finest, base).max())
                if bias <= BIAS_SHARE * accuracy or finest == most:
                    choice = Choice(levels, base, finest, 0.0, bias)
                    samples = allocation(measured, exponents, choice, accuracy)
                    work = float(np.dot(samples, _costs(measured)))
                    choices.append(choice._replace(work=work if math.isfinite(work) else math.inf))
                    break
    good = [choice for choice in choices if choice.bias <= BIAS_SHARE * accuracy]
    if good:
        return min(good, key=lambda choice: (choice.work, choice.finest))
    return min(choices, key=lambda choice: (choice.bias, choice.work))


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
    check; a level has at least :data:`TAILS` times its kurtosis of paths.  Half of the
    interval has `factor` standard errors.
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
    s[check], allowed = w[0], np.full((count, 1), math.sqrt(_LITTLE) * target)
    allowed[check] = CHECK_SHARE * accuracy
    samples[:count], tails[:count] = _enough(measured, samples[:count], tails[:count], s[:, np.newaxis] / allowed)
    s[check] = 0.0
    used = np.append(s != 0.0, np.zeros(count, bool))
    used[[check, count + choice.base]] = True
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
    """The allocation where the `base` has a power of two of points, of which `there` are computed.

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
    """The order that the means of the finest resolved levels show, if it is not that of theory; None otherwise.

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


# ---------------------------------------------------------------------------------------------------------------------
# The decisions of an answer, and the samples of its pilot.
# ---------------------------------------------------------------------------------------------------------------------

#: The stages: the pilot, a share of the work, the whole of it and more for its checks; and the end.
PILOTING, BEGINNING, WHOLE, DONE = 0, 1, 2, 99

#: The samples of each level of a first glance before the pilot, and the number of its levels, of larger steps.
GLANCE, GLANCE_LEVELS = ROUND * LANES, 4


class Decisions(NamedTuple):
    """Results besides sums over paths, for F functions."""

    seconds: float  #: wall clock, of what needs no paths
    cpu_seconds: float
    stage: int
    wanted: np.ndarray  #: (path sets,) samples
    piloted: int  #: the number of schemes with a pilot
    looked: int  #: whether it is decided if the pilot needs its small steps
    pointed: int  #: whether there is a pilot along quasi-random points
    points: int  #: whether the largest step follows such points
    scheme: int  #: the number of the scheme that was chosen; -1 for the solution without sampling
    levels: int  #: of extrapolation
    base: int  #: the level that is sampled alone
    finest: int
    compared: int  #: level at whose step the reference scheme is compared, 0 before that
    order: float  #: of the bias, where it is not that of theory; NaN else
    aim: float  #: half the width of the interval that is aimed at
    work: float  #: predicted, in seconds of typical speed
    pilot_cpu_seconds: float
    predicted_cpu_seconds: float
    next_cpu_seconds: float  #: of an answer to a tenth of the accuracy
    works: np.ndarray  #: (schemes, 4) predicted work by levels of extrapolation, NaN where it is not predicted
    known: np.ndarray  #: (F,) expectations without sampling, where they are the answer
    known_bound: np.ndarray  #: (F,) of their errors
    solving: int  #: whether it is solved for, one of UNDECIDED, SOLVING and SAMPLING of ``study``
    refined: np.ndarray  #: (refinements, F) expectations without sampling
    uncertain: np.ndarray  #: (refinements, F) the uncertainty of each refinement by itself
    efforts: np.ndarray  #: (refinements,) that each of them took
    solving_seconds: float  #: predicted, of typical speed; NaN before
    sampling_seconds: float

    @classmethod
    def initial(cls, sets: int, functions: int, sampling: bool) -> "Decisions":
        """The pilot of the first scheme is wanted, if anything is sampled."""
        nothing, nan = np.full(functions, np.nan), float("nan")
        wanted = glance(sets) if sampling else np.zeros(sets, np.int64)
        fields: dict[str, Any] = dict.fromkeys(("seconds", "cpu_seconds", "work", "pilot_cpu_seconds"), 0.0)
        fields |= dict.fromkeys(("order", "aim", "predicted_cpu_seconds", "next_cpu_seconds"), nan)
        fields |= dict.fromkeys(("solving_seconds", "sampling_seconds"), nan)
        fields |= dict.fromkeys(("levels", "base", "finest", "scheme", "pointed", "points", "looked", "compared"), 0)
        return cls(
            **fields,
            stage=PILOTING,
            wanted=wanted,
            piloted=1,
            works=np.full((sets // SETS, 4), nan),
            known=nothing,
            known_bound=nothing,
            solving=int(not sampling),
            refined=np.zeros((0, functions)),
            uncertain=np.zeros((0, functions)),
            efforts=np.zeros(0),
        )

    @property
    def set_of_base(self) -> int:
        """The number of the path set with the largest step alone among those of the scheme."""
        return (ALONG if self.points else LEVELS) + self.base

    def with_choice(self, choice: Choice, order: float | None) -> "Decisions":
        """The decisions with other levels."""
        levels, base, finest, work, _ = choice
        order = float("nan") if order is None else order
        return self._replace(levels=levels, base=base, finest=finest, work=work, order=order)


def pilot_of(scheme: int, sets: int) -> np.ndarray:
    """(sets,) the samples of the pilot of a scheme: of differences, and of the largest step alone."""
    wanted = np.zeros(sets, np.int64)
    wanted[scheme * SETS + 1 : scheme * SETS + PILOT_LEVELS + 1] = PILOT_SAMPLES
    wanted[scheme * SETS + LEVELS] = PILOT_SAMPLES
    return wanted


def glance(sets: int) -> np.ndarray:
    """(sets,) the samples of the first steps of the pilot of the first scheme."""
    wanted = np.zeros(sets, np.int64)
    wanted[[*range(1, GLANCE_LEVELS + 1), LEVELS]] = GLANCE
    return wanted
