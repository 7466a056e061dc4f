"""B(y) v as code where B is linear, and as formulas where it is not."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import mpmath
import sympy

from .brackets import NOTHING, Bracket, precise
from .code import Formula, written_sum, written_tuple
from .symbolics import Symbolics


def applied(bracket: Bracket, names: Mapping[Any, str], columns: Iterable[int], at: str = "y") -> str:
    """B(y) v of a linear bracket as a tuple, for a v that is 0 outside of some columns."""
    kept, rows = set(columns), dict[int, list[tuple[str, str]]]()
    for (i, j), linear in bracket.constants.items():
        for row, column, sign in ((i, j, 1), (j, i, -1)):
            if column in kept:
                formulas = bracket.formulas.get((i, j))
                if formulas:
                    writer = Formula(names, ())
                    terms = [("+" if sign > 0 else "-", f"{writer.code(c)} * {at}[{k}]") for k, c in formulas.items()]
                else:
                    terms = [_signed(sign * precise(c), f"{at}[{k}]") for k, c in linear.items()]
                inner = written_sum(terms)
                if len(terms) == 1:
                    rows.setdefault(row, []).append((terms[0][0], f"{terms[0][1]} * v[{column}]"))
                else:
                    rows.setdefault(row, []).append(("+", f"({inner}) * v[{column}]"))
    return written_tuple([written_sum(rows.get(i, [])) for i in range(bracket.dimension)])


def _signed(value: mpmath.mpf, what: str) -> tuple[str, str]:
    size = abs(value)
    return ("+" if value > 0 else "-"), what if abs(size - 1) < NOTHING else f"{float(size)!r} * {what}"


def rows(world: Symbolics, v: Sequence[Any], columns: Iterable[int]) -> list[Any]:
    """The components of B(y) v as formulas, for a v that is 0 outside of some columns.

    {y_i, y_j} is {w_i, w_j}, times y_i and y_j where their logarithms are coordinates.
    """
    bracket, y, kept = world.bracket, world.variables, set(columns)
    factor = [y[i] if i in bracket.logarithmic else sympy.Integer(1) for i in range(bracket.dimension)]
    found: list[list[Any]] = [[] for _ in y]
    for i, j, polynomial in bracket.entries(symbolic=True):
        entry = sympy.Add(*(c * sympy.Mul(*(y[k] for k in monomial)) for monomial, c in polynomial.items()))
        for row, column, sign in ((i, j, 1), (j, i, -1)):
            if column in kept:
                found[row].append(sign * entry * factor[column] * v[column])
    return [factor[i] * sympy.Add(*terms) for i, terms in enumerate(found)]
