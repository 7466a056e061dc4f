"""The splitting of a Hamiltonian into functions of linear functions that commute, whose flows are exact.

If {l_a, l_b} = 0 for all a, b, the flow of f(l_1, ..., l_r) keeps each l_a, so that its field is linear along the flow:
y' = sum_a (df/dl_a)(l(y)) M_a y with the constant matrices M_a of the fields of l_a.
"""

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import mpmath
import sympy

from .brackets import DIGITS, NOTHING, Bracket, Field, Matrix, Monomial, precise, summed
from .driving import by_factor, split_in_time
from .symbolics import (
    Functional,
    NoExactFlow,
    NowhereFinite,
    Quadratic,
    Span,
    Symbolics,
    commuting,
    degree_of,
    form_text,
    functionals_of,
    merged_powers,
    reduced,
    shortened,
    unmoved,
)

# ---------------------------------------------------------------------------------------------------------------------
# Flows that are polynomials in the time: Lie series that end.
#
# Along the flow of f(l_1, ..., l_r) with commuting l_a the field is X = sum_a a_a X_a, X_a that of l_a, a_a constant.
# After the time 1 a coordinate is sum_n X^n w_i / n!.  Where X_a are polynomials that each move a coordinate by others
# which are moved before it, as a magnetic field moves momenta by positions, only finitely many terms are not 0.
# ---------------------------------------------------------------------------------------------------------------------

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


def constant_rates(matrices: Sequence[Matrix], unit: int) -> tuple[dict[int, Series], list[Matrix]]:
    """(how coordinates are moved that move at constant rates and move no others, the matrices without them)."""
    others = {n for entries in matrices for row, column in entries if column != unit for n in (row, column)}
    rates: dict[int, Series] = {}
    for n, entries in enumerate(matrices):
        for (row, _), c in entries.items():
            if row not in others:
                rates.setdefault(row, {})[(n,), ()] = c
    return rates, [{place: c for place, c in entries.items() if place[0] in others} for entries in matrices]


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
    terms, n, term = [*first.items()], 1, first
    while term := _along(term, rows):
        n += 1
        if n > _MOST_TERMS or len(term) > _LONGEST:
            raise EndlessSeries
        terms += [(key, c / math.factorial(n)) for key, c in term.items()]
    return summed(terms)


def _along(function: Series, rows: Mapping[int, Series]) -> Series:
    """X f."""
    return summed(
        ((tuple(sorted(times + more)), tuple(sorted(monomial[:place] + monomial[place + 1 :] + other))), factor * c)
        for (times, monomial), factor in function.items()
        for place, m in enumerate(monomial)  # the derivative by w_m, power by power
        for (more, other), c in rows.get(m, {}).items()
    )


Parts = tuple[list["Term"], list[Any]]  #: (terms with exact flows, products y_i y_j of components that do not commute)


class Term(NamedTuple):
    """A function of commuting linear functions, or of all functions that its flow keeps."""

    expression: Any  #: in the variables, the parameters and, where forms were diagonalised, in :class:`Constants`
    functionals: tuple[Functional, ...]  #: in reduced form: each has the factor 1 at its pivot, where the others have 0
    pivots: tuple[int, ...]
    varying: bool  #: whether the factors depend on parameters
    values: Mapping[Any, Any] = MappingProxyType({})  #: symbols in it -> the invariant functions whose values they are
    original: Any = None  #: where it has such symbols: the same in the variables alone
    inner: Mapping[Any, Quadratic] = MappingProxyType({})  #: those of these functions that are no Casimir functions

    @property
    def whole(self) -> Any:
        """The expression without such symbols."""
        return self.expression if self.original is None else self.original

    def slope(self, variable: Any) -> Any:
        """The derivative by a variable, Casimir functions being kept, or by the symbol of a quadratic function."""
        inner = [sympy.diff(self.expression, s) * sympy.diff(u.form, variable) for s, u in self.inner.items()]
        return sympy.Add(sympy.diff(self.expression, variable), *inner).xreplace(dict(self.values))


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
        return sympy.Add(*(term.whole for term in self.terms))

    def slope(self, variable: Any) -> Any:
        """The derivative by a variable, Casimir functions being kept."""
        return sympy.Add(*(term.slope(variable) for term in self.terms))

    @property
    def varying(self) -> bool:
        return any(term.varying for term in self.terms)

    def reduced(self) -> Span:
        """All linear functions that the terms depend on, in reduced form, and their pivots."""
        return reduced([f for term in self.terms for f in term.functionals])


