"""Splitting of a Hamiltonian into functions of linear functions that commute, whose flows are exact.

If {l_a, l_b} = 0 for all a, b, the flow of f(l_1, ..., l_r) keeps each l_a, so that its field is linear along the flow:
y' = sum_a (df/dl_a)(l(y)) M_a y with the constant matrices M_a of the fields of l_a.  So it is with quadratic functions
beside them whose fields are linear along the flow as well.
"""

import contextlib
import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import mpmath
import sympy
from sympy.polys.matrices import DomainMatrix

from .brackets import (
    DIGITS,
    NOTHING,
    Bracket,
    Monomial,
    Symbolics,
    VectorField,
    degree_of,
    is_curved,
    merged_powers,
    monomials,
    numeric,
    precise,
    shortened,
    summed,
)
from .driving import split_in_time
from .rows import connected, echelon

# ---------------------------------------------------------------------------------------------------------------------
# Linear functions of the state, by the factors of components.
# ---------------------------------------------------------------------------------------------------------------------

Functional = dict[int, mpmath.mpf]  #: a linear function of y, the factor of each component that occurs in it
Span = tuple[tuple[Functional, ...], tuple[int, ...]]  #: linear functions, reduced, and their pivots


class NoExactFlow(ValueError):
    """A term whose flow is not known in closed form; the message names it."""


class NowhereFinite(NoExactFlow):
    """A term that has no finite value."""


def functionals_of(expression: Any, world: Symbolics) -> Span:
    """Fewest linear functions that an expression depends on: the span of its gradients, at random points."""
    used = world.used(expression)
    coordinates = tuple({i: mpmath.mpf(1)} for i in used)
    if len(used) == 1 or (_is_monomial(expression) and not world.bracket.logarithmic.intersection(used)):
        return coordinates, used
    if not (rows := _gradients(expression, used, world)):
        raise NowhereFinite(f"'{world.name(expression)}' has no finite value at these parameters")
    span, pivots = reduced(rows)
    return (coordinates, used) if len(span) == len(used) else (span, pivots)


def _is_monomial(expression: Any) -> bool:
    """Whether an expression is written as a product of variables, their powers and numbers."""
    return expression.is_Mul and all(
        f.is_Symbol or (f.is_Pow and f.base.is_Symbol) or f.is_number for f in expression.args
    )


def _gradients(expression: Any, used: Sequence[int], world: Symbolics) -> list[Functional]:
    """Gradients of an expression at random points, without those where it is not defined.

    Where a root or a logarithm is complex, its gradient depends on the same functions as where it is real.
    """
    gradient = [world.slope(expression, i) for i in used]
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
            parts = (mpmath.re, mpmath.im) if any(isinstance(g, mpmath.mpc) for g in row) else (mpmath.mpf,)
            rows += [{i: part(g) for i, g in zip(used, row, strict=True)} for part in parts]
    return rows


def reduced(rows: Sequence[Mapping[int, mpmath.mpf]]) -> Span:
    """A basis of the span of linear functions and its pivots, the largest factors; see :class:`.splitting.Term`."""
    with mpmath.workdps(DIGITS + 20):
        by_pivot = echelon(rows, mpmath.mpf(10) ** -30)
    pivots = tuple(sorted(by_pivot))
    return tuple(by_pivot[pivot] for pivot in pivots), pivots


def form_text(functional: Functional, names: Sequence[str]) -> str:
    """A linear function in words."""
    parts = [names[i] if abs(c - 1) < NOTHING else f"{mpmath.nstr(c, 6)}*{names[i]}" for i, c in functional.items()]
    return " + ".join(parts)


# ---------------------------------------------------------------------------------------------------------------------
# Flows that are polynomials in the time: Lie series that end.
#
# Along the flow of f(l_1, ..., l_r) with commuting l_a the field is X = sum_a a_a X_a, X_a that of l_a, a_a constant.
# After the time 1 a coordinate is sum_n X^n w_i / n!.  Where X_a are polynomials that each move a coordinate by others
# which are moved before it, as a magnetic field moves momenta by positions, only finitely many terms are not 0.
# ---------------------------------------------------------------------------------------------------------------------

#: What a coordinate is moved by: factors by (monomial of the a_a, monomial of the w_i).
PairSeries = dict[tuple[Monomial, Monomial], mpmath.mpf]
_MOST_TERMS, _LONGEST = 24, 500  # of a series, and monomials of a term


