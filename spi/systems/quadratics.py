"""Functions of quadratic functions whose flows are linear, as y_1^2 + y_2^2 on so(3) and q^2 + p^2.

Where {u, f} = 0 for all the u and linear l that f = F(u_1, ..., l_1, ...) is a function of, the flow of f keeps them,
and its field is the sum of theirs with the numbers dF/du, dF/dl.  Two kinds of quadratic u move y by constant matrices:

* {y_i, u} = sum_c y_c (M_c y)_i with components y_c that commute with everything.  On heisenberg(n), where there is
  one such component, these are all quadratic functions, and so they are where all brackets are constants.
* u = Q(s) + C with a polynomial of degree 2 in linear functions s_1, s_2, ... that u keeps and a Casimir function C:
  the field is that of the s_j with the numbers dQ/ds_j.  On so(3), y_1^2 + y_2^2 = C - y_3^2 turns about axis 3.
"""

import contextlib
import itertools
from collections.abc import Iterator, Sequence
from typing import Any

import mpmath
import sympy
from sympy.polys.matrices import DomainMatrix

from .brackets import NOTHING, Matrix, added, precise
from .splitting import Term, connected
from .symbolics import NoExactFlow, Quadratic, Symbolics, commuting, functionals_of, unmoved

_MOST_TERMS = 200  # of a polynomial that is factored
_MOST_KEPT = 20  # linear functions s


def by_quadratics(expression: Any, world: Symbolics, casimirs: Sequence[Any]) -> Term | None:
    """A function of such quadratic functions and of linear ones as a term; None if it is no such function."""
    if not all(map(world.bracket.is_affine, world.used(expression))):
        return None
    search = _Search(world, casimirs)
    outer = search.replaced(expression)
    if not search.quadratics:
        return None
    forms = {symbol: u.form + symbol for symbol, u in search.quadratics.items() if not u.fields}
    with contextlib.suppress(NoExactFlow):
        functionals, pivots = functionals_of(outer.xreplace(forms), world, search.quadratics)
        values = {symbol: u.function for symbol, u in search.quadratics.items()}
        varying = bool(world.bracket.formulas) or search.depends
        varying = varying or (any(len(f) > 1 for f in functionals) and world.varies(outer))
        term = Term(outer, functionals, pivots, varying, values, expression, search.quadratics)
        return term if _is_kept(term, world) else None
    return None


def _is_kept(term: Term, world: Symbolics) -> bool:
    """Whether the flow of a term keeps all that it is a function of: all of these commute."""
    bracket, moving = world.bracket, [u for u in term.inner.values() if u.fields]
    return (
        all(bracket.commuting(f, g) for f, g in itertools.combinations(term.functionals, 2))
        and all(unmoved(f, u) for f in term.functionals for u in moving)
        and all(commuting(u, other, bracket.dimension) for u, other in itertools.combinations(moving, 2))
    )


