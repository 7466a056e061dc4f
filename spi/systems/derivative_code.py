"""Source of what a model says besides its flows: B v, H, gradients and what follows of them by differentiation."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import sympy

from .brackets import Bracket, precise
from .code import Formula, as_tuple, case, signed, written_sum
from .system import System

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


class Derivatives:
    """Writes these methods; `names` says how symbols are called, `frozen` what formulas are within a step."""

    def __init__(
        self, system: System, names: Mapping[Any, str], frozen: Callable[[Iterable[Any]], list[Any]] = list
    ) -> None:
        self.given, self.frozen = names, frozen  # which names more where it freezes
        self.system, self.variables, self.bracket = system, system.world.variables, system.world.bracket
        count = range(self.bracket.dimension)
        self.v, self.u = ([sympy.Symbol(f"{c}{n + 1}", real=True) for n in count] for c in "νυ")
        self.names = {**names, **{v: f"v[{n}]" for n, v in enumerate(self.v)}}
        self.names |= {u: f"u[{n}]" for n, u in enumerate(self.u)}

    def lines(self, inexact: Iterable[int]) -> list[str]:
        """All methods; `inexact` are the pieces without an exact flow, whose own gradients are asked for."""
        system, variables = self.system, self.variables
        lines = self.structure()
        lines += self.word("hamiltonian(model, y)", [[system.hamiltonian]], scalar=True)
        lines += self.word("casimirs(model, y)", [[c.expression for c in system.casimirs]])
        gradient = [sympy.diff(system.hamiltonian, y) for y in variables]
        lines += self.word("drift_gradient(model, y)", [gradient])
        lines += self.word("drift_hessian(model, y, v)", [self.along(gradient, self.v)])
        gradients = [[sympy.diff(flow.expression, y) for y in variables] for flow in system.noises]
        lines += self.word("noise_gradient(model, k, y)", gradients)
        lines += self.word("noise_hessian(model, k, y, v)", [self.along(g, self.v) for g in gradients])
        if pieces := {k: [sympy.diff(system.flows[k].expression, y) for y in variables] for k in inexact}:
            lines += self.word("piece_gradient(model, k, y)", pieces)
            lines += self.word("piece_hessian(model, k, y, v)", {k: self.along(g, self.v) for k, g in pieces.items()})
        if self.bracket.dimension > 6 and gradients:  # most columns of B meet a 0 in such a gradient
            lines += self.noise_structure([[j for j, g in enumerate(gradient) if g != 0] for gradient in gradients])
        return lines

    # ---- B v -------------------------------------------------------------------------------------------------------

    def structure(self) -> list[str]:
        """The word for B v, and that for its derivative where B is not linear."""
        every = range(self.bracket.dimension)
        if self.bracket.is_lie:
            lines = ["", "def structure(model, y, v):", f"    return {structure_code(self.bracket, self.names, every)}"]
            code = lie_bracket_code(self.bracket, self.names)
            return [*lines, "", "def lie_bracket(model, v, w):", f"    return {code}"]
        lines = self.word("structure(model, y, v)", [self.rows(every)])
        return lines + self.word("structure_derivative(model, y, u, v)", [self.rows_along(every)])

    def noise_structure(self, supports: Sequence[Sequence[int]]) -> list[str]:
        """The same for v that are 0 outside of some components, one set of them for each noise."""
        heads = "noise_structure(model, k, y, v)", "noise_structure_derivative(model, k, y, u, v)"
        if not self.bracket.is_lie:
            lines = self.word(heads[0], [self.rows(support) for support in supports])
            return lines + self.word(heads[1], [self.rows_along(support) for support in supports])
        lines = []
        for head, at in zip(heads, "yu", strict=True):
            lines += ["", f"def {head}:"]
            for k, support in enumerate(supports):
                code = structure_code(self.bracket, self.names, support, at)
                lines += case(k, len(supports), [f"return {code}"])
        return lines

    def rows(self, columns: Iterable[int]) -> list[Any]:
        """The components of B(y) v as formulas, for a v that is 0 outside of some columns.

        {y_i, y_j} is {w_i, w_j}, times y_i and y_j where their logarithms are coordinates.
        """
        found = self._sums(columns, lambda entry, j: entry * self._factor(j))
        return [self._factor(i) * sympy.Add(*terms) for i, terms in enumerate(found)]

    def rows_along(self, columns: Iterable[int]) -> list[Any]:
        """Those of the derivative of B along u, applied to v."""
        kept = list(columns)
        change = [u if i in self.bracket.logarithmic else sympy.Integer(0) for i, u in enumerate(self.u)]
        still = self._sums(kept, lambda entry, j: entry * self._factor(j))
        moved = self._sums(kept, lambda entry, j: entry * change[j] + self.along([entry], self.u)[0] * self._factor(j))
        both = zip(still, moved, strict=True)
        return [change[i] * sympy.Add(*a) + self._factor(i) * sympy.Add(*b) for i, (a, b) in enumerate(both)]

    def _factor(self, i: int) -> Any:
        """The derivative of y_i by its coordinate."""
        return self.variables[i] if i in self.bracket.logarithmic else sympy.Integer(1)

    def _sums(self, columns: Iterable[int], term: Callable[[Any, int], Any]) -> list[list[Any]]:
        """For each i, the addends v_j term({w_i, w_j}, j) with j in some columns."""
        kept: set[int] = set(columns)
        found: list[list[Any]] = [[] for _ in self.variables]
        for i, j, polynomial in self.bracket.entries(symbolic=True):
            products = (c * sympy.Mul(*(self.variables[k] for k in monomial)) for monomial, c in polynomial.items())
            entry = sympy.Add(*products)
            for row, column, sign in ((i, j, 1), (j, i, -1)):
                if column in kept:
                    found[row].append(sign * self.v[column] * term(entry, column))
        return found

    # ---- formulas ----------------------------------------------------------------------------------------------------

    def along(self, expressions: Sequence[Any], direction: Sequence[Any]) -> list[Any]:
        """The derivatives of some expressions along a vector."""
        found = []
        for e in expressions:
            used = [n for n, y in enumerate(self.variables) if y in e.free_symbols]
            found.append(sympy.Add(*(sympy.diff(e, self.variables[n]) * direction[n] for n in used)))
        return found

    def word(
        self, head: str, cases: Sequence[Sequence[Any]] | Mapping[int, Sequence[Any]], scalar: bool = False
    ) -> list[str]:
        """A method whose value is a tuple of expressions, one for each k if there are several `cases`."""
        lines = ["", f"def {head}:"]
        numbered = cases if isinstance(cases, Mapping) else dict(enumerate(cases))
        for k, expressions in numbered.items():
            frozen = self.frozen(expressions)
            names = {**self.given, **self.names}
            inner, codes = Formula(names, [*self.variables, *self.v, *self.u]).lines(frozen)
            value = codes[0] if scalar else as_tuple(codes)
            lines += case(k, max(numbered) + 1, [*inner, f"return {value}"])
        return lines if cases else [*lines, f"    return {'v' if head.endswith('v)') else 'y'}"]
