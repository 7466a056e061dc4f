"""Casimir functions, B(y) grad C(y) = 0 for all y: polynomials computed by linear algebra, or given and verified."""

import itertools
import math
from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import mpmath
import numpy as np
import sympy
from sympy.polys.matrices import DomainMatrix

from .brackets import DIGITS, NOTHING, Bracket, added, precise
from .splitting import connected
from .symbolics import Function, Symbolics, degree_of, echelon, reduced

MOST_DEGREE = 4
LARGEST_DENOMINATOR = 1000  #: of the coefficients
_LARGEST_POWER = 12
_MOST_UNKNOWNS = 1000  # monomials of a degree; the null space of so many takes seconds


class Search(NamedTuple):
    """The result of a search."""

    functions: tuple[Any, ...]  #: none is a polynomial in the others; of degree 1, 2, ...
    degrees: tuple[int | None, ...]  #: None for a function that is not homogeneous
    searched: int  #: up to this degree all with coefficients of such denominators are included


def search(world: Symbolics, by_name: Sequence[tuple[set[int], int, Any]] = ()) -> Search:
    """The polynomial Casimir functions up to degree 4 that are no sums of products of others.

    For components with Casimir functions `by_name`, (components, degree, function), these.
    """
    bracket = world.bracket
    parts = connected([*({i, j}.union(*polynomial) for i, j, polynomial in bracket.entries())])
    linked = set().union(*parts)
    casimirs = [(1, world.variables[i]) for i in range(bracket.dimension) if i not in linked]
    casimirs += [(degree, function) for _, degree, function in by_name]
    searched = MOST_DEGREE
    for part in parts:
        if any(part <= components for components, _, _ in by_name):
            continue
        constant = [(i, j, c) for i, j, c in bracket.entries() if i in part]
        if all([*polynomial] == [()] for _, _, polynomial in constant):
            casimirs += [(1, f) for f in _linear({(i, j): c[()] for i, j, c in constant}, sorted(part), world)]
            continue
        unit = [] if bracket.is_lie else [bracket.dimension]
        functions, reached = _search_within([*sorted(part), *unit], world)
        casimirs += functions
        searched = min(searched, reached)
    casimirs.sort(key=lambda pair: pair[0])
    return Search(tuple(f for _, f in casimirs), tuple(degree_of(f, world) for _, f in casimirs), searched)


def named(world: Symbolics, by_name: Sequence[tuple[set[int], int, Any]]) -> tuple[tuple[Function, ...], int]:
    """(functions, degree up to which all are known); those `by_name` of degree 4 and more are named by their trace."""
    short = {function: f"tr X^{degree}" for _, degree, function in by_name if degree > 3}
    outcome = search(world, by_name)
    both = zip(outcome.functions, outcome.degrees, strict=True)
    return tuple(Function(short.get(f) or world.name(f), f, degree) for f, degree in both), outcome.searched


def squares_first(functions: tuple[Function, ...], world: Symbolics) -> tuple[tuple[Function, ...], bool]:
    """Some Casimir functions, |y|^2 before all others, and whether it is one of them."""
    squares = sympy.Add(*(y**2 for y in world.variables))
    first = next((n for n, c in enumerate(functions) if c.expression - squares == 0), None)
    if not first:
        return functions, first is not None
    return (functions[first], *functions[:first], *functions[first + 1 :]), True


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


def _linear(constants: dict[tuple[int, int], Any], part: Sequence[int], world: Symbolics) -> list[Any]:
    """The Casimir functions of constant brackets {w_i, w_j}: linear in the w_i; all others are functions of them."""
    matrix = [[constants.get((i, j), 0) - constants.get((j, i), 0) for j in part] for i in part]
    if all(c.is_Rational for c in constants.values()):
        kernel = DomainMatrix.from_Matrix(sympy.Matrix(matrix)).to_field().nullspace().rref()[0].to_Matrix().tolist()
    else:
        kernel = _kernel(matrix)
    functions = (sympy.Add(*(c * world.coordinate(i) for c, i in zip(row, part, strict=True))) for row in kernel)
    return [_without_logarithms(f, world) for f in functions]


def _kernel(matrix: Sequence[Sequence[Any]]) -> list[list[Any]]:
    """A basis of the kernel of a matrix of irrational numbers, in doubles where it is not rational itself."""
    with mpmath.workdps(DIGITS + 20):
        rows = ({j: precise(sympy.sympify(c)) for j, c in enumerate(row) if c != 0} for row in matrix)
        independent, pivots = reduced(list(rows))
        free = [j for j in range(len(matrix)) if j not in pivots]
        basis = [
            {j: mpmath.mpf(1)} | {p: -row.get(j, 0) for row, p in zip(independent, pivots, strict=True)} for j in free
        ]
        return [[_shortest(row.get(j, mpmath.mpf(0))) for j in range(len(matrix))] for row in basis]


def _shortest(c: mpmath.mpf) -> Any:
    """A number as a fraction with small terms, if it is one, or as a double."""
    fraction = Fraction(float(c)).limit_denominator(LARGEST_DENOMINATOR)
    near = sympy.Rational(fraction.numerator, fraction.denominator)
    return near if abs(precise(near) - c) < NOTHING else sympy.Float(float(c))


