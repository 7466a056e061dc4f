"""How the levels of a multilevel estimator make errors, extrapolated or not, and expectations."""

from typing import Any, NamedTuple

import numpy as np

from spi.statistics.estimators import GROUPS, jackknife_stderr
from spi.statistics.intervals import student_factor
from spi.statistics.powers import standard_deviation
from spi.statistics.richardson import Extrapolation

from .levels import VALUE
from .sums import EQUAL, LevelSums


class Combination(NamedTuple):
    """Errors at S steps as sums of the differences of levels.

    With d_l = E phi at 2^(l+1) h_ref minus E phi at 2^l h_ref the error of the step 2^k h_ref, measured against h_ref,
    is d_0 + ... + d_(k-1).  An extrapolated error is R(h) - R(h_ref), R(h) = sum_i w_i E phi(y_{2^i h}), hence another
    sum of the same differences.
    """

    extrapolation: Extrapolation
    below: np.ndarray  #: for each step of the case how many levels lie between it and the reference step

    def errors(self, differences: np.ndarray) -> np.ndarray:
        """The errors (..., F, S) against the reference that differences (..., levels, F) of the levels make."""
        sums = np.moveaxis(np.cumsum(differences, axis=-2), -2, -1)  # of the steps 2 h_ref, 4 h_ref, ...
        count, weights = self.extrapolation.levels, self.extrapolation.weights
        errors = self.extrapolation.combined(sums[..., self.below - 1])
        return errors - (sums[..., :count] * weights[1:]).sum(axis=-1, keepdims=True) if count else errors

    def shares(self) -> np.ndarray:
        """(S, levels) how much of each difference is in the error at each step; 1 or 0 without extrapolation."""
        level = np.arange(self.below.max())
        return self.extrapolation.combined((level[:, np.newaxis] < self.below) * 1.0).T - self._of_reference()

    def shares_above(self) -> tuple[np.ndarray, np.ndarray]:
        """Shares of the differences in E phi at the largest step less R(h_ref), (levels,), or R(h), (S, levels)."""
        whole = 1.0 - self._of_reference()
        return whole, whole - self.shares()

    def _of_reference(self) -> np.ndarray:
        """(levels,) how much of each difference is in R(h_ref) - E phi(y_{h_ref})."""
        return np.array([self.extrapolation.weights[level + 1 :].sum() for level in range(self.below.max())])


def expectations(p: Any, levels: LevelSums) -> tuple[np.ndarray, dict[str, Any]]:
    """E phi at all steps: at the largest one from the last level, at the others by the differences between levels.

    Beside it the fields of Sampled that state its uncertainty.
    """
    h, coarse, moments = np.array(p.case.steps), p.coarse, levels.moments()
    lacking = (p.unseen_levels(levels) / student_factor(GROUPS)) ** 2
    last, variances = _variance_of_base(p, levels) + lacking[-1], moments.stderr[:-1] ** 2 + lacking[:-1]
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