class EndlessSeries(ValueError):
    """A series has more terms, or longer ones, than are looked at."""


def series(fields: Sequence[VectorField]) -> dict[int, PairSeries]:
    """By how much each coordinate is moved that is moved at all, X w_i + X^2 w_i / 2 + ...; or EndlessSeries."""
    rows = _first(fields)
    with mpmath.workdps(DIGITS):
        return {row: _summed(motion, rows) for row, motion in rows.items()}


def constant_rates(fields: Sequence[VectorField]) -> tuple[dict[int, PairSeries], list[VectorField]]:
    """(how coordinates are moved that move at constant rates and move no others, the fields without them)."""
    others = {n for field in fields for row, monomial in field if monomial for n in (row, *monomial)}
    steady = [{place: c for place, c in field.items() if place[0] not in others} for field in fields]
    return _first(steady), [{place: c for place, c in field.items() if place[0] in others} for field in fields]


def _first(fields: Sequence[VectorField]) -> dict[int, PairSeries]:
    """sum_n a_n X_n w_i for each coordinate w_i that is moved."""
    rows: dict[int, PairSeries] = {}
    for n, field in enumerate(fields):
        for (row, monomial), c in field.items():
            rows.setdefault(row, {})[(n,), monomial] = c
    return rows


def _summed(first: PairSeries, rows: Mapping[int, PairSeries]) -> PairSeries:
    terms, n, term = [*first.items()], 1, first
    while term := _along(term, rows):
        n += 1
        if n > _MOST_TERMS or len(term) > _LONGEST:
            raise EndlessSeries
        terms += [(key, c / math.factorial(n)) for key, c in term.items()]
    return summed(terms)


def _along(function: PairSeries, rows: Mapping[int, PairSeries]) -> PairSeries:
    """X f."""
    return summed(
        ((tuple(sorted(times + more)), tuple(sorted(monomial[:place] + monomial[place + 1 :] + other))), factor * c)
        for (times, monomial), factor in function.items()
        for place, m in enumerate(monomial)  # the derivative by w_m, power by power
        for (more, other), c in rows.get(m, {}).items()
    )


#: (terms with exact flows, products y_i y_j of components that do not commute)
TermParts = tuple[list["Term"], list[Any]]


class Quadratic(NamedTuple):
    """A quadratic function u that the flows of functions of it keep, in one of two ways.

    Its field is a component that commutes with everything, or 1, times an affine field.  Or it is Q(s) + C with linear
    functions s that it keeps, which commute, and a Casimir function C, so that its field is that of Q(s).
    """

    function: Any  #: u in the variables
    terms: PairSeries  #: the same as a polynomial
    form: Any = sympy.S.Zero  #: Q(s) in the variables
    factor: Any = sympy.S.One  #: the component
    field: VectorField = MappingProxyType({})  #: the affine field; none that does not vanish where there is a form


class Term(NamedTuple):
    """A function of linear functions, and of quadratic ones, all of which commute."""

    expression: Any  #: in the variables, the parameters and, where forms were diagonalised, in :class:`Constants`
    functionals: tuple[Functional, ...]  #: in reduced form: each has the factor 1 at its pivot, where the others have 0
    pivots: tuple[int, ...]
    varying: bool  #: whether the factors depend on parameters
    inner: Mapping[Any, Quadratic] = MappingProxyType({})  #: the quadratic functions by their symbols
    outer: Any = None  #: where there are some, the expression with these symbols
    joined: int = 0  #: of how many terms it is the sum that do not commute, see ``joining``

    def slope(self, symbol: Any) -> Any:
        """Derivative by a variable, Casimir functions being kept, or by the symbol of a quadratic function."""
        outer = self.outer if self.inner else self.expression
        inner = [sympy.diff(outer, s) * sympy.diff(u.form, symbol) for s, u in self.inner.items()]
        total = sympy.Add(sympy.diff(outer, symbol), *inner)
        return total.xreplace({s: u.function for s, u in self.inner.items()})


class Constants:
    """Numbers found from the parameters, which formulas name κ1, κ2, ..."""

    def __init__(self) -> None:
        self.values: dict[sympy.Symbol, mpmath.mpf] = {}

    def symbol(self, value: mpmath.mpf) -> Any:
        """A number as a symbol; 0 and 1 as themselves."""
        if abs(value) < NOTHING or abs(value - 1) < NOTHING:
            return sympy.Integer(round(value))
        symbol = sympy.Symbol(f"κ{len(self.values) + 1}", real=True)
        self.values[symbol] = value
        return symbol


