"""Formulas of a system: their variables, their names, whether they commute with everything."""

import contextlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import mpmath
import sympy

from .brackets import DIGITS, NOTHING, Bracket, Polynomial, added


class Symbolics(NamedTuple):
    """The symbols of formulas and their meaning."""

    bracket: Bracket
    variables: tuple[sympy.Symbol, ...]  #: y_1, ..., y_d
    parameters: Mapping[sympy.Symbol, Any]  #: -> value, an exact number
    time: Any = None  #: the symbol of time, None where a parameter or variable has the name t
    casimirs: Sequence[Any] = ()  #: the known Casimir functions

    def used(self, expression: Any) -> tuple[int, ...]:
        """The components that occur in an expression."""
        free = expression.free_symbols
        return tuple(i for i, y in enumerate(self.variables) if y in free)

    def at_a_time(self) -> dict[Any, Any]:
        """The value of time at which formulas are tested."""
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
        """The derivative of a function by the coordinate w_i; see :attr:`Bracket.coordinates`."""
        return self.by_coordinate(sympy.diff(function, self.variables[i]), i)

    def by_coordinate(self, derivative: Any, i: int) -> Any:
        """The same from that by y_i."""
        return sympy.Add(*(self.factor(i) * term for term in sympy.Add.make_args(derivative)))

    def factor(self, i: int) -> Any:
        """The derivative of y_i by its coordinate w_i."""
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
        """The derivative of a function along a vector."""
        moved = (i for i in self.used(function) if i in direction)
        return sympy.Add(*(sympy.diff(function, self.variables[i]) * direction[i] for i in moved))

    def slope(self, function: Any, i: int) -> Any:
        """The derivative of a function by the coordinate w_i, at the values of the parameters."""
        return self.derivative(function, i).xreplace(dict(self.parameters))

    def gradient_at(self, function: Any, point: Sequence[Any]) -> dict[int, Any]:
        """The gradient of a function by coordinate, to the digits at hand; without those where it is not defined."""
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
    """The degree of a homogeneous polynomial; None for another function."""
    if not value.is_polynomial(*world.variables):
        return None
    return sympy.Poly(value, *world.variables).homogeneous_order()


def monomials(polynomial: Any, variables: Sequence[Any]) -> Polynomial:
    """The factors of the monomials of a polynomial, those that are not 0."""
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
