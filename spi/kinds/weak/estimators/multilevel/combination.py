"""How the differences between levels of a multilevel estimator make errors, extrapolated or not."""

from typing import NamedTuple

import numpy as np

from spi.statistics.richardson import Extrapolation


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
