"""Casimir functions, B(y) grad C(y) = 0 for all y: polynomials computed by linear algebra, or given and verified."""

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Any

import mpmath
import numpy as np
import sympy
from sympy.polys.matrices import DomainMatrix

from .brackets import DIGITS, NOTHING, Bracket, BracketPolynomial, Function, Symbolics, degree_of, precise
from .rows import connected, echelon

MOST_DEGREE = 4
_LARGEST_DENOMINATOR = 1000  #: of the coefficients
_LARGEST_POWER = 12
_MOST_UNKNOWNS = 1000  # monomials of a degree; the null space of so many takes seconds


def search(world: Symbolics, by_name: Sequence[tuple[set[int], int, Any]] = ()) -> tuple[tuple[Function, ...], int]:
    """(the polynomial Casimir functions up to degree 4 that are no sums of products of others, the degree searched).

    For components with Casimir functions `by_name`, (components, degree, function), these; those of degree 4 and more
    are named by their trace.  Up to the degree searched all with coefficients of such denominators are included.
    """
    bracket = world.bracket
    parts = connected({*pair}.union(*entry) for pair, entry in bracket.entries.items())
    linked = set().union(*parts)
    casimirs = [(1, world.variables[i]) for i in range(bracket.dimension) if i not in linked]
    casimirs += [(degree, function) for _, degree, function in by_name]
    searched = MOST_DEGREE
    for part in parts:
        if any(part <= components for components, _, _ in by_name):
            continue
        functions, reached = _of_part(part, world)
        casimirs += functions
        searched = min(searched, reached)
    casimirs.sort(key=lambda pair: pair[0])
    short = {function: f"tr X^{degree}" for _, degree, function in by_name if degree > 3}
    named = (Function(short.get(f) or world.name(f), f, degree_of(f, world)) for _, f in casimirs)
    return tuple(named), searched


def counted(functions: Sequence[Any], world: Symbolics) -> tuple[int, int]:
    """(number of independent ones among some Casimir functions, number of all independent ones).

    Near almost all points the latter is the corank of B(y), the dimension less the rank; not all of them need be
    polynomials, or defined everywhere.
    """
    d = len(world.variables)
    with mpmath.workdps(DIGITS + 20):
        point = [mpmath.frac(mpmath.exp(mpmath.mpf(n + 3) / 2) * 7) + mpmath.mpf(1) / 8 for n in range(d)]
        rows: list[dict[int, Any]] = [{} for _ in range(d)]
        for (i, j), entry in world.bracket.at(point).items():
            rows[i][j], rows[j][i] = entry, -entry
        gradients = [world.gradient_at(function, point) for function in functions]
        return len(echelon(gradients, NOTHING)), d - len(echelon(rows, NOTHING))


def _of_part(part: set[int], world: Symbolics) -> tuple[list[tuple[int, Any]], int]:
    """[(degree, Casimir function)] of linked components, and the degree searched: all where brackets are constant."""
    bracket = world.bracket
    inside = {pair: entry for pair, entry in bracket.entries.items() if pair[0] in part}
    if all([*entry] == [()] for entry in inside.values()):
        return [(1, f) for f in _linear(inside, sorted(part), world)], MOST_DEGREE
    unit = [] if bracket.is_lie else [bracket.dimension]
    return _search_within([*sorted(part), *unit], world)


def _linear(entries: Mapping[tuple[int, int], BracketPolynomial], part: Sequence[int], world: Symbolics) -> list[Any]:
    """Casimir functions of constant brackets {w_i, w_j}: linear in the w_i; all others are functions of them."""
    constants: dict[tuple[int, int], Any] = {
        **entries,
        **{(j, i): {(): -entry[()]} for (i, j), entry in entries.items()},
    }
    matrix = sympy.Matrix([[constants.get((i, j), {}).get((), 0) for j in part] for i in part])
    kernel = DomainMatrix.from_Matrix(matrix, extension=True).to_field().nullspace().rref()[0].to_Matrix().tolist()
    numbers = ([c if c.is_Rational else sympy.Float(float(c)) for c in row] for row in kernel)
    functions = (sympy.Add(*(c * world.coordinate(i) for c, i in zip(row, part, strict=True))) for row in numbers)
    return [_without_logarithms(f, world) for f in functions]


