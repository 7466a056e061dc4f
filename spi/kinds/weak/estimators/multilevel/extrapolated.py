"""How the differences between levels of a multilevel estimator make errors, extrapolated or not.

With d_l = E phi at 2^(l+1) h_ref minus E phi at 2^l h_ref the error of the step 2^k h_ref, measured against h_ref, is
d_0 + ... + d_(k-1).  An extrapolated error is R(h) - R(h_ref), R(h) = sum_i w_i E phi(y_{2^i h}), hence another sum of
the same differences.
"""

from typing import Any

import numpy as np

from ...study.fields import extrapolation


def errors_at_steps(p: Any, differences: np.ndarray) -> np.ndarray:
    """The errors (..., F, S) against the reference that differences (..., levels, F) of the levels make."""
    sums = np.moveaxis(np.cumsum(differences, axis=-2), -2, -1)  # of the steps 2 h_ref, 4 h_ref, ...
    combine = extrapolation(p)
    errors = combine.combined(sums[..., _levels_below(p) - 1])
    if not combine.levels:
        return errors
    return errors - (sums[..., : combine.levels] @ combine.weights[1:])[..., np.newaxis]


def shares(p: Any) -> np.ndarray:
    """(S, levels) how much of each difference is in the error at each step; 1 or 0 without extrapolation."""
    below, level, combine = _levels_below(p), np.arange(_count(p)), extrapolation(p)
    return combine.combined((level[:, np.newaxis] < below) * 1.0).T - _of_reference(p)


def shares_above(p: Any) -> tuple[np.ndarray, np.ndarray]:
    """How much of each difference is in E phi at the largest step less R(h_ref), (levels,), or R(h), (S, levels)."""
    whole = 1.0 - _of_reference(p)
    return whole, whole - shares(p)


def _count(p: Any) -> int:
    """How many levels are differences."""
    return round(np.log2(max(p.case.steps) / p.case.reference_step))


def _levels_below(p: Any) -> np.ndarray:
    """For each step of the case how many levels lie between it and the reference step."""
    return np.array([round(np.log2(h / p.case.reference_step)) for h in p.case.steps])


def _of_reference(p: Any) -> np.ndarray:
    """(levels,) how much of each difference is in R(h_ref) - E phi(y_{h_ref})."""
    weights = extrapolation(p).weights
    return np.array([weights[level + 1 :].sum() for level in range(_count(p))])
