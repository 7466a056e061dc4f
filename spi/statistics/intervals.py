"""Intervals that hold where few samples differ: shares that were not seen, few degrees of freedom, and skewness."""

import numpy as np

from ..storage.records import INTERVAL


def zero_share_bound(samples: np.ndarray | float, confidence: float = 0.95) -> np.ndarray:
    """The largest share of which `samples` independent samples all miss with a probability above 1 - confidence.

    1 - (1 - confidence)^(1/n), about 3/n at 95 %, the rule of three; 1 for no samples.
    """
    with np.errstate(divide="ignore"):
        return np.asarray(-np.expm1(np.log1p(-confidence) / np.asarray(samples, float)))


def skewed_half_width(stderr: np.ndarray, third: np.ndarray, degrees: np.ndarray) -> np.ndarray:
    """Half the width of a 95 % interval about a mean, symmetric, that holds though the mean may be skewed.

    Student's factor for the `degrees` of freedom of the standard error, times that, and what the third cumulant of
    the mean shifts: |third| (1 + 2 * 1.96^2) / (6 stderr^2) (Johnson, Journal of the American Statistical Association
    73, 1978).  For k of many that are 1, the others 0, the upper end is that of Clopper and Pearson within 3 % from
    k = 2 on.
    """
    from scipy.special import stdtrit  # not needed to start the program

    degrees = np.maximum(np.nan_to_num(degrees, nan=np.inf, posinf=1e9), 1.0)
    with np.errstate(all="ignore"):
        shift = np.where(stderr > 0.0, np.abs(third) / stderr**2, 0.0) * (1.0 + 2.0 * INTERVAL**2) / 6.0
        return np.asarray(stdtrit(degrees, 0.975) * stderr + np.nan_to_num(shift))