def _search_within(part: Sequence[int], world: Symbolics) -> tuple[list[tuple[int, Any]], int]:
    """[(degree, Casimir function)] of some components that no bracket links with others, and the degree reached."""
    polynomials: list[tuple[int, dict[tuple[int, ...], Fraction]]] = []
    for degree in range(1, MOST_DEGREE + 1):
        if math.comb(len(part) + degree - 1, degree) > _MOST_UNKNOWNS:
            return _expressions(polynomials, part, world), degree - 1
        monomials = list(itertools.combinations_with_replacement(range(len(part)), degree))
        products = list(_products(polynomials, degree))
        space = _null_space(part, monomials, world.bracket, len(products))
        rows = [[product.get(monomial, Fraction(0)) for monomial in monomials] for product in products]
        for row in _new_rows(rows, space, len(monomials)):
            polynomial = {monomials[n]: c for n, c in enumerate(row) if c}
            if world.is_casimir(_expression(polynomial, part, world)):
                polynomials.append((degree, polynomial))
    return _expressions(polynomials, part, world), MOST_DEGREE


def _null_space(
    part: Sequence[int], monomials: Sequence[tuple[int, ...]], bracket: Bracket, product_count: int
) -> list[list[float]]:
    """The coefficients of all Casimir functions of a degree: B(y) grad C(y) = 0 at more points than unknowns.

    None where there are no more than `product_count`, so that no vectors need be computed.
    """
    generator = np.random.default_rng(5)
    d, count = len(part), len(monomials)
    place = {component: n for n, component in enumerate(part)}
    entries = [
        (place[i], place[j], [([place[k] for k in monomial], float(precise(c))) for monomial, c in polynomial.items()])
        for i, j, polynomial in bracket.entries()
        if i in place
    ]
    powers = np.zeros((count, d), int)
    for n, monomial in enumerate(monomials):
        for i in monomial:
            powers[n, i] += 1
    gram = np.zeros((count, count))  # of the equations, which number several thousand
    before, wanted = -1, 1.3 * count + 2 * d
    while True:  # equations at different points need not be independent, so more are added until nothing changes
        while wanted > 0:
            y = generator.standard_normal(d)
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
            return []
        if dimension == before:
            return np.linalg.eigh(gram)[1][:, :dimension].T.tolist()
        before, wanted = dimension, 0.4 * count


def _new_rows(
    given: Sequence[Sequence[Fraction]], space: Sequence[Sequence[float]], count: int
) -> list[list[Fraction]]:
    """Rows that complete `given` to a basis of a space, with small rational entries; none for irrational ones."""
    if len(space) <= len(given):
        return []
    reduced = _echelon(np.array(space).reshape(-1, count))
    rational = [[Fraction(float(c)).limit_denominator(LARGEST_DENOMINATOR) for c in row] for row in reduced]
    rows, basis = [], [list(map(float, row)) for row in given]
    for row, exact in zip(reduced, rational, strict=True):
        if max(abs(float(e) - c) for e, c in zip(exact, row, strict=True)) > 1e-8:
            continue
        if np.linalg.matrix_rank(np.array([*basis, row]), tol=1e-8) > len(basis):
            basis.append(list(row))
            rows.append(exact)
    return rows


def _echelon(matrix: np.ndarray) -> np.ndarray:
    """The reduced echelon form of a matrix of full row rank."""
    a = matrix.copy()
    row = 0
    for column in range(a.shape[1]):
        best = row + int(np.argmax(np.abs(a[row:, column]))) if row < len(a) else row
        if row >= len(a) or abs(a[best, column]) < 1e-8:
            continue
        a[[row, best]] = a[[best, row]]
        a[row] /= a[row, column]
        others = np.arange(len(a)) != row
        a[others] -= np.outer(a[others, column], a[row])
        row += 1
    a[np.abs(a) < 1e-9] = 0.0
    return a


def _products(
    polynomials: Sequence[tuple[int, dict[tuple[int, ...], Fraction]]], degree: int
) -> Iterable[dict[tuple[int, ...], Fraction]]:
    """All products of some polynomials that have this degree."""
    for count in range(1, degree + 1):
        for chosen in itertools.combinations_with_replacement(polynomials, count):
            if sum(d for d, _ in chosen) == degree and count > 1:
                product: dict[tuple[int, ...], Fraction] = {(): Fraction(1)}
                for _, factor in chosen:
                    pairs = itertools.product(product.items(), factor.items())
                    product = added((tuple(sorted(a + b)), x * y) for (a, x), (b, y) in pairs)
                yield product


def _expressions(
    polynomials: Sequence[tuple[int, Any]], part: Sequence[int], world: Symbolics
) -> list[tuple[int, Any]]:
    functions = [(degree, _expression(polynomial, part, world)) for degree, polynomial in polynomials]
    return [(degree, _without_logarithms(f, world)) for degree, f in functions if world.used(f)]


def _expression(polynomial: dict[tuple[int, ...], Fraction], part: Sequence[int], world: Symbolics) -> Any:
    return sympy.Add(
        *(
            sympy.Rational(c.numerator, c.denominator) * sympy.Mul(*(world.coordinate(part[i]) for i in monomial))
            for monomial, c in polynomial.items()
        )
    )


def _without_logarithms(function: Any, world: Symbolics) -> Any:
    """The product of powers x_i^c_i whose logarithm a function is, if it is one; whole powers if they can be small."""
    terms = function.as_coefficients_dict()
    if not all(term in map(world.coordinate, world.bracket.logarithmic) for term in terms):
        return function
    whole = math.lcm(*(int(c.q) for c in terms.values() if c.is_Rational))
    scale = whole if max(abs(c) * whole for c in terms.values()) <= _LARGEST_POWER else 1
    return sympy.Mul(*(term.args[0] ** (scale * c) for term, c in terms.items()))
