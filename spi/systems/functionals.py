"""Linear functions of the state, by the factors of components, and quadratic functions that a flow keeps."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import mpmath
import sympy

from .brackets import DIGITS, NOTHING
from .symbolics import Symbolics, numeric

Functional = dict[int, mpmath.mpf]  #: a linear function of y, the factor of each component that occurs in it
Entries = Mapping[tuple[int, int], mpmath.mpf]  #: (row, column) -> number of a matrix; a last column is that of 1


class NoExactFlow(ValueError):
    """A term whose flow is not known in closed form; the message names it."""


class NowhereFinite(NoExactFlow):
    """A term that has no finite value."""


def functionals_of(
    expression: Any, world: Symbolics, kept: Iterable[Any] = ()
) -> tuple[tuple[Functional, ...], tuple[int, ...]]:
    """The fewest linear functions that an expression depends on: the span of its gradients, at random points."""
    used = world.used(expression)
    coordinates = tuple({i: mpmath.mpf(1)} for i in used)
    if len(used) == 1:
        return coordinates, used
    if (
        expression.is_Mul
        and not world.bracket.logarithmic.intersection(used)
        and all(f.is_Symbol or (f.is_Pow and f.base.is_Symbol) or f.is_number for f in expression.args)
    ):
        return coordinates, used  # a monomial
    numbers = {symbol: sympy.sqrt(7 + 4 * n) for n, symbol in enumerate(kept)}
    gradient = [world.slope(expression, i).xreplace(numbers) for i in used]
    in_time = [] if world.time is None or world.time not in expression.free_symbols else [world.time]
    symbols = [*(world.variables[i] for i in used), *in_time]
    value = numeric(symbols, gradient)
    rows = []
    with mpmath.workdps(DIGITS + 20):
        for n in range(len(used) + 2):
            point = [mpmath.frac(mpmath.sqrt(2 + 3 * n + 7 * j) * 17) + mpmath.mpf(1) / 4 for j in range(len(symbols))]
            try:
                row = [mpmath.mpmathify(g) for g in value(*point)]
            except (TypeError, ZeroDivisionError, ValueError):
                continue  # not defined there
            # where a root or a logarithm is complex, its gradient depends on the same functions as where it is real
            parts = (mpmath.re, mpmath.im) if any(isinstance(g, mpmath.mpc) for g in row) else (mpmath.mpf,)
            rows += [{i: part(g) for i, g in zip(used, row, strict=True)} for part in parts]
        if not rows:
            raise NowhereFinite(f"'{world.name(expression)}' has no finite value at these parameters")
    found, pivots = reduced(rows)
    return (coordinates, used) if len(found) == len(used) else (found, pivots)


def reduced(rows: Sequence[Mapping[int, mpmath.mpf]]) -> tuple[tuple[Functional, ...], tuple[int, ...]]:
    """A basis of the span of linear functions and its pivots, the largest factors; see :class:`.splitting.Term`."""
    left = [dict(row) for row in rows]
    found: dict[int, Functional] = {}
    tiny = mpmath.mpf(10) ** -30
    with mpmath.workdps(DIGITS + 20):
        while True:
            left = [row for row in left if any(abs(c) > tiny for c in row.values())]
            if not left:
                break
            row = left.pop(0)
            largest = max(abs(c) for c in row.values())
            pivot = min(i for i, c in row.items() if abs(c) > largest * (1 - mpmath.mpf(10) ** -9))
            row = {i: c / row[pivot] for i, c in row.items() if abs(c) > largest * tiny}
            row[pivot] = mpmath.mpf(1)
            left = [_without(other, pivot, row, tiny) for other in left]
            found = {p: _without(other, pivot, row, tiny) for p, other in found.items()}
            found[pivot] = row
    pivots = tuple(sorted(found))
    return tuple(found[pivot] for pivot in pivots), pivots


def _without(row: Mapping[int, mpmath.mpf], pivot: int, by: Functional, tiny: mpmath.mpf) -> Functional:
    """A row less so much of another that its entry at the pivot is 0."""
    factor = row.get(pivot)
    if not factor:
        return dict(row)
    new = {i: row.get(i, mpmath.mpf(0)) - factor * by.get(i, mpmath.mpf(0)) for i in {*row, *by} - {pivot}}
    return {i: c for i, c in sorted(new.items()) if abs(c) > tiny}


def form_text(functional: Functional, names: Sequence[str]) -> str:
    """A linear function in words."""
    parts = [names[i] if abs(c - 1) < NOTHING else f"{mpmath.nstr(c, 6)}*{names[i]}" for i, c in functional.items()]
    return " + ".join(parts)


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