Otherwise = Callable[[Any], Term | None]  #: another term for an addend without a flow of its own


def single(expression: Any, world: Symbolics) -> Term:
    """The term that an expression is; NoExactFlow if it is none."""
    functionals, pivots = functionals_of(expression, world)
    for first, second in itertools.combinations(functionals, 2):
        if not world.bracket.commuting(first, second):
            names = " and ".join(form_text(f, world.bracket.coordinates) for f in (first, second))
            text = shortened(world.name(expression))
            raise NoExactFlow(f"'{text}' depends on {names.replace('+ -1.0*', '- ')}, which do not commute")
    if world.bracket.higher and not ends(world.bracket, functionals):
        raise NoExactFlow(f"'{shortened(world.name(expression))}' moves by a Lie series that does not end")
    varying = bool(world.bracket.formulas) or (any(len(f) > 1 for f in functionals) and world.varies(expression))
    return Term(expression, functionals, pivots, varying)


def split(
    addends: Sequence[Any],
    world: Symbolics,
    constants: Constants,
    otherwise: Otherwise = lambda addend: None,
) -> list[Flow]:
    """The flows into which a sum splits, in the order of its addends; the last may be that of all that has none.

    `otherwise(addend)`: another term for an addend without an exact flow of its own.
    """
    terms: list[Term] = []
    crossing: list[Any] = []
    lacking: list[tuple[Any, str]] = []  # (addend without an exact flow, reason)
    left = list(addends)
    while left:
        addend = left.pop(0)
        try:
            more, cross = _terms([addend], world, otherwise)
        except NowhereFinite:
            raise
        except NoExactFlow as refused:
            if parts := _written_parts(addend, world):
                left = parts + left
            else:
                lacking.append((addend, str(refused)))
        else:
            terms, crossing = terms + more, crossing + cross
    for factor, products in by_factor(crossing, world.time).items():
        for component in connected(map(world.used, products)):
            inside = [t for t in terms if not t.values and _is_square_within(t.expression, component, factor, world)]
            terms = [term for term in terms if term not in inside]
            form = sympy.Add(*products, *(split_in_time(term.expression, world.time)[1] for term in inside))
            terms += _diagonalised(form, component, factor, world, constants)
    flows = merged(terms, world.bracket)
    if lacking:
        whole, reason = sympy.Add(*(addend for addend, _ in lacking)), lacking[0][1]
        flows += [without_flow(whole, reason, world)] if world.used(whole) else []
    return flows


def without_flow(expression: Any, reason: str, world: Symbolics) -> Flow:
    """The stand-in for the flow of a function that has none in closed form."""
    expression = merged_powers(expression)
    return Flow((Term(expression, *functionals_of(expression, world), world.varies(expression)),), reason)


def commute(terms: Iterable[Term], others: Iterable[Term], bracket: Bracket) -> bool:
    """Whether all linear and quadratic functions that some terms depend on commute with those of others."""
    both = (list(terms), list(others))
    first, second = ([f for term in side for f in term.functionals] for side in both)
    if not all(bracket.commuting(f, g) for f, g in itertools.product(first, second)):
        return False
    mine, theirs = ([u for term in side for u in term.inner.values() if u.fields] for side in both)
    if not all(unmoved(f, u) for f, u in (*itertools.product(first, theirs), *itertools.product(second, mine))):
        return False
    return all(commuting(u, other, bracket.dimension) for u, other in itertools.product(mine, theirs))


