"""What is rounding: one rule for differences that are 0 but for it, of every kind of experiment.

A step rounds a number of size s by about 2^-53 s, and the roundings of n steps add up like a random walk.  A difference
of two such numbers, or a standard deviation of them, that is at most

    8 (1 + sqrt(n)) 2^-52 s

is *exact up to rounding*: it has no order, no correlation time and no quantiles, and half its interval is that
bound, so that it is resolved nowhere and no claim about its order is judged.  Strong errors of a scheme that is exact,
after n = 2^12 steps, are 7 to 10 times smaller.
"""

import itertools
import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from spi.numerics.types import Array

from ..ensemble.long_states import LongState
from ..storage.records import INTERVAL

EPSILON = 2.0**-52
MULTIPLE = 8.0  #: of EPSILON, the size and 1 + sqrt(n)
_NUDGES = 2.0**-10, 2.0**-20  # relative, of components: far above rounding, far below 1
_PATTERNS = 4  # of signs


def rounding(size: Any, steps: Any = 0) -> Array:
    """Largest difference of numbers of this size, after so many steps, that counts as rounding."""
    return MULTIPLE * (1.0 + np.sqrt(steps)) * EPSILON * np.asarray(size, float)


def is_rounding(difference: Any, size: Any, steps: Any = 0) -> Array:
    """Whether differences of numbers of this size, after so many steps, are rounding; not of NaN and infinity."""
    with np.errstate(invalid="ignore"):
        return np.asarray(np.abs(difference) <= rounding(size, steps))


def with_rounding(stderr: Any, difference: Any, size: Any, steps: Any = 0) -> Array:
    """Standard errors (...) of differences; where these are rounding, the bound of it is half the interval at least."""
    least = np.maximum(stderr, rounding(size, steps) / INTERVAL)
    return np.where(is_rounding(difference, size, steps), least, stderr)


def size_of(state: Iterable[float] | None) -> float:
    """Size of a state for :func:`rounding`: its length, or 1 of the state 0, and of none."""
    if isinstance(state, LongState):
        return float(np.linalg.norm(state.values)) or 1.0
    length = math.hypot(*(() if state is None else state))
    return length if 0.0 < length < math.inf else 1.0


def size_of_values(function: Callable[[Array], Array], state: Iterable[float]) -> float:
    """Size for :func:`rounding` of the values f(y) of a function of arrays (d, n) near a state.

    |f(y)|, or sum_i s_i |df/dy_i|, s_i the larger of |y_i| and the root mean square of all components: relative
    roundings of y change f by that times their size, also where f is a small difference such as H - H_0.  The sum is
    estimated from the largest change by components that are moved up or down at random.
    """
    long = isinstance(state, LongState)
    y = np.asarray(state if long else tuple(state), float)
    scale = np.maximum(np.abs(y), size_of(state if long else y) / math.sqrt(len(y)))
    random, patterns = np.random.default_rng(0), 2 if long else _PATTERNS
    signs = [np.where(random.random(len(y)) < 0.5, -1, 1).astype(np.int8) for _ in range(patterns)]
    signs[0][:] = 1
    moved = itertools.chain([y], (y + nudge * scale * sign for nudge in _NUDGES for sign in signs))
    with np.errstate(all="ignore"):
        each = [function(y[:, np.newaxis]) for y in moved] if long else function(np.stack([*moved], axis=1))
        values = np.asarray(each, float).ravel()
        changes = np.abs(values[1:] - values[0]).reshape(len(_NUDGES), -1) / np.reshape(_NUDGES, (-1, 1))
        sizes = np.append(np.abs(values[0]), changes.min(axis=0))  # of a jump the smaller quotient
    return float(np.max(sizes[np.isfinite(sizes)], initial=0.0))


def note_exact(errors: Array, exact: Array) -> str:
    """``exact up to rounding (6e-16)``, with the largest of the errors that are; "" if none is."""
    if not exact.any():
        return ""
    mantissa, _, exponent = f"{(most := np.abs(errors[exact]).max()):.0e}".partition("e")
    largest = f"exact up to rounding ({mantissa}e{int(exponent)})" if most else "exact"
    return largest if exact.all() else f"{exact.sum()} of {exact.size} errors are {largest}"


def all_exact(notes: str, function: str = "") -> str:
    """Part of notes by :func:`note_exact` that says that all errors, of a function, are exact; "" without one."""
    for part in notes.split("; "):
        name, _, note = part.rpartition(": ")
        if note.startswith("exact") and function in ("", name):
            return note
    return ""
