"""Brackets that are polynomials, mostly {y_i, y_j} = sum_k c_ij^k y_k: their conditions and their fields.

A bracket is one of coordinates w: w_i = log y_i for some variables, see ``coordinates``, and w_i = y_i for the others.
"""

import contextlib
import functools
import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import mpmath
import sympy

from .keys import DefinitionError

#: Digits of irrational numbers, and the size below which they count as 0.
DIGITS = 60
NOTHING = mpmath.mpf(10) ** -40

Monomial = tuple[int, ...]  #: w1^2*w3 is (0, 0, 2), and 1 is ()
BracketPolynomial = dict[Monomial, Any]  #: the factor of each monomial
Matrix = Mapping[tuple[int, int], mpmath.mpf]  #: (row, column) -> number
VectorField = Mapping[tuple[int, Monomial], mpmath.mpf]  #: (row, monomial of the w_i) -> factor


def added(terms: Iterable[tuple[Any, Any]]) -> dict[Any, Any]:
    """Terms (key, value) with equal keys added up."""
    sums: dict[Any, Any] = {}
    for key, value in terms:
        sums[key] = sums.get(key, 0) + value
    return sums


def summed(terms: Iterable[tuple[Any, Any]]) -> dict[Any, Any]:
    """Terms (key, number) with equal keys added up, without those that vanish."""
    return {key: value for key, value in added(terms).items() if abs(value) > NOTHING}


class Bracket(NamedTuple):
    """A bracket, checked."""

    variables: tuple[str, ...]
    #: (i, j) with i < j -> {w_i, w_j}, exact numbers; none that vanishes.
    entries: Mapping[tuple[int, int], BracketPolynomial]
    formulas: Mapping[tuple[int, int], BracketPolynomial] = {}  #: in symbols, those that depend on parameters
    logarithmic: frozenset[int] = frozenset()  #: the variables whose logarithms are coordinates; no bracket has these

    @property
    def dimension(self) -> int:
        return len(self.variables)

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        return tuple(f"log({name})" if i in self.logarithmic else name for i, name in enumerate(self.variables))

    @property
    def is_lie(self) -> bool:
        """Whether it is a Lie-Poisson bracket: linear, without constants."""
        return not self.logarithmic and all(len(m) == 1 for entry in self.entries.values() for m in entry)

    @property
    def is_cross_product(self) -> bool:
        """Whether B(y) v = y x v, whatever the parameters."""
        right = {(0, 1): {(2,): -1}, (0, 2): {(1,): 1}, (1, 2): {(0,): -1}}
        return self.dimension == 3 and self.is_lie and not self.formulas and dict(self.entries) == right

    @property
    def is_kept(self) -> bool:
        """Whether every flow keeps all entries of B, which are then Casimir functions."""
        curved = any(len(monomial) > 1 for entry in self.entries.values() for monomial in entry)
        linear = ({k: c for m, c in entry.items() for k in m} for entry in self.entries.values())
        return not (self.logarithmic or curved or any(map(self.field, linear)))

    def of(self, i: int, j: int) -> BracketPolynomial:
        """{w_i, w_j}."""
        if i <= j:
            return self.entries.get((i, j), {})
        return {monomial: -c for monomial, c in self.entries.get((j, i), {}).items()}

    def in_symbols(self) -> Iterator[tuple[int, int, BracketPolynomial]]:
        """(i, j, {w_i, w_j}) with i < j, with the parameters as symbols."""
        return ((i, j, self.formulas.get((i, j), entry)) for (i, j), entry in self.entries.items())

    def is_affine(self, i: int) -> bool:
        """Whether y_i is a coordinate whose brackets are affine."""
        entries = (entry for pair, entry in self.entries.items() if i in pair)
        return i not in self.logarithmic and all(len(monomial) < 2 for entry in entries for monomial in entry)

    def field(self, functional: Mapping[int, Any]) -> VectorField:
        """Field of a linear function, w_i' = sum_j functional[j] {w_i, w_j}."""
        with mpmath.workdps(DIGITS):
            return summed(
                ((row, monomial), sign * precise(c) * functional[column])
                for (i, j), entry in self.entries.items()
                for row, column, sign in ((i, j, 1), (j, i, -1))
                if column in functional
                for monomial, c in entry.items()
            )

    def commuting(self, first: Mapping[int, Any], second: Mapping[int, Any]) -> bool:
        """Whether two linear functions of w commute."""
        with mpmath.workdps(DIGITS):
            pairs = itertools.product(first.items(), second.items())
            return not summed((m, a * b * precise(c)) for (i, a), (j, b) in pairs for m, c in self.of(i, j).items())

    def at(self, point: Sequence[Any]) -> dict[tuple[int, int], Any]:
        """{w_i, w_j}, i < j, where w has these values; those of logarithms do not matter."""
        return {
            pair: mpmath.fsum(math.prod((point[k] for k in m), start=precise(c)) for m, c in entry.items())
            for pair, entry in self.entries.items()
        }


