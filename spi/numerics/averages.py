"""Averages of functions of time over a step, by Gauss's quadrature with five nodes.

The error for cos(w t) is 4e-13 (w h)^10: roundings as long as a step takes less than a sixth of a period.
"""

import math

import numpy as np

from spi.compiler.dispatch import device

_ROOTS = tuple(math.sqrt(5.0 + sign * 2.0 * math.sqrt(10.0 / 7.0)) / 3.0 for sign in (1.0, -1.0))
#: The nodes of the quadrature as shares of a step; the third is its middle.
NODES = (*(0.5 - 0.5 * x for x in _ROOTS), 0.5, *(0.5 + 0.5 * x for x in reversed(_ROOTS)))
_OUTER, _INNER = ((322.0 - sign * 13.0 * math.sqrt(70.0)) / 1800.0 for sign in (1.0, -1.0))


@device
def mean(a: float, b: float, c: float, d: float, e: float) -> float:
    """The mean over a step of a function with these values at its nodes."""
    return c + (_OUTER * ((a - c) + (e - c)) + _INNER * ((b - c) + (d - c)))


@device
def signed_root_mean_square(a: float, b: float, c: float, d: float, e: float) -> float:
    """The root of the mean of the squares, with the sign of the mean."""
    size = np.sqrt(mean(a * a, b * b, c * c, d * d, e * e))
    return size if mean(a, b, c, d, e) >= 0.0 else -size