def _search_within(part: Sequence[int], world: Symbolics) -> tuple[list[tuple[int, Any]], int]:
    """[(degree, Casimir function)] of some components that no bracket links with others, and the degree reached."""
    symbols, reached = sympy.symbols(f"w:{len(part)}"), 0
    coordinates = dict(zip(symbols, map(world.coordinate, part), strict=True))
    casimirs: dict[Any, Any] = {}  # a homogeneous polynomial in the symbols -> the function of the variables
    while reached < MOST_DEGREE and math.comb(len(part) + reached, reached + 1) <= _MOST_UNKNOWNS:
        reached += 1
        places = itertools.combinations_with_replacement(range(len(part)), reached)
        monomials = [tuple(map(chosen.count, range(len(part)))) for chosen in places]
        products = [
            math.prod(chosen).as_dict()
            for count in range(2, reached + 1)
            for chosen in itertools.combinations_with_replacement(casimirs, count)
            if sum(factor.total_degree() for factor in chosen) == reached
        ]
        space = _null_space(part, np.array(monomials), world.bracket, len(products))
        given = [[float(product.get(monomial, 0)) for monomial in monomials] for product in products]
        for row in _new_rows(given, space):
            polynomial = sympy.Poly.from_dict(dict(zip(monomials, row, strict=True)), *symbols, domain="QQ")
            function = polynomial.as_expr().xreplace(coordinates)
            if world.is_casimir(function):
                casimirs[polynomial] = function
    functions = ((polynomial.total_degree(), f) for polynomial, f in casimirs.items() if world.used(f))
    return [(degree, _without_logarithms(f, world)) for degree, f in functions], reached


def _null_space(part: Sequence[int], powers: np.ndarray, bracket: Bracket, product_count: int) -> np.ndarray:
    """Coefficients of all Casimir functions of a degree: B(y) grad C(y) = 0 at more points than unknowns.

    `powers`, (monomial, component), are those of the monomials.  No coefficients where there are no more than
    `product_count`, so that no vectors need be computed.
    """
    generator = np.random.default_rng(5)
    count, d = powers.shape
    place = {component: n for n, component in enumerate(part)}
    entries = [
        (place[i], place[j], [([place[k] for k in monomial], float(precise(c))) for monomial, c in polynomial.items()])
        for (i, j), polynomial in bracket.entries.items()
        if i in place
    ]
    gram = np.zeros((count, count))  # of the equations, which number several thousand
    before, wanted = -1, 1.3 * count + 2 * d
    while True:  # equations at different points need not be independent, so more are added until nothing changes
        while wanted > 0:
            y = generator.standard_normal((d,))
            if part[-1] == bracket.dimension:
                y[-1] = 1.0
            structure = np.zeros((d, d))
            for i, j, polynomial in entries:
                structure[i, j] = sum(c * np.prod(y[powers_of]) for powers_of, c in polynomial)
                structure[j, i] = -structure[i, j]
            gradient = np.prod(y**powers, axis=1) * powers.T / y[:, None]  # (component, monomial)
            rows = structure @ gradient
            gram += rows.T @ rows
            wanted -= max(1, np.linalg.matrix_rank(structure))
        values = np.linalg.eigvalsh(gram)
        dimension = int(np.sum(values < 1e-11 * values[-1]))
        if dimension <= product_count:  # it contains all these products, and more equations only make it smaller
            return np.empty((0, count))
        if dimension == before:
            return np.linalg.eigh(gram)[1][:, :dimension].T
        before, wanted = dimension, 0.4 * count


def _new_rows(given: list[list[float]], space: np.ndarray) -> Iterator[list[Any]]:
    """Rows that complete `given` to a basis of a space, with small rational entries; none for irrational ones."""
    pivots: list[int] = []
    for column in range(space.shape[1]):
        if np.linalg.matrix_rank(space[:, [*pivots, column]], tol=1e-8) > len(pivots):
            pivots.append(column)
    for row in np.linalg.solve(space[:, pivots], space):
        exact = [Fraction(c).limit_denominator(_LARGEST_DENOMINATOR) for c in row.tolist()]
        is_near = np.allclose(np.array(exact, float), row, rtol=0.0, atol=1e-8)
        if is_near and np.linalg.matrix_rank(np.array([*given, row]), tol=1e-8) > len(given):
            given.append(row.tolist())
            yield [sympy.Rational(c) for c in exact]


def _without_logarithms(function: Any, world: Symbolics) -> Any:
    """Product of powers x_i^c_i whose logarithm a function is, if it is one; whole powers if they can be small."""
    terms = function.as_coefficients_dict()
    if not all(term in map(world.coordinate, world.bracket.logarithmic) for term in terms):
        return function
    whole = math.lcm(*(int(c.q) for c in terms.values() if c.is_Rational))
    scale = whole if max(abs(c) * whole for c in terms.values()) <= _LARGEST_POWER else 1
    return sympy.Mul(*(term.args[0] ** (scale * c) for term, c in terms.items()))