def is_curved(field: VectorField) -> bool:
    """Whether a field is not affine."""
    return any(len(monomial) > 1 for _, monomial in field)


@functools.lru_cache(maxsize=10_000)  # a number occurs at many places of a bracket, which are visited often
def precise(number: Any) -> mpmath.mpf:
    """A number of sympy to DIGITS digits."""
    if isinstance(number, mpmath.mpf):
        return number
    with mpmath.workdps(DIGITS):
        if number.is_Rational:
            return mpmath.mpf(number.p) / number.q
        return mpmath.mpf(sympy.N(number, DIGITS + 5)._mpf_)


BracketEntry = tuple[str, int, int, BracketPolynomial]  #: key, i, j, {x_i, x_j} with its parameters as symbols


def _times(entry: BracketPolynomial, factor: int) -> BracketPolynomial:
    return {monomial: factor * c for monomial, c in entry.items()}


def _are_equal(first: BracketPolynomial, second: BracketPolynomial) -> bool:
    return all(_is_zero(sympy.sympify(first.get(m, 0)) - second.get(m, 0)) for m in {*first, *second})


def checked(
    variables: Sequence[str],
    given: Iterable[BracketEntry],
    values: Mapping[Any, Any] = MappingProxyType({}),
    logarithmic: frozenset[int] = frozenset(),
) -> Bracket:
    """Bracket with given {w_i, w_j}, each pair once or twice, those not given being 0.

    `values` are those of its parameters.

    DefinitionError if {w_i, w_j} is given twice with values that are not opposite, if {w_i, w_i} is not 0, or if
    Jacobi's identity does not hold.  Exact; where a number is irrational, to 40 digits.
    """
    entries: dict[tuple[int, int], BracketPolynomial] = {}
    formulas: dict[tuple[int, int], BracketPolynomial] = {}
    for key, i, j, symbolic in given:
        pair, sign = (min(i, j), max(i, j)), 1 if i < j else -1
        entry = _times(at_values(symbolic, values), sign)
        if any(c.free_symbols for c in symbolic.values()):
            formulas[pair] = {monomial: c for monomial, c in _times(symbolic, sign).items() if monomial in entry}
        name, opposite = ("{" + f"{variables[a]}, {variables[b]}" + "}" for a, b in ((i, j), (j, i)))
        if i == j and entry:
            raise DefinitionError(
                f"makes {name} other than 0; a bracket is antisymmetric, leave it out", "bracket", key
            )
        if not _are_equal(entries.get(pair, entry), entry):
            fault = f"{name} is not the opposite of {opposite}"
            raise DefinitionError(f"is not antisymmetric: {fault}; give one of them only", "bracket", key)
        entries[pair] = entry
    nonzero = {pair: entry for pair, entry in entries.items() if entry}
    bracket = Bracket(tuple(variables), nonzero, formulas, logarithmic)
    if violation := _violation(bracket):
        a, b, c = (variables[n] for n in violation)
        fault = f"violates Jacobi's identity for {a}, {b}, {c}"
        raise DefinitionError(f"{fault}; {{{a}, {{{b}, {c}}}}} + cyclic permutations must be 0", "bracket")
    return bracket


def at_values(symbolic: Mapping[Any, Any], values: Mapping[Any, Any]) -> dict[Any, Any]:
    """Factors at some values of the parameters, without those that are 0."""
    numbers = {k: c.xreplace(dict(values)) for k, c in symbolic.items()}
    return {k: c for k, c in numbers.items() if not _is_zero(c)}


def _violation(bracket: Bracket) -> tuple[int, int, int] | None:
    """Three components for which Jacobi's identity does not hold; None if there are none."""
    for i, j, k in itertools.combinations(range(bracket.dimension), 3):
        jacobi = added(
            (tuple(sorted(monomial[:place] + monomial[place + 1 :] + other)), factor * number)
            for a, b, c in ((i, j, k), (j, k, i), (k, i, j))
            for monomial, factor in bracket.of(b, c).items()
            for place, m in enumerate(monomial)  # {w_a, w_m} times the derivative by w_m, power by power
            for other, number in bracket.of(a, m).items()
        )
        if not all(map(_is_zero, jacobi.values())):
            return i, j, k
    return None


def _is_zero(number: Any) -> bool:
    return bool(number == 0) or (not number.is_Rational and abs(precise(number)) < NOTHING)


