"""Linear functions of the state, by the factors of the components that occur in them."""

from collections.abc import Mapping, Sequence

import mpmath

from .brackets import DIGITS, NOTHING

Functional = dict[int, mpmath.mpf]  #: a linear function of y, the factor of each component that occurs in it


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