class Flow(NamedTuple):
    """Terms that commute, to be moved by together; or one term that has no exact flow."""

    terms: tuple[Term, ...]
    lacking: str = ""  #: why there is no exact flow; "" where there is one

    @property
    def expression(self) -> Any:
        return sympy.Add(*(term.expression for term in self.terms))

    @property
    def varying(self) -> bool:
        return any(term.varying for term in self.terms)

    @property
    def together(self) -> str:
        """How many terms it moves by at once, for people; "" for one."""
        count = sum(term.joined or len(sympy.Add.make_args(term.expression)) for term in self.terms)
        joined = sum(term.joined for term in self.terms)
        if joined in (0, count):
            return f"{count} terms {'joined' if joined else 'merged'}" if count > 1 else ""
        return f"{count} terms merged, {joined} of them joined"

    def slope(self, symbol: Any) -> Any:
        """Derivative by a variable, Casimir functions being kept."""
        return sympy.Add(*(term.slope(symbol) for term in self.terms))

    def reduced(self) -> Span:
        """All linear functions that the terms depend on, in reduced form, and their pivots."""
        return reduced([f for term in self.terms for f in term.functionals])


def single(expression: Any, world: Symbolics) -> Term:
    """Term that an expression is; NoExactFlow if it is none."""
    functionals, pivots = functionals_of(expression, world)
    for first, second in itertools.combinations(functionals, 2):
        if not world.bracket.commuting(first, second):
            names = " and ".join(form_text(f, world.bracket.coordinates) for f in (first, second))
            text = shortened(world.name(expression))
            raise NoExactFlow(f"'{text}' depends on {names.replace('+ -1.0*', '- ')}, which do not commute")
    fields = list(map(world.bracket.field, functionals))
    try:
        if any(map(is_curved, fields)):
            series(fields)
    except EndlessSeries:
        raise NoExactFlow(f"'{shortened(world.name(expression))}' moves by a Lie series that does not end") from None
    varying = bool(world.bracket.formulas) or (any(len(f) > 1 for f in functionals) and world.varies(expression))
    return Term(expression, functionals, pivots, varying)


def parts(addends: Sequence[Any], world: Symbolics) -> tuple[list[Term], list[Any], list[tuple[Any, str]]]:
    """(terms, products of components that do not commute, (addend without an exact flow, reason)) of a sum."""
    terms: list[Term] = []
    crossing: list[Any] = []
    lacking: list[tuple[Any, str]] = []
    left = list(addends)
    while left:
        addend = left.pop(0)
        try:
            more, cross = _terms([addend], world)
        except NowhereFinite:
            raise
        except NoExactFlow as refused:
            if parts := _written_parts(addend, world):
                left = parts + left
            else:
                lacking.append((addend, str(refused)))
        else:
            terms, crossing = terms + more, crossing + cross
    return terms, crossing, lacking


def diagonalised(
    terms: Sequence[Term], crossing: Sequence[Any], world: Symbolics, constants: Constants
) -> Sequence[Term]:
    """Terms and products as terms: the quadratic forms that products are a part of as squares of linear functions."""
    by_factor: dict[Any, list[Any]] = {}  # of time alone
    for product in crossing:
        factor, rest = split_in_time(product, world.time)
        by_factor.setdefault(factor, []).append(rest)
    for factor, products in by_factor.items():
        for component in connected(map(world.used, products)):
            inside = [t for t in terms if not t.inner and _is_square_within(t.expression, component, factor, world)]
            others = [term for term in terms if term not in inside]
            form = sympy.Add(*products, *(split_in_time(term.expression, world.time)[1] for term in inside))
            terms = [*others, *_diagonalised(form, component, factor, world, constants)]
    return terms


def without_flow(expression: Any, reason: str, world: Symbolics) -> Flow:
    """The stand-in for the flow of a function that has none in closed form."""
    expression = merged_powers(expression)
    return Flow((Term(expression, *functionals_of(expression, world), world.varies(expression)),), reason)


