"""What is rounding: one rule for differences that theory says are 0, of every kind of experiment.

A step rounds a number of size s by about 2^-53 s, and roundings of n steps add up like a random walk.  A difference of
two such numbers that is at most

    8 (1 + sqrt(n)) 2^-52 s

is *exact up to rounding*: it has no order, no standard error, no autocorrelation time and no quantiles, and no claim
about such a number is contradicted or confirmed.  Measured roundings are 2 to 8 times smaller.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

Array = np.ndarray

EPSILON = 2.0**-52
MULTIPLE = 8.0  #: of EPSILON, the size and 1 + sqrt(n)
_NUDGE = 2.0**-20  # relative, of components: far above rounding, far below 1
_NUDGES = 4  # patterns of signs


def rounding(size: Any, steps: Any = 0) -> Array:
    """The largest difference of numbers of this size, after so many steps, that counts as rounding."""
    return MULTIPLE * (1.0 + np.sqrt(steps)) * EPSILON * np.asarray(size, float)


def is_rounding(difference: Any, size: Any, steps: Any = 0) -> Array:
    """Whether differences of numbers of this size, after so many steps, are rounding; not of NaN and infinity."""
    with np.errstate(invalid="ignore"):
        return np.asarray(np.abs(difference) <= rounding(size, steps))


def size_of(state: Sequence[float]) -> float:
    """The size of a state for :func:`rounding`: its length, or 1 of the state 0, whose components become as large."""
    length = math.hypot(*state)
    return length if 0.0 < length < math.inf else 1.0


def size_of_values(function: Callable[[Array], Array], state: Sequence[float]) -> float:
    """The size for :func:`rounding` of the values f(y) of a function (d, n) -> (n,) near a state.

    |f(y)|, or sum_i |y_i df/dy_i| where this is larger, as it is of H - H_0: relative roundings of y change f by that
    times their size.  The sum is estimated from the largest change by components moved up or down at random.
    """
    y = np.asarray(state, float)[:, np.newaxis]
    signs = np.where(np.random.default_rng(0).random((len(y), _NUDGES)) < 0.5, -1.0, 1.0)
    signs[:, 0] = 1.0
    with np.errstate(all="ignore"):
        values = np.asarray(function(np.concatenate([y, y * (1.0 + _NUDGE * signs)], axis=1)), float)
        sizes = np.append(np.abs(values[:1]), np.abs(values[1:] - values[0]) / _NUDGE)
    return float(np.max(sizes[np.isfinite(sizes)], initial=0.0))


def exact_text(largest: float) -> str:
    """``exact up to rounding (6e-16)``, with the largest of the differences."""
    return f"exact up to rounding ({largest:.0e})".replace("e-0", "e-") if largest else "exact"