# ---------------------------------------------------------------------------------------------------------------------
# Coordinates in which a polynomial bracket is simpler: the logarithms of some variables, the others as they are.
#
# With w_i = log x_i, {w_i, f} = {x_i, f}/x_i.  A log-canonical bracket {x_i, x_j} = a_ij x_i x_j is constant then, and
# a flow that moves w_i at a constant rate multiplies x_i by an exponential: positive x_i stay positive.
# ---------------------------------------------------------------------------------------------------------------------


def simplified(given: Iterable[BracketEntry], values: Mapping[Any, Any]) -> tuple[list[BracketEntry], frozenset[int]]:
    """(the brackets of the coordinates, the variables whose logarithms are coordinates).

    `values` are those of the parameters.
    """
    nonzero = []
    for key, i, j, polynomial in given:
        numbers = at_values(polynomial, values)
        nonzero.append((key, i, j, {monomial: c for monomial, c in polynomial.items() if monomial in numbers}))
    chosen = _logarithmic([(i, j, monomial) for _, i, j, polynomial in nonzero for monomial in polynomial])
    return [
        (key, i, j, {_divided(i, j, monomial, chosen): c for monomial, c in polynomial.items()})
        for key, i, j, polynomial in nonzero
    ], frozenset(chosen)


def _logarithmic(monomials: Sequence[tuple[int, int, Monomial]]) -> set[int]:
    """None where all brackets, with monomials (i, j, monomial), are affine; else the largest set of such variables.

    Each divides all of its brackets; and after all divisions no bracket has any of them.
    """
    if all(len(monomial) <= 1 for _, _, monomial in monomials):
        return set()
    chosen = {n for i, j, _ in monomials for n in (i, j)}
    chosen -= {n for i, j, monomial in monomials for n in (i, j) if n not in monomial}
    while left := {n for i, j, monomial in monomials for n in _divided(i, j, monomial, chosen) if n in chosen}:
        chosen -= left
    return chosen


def _divided(i: int, j: int, monomial: Monomial, chosen: set[int]) -> Monomial:
    """A monomial of {x_i, x_j} divided by those of x_i and x_j whose logarithms are coordinates."""
    rest = list(monomial)
    for n in {i, j} & chosen:
        rest.remove(n)
    return tuple(rest)


# ---------------------------------------------------------------------------------------------------------------------
# Formulas of a system: their variables, their names, whether they commute with everything.
# ---------------------------------------------------------------------------------------------------------------------


class Symbolics(NamedTuple):
    """Symbols of formulas and their meaning."""

    bracket: Bracket
    variables: tuple[sympy.Symbol, ...]  #: y_1, ..., y_d
    parameters: Mapping[sympy.Symbol, Any]  #: -> value, an exact number
    time: Any = None  #: the symbol of time, None where a parameter or variable has the name t
    casimirs: Sequence[Any] = ()  #: the known Casimir functions

    def used(self, expression: Any) -> tuple[int, ...]:
        """Components that occur in an expression."""
        free = expression.free_symbols
        return tuple(i for i, y in enumerate(self.variables) if y in free)

    def at_a_time(self) -> dict[Any, Any]:
        """Value of time at which formulas are tested."""
        return {self.time: sympy.sqrt(19) / 7} if self.time is not None else {}

    def varies(self, expression: Any) -> bool:
        """Whether a parameter occurs in it."""
        return any(symbol in self.parameters for symbol in expression.free_symbols)

    def coordinate(self, i: int) -> Any:
        """w_i as a formula; 1 for i = d."""
        if i == len(self.variables):
            return sympy.Integer(1)
        return sympy.log(self.variables[i]) if i in self.bracket.logarithmic else self.variables[i]

    def name(self, expression: Any) -> str:
        """An expression in the words of the user."""
        words = dict(zip(self.variables, map(sympy.Symbol, self.bracket.variables), strict=True))
        return str(expression.xreplace(words)).replace("**", "^")

    def derivative(self, function: Any, i: int) -> Any:
        """Derivative of a function by the coordinate w_i; see :attr:`Bracket.coordinates`."""
        return self.by_coordinate(sympy.diff(function, self.variables[i]), i)

    def by_coordinate(self, derivative: Any, i: int) -> Any:
        """The same from that by y_i."""
        return sympy.Add(*(self.factor(i) * term for term in sympy.Add.make_args(derivative)))

    def factor(self, i: int) -> Any:
        """Derivative of y_i by its coordinate w_i."""
        return self.variables[i] if i in self.bracket.logarithmic else sympy.Integer(1)

    def rates(self, v: Mapping[int, Any]) -> dict[int, Any]:
        """w_i' for y' = B(y) v, by coordinate, with the parameters as symbols; v by component."""
        terms: dict[int, list[Any]] = {}
        for i, j, polynomial in self.bracket.in_symbols():
            for row, column, sign in ((i, j, 1), (j, i, -1)):
                if column in v:
                    products = (c * sympy.Mul(*(self.variables[k] for k in m)) for m, c in polynomial.items())
                    entry = sympy.Add(*products) * self.factor(column)
                    terms.setdefault(row, []).append(sign * v[column] * entry)
        return {i: sympy.Add(*of) for i, of in terms.items()}

    def field(self, function: Any) -> dict[int, Any]:
        """B(y) grad f by component."""
        rates = self.rates({i: sympy.diff(function, self.variables[i]) for i in self.used(function)})
        return {i: self.factor(i) * rate for i, rate in rates.items() if rate != 0}

    def along(self, function: Any, direction: Mapping[int, Any]) -> Any:
        """Derivative of a function along a vector."""
        moved = (i for i in self.used(function) if i in direction)
        return sympy.Add(*(sympy.diff(function, self.variables[i]) * direction[i] for i in moved))

    def slope(self, function: Any, i: int) -> Any:
        """Derivative of a function by the coordinate w_i, at the values of the parameters."""
        return self.derivative(function, i).xreplace(dict(self.parameters))

    def gradient_at(self, function: Any, point: Sequence[Any]) -> dict[int, Any]:
        """Gradient of a function by coordinate, to the digits at hand; without those where it is not defined."""
        gradient = {}
        for i in self.used(function):
            with contextlib.suppress(TypeError, ValueError, ZeroDivisionError):
                slope = self.slope(function, i).xreplace(self.at_a_time())
                gradient[i] = mpmath.mpmathify(numeric(self.variables, slope)(*point))
        return gradient

    def is_casimir(self, function: Any) -> bool:
        """Whether a function, polynomial or not, is a Casimir function: at random points, to 40 digits."""
        used = self.used(function)
        slopes = [self.slope(function, i).xreplace(self.at_a_time()) for i in used]
        value = numeric(self.variables, slopes)
        tried, d = 0, len(self.variables)
        with mpmath.workdps(DIGITS):
            for n in range(12):
                point = [mpmath.frac(mpmath.sqrt(3 + 5 * n + 11 * j) * 13) + mpmath.mpf(1) / 8 for j in range(d)]
                try:
                    at = dict(zip(used, map(mpmath.mpmathify, value(*point)), strict=True))
                except (TypeError, ValueError, ZeroDivisionError):
                    continue  # not defined there
                moved, size = _applied(self.bracket, at, point)
                if any(abs(c) > NOTHING * (1 + size) for c in moved.values()):
                    return False
                tried += 1
        return tried > 0