def commute(terms: Sequence[Term], others: Sequence[Term], bracket: Bracket) -> bool:
    """Whether all linear and quadratic functions that some terms depend on commute with those of others."""
    first, second = (list(itertools.chain.from_iterable(term.functionals for term in side)) for side in (terms, others))
    if not all(itertools.starmap(bracket.commuting, itertools.product(first, second))):
        return False
    mine, theirs = ([u for term in side for u in term.inner.values()] for side in (terms, others))
    functions = [(u.terms, v) for u, v in itertools.product(mine, theirs)]
    linear = [*itertools.product(first, theirs), *itertools.product(second, mine)]
    functions += [({((), (i,)): c for i, c in f.items()}, u) for f, u in linear]
    with mpmath.workdps(DIGITS):
        return not any(_along(function, _first([u.field])) for function, u in functions)


def merged(terms: Iterable[Term], bracket: Bracket) -> list[Flow]:
    """Each term in the first flow with which it commutes, or in one of its own."""
    flows: list[tuple[bool, list[Term]]] = []
    for term in terms:
        curved = any(map(is_curved, map(bracket.field, term.functionals)))  # so that its flow is a series
        for is_series, flow in flows:
            if curved == is_series and commute([term], flow, bracket):
                flow.append(term)
                break
        else:
            flows.append((curved, [term]))
    return [Flow(tuple(flow)) for _, flow in flows]


def _terms(addends: Sequence[Any], world: Symbolics, are_expanded: bool = False) -> TermParts:
    """Terms and products that a sum consists of; NoExactFlow if an addend is neither.

    Addends of an expanded sum are no functions of quadratic functions: (q^2 + p^2)^2 as a whole is better.
    """
    terms: list[Term] = []
    crossing: list[Any] = []
    for addend in addends:
        if not world.used(addend):
            continue  # a constant moves nothing
        try:
            terms.append(single(addend, world))
            continue
        except NoExactFlow as refused:
            reason = refused
        if world.is_casimir(addend):
            continue  # so does a Casimir function
        expanded = sorted(sympy.Add.make_args(sympy.expand(addend)), key=world.used)
        if len(expanded) > 1:
            try:
                more, cross = _terms(expanded, world, are_expanded=True)
            except NoExactFlow:
                if (term := by_quadratics(addend, world)) is None:
                    raise
                more, cross = [term], []
            terms, crossing = terms + more, crossing + cross
        elif all(map(world.bracket.is_affine, world.used(addend))) and degree_of(addend, world) == 2:
            crossing.append(addend)
        elif not are_expanded and (term := by_quadratics(addend, world)):
            terms.append(term)
        else:
            raise reason
    return terms, crossing


def _written_parts(addend: Any, world: Symbolics) -> list[Any]:
    """Addends of a sum times factors, as they are written; none of other expressions."""
    sums = [f for f in sympy.Mul.make_args(addend) if f.is_Add and world.used(f)]
    if len(sums) != 1:
        return []
    outer = [f for f in sympy.Mul.make_args(addend) if f is not sums[0]]
    return [sympy.Mul(*outer, part) for part in sorted(sums[0].args, key=world.used)]


def _is_square_within(expression: Any, components: set[int], factor: Any, world: Symbolics) -> bool:
    """Whether an expression is a quadratic form of these components times a factor that depends on time alone."""
    used, (own, expression) = world.used(expression), split_in_time(expression, world.time)
    if own != factor or (world.time is not None and world.time in expression.free_symbols):
        return False
    return set(used) <= components and degree_of(expression, world) == 2


def _diagonalised(form: Any, components: set[int], factor: Any, world: Symbolics, constants: Constants) -> list[Term]:
    """Quadratic form, of these components only, as squares of linear functions, its principal axes; with a factor.

    The factor, 1 or a function of time alone, is that of all of them.
    """
    order = sorted(components)
    with mpmath.workdps(DIGITS + 20):
        matrix = mpmath.zeros(len(order))
        for places, coefficient in monomials(form, world.variables).items():
            if set(places) <= components:
                i, j = (order.index(place) for place in places)
                value = precise(coefficient.xreplace(dict(world.parameters)))
                matrix[i, j] += value / 2
                matrix[j, i] += value / 2
        weights, axes = mpmath.eigsy(matrix)
        size = max(abs(weight) for weight in weights)
        terms = []
        for n in range(len(order)):
            if abs(weights[n]) <= size * NOTHING:
                continue
            functional = {i: axes[r, n] for r, i in enumerate(order) if abs(axes[r, n]) > mpmath.mpf(10) ** -30}
            (functional,), (pivot,) = reduced([functional])
            scale = next(axes[r, n] for r, i in enumerate(order) if i == pivot)
            line = sympy.Add(*(constants.symbol(c) * world.variables[i] for i, c in functional.items()))
            weight = constants.symbol(weights[n] * scale**2)
            terms.append(Term(factor * weight * line**2, (functional,), (pivot,), True))
    return terms


