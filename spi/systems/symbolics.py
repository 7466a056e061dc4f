"""Formulas of a system: what occurs in them, what they are called, whether they commute with everything."""

import contextlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import mpmath
import sympy

from .brackets import DIGITS, NOTHING, Bracket, Polynomial
from .keys import DefinitionError
from .text import TAKEN, NumberError, Symbols


class Symbolics(NamedTuple):
    """What formulas are made of."""

    bracket: Bracket
    variables: tuple[sympy.Symbol, ...]  #: y_1, ..., y_d
    parameters: Mapping[sympy.Symbol, Any]  #: -> value, an exact number
    time: Any = None  #: the symbol of time, None where a parameter or variable is called t

    def used(self, expression: Any) -> tuple[int, ...]:
        """The components that occur in an expression."""
        free = expression.free_symbols
        return tuple(i for i, y in enumerate(self.variables) if y in free)

    def at_a_time(self) -> dict[Any, Any]:
        """What stands for time where a formula is looked at."""
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

    def by_coordinate(self, derivative: Any, i: int) -> Any:
        """The derivative of a function by the coordinate w_i, made of that by y_i; see ``coordinates``."""
        if i not in self.bracket.logarithmic:
            return derivative
        return sympy.Add(*(self.variables[i] * term for term in sympy.Add.make_args(derivative)))

    def slope(self, function: Any, i: int) -> Any:
        """The derivative of a function by the coordinate w_i, at the values of the parameters."""
        derivative = self.by_coordinate(sympy.diff(function, self.variables[i]), i)
        return derivative.xreplace(dict(self.parameters))

    def gradient_at(self, function: Any, point: Sequence[Any]) -> dict[int, Any]:
        """The gradient of a function by coordinate, to the digits at hand; without those where it is not defined."""
        found = {}
        for i in self.used(function):
            with contextlib.suppress(TypeError, ValueError, ZeroDivisionError):
                slope = self.slope(function, i).xreplace(self.at_a_time())
                found[i] = mpmath.mpmathify(numeric(self.variables, slope)(*point))
        return found

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

    def keeps(self, function: Any, functional: Mapping[int, Any]) -> bool:
        """Whether a linear function commutes with a function, so that its flow keeps it: likewise."""
        field, d = self.bracket.field(functional), len(self.variables)
        tried = 0
        with mpmath.workdps(DIGITS):
            for n in range(6):
                point = [mpmath.frac(mpmath.sqrt(3 + 5 * n + 11 * j) * 13) + mpmath.mpf(1) / 8 for j in range(d)]
                gradient = self.gradient_at(function, point)
                if len(gradient) < len(self.used(function)):
                    continue  # not defined there
                terms = [gradient[i] * c * [*point, 1][k] for (i, k), c in field.items() if i in gradient]
                if abs(mpmath.fsum(terms)) > NOTHING * (1 + max(map(abs, terms), default=0)):
                    return False
                tried += 1
        return tried > 0


def numeric(variables: Sequence[Any], what: Any) -> Callable[..., Any]:
    """Expressions as a function of numbers of mpmath."""
    known = {"Heaviside": _step, "DiracDelta": _delta}
    found: Callable[..., Any] = sympy.lambdify(variables, what, [known, "mpmath"])
    return found


def _step(x: Any, at_0: Any) -> Any:
    """The derivative of max(x, 0)."""
    return at_0 if x == 0 else mpmath.mpf(x > 0)


def _delta(x: Any) -> Any:
    """The second one, wherever it exists."""
    return mpmath.mpf(0)


def _applied(bracket: Bracket, gradient: dict[int, Any], point: Sequence[Any]) -> tuple[dict[int, Any], Any]:
    """B v by coordinate, and the size of the largest of the terms that are added up there."""
    moved: dict[int, Any] = {}
    size = mpmath.mpf(0)
    for (i, j), entry in bracket.at(point).items():
        for row, column, sign in ((i, j, 1), (j, i, -1)):
            if column in gradient:
                term = sign * entry * gradient[column]
                moved[row] = moved.get(row, mpmath.mpf(0)) + term
                size = max(size, abs(term))
    return moved, size


def degree_of(value: Any, world: Symbolics) -> int | None:
    """The degree of a homogeneous polynomial; None for another function."""
    if not value.is_polynomial(*world.variables):
        return None
    return sympy.Poly(value, *world.variables).homogeneous_order()


def check_name(name: str, key: str) -> None:
    """DefinitionError if formulas cannot name a parameter or a size so."""
    is_name = name.isidentifier() and name.isascii() and not name.startswith("_")
    if not is_name or name in TAKEN:
        raise DefinitionError(
            "is not a valid name; use letters from a to z and digits, and not the name of a function", key, name
        )


def polynomial(value: Any, formulas: Symbols) -> Polynomial:
    """A polynomial in the variables, as factors by monomial; NumberError if it is none."""
    symbols = list(formulas.variables.values())
    expanded = sympy.expand(value)
    if not expanded.is_polynomial(*symbols):
        raise NumberError("a bracket must be a polynomial in the variables")
    found: Polynomial = {}
    for powers, c in sympy.Poly(expanded, *symbols).terms():
        if c != 0:
            found[tuple(n for n, power in enumerate(powers) for _ in range(power))] = c
    return found


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


def check_finite(functions: Sequence[Any], world: Symbolics, constants: Mapping[Any, Any]) -> None:
    """DefinitionError if the parameters make one of some Hamiltonians infinite or complex everywhere."""
    for function in functions:
        for y in world.used(function):
            derivative = sympy.diff(function, world.variables[y])
            for factor in derivative.atoms(sympy.Pow):
                if not factor.exp.is_negative or factor.free_symbols & set(world.variables):
                    continue
                value = factor.base.xreplace(world.parameters).xreplace(constants)
                if value == 0:
                    name = next((str(s) for s in sorted(factor.base.free_symbols, key=str)), "")
                    raise DefinitionError(
                        f"makes the Hamiltonian infinite, '{world.name(factor.base)}' is 0; take another value",
                        *(
                            ["parameters", name]
                            if any(name == str(symbol) for symbol in world.parameters)
                            else ["hamiltonian"]
                        ),
                    )
        if function.xreplace(dict(world.parameters)).has(sympy.I, sympy.zoo, sympy.nan, sympy.oo):
            name = world.name(function)
            what = f"has no finite real value at these parameters: '{shortened(name)}'"
            raise DefinitionError(f"{what}; take others", "parameters")