class Function(NamedTuple):
    """A Casimir function."""

    text: str  #: in the words of the user
    expression: Any
    degree: int | None  #: of a homogeneous polynomial


def numeric(variables: Sequence[Any], expressions: Any) -> Callable[..., Any]:
    """Expressions as a function of numbers of mpmath."""
    derivatives = {  # of max(x, 0), the second one wherever it exists
        "Heaviside": lambda x, at_0: at_0 if x == 0 else mpmath.mpf(x > 0),
        "DiracDelta": lambda x: mpmath.mpf(0),
    }
    function: Callable[..., Any] = sympy.lambdify(variables, expressions, [derivatives, "mpmath"])
    return function


def _applied(bracket: Bracket, gradient: dict[int, Any], point: Sequence[Any]) -> tuple[dict[int, Any], Any]:
    """B v by coordinate, and the size of the largest of the terms that are added up there."""
    terms = [
        (row, sign * entry * gradient[column])
        for (i, j), entry in bracket.at(point).items()
        for row, column, sign in ((i, j, 1), (j, i, -1))
        if column in gradient
    ]
    return added(terms), max((abs(term) for _, term in terms), default=mpmath.mpf(0))


def degree_of(value: Any, world: Symbolics) -> int | None:
    """Degree of a homogeneous polynomial; None for another function."""
    if not value.is_polynomial(*world.variables):
        return None
    return sympy.Poly(value, *world.variables).homogeneous_order()


def monomials(polynomial: Any, variables: Sequence[Any]) -> BracketPolynomial:
    """Factors of the monomials of a polynomial, those that are not 0."""
    terms = sympy.Poly(polynomial, *variables).terms()
    return {tuple(n for n, power in enumerate(powers) for _ in range(power)): c for powers, c in terms if c != 0}


def merged_powers(function: Any) -> Any:
    """A function in which (b - a)^2 is written as (a - b)^2, so that terms which differ by that alone are merged."""

    def turned(power: Any) -> bool:
        even = power.is_Pow and power.exp.is_Integer and power.exp % 2 == 0
        return bool(even and power.base.is_Add and power.base.could_extract_minus_sign())

    return function.replace(turned, lambda power: (-power.base) ** power.exp)


def shortened(text: Any) -> str:
    """At most 60 characters of a text."""
    text = str(text)
    return text if len(text) <= 60 else f"{text[:57]}..."
