"""Intervals with their nominal coverage: of shares, of events never seen, from few groups, and of skewed means."""

from typing import Any

import numpy as np

from spi.numerics.types import Array

from ..numerics.groups import filled_groups
from ..storage.records import CONFIDENCE, INTERVAL, student


def zero_share_bound(samples: Any, confidence: float = CONFIDENCE) -> Any:
    """Largest share that gives none in n independent samples with probability 1 - confidence or more.

    1 - (1 - confidence)^(1/n), about 3/n at 95 %: the exact rule of three.
    """
    with np.errstate(divide="ignore"):
        return -np.expm1(np.log1p(-confidence) / np.asarray(samples, float))


def clopper_pearson(count: Any, samples: Any, confidence: float = CONFIDENCE) -> tuple[Array, Array]:
    """(low, high) of a share of which `count` of `samples` paths are, arrays of their common shape.

    The interval of Clopper and Pearson (Biometrika 26, 1934): the truth is below it with probability (1 - confidence)/2
    at most, and above it likewise, whatever it is.  NaN for counts that are no numbers, and without samples.
    """
    from scipy.special import betaincinv  # not needed to start the program

    k, n = np.broadcast_arrays(np.asarray(count, float), np.asarray(samples, float))
    tail = 0.5 * (1.0 - confidence)
    low = np.where(k > 0, betaincinv(np.maximum(k, 1.0), n - k + 1.0, tail), 0.0)
    high = np.where(k < n, betaincinv(k + 1.0, np.maximum(n - k, 1.0), 1.0 - tail), 1.0)
    valid = np.isfinite(k) & (n > 0)
    return np.where(valid, low, np.nan), np.where(valid, high, np.nan)


def student_factor(groups: int, confidence: float = CONFIDENCE) -> float:
    """Half the width of an interval in standard errors estimated from `groups` groups; NaN for fewer than two."""
    return float(student(groups - 1, confidence))


def student_of_paths(samples: int, least: int = 2) -> float:
    """:func:`student_factor` of the jackknife groups that `samples` paths fill; NaN if these are fewer than `least`."""
    groups = filled_groups(samples)
    return student_factor(groups) if groups >= least else float("nan")


def order_statistics(samples: int, level: float, confidence: float = CONFIDENCE) -> tuple[int, int]:
    """(low, high): the low-th and the high-th smallest of `samples` values enclose the quantile of this level.

    By the binomial law of how many values lie below it, with at most (1 - confidence) / 2 on either side.  0 or
    samples + 1 where there is no such value.
    """
    from scipy.special import bdtr

    tail = 0.5 * (1.0 - confidence)

    def first(probability: float) -> int:
        """Smallest k such that k values or fewer lie below with this probability or more."""
        low, high = -1, samples
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (low, middle) if bdtr(middle, samples, level) >= probability else (middle, high)
        return high

    return first(tail), first(1.0 - tail) + 1


def skewed_half_width(stderr: np.ndarray, third: np.ndarray, degrees: np.ndarray) -> np.ndarray:
    """Half the width of a 95 % interval about a mean, symmetric, that holds though the mean may be skewed.

    The standard error times Student's factor for its `degrees` of freedom, plus the shift by the third cumulant of the
    mean, |third| (1 + 2 * 1.96^2) / (6 stderr^2) (Johnson, Journal of the American Statistical Association 73, 1978).
    For k of many values that are 1, the others 0, the upper end is that of Clopper and Pearson within 3 % from k = 2
    on.
    """
    degrees = np.maximum(np.nan_to_num(degrees, nan=np.inf, posinf=1e9), 1.0)
    with np.errstate(all="ignore"):
        shift = np.where(stderr > 0.0, np.abs(third) / stderr**2, 0.0) * (1.0 + 2.0 * INTERVAL**2) / 6.0
        return np.asarray(student(degrees) * stderr + np.nan_to_num(shift))
