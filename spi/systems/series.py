"""Flows that are polynomials in the time: Lie series that end.

Along the flow of f(l_1, ..., l_r) with commuting l_a the field is X = sum_a a_a X_a, X_a that of l_a, a_a constant.
After the time 1 a coordinate is sum_n X^n w_i / n!.  Where X_a are polynomials that each move a coordinate by others
which are moved before it, as a magnetic field moves momenta by positions, only finitely many terms are not 0.
"""

import itertools
import math
from collections.abc import Mapping, Sequence

import mpmath

from .brackets import DIGITS, NOTHING, Bracket, Monomial

Field = Mapping[tuple[int, Monomial], mpmath.mpf]  #: (row, monomial of the w_i) -> factor
#: What a coordinate is moved by: factors by (monomial of the a_a, monomial of the w_i).
Series = dict[tuple[Monomial, Monomial], mpmath.mpf]
_MOST_TERMS, _LONGEST = 24, 500  # of a series, and monomials of a term


class EndlessSeries(ValueError):
    """A series has more terms, or longer ones, than are looked at."""


def series(fields: Sequence[Field]) -> dict[int, Series]:
    """By how much each coordinate is moved that is moved at all, X w_i + X^2 w_i / 2 + ...; or EndlessSeries."""
    rows: dict[int, Series] = {}
    for n, field in enumerate(fields):
        for (row, monomial), c in field.items():
            rows.setdefault(row, {})[(n,), monomial] = c
    with mpmath.workdps(DIGITS):
        return {row: _summed(motion, rows) for row, motion in rows.items()}


def constant_rates(
    matrices: Sequence[Mapping[tuple[int, int], mpmath.mpf]], unit: int
) -> tuple[dict[int, Series], list[dict[tuple[int, int], mpmath.mpf]]]:
    """(how coordinates are moved that move at constant rates and move no others, the matrices without them)."""
    others = {n for entries in matrices for row, column in entries if column != unit for n in (row, column)}
    found: dict[int, Series] = {}
    for n, entries in enumerate(matrices):
        for (row, _), c in entries.items():
            if row not in others:
                found.setdefault(row, {})[(n,), ()] = c
    return found, [{place: c for place, c in entries.items() if place[0] in others} for entries in matrices]


def ends(bracket: Bracket, functionals: Sequence[Mapping[int, mpmath.mpf]]) -> bool:
    """Whether the flow along the fields of linear functions is known: all are affine, or their series ends."""
    if not any(map(bracket.curved, functionals)):
        return True
    try:
        series(list(map(bracket.polynomial_field, functionals)))
    except EndlessSeries:
        return False
    return True


def _summed(first: Series, rows: Mapping[int, Series]) -> Series:
    total, term = dict(first), first
    for n in itertools.count(2):
        term = _along(term, rows)
        if not term:
            return {key: c for key, c in total.items() if abs(c) > NOTHING}
        if n > _MOST_TERMS or len(term) > _LONGEST:
            raise EndlessSeries
        for key, c in term.items():
            total[key] = total.get(key, mpmath.mpf(0)) + c / math.factorial(n)
    raise AssertionError


def _along(function: Series, rows: Mapping[int, Series]) -> Series:
    """X f."""
    found: Series = {}
    for (times, monomial), factor in function.items():
        for place, m in enumerate(monomial):  # the derivative by w_m, power by power
            rest = monomial[:place] + monomial[place + 1 :]
            for (more, other), c in rows.get(m, {}).items():
                key = tuple(sorted(times + more)), tuple(sorted(rest + other))
                found[key] = found.get(key, mpmath.mpf(0)) + factor * c
    return {key: c for key, c in found.items() if abs(c) > NOTHING}
