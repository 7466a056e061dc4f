"""Expectations at all steps by the levels of a multilevel estimator, and how exactly they are known."""

from typing import Any

import numpy as np

from spi.statistics.estimators import jackknife_stderr
from spi.statistics.powers import standard_deviation

from .levels import VALUE
from .sums import EQUAL, LevelSums


def expectations(p: Any, levels: LevelSums) -> tuple[np.ndarray, dict[str, Any]]:
    """E phi at all steps: at the largest one from the last level, at the others by the differences between levels.

    Beside it the fields of Sampled that state its uncertainty.
    """
    h, coarse, moments = np.array(p.case.steps), p.coarse, levels.moments()
    last, variances = _variance_of_base(p, levels), moments.stderr[:-1] ** 2
    fine, square = levels.means_of_powers()[VALUE][:2, -1]
    differences = p.combination.errors(moments.mean[:-1])
    largest = differences[:, :1]
    if p.part.extrapolate:
        to_reference, to_steps = p.combination.shares_above()
        largest = (to_reference * moments.mean[:-1].T).sum(axis=1, keepdims=True)
        spread = np.sqrt(last + (to_steps[..., np.newaxis] ** 2 * variances).sum(axis=1)).T
    else:
        above = [(coarse > step) & (coarse <= h[0]) for step in h]  # levels between the largest step and this one
        spread = np.array([np.sqrt(last + variances[used].sum(axis=0)) for used in above]).T
    return moments.mean[-1][:, np.newaxis] - largest + differences, {
        "expectation_stderr": spread,
        "reference": moments.mean[-1] - largest[:, 0],
        "sd": standard_deviation(fine, square),
    }


def base_gain(p: Any, levels: LevelSums) -> np.ndarray | None:
    """(F,) the variance of the mean at the largest step by independent samples over that by points, if these are."""
    if not p.scrambled:
        return None
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(levels.moments().stderr[-1] ** 2 / _variance_of_base(p, levels))


def _variance_of_base(p: Any, levels: LevelSums) -> np.ndarray:
    """(F,) of the mean at the largest step; along points over the scrambles, which are the groups."""
    if not p.scrambled:
        return np.asarray(levels.moments().stderr[-1] ** 2)
    mean, without = levels.averages()
    return np.asarray(jackknife_stderr(mean[-1], without[:, -1], EQUAL) ** 2)
