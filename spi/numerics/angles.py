"""Ranges of angles, by which flows that rotate choose the cheapest sine that is accurate there."""

import inspect
from typing import NamedTuple

import numpy as np

from ..compiler.dispatch import calling, device, function_of, method
from . import elementary


@device
def _divided(angles, square):
    """Sine and versine divided by the angle and its square; the limits at 0."""
    square += 1e-300
    angle = np.sqrt(square)
    s, v = sin_versine(angles, angle)
    return (s - angle) / angle, v / square


class TinyAngles(NamedTuple):
    """All angles lie within +-2^-5: short polynomials."""

    sin_versine = calling(elementary.sin_versine_tiny, "angles")
    sinc_versinc = calling(elementary.sinc_versinc_tiny, "angles")

    def adding_to_zero(angles, p0, p1, p2):
        return p0, p1, p2


class SmallAngles(NamedTuple):
    """All angles lie within [-pi/4, pi/4]: no range reduction."""

    sin_versine = calling(elementary.sin_versine_small, "angles")
    sinc_versinc = calling(elementary.sinc_versinc_small, "angles")
    adding_to_zero = TinyAngles.adding_to_zero


class ReducedAngles(NamedTuple):
    """All angles lie within +-1.6e6: range reduction in vector instructions."""

    sin_versine = calling(elementary.sin_versine, "angles")

    def sinc_versinc(angles, square):
        return _divided(angles, square)

    def adding_to_zero(angles, p0, p1, p2):
        """As multiples of one small number, so that additions are exact: for large angles the sum must be exactly 0."""
        size = abs(p0) + abs(p1) + abs(p2)  # twice the largest, so that all are rounded to the same multiples
        p0, p1 = (p0 + size) - size, (p1 + size) - size
        return p0, p1, -(p0 + p1)


class AnyAngles(NamedTuple):
    """Angles of any size: range reduction by whole numbers beyond +-1.6e6."""

    sin_versine = calling(elementary.sin_versine_huge, "angles")
    sinc_versinc = ReducedAngles.sinc_versinc
    adding_to_zero = ReducedAngles.adding_to_zero


TINY_ANGLES, SMALL_ANGLES, REDUCED_ANGLES, ANY_ANGLES = TinyAngles(), SmallAngles(), ReducedAngles(), AnyAngles()


@method
def sin_versine(angles, x):
    """(sin x, 1 - cos x).

    Rotations use the versine, because with a rounded cosine the length drifts systematically (-1e-17 a step), while
    with p += s w - v p, w -= s p + v w its error is an unbiased walk of roundings.
    """


@method
def sinc_versinc(angles, square):
    """(sin x / x - 1, (1 - cos x) / x^2), given x^2, for Rodrigues' formula for rotations about any axis."""


@method
def adding_to_zero(angles, p0, p1, p2):
    """Three angles whose sum is 0 up to roundings, changed so that the sum is no larger than for small angles."""


# Angles are compared by their bits: as integers, because a maximum of floats that respects NaN is not vectorised.
# The bits of a NaN exceed those of every number, so it takes the last road.
_RANGES = {"TINY_ANGLES": elementary.TINY, "SMALL_ANGLES": elementary.SMALL, "REDUCED_ANGLES": elementary.REDUCIBLE}


def by_size(within, squares=False):
    """Function (largest, ...) that calls ``within(angles, ...)`` with the cheapest sines that are accurate.

    `largest` has the bits of the largest angle, or of its square.
    """
    _, *others = inspect.signature(within).parameters
    arguments = ", ".join(others)
    lines = [f"def of_size(largest, {arguments}):"]
    for angles, bound in _RANGES.items():
        limit = int(elementary.bits(bound * bound if squares else bound))
        lines += [f"if largest <= {limit}:", f"    return within({angles}, {arguments})"]
    return function_of([*lines, f"return within(ANY_ANGLES, {arguments})"], {**globals(), "within": within})
