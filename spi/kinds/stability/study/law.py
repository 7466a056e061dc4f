"""Expectations at the final time against their true values."""

import functools
import time
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from spi.ensemble.protocol import dimension
from spi.exact.kolmogorov import can_solve_equation, exact_expectations
from spi.expressions import canonical, functions_of

from ..results import Law

if TYPE_CHECKING:
    from . import StabilityPlan

#: What the true expectations take for one value, on one thread.
TRUTH_SECONDS = 3.0

_ACCURACY = 1e-3  # numerical error that they may have


def has_truth(p: "StabilityPlan") -> bool:
    """Whether there are test functions, and their true expectations can be found without a scheme."""
    return bool(p.functions) and can_solve_equation(p.first.model)


@functools.lru_cache(maxsize=256, typed=True)
def _truth(
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


def unknown_truth(p: "StabilityPlan") -> Truth:
    """Nothing is known."""
    unknown = np.full((len(p.points), len(p.functions)), np.nan)
    return Truth(0.0, unknown, unknown)


def with_truth(p: "StabilityPlan", known: Truth, i: int) -> Truth:
    """What is known, with the true expectations of value number i."""
    began = time.perf_counter()
    truth, bound = known.truth.copy(), known.truth_bound.copy()
    point = p.points[i]
    truth[i], bound[i] = _truth(point.model, point.initial, p.case.final_time, tuple(map(canonical, p.functions)))
    return Truth(known.seconds + time.perf_counter() - began, truth, bound)


def law(names: tuple[str, ...], mean: np.ndarray, stderr: np.ndarray, known: Truth) -> Law:
    """Expectations of the test functions, of shape (values, levels, F), and how far from the truth they are."""
    truth, bound = known.truth, known.truth_bound
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
