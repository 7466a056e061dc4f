"""Expectations at the final time against their true values."""

import functools
from typing import Any, NamedTuple

import numpy as np

from spi.ensemble.protocol import dimension
from spi.exact.kolmogorov import exact_expectations
from spi.expressions import functions_of

from ..results import Law

#: What the true expectations take for one value, on one thread.
TRUTH_SECONDS = 3.0

_ACCURACY = 1e-3  # numerical error that they may have


@functools.lru_cache(maxsize=256, typed=True)
def true_expectations(
    model: Any, initial: tuple[float, ...], final_time: float, functions: tuple[str, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """E phi(y(T)) and its numerical error, (F,) each; kept, because it is the same for all schemes.

    Typed, because models of two classes may be equal tuples.
    """
    return exact_expectations(model, initial, final_time, functions_of(functions, dimension(model)), _ACCURACY)


class Truth(NamedTuple):
    """True expectations of F test functions for each value."""

    seconds: float  #: wall clock
    truth: np.ndarray  #: (values, F), NaN until they are known
    truth_bound: np.ndarray  #: (values, F), their numerical error

    def law(self, names: tuple[str, ...], mean: np.ndarray, stderr: np.ndarray) -> Law:
        """Expectations of the test functions, of shape (values, levels, F), and how far from the truth they are."""
        truth, bound = self.truth, self.truth_bound
        with np.errstate(invalid="ignore"):
            away = np.abs(mean - truth[:, None])
            away = np.where(np.isfinite(truth)[:, None] & np.isnan(away), np.inf, away)
        farthest = np.argmax(np.nan_to_num(away, nan=-1.0, posinf=np.inf), axis=2)[..., None]
        doubt = np.hypot(stderr, bound[:, None])
        return Law(
            names=names,
            expectation=mean,
            expectation_stderr=stderr,
            truth=truth,
            truth_bound=bound,
            distance=np.take_along_axis(away, farthest, 2)[..., 0],
            distance_stderr=np.take_along_axis(doubt, farthest, 2)[..., 0],
        )