# ---------------------------------------------------------------------------------------------------------------------
# Functions of quadratic functions.
#
# Where {u, f} = 0 for all the u and linear l that f = F(u_1, ..., l_1, ...) is a function of, the flow of f keeps them,
# and its field is the sum of theirs with the numbers dF/du, dF/dl.
# ---------------------------------------------------------------------------------------------------------------------

_MOST_KEPT = 20  # linear functions s


def by_quadratics(function: Any, world: Symbolics) -> Term | None:
    """A function of quadratic functions and of linear ones as a term; None if it is no such function."""
    factor, rest = split_in_time(function, world.time)
    if world.time in rest.free_symbols or not all(map(world.bracket.is_affine, world.used(rest))):
        return None
    inner: dict[Any, Quadratic] = {}
    with mpmath.workdps(DIGITS):
        outer = _replaced(rest, world, inner)
    if not inner:
        return None
    at = {symbol: u.form + sympy.sqrt(7 + 4 * n) for n, (symbol, u) in enumerate(inner.items())}
    try:
        functionals, pivots = functionals_of(outer.xreplace(at), world)
    except NoExactFlow:
        return None
    varying = bool(world.bracket.formulas) or any(world.varies(u.function) for u in inner.values())
    varying = varying or (any(len(f) > 1 for f in functionals) and world.varies(rest))
    term = Term(function, functionals, pivots, varying, inner, factor * outer)
    return term if commute([term], [term], world.bracket) else None


def _replaced(e: Any, world: Symbolics, inner: dict[Any, Quadratic]) -> Any:
    """An expression with symbols for the quadratic functions in it, which are added to `inner`."""
    if (total := degree(e, world)) <= 2:
        return e if total < 2 else _of_degree_two(e, world, inner)
    if e.is_Add and total < sympy.oo and len(e.args) <= _LONGEST:
        e = e if (factors := sympy.factor(e)).is_Add else factors
    return e.func(*(_replaced(part, world, inner) for part in _joined_operands(e, world)))


def _joined_operands(e: Any, world: Symbolics) -> list[Any]:
    """Operands of an expression, with quadratic functions in one: the low terms of a sum, q^3 p^3 as (q p)^3."""
    parts = list(e.args)
    if e.is_Add:
        low = [part for part in parts if degree(part, world) <= 2]
        return [sympy.Add(*low), *(part for part in parts if part not in low)]
    return _paired(parts, world) if e.is_Mul else parts


def _paired(parts: list[Any], world: Symbolics) -> list[Any]:
    """Factors of a product, with the same power of two linear functions as one of their product."""
    powers = [part.as_base_exp() for part in parts]
    for n in dict.fromkeys(n for _, n in powers):
        pair = [base for base, m in powers if m == n and degree(base, world) == 1]
        if len(pair) == 2:
            parts = [part for part in parts if part not in [base**n for base in pair]]
            parts.append(sympy.Pow(sympy.Mul(*pair), n, evaluate=False))
    return parts


def degree(e: Any, world: Symbolics) -> Any:
    """Degree of a polynomial; infinity for another function."""
    return sympy.Poly(e, *world.variables).total_degree() if e.is_polynomial(*world.variables) else sympy.oo


def _of_degree_two(e: Any, world: Symbolics, inner: dict[Any, Quadratic]) -> Any:
    """A polynomial of degree 2 with a symbol in its place, or symbols in place of parts that no bracket links."""
    rest, symbols, bracket = sympy.expand(e), sympy.S.Zero, world.bracket
    squares = [piece for piece in sympy.Add.make_args(rest) if degree(piece, world) == 2]
    used = {*world.used(sympy.Add(*squares))}
    groups = connected([*map(world.used, squares), *(pair for pair in bracket.entries if used >= {*pair})])
    for group in ({*range(bracket.dimension)}, *groups):
        inside = [p for p in sympy.Add.make_args(rest) if world.used(p) and group >= {*world.used(p)}]
        whole, form = sympy.Add(*inside), sympy.Add(*(piece for piece in inside if piece in squares))
        with contextlib.suppress(NoExactFlow):
            single(form, world)
            continue  # a function of linear functions that commute
        if u := by_affine_field(whole, world) or by_affine_field(form, world) or _by_kept(form, world):
            rest -= u.function
            if symbols == 0 and not world.used(rest):
                u, rest = u._replace(function=e), sympy.S.Zero  # as it is written, where less cancels
            symbol = _symbol_of(u, inner)
            inner[symbol], symbols = u, symbols + symbol
    return e if symbols == 0 else rest + symbols


