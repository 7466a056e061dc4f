"""Crossings of curves over a swept parameter, as those of Binder's cumulant of lattices of two sizes."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from .curves import Curve, sign_changes

Line = tuple[str, Curve]  #: what is shown of a case or of a value of a second parameter, and the curve of it


class Place(NamedTuple):
    """A crossing with half the widths of its 95 % intervals."""

    at: float  #: value of the parameter
    at_half: float
    value: float  #: of the quantity there
    value_half: float


class Crossing(NamedTuple):
    """Two curves of one quantity and scheme, and where they cross."""

    first: Line
    second: Line
    places: list[Place]


def crossings(lines: Iterable[Line]) -> list[Crossing]:
    """Crossings of each line with the next one of the same quantity, test function, scheme and estimator."""
    alike: dict[tuple, list[Line]] = {}
    for name, curve in lines:
        about = curve.about
        key = curve.name, curve.function, about.scheme, about.eps, about.extrapolate, about.estimator
        alike.setdefault(key, []).append((name, curve))
    return [
        Crossing(one, other, list(_places(one[1], other[1])))
        for members in alike.values()
        for one, other in pairwise(members)
    ]


def _places(one: Curve, other: Curve) -> Iterator[Place]:
    """Crossings of two curves at the values that both have.

    The signs of their difference on both sides are certain to 95 %.  There, and at one more value on either side, both
    curves are fitted by parabolas by least squares, with the weights of the difference; see :func:`_crossing`.
    """
    x, mine, others = np.intersect1d(one.values, other.values, return_indices=True)
    value, low, high = (np.array([one.of(it)[mine], other.of(it)[others]]) for it in ("value", "low", "high"))
    half = (high - low) / 2
    apart, within = value[0] - value[1], np.hypot(*half)
    for first, last in sign_changes(apart, apart - within, apart + within):
        near = slice(max(0, first - 1), last + 2)
        yield _crossing(x[near], value[:, near], half[:, near], (float(x[first]), float(x[last])))


def _crossing(x: np.ndarray, values: np.ndarray, half: np.ndarray, ends: tuple[float, float]) -> Place:
    """Crossing between `ends` of parabolas through values (2, n) with independent errors; of lines if these have none.

    The fit at x is g(x) . v with weights g(x) that both curves share, so that the errors of the crossing follow from
    those of the values to first order, which is what a jackknife over the samples of each value gives:
    half_x^2 = sum_i g_i^2 (half_1i^2 + half_2i^2) / (p_1' - p_2')^2, and at the crossing the quantity has
    half_y^2 = sum_i g_i^2 ((p_2' half_1i)^2 + (p_1' half_2i)^2) / (p_1' - p_2')^2.
    """
    middle, reach = sum(ends) / 2, (ends[1] - ends[0]) / 2
    scaled = (x - middle) / reach
    both = np.hypot(*half)
    weight = 1.0 / np.maximum(both, 1e-12 * np.abs(values).max())
    roots: np.ndarray = np.empty(0)
    degree = min(3, len(x))
    while not roots.size:
        degree -= 1
        basis = np.vander(scaled, degree + 1)
        solved = np.linalg.pinv(basis * weight[:, np.newaxis]) * weight  # (degree + 1, n)
        fits = values @ solved.T
        found = np.roots(fits[0] - fits[1])
        roots = found.real[(np.abs(found.imag) < 1e-9) & (np.abs(found.real) <= 1.0)] if degree > 1 else found.real
    at = float(roots[np.argmin(np.abs(roots))])
    g = np.vander([at], degree + 1)[0] @ solved
    slope, other_slope = (np.polyval(np.polyder(fit), at) for fit in fits)
    apart = abs(slope - other_slope)
    value_half = np.sqrt((g**2 * ((other_slope * half[0]) ** 2 + (slope * half[1]) ** 2)).sum()) / apart
    at_half = reach * np.sqrt((g**2 * both**2).sum()) / apart
    return Place(middle + reach * at, float(at_half), float(np.polyval(fits[0], at)), float(value_half))


def lines_of(cases: Sequence[tuple[str, Sequence[Curve]]], of: str) -> list[Line]:
    """Curves of a quantity, or of a test function, by its name: one of each case or of each second value of a case."""
    every = [(name, curve) for name, curves in cases for curve in curves if of in (curve.name, curve.function)]
    lines = []
    for name, curve in every:
        if curve.second_word:
            lines += [(f"{curve.second_word} = {value:g}", line) for value, line in curve.lines()]
        else:
            lines.append((name, curve))
    return [(name, line) for name, line in lines if line.is_known and len(line.values) > 1]
