"""Means, standard errors and orders of convergence, from sums over groups of paths.

Paths fall into GROUPS groups, lane l of block b into group (b mod 8) * 8 + l mod 8, of which only sums are kept, so
that memory does not grow with the number of paths.  Standard errors and intervals come from leaving out one group at a
time (the jackknife), which needs no assumption on how the errors at different step sizes depend on one another: they
share their paths.
"""

from typing import NamedTuple

import numpy as np

from .rng import LANES

#: Paths are summed up in this many groups.
GROUPS = 64
#: A block's lanes go into this many of them, lane mod PARTS; the next block into the next ones.
PARTS = 8
#: A value counts as resolved if it is at least this many standard errors.
RESOLVED = 4.0


class Order(NamedTuple):
    """A fitted order of convergence with its 95 % interval; NaN where fewer than three points are resolved."""

    order: float
    low: float
    high: float
    points: int  #: in the fit


def group_counts(samples):
    """How many of the paths 0, ..., samples - 1 each group has, shape (GROUPS,)."""
    rounds, rest = divmod(samples, GROUPS * PARTS)
    blocks, lanes = divmod(rest, LANES)
    counts = np.full((GROUPS // PARTS, PARTS), rounds * (LANES // PARTS))
    counts[:blocks] += LANES // PARTS
    counts[blocks] += lanes // PARTS + (np.arange(PARTS) < lanes % PARTS)
    return counts.ravel()


def root_mean_square(sums, counts):
    """Root of the mean and its leave-one-out values.

    `sums` (GROUPS, ...) are sums of squares, `counts` (GROUPS,) the numbers of paths.  Returns the root of total sum
    over total count, shape (...), and the same without each group in turn, shape (groups with paths, ...).
    """
    used = counts > 0
    sums, counts = sums[used], counts[used]
    total, n = sums.sum(axis=0), counts.sum()
    rest = (n - counts).reshape(-1, *[1] * total.ndim)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        # the difference of nearly equal sums may round to just below 0
        without = np.sqrt(np.maximum(total - sums, 0.0) / rest) if len(counts) > 1 else np.full_like(sums, np.nan)
        return np.sqrt(total / n), without


def stderr_of_mean(values):
    """Standard error of the mean over the last axis, independent paths; NaN for one path."""
    paths = values.shape[-1]
    with np.errstate(all="ignore"):
        return values.std(axis=-1, ddof=1) / np.sqrt(paths) if paths > 1 else np.full(values.shape[:-1], np.nan)


def jackknife_stderr(value, without, counts):
    """Standard error of `value` (...) from its leave-one-out values (groups, ...), for groups of unequal size.

    With weights w_g = n / n_g: sqrt(1/G sum_g (p_g - mean)^2 / (w_g - 1)) of the pseudo-values
    p_g = w_g value - (w_g - 1) without_g (Busing, Meijer and van der Leeden, Statistics and Computing 9, 1999).
    NaN for fewer than two groups; inf or NaN where a value is not finite.
    """
    counts = counts[counts > 0]
    if len(counts) < 2:
        return np.full(np.shape(value), np.nan)
    w = (counts.sum() / counts).reshape(-1, *[1] * np.ndim(value))
    with np.errstate(invalid="ignore", over="ignore"):
        pseudo = w * value - (w - 1.0) * without
        return np.sqrt(np.mean((pseudo - (pseudo / w).sum(axis=0)) ** 2 / (w - 1.0), axis=0))


def is_resolved(value, stderr):
    """Whether a value stands clear of its standard error."""
    with np.errstate(invalid="ignore"):
        return np.isfinite(value) & np.isfinite(stderr) & (value > 0.0) & (value >= RESOLVED * stderr)


def samples_needed(value, stderr, samples):
    """About how many samples would resolve a value that `samples` did not; NaN if that cannot be said."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return samples * (RESOLVED * stderr / value) ** 2


def fit_order(h, value, without, counts, use, reference_step=0.0):
    """Order p of value = C h^p, by least squares in logarithms through the points `use`, with its 95 % interval.

    The values are distances from a reference of the same scheme at step h_ref and lack the reference's own error, which
    makes a plain slope too steep (for steps from 8 to 2048 h_ref by 0.01 for p = 1/2).  If the two errors are
    independent, as they are for p = 1/2, C h^p is value / (1 - r^(2p))^(1/2) with r = h_ref/h; if p = 1 and they are
    proportional along each path, it is value / (1 - r).  The order is the middle of the slopes of the former and of
    value / (1 - r)^p, which for p = 1/2 are the same, and the interval covers both.

    The interval is, besides, the wider of two of Student's: from the jackknife, for the sampling, and from the scatter
    of the points about the line, for what is no power of h.  As long as the points bend by more than sampling can
    explain (at 95 %), the largest step is not yet asymptotic and is left out, down to four points.  `value` has shape
    (steps,), `without` (groups, steps).
    """
    from scipy.special import stdtrit  # not needed to start the program

    use = np.flatnonzero(use)
    student = stdtrit(np.count_nonzero(counts) - 1, 0.975)
    while len(use) > 4:
        bend, stderr = _coefficient(2, h[use] - reference_step, value[use], without[:, use], counts)
        if not abs(bend) > stderr * student + 1e-9:  # false for NaN
            break
        use = np.delete(use, np.argmax(h[use]))
    n = len(use)
    if n < 3:
        return Order(np.nan, np.nan, np.nan, n)
    plain, stderr = _coefficient(1, h[use], value[use], without[:, use], counts)
    r = reference_step / h[use]
    low = high = plain
    for _ in range(20):  # contractions by a factor of about 0.02
        low = plain - _slope(h[use], np.log(1.0 - r) * max(low, 0.0))
        high = plain - _slope(h[use], 0.5 * np.log(1.0 - r ** (2.0 * max(high, 0.01))))
    order = 0.5 * (low + high)
    x, y = _centred(np.log(h[use])), _centred(np.log(value[use]) - 0.5 * np.log(1.0 - r ** (2.0 * max(high, 0.01))))
    scatter = np.sqrt(((y - high * x) ** 2).sum() / (n - 2) / (x @ x))
    half = float(np.maximum(stderr * student, scatter * stdtrit(n - 2, 0.975)) + 0.5 * abs(high - low))
    return Order(order, order - half, order + half, n)


class Largest(NamedTuple):
    """The largest of several errors at each step size."""

    which: np.ndarray  #: (steps,) the number of the largest
    value: np.ndarray  #: (steps,) without its sign
    stderr: np.ndarray  #: (steps,)
    resolved: np.ndarray  #: (steps,)
    order: Order


def largest_over(h, errors, withouts):
    """The largest of the absolute values of errors (n, steps) at each step size, and its order of convergence.

    `withouts` (n, groups, steps) are their leave-one-out values, of groups as large as one another.  Those of the
    largest are taken for its own, as if it were known beforehand which one is the largest.  What is not a number counts
    as larger than all numbers.
    """
    sizes, steps = np.abs(errors), np.arange(len(h))
    which = np.argmax(sizes, axis=0)
    value, without = sizes[which, steps], np.abs(withouts)[which, :, steps].T
    counts = np.full(len(without), PARTS)
    stderr = jackknife_stderr(value, without, counts)
    resolved = is_resolved(value, stderr)
    return Largest(which, value, stderr, resolved, fit_order(h, value, without, counts, resolved))


class WorkCurve(NamedTuple):
    """Errors of one scheme and what they cost at each step size; all arrays have shape (steps,)."""

    h: np.ndarray
    error: np.ndarray  #: without its sign, not finite where paths were lost
    half: np.ndarray  #: half the 95 % interval of the error, or the bound of its numerical error
    resolved: np.ndarray
    seconds: np.ndarray  #: for one path
    low: np.ndarray  #: the 95 % interval of the seconds
    high: np.ndarray


class WorkPoint(NamedTuple):
    """What a scheme needs to reach a requested error."""

    seconds: float  #: for one path
    low: float  #: its 95 % interval
    high: float
    h: float  #: the step size
    at_most: bool = False  #: whether a larger step than those run might do, so that all of this is an upper bound


class Factor(NamedTuple):
    """How many times as long another scheme takes, with its 95 % interval."""

    value: float
    low: float  #: 0 if the other might need less time than is known
    high: float  #: infinite if the cheapest might

    @property
    def tie(self):
        """Whether it may as well be the other way round."""
        return self.low <= 1.0 <= self.high


def interval_of_median(median, low, high, repeats):
    """The 95 % interval of a median of times whose quartiles are `low` and `high`, all of shape (...).

    The median of n normal values has the standard deviation 1.253 n^(-1/2), and their quartiles are 1.349 apart: hence
    the half width 1.82 n^(-1/2) ln(high / low) in logarithms, times 1 + 4/n because few values know their quartiles
    badly (fitted to simulations; at n = 5 about 90 % are reached).  The interval contains the quartiles themselves, for
    what slows a machine down lasts longer than one repeat.
    """
    n = max(repeats, 1)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        factor = (high / low) ** (1.82 / np.sqrt(n) * (1.0 + 4.0 / n))
        return np.minimum(low, median / factor), np.maximum(high, median * factor)


def work_for(target, curve):
    """Seconds per path at which a scheme reaches the error `target`; None if at no step size that was run.

    Between neighbours a and b with error_a > target >= error_b it is a power of the error: with the weight
    w = ln(error_a / target) / ln(error_a / error_b), ln s = (1 - w) ln s_a + w ln s_b, and likewise the step size.
    Errors need not fall from step to step: b is the largest step from which on, towards smaller ones, all are at most
    `target`, and error_b is the largest of these, so that no luck is rewarded.  Points that are not resolved are passed
    over, unless their whole interval lies above `target`.  If there is no a, or none with a finite error, b itself is
    an upper bound.

    The interval of ln s has the half widths ((k e)^2 + t^2)^(1/2).  Its slope is k = ln(s_b / s_a) / ln(error_a /
    error_b), e = (1 - w) half_a / error_a + w half_b / error_b is as for errors that depend on one another, as they do
    if they share their paths, and t is the same mean of the logarithmic distances from s to the ends of its interval.
    """
    curve = WorkCurve(*(np.asarray(values)[np.argsort(curve.h)] for values in curve))
    usable = curve.resolved.astype(bool) & (curve.error > 0) & (curve.seconds > 0)
    usable &= np.isfinite(curve.error) & np.isfinite(curve.half) & np.isfinite(curve.seconds)
    certain = curve.resolved.astype(bool) | ~np.isfinite(curve.half)
    against = ~(curve.error - np.where(certain, 0.0, curve.half) <= target)  # of nan as well
    first = int(np.argmax(against)) if against.any() else len(against)
    met = np.flatnonzero(usable[:first])
    if not len(met):
        return None
    b = met[-1]
    if first == len(against) or not usable[first]:
        ends = (float(values[b]) for values in (curve.seconds, curve.low, curve.high, curve.h))
        return WorkPoint(*ends, at_most=True)
    pair, worst = np.array([first, b]), np.array([first, met[np.argmax(curve.error[met])]])
    errors, logs = curve.error[worst], np.log(curve.seconds[pair])
    weight = np.log(errors[0] / target) / np.log(errors[0] / errors[1])
    weights = np.array([1.0 - weight, weight])
    slope = (logs[1] - logs[0]) / np.log(errors[0] / errors[1])
    spread = slope * (weights @ (curve.half[worst] / errors))
    with np.errstate(divide="ignore", over="ignore"):
        down, up = (weights @ np.abs(logs - np.log(ends[pair])) for ends in (curve.low, curve.high))
        ends = np.exp(weights @ logs + np.array([0.0, -np.hypot(spread, down), np.hypot(spread, up)]))
    return WorkPoint(*ends.tolist(), h=float(np.exp(weights @ np.log(curve.h[pair]))))


def time_factor(one, other):
    """How many times the time of the work point `one` the work point `other` takes.

    The two are taken for independent of one another: the logarithmic distances to the ends of their intervals are added
    in squares.  Where the time of `other` is an upper bound the factor may be anything below, and the other way round.
    """
    value = other.seconds / one.seconds
    with np.errstate(divide="ignore", over="ignore"):
        down = np.hypot(np.log(other.seconds / np.float64(other.low)), np.log(one.high / np.float64(one.seconds)))
        up = np.hypot(np.log(other.high / np.float64(other.seconds)), np.log(one.seconds / np.float64(one.low)))
        low = 0.0 if other.at_most else float(value * np.exp(-down))
        high = np.inf if one.at_most else float(value * np.exp(up))
    return Factor(value, low, high)


def cheapest(works):
    """Which scheme needs the least time, and the :class:`Factor` of each of the others, from the cheapest on.

    `works` are work points by name, None where a scheme does not reach the error.  Returns a name, None if no scheme
    reaches it, and a dictionary; the first of its factors says whether the cheapest is clear of the second.
    """
    reached = sorted((point.seconds, name) for name, point in works.items() if point is not None)
    if not reached:
        return None, {}
    (_, best), *others = reached
    return best, {name: time_factor(works[best], works[name]) for _, name in others}


def _centred(x):
    return x - x.mean()


def _slope(h, y):
    x = _centred(np.log(h))
    return float(y @ x / (x @ x))


def _coefficient(degree, h, value, without, counts):
    """Leading coefficient of the polynomial in ln(h) that fits ln(value), and its jackknife standard error."""
    weights = np.linalg.pinv(np.vander(_centred(np.log(h)), degree + 1))[0]
    coefficient = float(np.log(value) @ weights)
    with np.errstate(divide="ignore", invalid="ignore"):
        return coefficient, float(jackknife_stderr(coefficient, np.log(without) @ weights, counts))
