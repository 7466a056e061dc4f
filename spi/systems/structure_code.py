"""Python source for the structure matrix of a Lie-Poisson bracket, B(y) v, and for the bracket of its Lie algebra."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from .brackets import Bracket, precise
from .code import Formula, as_tuple, signed, written_sum

Term = tuple[str, str]  #: (sign, code)


def structure_code(bracket: Bracket, names: Mapping[Any, str], columns: Iterable[int], at: str = "y") -> str:
    """B(y) v as a tuple, for a v that is 0 outside of some columns; `names` says how parameters are called."""
    kept, rows = set(columns), dict[int, list[Term]]()
    for i, j in bracket.constants:
        for row, column, sign in ((i, j, 1), (j, i, -1)):
            if column in kept:
                terms = [term for _, term in _terms(bracket, names, i, j, sign, lambda k: f"{at}[{k}]")]
                if len(terms) == 1:
                    rows.setdefault(row, []).append((terms[0][0], f"{terms[0][1]} * v[{column}]"))
                else:
                    rows.setdefault(row, []).append(("+", f"({written_sum(terms)}) * v[{column}]"))
    return as_tuple([written_sum(rows.get(i, [])) for i in range(bracket.dimension)])


def lie_bracket_code(bracket: Bracket, names: Mapping[Any, str]) -> str:
    """[v, w], the gradient of w . B(y) v = sum_{i < j} {y_i, y_j} (w_i v_j - w_j v_i), as a tuple."""
    rows = dict[int, list[Term]]()
    for i, j in bracket.constants:
        product = f"(w[{i}] * v[{j}] - w[{j}] * v[{i}])"
        for k, term in _terms(bracket, names, i, j, 1, lambda k, product=product: product):  # type: ignore[misc]
            rows.setdefault(k, []).append(term)
    return as_tuple([written_sum(rows.get(k, [])) for k in range(bracket.dimension)])


def _terms(
    bracket: Bracket, names: Mapping[Any, str], i: int, j: int, sign: int, factor: Callable[[int], str]
) -> list[tuple[int, Term]]:
    """(k, term) of {y_i, y_j}, or of its negative, with this factor in the place of each y_k."""
    if formulas := bracket.formulas.get((i, j)):
        writer = Formula(names, ())
        return [(k, ("+" if sign > 0 else "-", f"{writer.code(c)} * {factor(k)}")) for k, c in formulas.items()]
    return [(k, signed(sign * precise(c), factor(k))) for k, c in bracket.constants[i, j].items()]