class _Search:
    """The search for quadratic functions in one expression."""

    def __init__(self, world: Symbolics, casimirs: Sequence[Any]) -> None:
        self.world, self.quadratics, self.depends = world, dict[Any, Quadratic](), False
        linked = {i for pair in world.bracket.constants for i in pair}
        self.central = set(range(len(world.variables))) - linked
        if not world.bracket.is_lie:
            self.central.add(len(world.variables))  # the place of 1
        self.casimirs = [c for c in casimirs if self._degree(c) == 2 and not c.free_symbols & set(world.parameters)]

    def _degree(self, expression: Any) -> int | None:
        """The degree of a polynomial; None for another function."""
        if not expression.is_polynomial(*self.world.variables):
            return None
        return sympy.Poly(expression, *self.world.variables).total_degree()

    def replaced(self, e: Any) -> Any:
        """The expression with symbols for the quadratic functions in it."""
        if not self.world.used(e):
            return e
        degree = self._degree(e)
        if degree is not None and degree < 2:
            return e
        if degree == 2:
            return self.of_degree_two(e)
        if degree is not None and len(sympy.Add.make_args(sympy.expand(e))) <= _MOST_TERMS:
            factored = sympy.factor(e)
            e = e if factored.is_Add else factored
        if e.is_Mul:
            return self.of_product(e)
        if not e.is_Add:
            return e.func(*map(self.replaced, e.args))
        low = [part for part in e.args if (self._degree(part) or 3) <= 2]
        return self.replaced(sympy.Add(*low)) + sympy.Add(*(self.replaced(part) for part in e.args if part not in low))

    def of_product(self, e: Any) -> Any:
        """A product, with a symbol also for q p in q^3 p^3, which are written apart."""
        factors = [f.as_base_exp() for f in e.args]
        groups: dict[Any, list[Any]] = {}
        for base, exponent in factors:
            if self._degree(base) == 1:
                groups.setdefault(exponent, []).append(base)
        pairs = {exponent: sympy.Mul(*bases) for exponent, bases in groups.items() if len(bases) == 2}
        alone = [base**n for base, n in factors if n not in pairs or self._degree(base) != 1]
        return sympy.Mul(*map(self.replaced, alone), *(self.replaced(base) ** n for n, base in pairs.items()))

    def of_degree_two(self, e: Any) -> Any:
        """A polynomial of degree 2, with a symbol for its quadratic part where that is of one of the two kinds."""
        poly = sympy.Poly(e, *self.world.variables)
        parts: list[list[Any]] = [[], [], []]
        for monomial, c in poly.terms():
            parts[sum(monomial)].append(c * sympy.Mul(*(y**n for y, n in zip(poly.gens, monomial, strict=True))))
        constant, linear, form = (sympy.Add(*part) for part in parts)
        functionals, _ = functionals_of(form, self.world)
        if all(self.world.bracket.commuting(f, g) for f, g in itertools.combinations(functionals, 2)):
            return e
        if linear != 0 and (whole := self.by_fields(linear + form)):
            return self.symbol(whole) + constant
        if u := self.by_fields(form) or self.by_kept(form):
            return self.symbol(u) + linear + constant
        pieces = sympy.Add.make_args(form)
        links = [{*self.world.used(piece)} for piece in pieces] + [
            {i, j} for i, j in self.world.bracket.constants if {i, j} <= {*self.world.used(form)}
        ]
        groups = connected(links)
        if len(groups) < 2:
            return e
        divided = [sympy.Add(*(p for p in pieces if {*self.world.used(p)} <= group)) for group in groups]
        return sympy.Add(*map(self.of_degree_two, divided)) + linear + constant

    def symbol(self, u: Quadratic) -> Any:
        for symbol, other in self.quadratics.items():
            if other.function == u.function:
                return symbol
        symbol = sympy.Symbol(f"ζ{len(self.quadratics) + 1}", real=True)
        self.quadratics[symbol] = u
        self.depends = self.depends or (bool(u.fields) and self.world.varies(u.function))
        return symbol

    # ---- the first kind ------------------------------------------------------------------------------------------

    def by_fields(self, u: Any) -> Quadratic | None:
        """The quadratic function with the matrices of its field, if all factors beside them are central."""
        slopes = self._slopes(u)
        fields: dict[int, dict[tuple[int, int], Any]] = {}
        d = len(self.world.variables)
        for (i, j), bracket in self.world.bracket.constants.items():
            for row, other, sign in ((i, j, 1), (j, i, -1)):
                for k, c in bracket.items():
                    for m in [m for r, m in slopes if r == other]:
                        if k not in self.central and (m == d or m not in self.central):
                            return None
                        factor, column = (k, m) if k in self.central else (m, k)
                        entries = fields.setdefault(factor, {})
                        value = sign * precise(c) * slopes[other, m]
                        entries[row, column] = entries.get((row, column), mpmath.mpf(0)) + value
        cleaned = [(c, {p: x for p, x in entries.items() if abs(x) > NOTHING}) for c, entries in sorted(fields.items())]
        return Quadratic(u, sympy.Integer(0), tuple((c, entries) for c, entries in cleaned if entries), slopes)

    def _slopes(self, u: Any) -> Matrix:
        """The gradient of u, (component, factor of y_k or, in the last column, of 1)."""
        poly = sympy.Poly(u, *self.world.variables)
        terms = []
        for monomial, coefficient in poly.terms():
            value = precise(coefficient.xreplace(dict(self.world.parameters)))
            i, *rest = [i for i, power in enumerate(monomial) for _ in range(power)]
            terms += [((i, k), value) for k in rest or [len(monomial)]] + [((k, i), value) for k in rest]
        return added(terms)

    # ---- the second kind -----------------------------------------------------------------------------------------

    def by_kept(self, u: Any) -> Quadratic | None:
        """The function as Q(s) + C, Q of degree 2; exact, so that all factors must be fractions."""
        unit = {len(self.world.variables)}
        linked = connected([{*pair, *linear} - unit for pair, linear in self.world.bracket.constants.items()])
        within = sorted(set().union(*(group for group in linked if group & set(self.world.used(u)))))
        try:
            linear = list(self._kept(u, within))
            if not 0 < len(linear) <= _MOST_KEPT:
                return None
            pairs = itertools.combinations_with_replacement(linear, 2)
            products = [*(sympy.expand(a * b) for a, b in pairs), *linear]
            functions = [sympy.expand(c) for c in self.casimirs if {*self.world.used(c)} <= {*within}]
            factors = _combination(u, [*functions, *products], self.world.variables)
        except (sympy.CoercionFailed, ValueError):
            return None
        if factors is None:
            return None
        form = sympy.Add(*(c * p for c, p in zip(factors[len(functions) :], products, strict=True)))
        return Quadratic(u, form, (), {})

    def _kept(self, u: Any, within: Sequence[int]) -> Iterator[Any]:
        """A basis of the linear functions of some components that commute with u."""
        variables = self.world.variables
        moved = [sympy.Poly(self._moved(i, u), *variables) for i in within]
        if not any(moved):
            return iter(variables[i] for i in within)
        monomials = sorted({monomial for poly in moved for monomial in poly.monoms()})
        rows = [[sympy.QQ.from_sympy(poly.coeff_monomial(m)) for poly in moved] for m in monomials]
        basis = DomainMatrix(rows, (len(rows), len(within)), sympy.QQ).nullspace().to_Matrix()
        return iter(sympy.Add(*(basis[r, n] * variables[i] for n, i in enumerate(within))) for r in range(basis.rows))

    def _moved(self, i: int, u: Any) -> Any:
        """{y_i, u}."""
        world, total = self.world, []
        for j in world.used(u):
            linear = world.bracket.of(i, j)
            slope = sympy.diff(u, world.variables[j])
            total.append(sympy.Add(*(c * world.coordinate(k) for k, c in linear.items())) * slope)
        return sympy.expand(sympy.Add(*total))


def _combination(u: Any, functions: Sequence[Any], variables: Sequence[Any]) -> list[Any] | None:
    """The factors with which u is a sum of some polynomials, those of the first ones rather than of the last."""
    polys = [sympy.Poly(f, *variables) for f in (*functions, u)]
    monomials = sorted({monomial for poly in polys for monomial in poly.monoms()})
    rows = [[sympy.QQ.from_sympy(poly.coeff_monomial(m)) for poly in polys] for m in monomials]
    reduced, pivots = DomainMatrix(rows, (len(rows), len(polys)), sympy.QQ).rref()
    if len(functions) in pivots:
        return None
    solved = reduced.to_Matrix()
    factors: list[Any] = [sympy.Integer(0)] * len(functions)
    for row, pivot in enumerate(pivots):
        factors[pivot] = solved[row, len(functions)]
    return factors
