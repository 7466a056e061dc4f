"""Quadratic functions that a flow keeps, of which its Hamiltonian is a function."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import mpmath

from .brackets import DIGITS, NOTHING

Entries = Mapping[tuple[int, int], mpmath.mpf]  #: (row, column) -> number of a matrix; a last column is that of 1


class Quadratic(NamedTuple):
    """A quadratic function u, in one of two ways.

    Either u = Q(s) + C with a quadratic form in linear functions that u keeps and a Casimir function C; or its field is
    sum_c y_c M_c y with components y_c that commute with everything, or y_d = 1.
    """

    function: Any  #: u in the variables
    form: Any  #: Q(s) in the variables; 0 where there are fields
    fields: tuple[tuple[int, Entries], ...]  #: of (c, M_c)
    slopes: Entries  #: grad u = slopes y, needed where there are fields


def unmoved(functional: Mapping[int, mpmath.mpf], u: Quadratic) -> bool:
    """Whether a linear function commutes with u, by the fields of u."""
    for _, entries in u.fields:
        moved: dict[int, Any] = {}
        for (row, column), value in entries.items():
            if row in functional:
                moved[column] = moved.get(column, mpmath.mpf(0)) + functional[row] * value
        if any(abs(value) > NOTHING for value in moved.values()):
            return False
    return True


def commuting(u: Quadratic, other: Quadratic, dimension: int) -> bool:
    """Whether {u, other} = 0, both having fields: at random points, to 40 digits."""
    with mpmath.workdps(DIGITS):
        for n in range(3):
            point = [mpmath.frac(mpmath.sqrt(5 + 3 * n + 7 * j) * 19) + mpmath.mpf(1) / 8 for j in range(dimension)]
            point.append(mpmath.mpf(1))
            slopes = _times(u.slopes, point)
            total = size = mpmath.mpf(0)
            for c, entries in other.fields:
                for row, value in _times(entries, point).items():
                    term = point[c] * value * slopes.get(row, 0)
                    total, size = total + term, max(size, abs(term))
            if abs(total) > NOTHING * (1 + size):
                return False
    return True


def _times(entries: Entries, y: Sequence[Any]) -> dict[int, Any]:
    moved: dict[int, Any] = {}
    for (row, column), value in entries.items():
        moved[row] = moved.get(row, mpmath.mpf(0)) + value * y[column]
    return moved
