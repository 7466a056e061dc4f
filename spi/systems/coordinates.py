"""Coordinates in which a polynomial bracket is simpler: the logarithms of some variables, the others as they are.

With w_i = log x_i, {w_i, f} = {x_i, f}/x_i.  A log-canonical bracket {x_i, x_j} = a_ij x_i x_j is constant then, and
what moves w_i at a constant rate multiplies x_i by an exponential: positive x_i stay positive.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from .brackets import Entry, Monomial, Polynomial, at_values

Given = tuple[str, int, int, Polynomial]  #: key, i, j, {x_i, x_j} with its parameters as symbols


def simplified(
    given: Iterable[Given], values: Mapping[Any, Any], unit: int
) -> tuple[list[tuple[str, int, int, Entry]], frozenset[int]]:
    """(the brackets of the coordinates, the variables whose logarithms are coordinates).

    A monomial of degree 1 is called by its variable, 1 by `unit`.  `values` are those of the parameters.
    """
    kept = []
    for key, i, j, polynomial in given:
        numbers = at_values(polynomial, values)
        kept.append((key, i, j, {monomial: c for monomial, c in polynomial.items() if monomial in numbers}))
    chosen = _logarithmic([(i, j, monomial) for _, i, j, polynomial in kept for monomial in polynomial])
    found = []
    for key, i, j, polynomial in kept:
        divided = {_divided(i, j, monomial, chosen): c for monomial, c in polynomial.items()}
        found.append((key, i, j, {(m if len(m) > 1 else m[0] if m else unit): c for m, c in divided.items()}))
    return found, frozenset(chosen)


def _logarithmic(monomials: Sequence[tuple[int, int, Monomial]]) -> set[int]:
    """None where all brackets, with monomials (i, j, monomial), are affine; else as many variables as may be.

    Each divides all of its brackets; and once all are divided, no bracket has any of them.
    """
    if all(len(monomial) <= 1 for _, _, monomial in monomials):
        return set()
    chosen = {n for i, j, _ in monomials for n in (i, j)}
    chosen -= {n for i, j, monomial in monomials for n in (i, j) if n not in monomial}
    while left := {n for i, j, monomial in monomials for n in _divided(i, j, monomial, chosen) if n in chosen}:
        chosen -= left
    return chosen


def _divided(i: int, j: int, monomial: Monomial, chosen: set[int]) -> Monomial:
    """A monomial of {x_i, x_j} divided by those of the two whose logarithms are taken."""
    rest = list(monomial)
    for n in {i, j} & chosen:
        rest.remove(n)
    return tuple(rest)
