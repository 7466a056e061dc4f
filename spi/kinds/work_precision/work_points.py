"""The cost of a requested error: the step size and the time at which a scheme reaches it."""

from typing import NamedTuple

import numpy as np


class WorkCurve(NamedTuple):
    """Errors of one scheme and what they cost at each step size; all arrays have shape (steps,)."""

    h: np.ndarray
    error: np.ndarray  #: without its sign, not finite where paths diverged
    half: np.ndarray  #: half the 95 % interval of the error, or the bound of its numerical error
    resolved: np.ndarray
    seconds: np.ndarray  #: for one path
    low: np.ndarray  #: the 95 % interval of the seconds
    high: np.ndarray


class WorkPoint(NamedTuple):
    """The time and the step size at which a scheme reaches a requested error."""

    seconds: float  #: for one path
    low: float  #: its 95 % interval
    high: float
    h: float  #: the step size
    at_most: bool = False  #: whether a larger step than those run might do, so that the time is an upper bound


class Factor(NamedTuple):
    """The time of another scheme over that of the cheapest, with its 95 % interval."""

    value: float
    low: float  #: 0 where the time of the other is an upper bound
    high: float  #: infinite where that of the cheapest is one

    @property
    def tie(self) -> bool:
        """Whether it may as well be the other way round."""
        return self.low <= 1.0 <= self.high


def interval_of_median(
    median: np.ndarray, low: np.ndarray, high: np.ndarray, repeats: int
) -> tuple[np.ndarray, np.ndarray]:
    """The 95 % interval of a median of times whose quartiles are `low` and `high`, all of shape (...).

    The median of n normal values has the standard deviation 1.253 n^(-1/2), and their quartiles are 1.349 apart: hence
    the half width 1.82 n^(-1/2) ln(high / low) in logarithms, times 1 + 4/n because quartiles of few values are
    uncertain (fitted to simulations; at n = 5 about 90 % are reached).  The interval contains the quartiles themselves,
    for slow phases of a machine last longer than one repeat.
    """
    n = max(repeats, 1)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        factor = (high / low) ** (1.82 / np.sqrt(n) * (1.0 + 4.0 / n))
        return np.minimum(low, median / factor), np.maximum(high, median * factor)


def work_for(target: float, curve: WorkCurve) -> WorkPoint | None:
    """Seconds per path at which a scheme reaches the error `target`; None if at no step size that was run.

    Between neighbours a and b with error_a > target >= error_b it is a power of the error: with the weight
    w = ln(error_a / target) / ln(error_a / error_b), ln s = (1 - w) ln s_a + w ln s_b, and likewise the step size.
    Errors need not fall from step to step: b is the largest step from which on, towards smaller ones, all are at most
    `target`, and error_b is the largest of these, so that no luck is rewarded.  A point that is not resolved counts
    with the upper end of its interval, and is passed over where that lies above `target` and the lower end does not.
    If there is no a, or none with a finite error, b itself is an upper bound.

    The interval of ln s has the half widths ((k e)^2 + t^2)^(1/2).  Its slope is k = ln(s_b / s_a) / ln(error_a /
    error_b), e = (1 - w) half_a / error_a + w half_b / error_b is as for errors that depend on one another, as they do
    if they share their paths, and t is the same mean of the logarithmic distances from s to the ends of its interval.
    """
    curve = WorkCurve(*(np.asarray(values)[np.argsort(curve.h)] for values in curve))
    resolved = curve.resolved.astype(bool)
    against = ~(curve.error - np.where(resolved | ~np.isfinite(curve.half), 0.0, curve.half) <= target)  # of nan too
    curve = curve._replace(error=np.where(resolved, curve.error, curve.error + curve.half))
    usable = (resolved | (curve.error <= target)) & (curve.error > 0) & (curve.seconds > 0)
    usable &= np.isfinite(curve.error) & np.isfinite(curve.half) & np.isfinite(curve.seconds)
    first = int(np.argmax(against)) if against.any() else len(against)
    met = np.flatnonzero(usable[:first])
    if not len(met):
        return None
    b = met[-1]
    if first == len(against) or not usable[first]:
        seconds, low, high, h = (float(values[b]) for values in (curve.seconds, curve.low, curve.high, curve.h))
        return WorkPoint(seconds, low, high, h, at_most=True)
    pair, worst = np.array([first, b]), np.array([first, met[np.argmax(curve.error[met])]])
    errors, logs = curve.error[worst], np.log(curve.seconds[pair])
    weight = np.log(errors[0] / target) / np.log(errors[0] / errors[1])
    weights = np.array([1.0 - weight, weight])
    slope = (logs[1] - logs[0]) / np.log(errors[0] / errors[1])
    spread = slope * (weights @ (curve.half[worst] / errors))
    with np.errstate(divide="ignore", over="ignore"):
        down, up = (weights @ np.abs(logs - np.log(ends[pair])) for ends in (curve.low, curve.high))
        interval = weights @ logs + np.array([0.0, -np.hypot(spread, down), np.hypot(spread, up)])
        seconds, low, high = np.exp(interval).tolist()
    return WorkPoint(seconds, low, high, float(np.exp(weights @ np.log(curve.h[pair]))))


def time_factor(best: WorkPoint, other: WorkPoint) -> Factor:
    """The time of the work point `other` over that of `best`.

    The two are taken for independent of one another: the logarithmic distances to the ends of their intervals are added
    in squares.  Where the time of `other` is an upper bound the factor may be anything below, and the other way round.
    """
    value = other.seconds / best.seconds
    with np.errstate(divide="ignore", over="ignore"):
        down = np.hypot(np.log(other.seconds / np.float64(other.low)), np.log(best.high / np.float64(best.seconds)))
        up = np.hypot(np.log(other.high / np.float64(other.seconds)), np.log(best.seconds / np.float64(best.low)))
        low = 0.0 if other.at_most else float(value * np.exp(-down))
        high = np.inf if best.at_most else float(value * np.exp(up))
    return Factor(value, low, high)


def cheapest(works: dict[str, WorkPoint | None]) -> tuple[str | None, dict[str, Factor]]:
    """The scheme that needs the least time, and the :class:`Factor` of each of the others, from the cheapest on.

    `works` are work points by name, None where a scheme does not reach the error.  Returns a name, None if no scheme
    reaches it, and a dictionary; the first of its factors says whether the cheapest is clear of the second.
    """
    reached = {name: point for name, point in works.items() if point is not None}
    if not reached:
        return None, {}
    best, *others = sorted(reached, key=lambda name: (reached[name].seconds, name))
    return best, {name: time_factor(reached[best], reached[name]) for name in others}