def _symbol_of(u: Quadratic, inner: Mapping[Any, Quadratic]) -> Any:
    """Symbol that stands for a quadratic function, a new one unless it has one in `inner`."""
    symbol = next((s for s, other in inner.items() if other.function == u.function), None)
    return symbol or sympy.Symbol(f"ζ{len(inner) + 1}", real=True)


def _quadratic(u: Any, world: Symbolics, **more: Any) -> Quadratic:
    """Function with its polynomial and what else is known of it."""
    numbers = monomials(u.xreplace(dict(world.parameters)), world.variables)
    return Quadratic(u, {((), monomial): precise(c) for monomial, c in numbers.items()}, **more)


def rates_of(u: Any, world: Symbolics, at: Mapping[Any, Any] = MappingProxyType({})) -> dict[int, Any]:
    """{w_i, u} by coordinate, at some values of parameters."""
    rates = world.rates({i: sympy.diff(u, world.variables[i]) for i in world.used(u)})
    return {i: rate.xreplace(dict(at)) for i, rate in rates.items()}


def affine_rates(rates: Mapping[int, Any], world: Symbolics) -> tuple[Any, dict[int, Any]] | None:
    """(c, affine functions) of which the rates are the products, c being 1 or a component that nothing moves, or None.

    Rates may be infinite or complex at the values of parameters.
    """
    linked = {i for pair in world.bracket.entries for i in pair}
    for factor in (sympy.S.One, *(y for i, y in enumerate(world.variables) if i not in linked)):
        changes = {row: sympy.expand(rate / factor) for row, rate in rates.items()}
        if any(change.has(sympy.I, sympy.zoo, sympy.nan, sympy.oo) for change in changes.values()):
            return None
        if all(degree(change, world) < 2 for change in changes.values()):
            return factor, changes
    return None


def by_affine_field(u: Any, world: Symbolics) -> Quadratic | None:
    """Function with its affine field and the factor of that, if it has one."""
    if (found := affine_rates(rates_of(u, world, world.parameters), world)) is None:
        return None
    terms = ((row, monomials(change, world.variables)) for row, change in found[1].items())
    field = summed(((row, monomial), precise(c)) for row, of in terms for monomial, c in of.items())
    return _quadratic(u, world, factor=found[0], field=field)


def _by_kept(u: Any, world: Symbolics) -> Quadratic | None:
    """Function as Q(s) + C, if it is one; exact, so that all factors must be fractions."""
    bracket, variables, rates = world.bracket, world.variables, rates_of(u, world, world.parameters)
    linked = connected({*pair}.union(*entry) for pair, entry in bracket.entries.items())
    within = set().union(*(part for part in linked if part & {*world.used(u)})) - bracket.logarithmic
    casimirs = [c for c in world.casimirs if degree(c, world) == 2 and within >= {*world.used(c)}]
    try:
        rows = _relations([sympy.expand(rates.get(i, 0)) for i in sorted(within)], variables)
        linear = [sympy.Add(*(c * variables[i] for c, i in zip(row, sorted(within), strict=True))) for row in rows]
        factors = itertools.combinations_with_replacement([sympy.S.One, *linear], 2)
        products = [sympy.expand(a * b) for a, b in factors] if len(linear) <= _MOST_KEPT else []
        rows = _relations([*casimirs, *products, u], variables)
    except sympy.CoercionFailed:
        return None
    for row in rows:
        if row[-1] != 0:
            form = sympy.Add(*(c * p / -row[-1] for c, p in zip(row[len(casimirs) :], products, strict=False)))
            return _quadratic(u, world, form=form)
    return None


def _relations(polynomials: Sequence[Any], variables: Sequence[Any]) -> list[list[Any]]:
    """A basis of the exact numbers with which some polynomials add up to 0."""
    columns = [monomials(polynomial, variables) for polynomial in polynomials]
    present = {monomial for column in columns for monomial in column}
    rows = [[sympy.QQ.from_sympy(column.get(m, sympy.S.Zero)) for column in columns] for m in sorted(present)]
    basis = DomainMatrix(rows, (len(rows), len(columns)), sympy.QQ).nullspace().to_Matrix()
    return [list(basis.row(r)) for r in range(basis.rows)]