def merged(terms: Iterable[Term], bracket: Bracket) -> list[Flow]:
    """Each term in the first flow with which it commutes, or in one of its own."""
    flows: list[list[Term]] = []
    for term in terms:
        for flow in flows:
            if commute([term], flow, bracket) and _is_curved(term, bracket) == _is_curved(flow[0], bracket):
                flow.append(term)
                break
        else:
            flows.append([term])
    return [Flow(tuple(flow)) for flow in flows]


def _is_curved(term: Term, bracket: Bracket) -> bool:
    """Whether its fields are not affine, so that its flow is a series."""
    return any(map(bracket.curved, term.functionals))


def _terms(addends: Sequence[Any], world: Symbolics, otherwise: Otherwise) -> Parts:
    """The terms and products that a sum consists of; NoExactFlow if an addend is neither."""
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
            more, cross = _of_parts(addend, expanded, world, otherwise)
            terms, crossing = terms + more, crossing + cross
        elif all(map(world.bracket.is_affine, world.used(addend))) and degree_of(addend, world) == 2:
            crossing.append(addend)
        elif (term := otherwise(addend)) is not None:
            terms.append(term)
        else:
            raise reason
    return terms, crossing


def _of_parts(addend: Any, expanded: Sequence[Any], world: Symbolics, otherwise: Otherwise) -> Parts:
    """The terms of a sum that is written as a product: expanded, or else its parts as they are written."""
    try:
        return _terms(expanded, world, lambda part: None)
    except NoExactFlow as refused:
        reason = refused
    if (term := otherwise(addend)) is not None:
        return [term], []
    if parts := _written_parts(addend, world):
        return _terms(parts, world, otherwise)
    raise reason


def _written_parts(addend: Any, world: Symbolics) -> list[Any]:
    """The addends of a sum times factors, as they are written; none of other expressions."""
    sums = [f for f in sympy.Mul.make_args(addend) if f.is_Add and world.used(f)]
    if len(sums) != 1:
        return []
    outer = [f for f in sympy.Mul.make_args(addend) if f is not sums[0]]
    return [sympy.Mul(*outer, part) for part in sorted(sums[0].args, key=world.used)]


def connected(links: Iterable[Iterable[int]]) -> list[set[int]]:
    """Numbers that are linked, directly or by others, together; in the order of their smallest."""
    groups: list[set[int]] = []
    for link in map(set, links):
        touching = [group for group in groups if group & link]
        groups = [group for group in groups if not group & link] + [link.union(*touching)]
    return sorted((group for group in groups if group), key=min)


def _is_square_within(expression: Any, components: set[int], factor: Any, world: Symbolics) -> bool:
    """Whether an expression is a quadratic form of these components times a factor that depends on time alone."""
    used, (own, expression) = world.used(expression), split_in_time(expression, world.time)
    if own != factor or (world.time is not None and world.time in expression.free_symbols):
        return False
    if not set(used) <= components or not expression.is_polynomial(*world.variables):
        return False
    monomials = sympy.Poly(expression, *world.variables).monoms()
    return all(sum(monomial) == 2 for monomial in monomials)


def _diagonalised(form: Any, components: set[int], factor: Any, world: Symbolics, constants: Constants) -> list[Term]:
    """The quadratic form, of these components only, as squares of linear functions, its principal axes; with a factor.

    The factor, 1 or a function of time alone, is that of all of them.
    """
    order = sorted(components)
    poly = sympy.Poly(form, *world.variables)
    with mpmath.workdps(DIGITS + 20):
        matrix = mpmath.zeros(len(order))
        for monomial, coefficient in poly.terms() if form != 0 else ():
            places = [i for i, power in enumerate(monomial) for _ in range(power)]
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
