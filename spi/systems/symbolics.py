"""Formulas of a system: their variables, their names, whether they commute with everything."""

import contextlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import mpmath
import sympy

from .brackets import DIGITS, NOTHING, Bracket, Matrix, Polynomial, added, summed
from .keys import DefinitionError
from .text import TAKEN, NumberError, Symbols


class Symbolics(NamedTuple):
    """The symbols of formulas and their meaning."""

    bracket: Bracket
    variables: tuple[sympy.Symbol, ...]  #: y_1, ..., y_d
    parameters: Mapping[sympy.Symbol, Any]  #: -> value, an exact number
    time: Any = None  #: the symbol of time, None where a parameter or variable has the name t

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

    def by_coordinate(self, derivative: Any, i: int) -> Any:
        """The derivative of a function by the coordinate w_i, from that by y_i; see :attr:`Bracket.coordinates`."""
        if i not in self.bracket.logarithmic:
            return derivative
        return sympy.Add(*(self.variables[i] * term for term in sympy.Add.make_args(derivative)))

    def slope(self, function: Any, i: int) -> Any:
        """The derivative of a function by the coordinate w_i, at the values of the parameters."""
        derivative = self.by_coordinate(sympy.diff(function, self.variables[i]), i)
        return derivative.xreplace(dict(self.parameters))

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


def check_name(name: str, key: str) -> None:
    """DefinitionError if a parameter or a size cannot have this name in formulas."""
    is_name = name.isidentifier() and name.isascii() and not name.startswith("_")
    if not is_name or name in TAKEN:
        right = "use letters from a to z and digits, and not the name of a function"
        raise DefinitionError(f"is not a valid name; {right}", key, name)


def polynomial(value: Any, formulas: Symbols) -> Polynomial:
    """A polynomial in the variables, as factors by monomial; NumberError if it is none."""
    symbols = list(formulas.variables.values())
    expanded = sympy.expand(value)
    if not expanded.is_polynomial(*symbols):
        raise NumberError("a bracket must be a polynomial in the variables")
    factors: Polynomial = {}
    for powers, c in sympy.Poly(expanded, *symbols).terms():
        if c != 0:
            factors[tuple(n for n, power in enumerate(powers) for _ in range(power))] = c
    return factors


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
                    name = min(map(str, factor.base.free_symbols), default="")
                    keys = ("parameters", name) if name in map(str, world.parameters) else ("hamiltonian",)
                    fault = f"makes the Hamiltonian infinite, '{world.name(factor.base)}' is 0"
                    raise DefinitionError(f"{fault}; take another value", *keys)
        if function.xreplace(dict(world.parameters)).has(sympy.I, sympy.zoo, sympy.nan, sympy.oo):
            name = world.name(function)
            fault = f"has no finite real value at these parameters: '{shortened(name)}'"
            raise DefinitionError(f"{fault}; take others", "parameters")


# ---------------------------------------------------------------------------------------------------------------------
# Linear functions of the state, by the factors of components, and quadratic functions that a flow keeps.
# ---------------------------------------------------------------------------------------------------------------------

Functional = dict[int, mpmath.mpf]  #: a linear function of y, the factor of each component that occurs in it
Span = tuple[tuple[Functional, ...], tuple[int, ...]]  #: linear functions, reduced, and their pivots


class NoExactFlow(ValueError):
    """A term whose flow is not known in closed form; the message names it."""


class NowhereFinite(NoExactFlow):
    """A term that has no finite value."""


def functionals_of(expression: Any, world: Symbolics, fixed: Iterable[Any] = ()) -> Span:
    """The fewest linear functions that an expression depends on: the span of its gradients, at random points."""
    used = world.used(expression)
    coordinates = tuple({i: mpmath.mpf(1)} for i in used)
    if len(used) == 1:
        return coordinates, used
    if (
        expression.is_Mul
        and not world.bracket.logarithmic.intersection(used)
        and all(f.is_Symbol or (f.is_Pow and f.base.is_Symbol) or f.is_number for f in expression.args)
    ):
        return coordinates, used  # a monomial
    numbers = {symbol: sympy.sqrt(7 + 4 * n) for n, symbol in enumerate(fixed)}
    gradient = [world.slope(expression, i).xreplace(numbers) for i in used]
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
            # where a root or a logarithm is complex, its gradient depends on the same functions as where it is real
            parts = (mpmath.re, mpmath.im) if any(isinstance(g, mpmath.mpc) for g in row) else (mpmath.mpf,)
            rows += [{i: part(g) for i, g in zip(used, row, strict=True)} for part in parts]
        if not rows:
            raise NowhereFinite(f"'{world.name(expression)}' has no finite value at these parameters")
    span, pivots = reduced(rows)
    return (coordinates, used) if len(span) == len(used) else (span, pivots)


def reduced(rows: Sequence[Mapping[int, mpmath.mpf]]) -> Span:
    """A basis of the span of linear functions and its pivots, the largest factors; see :class:`.splitting.Term`."""
    with mpmath.workdps(DIGITS + 20):
        by_pivot = echelon(rows, mpmath.mpf(10) ** -30)
    pivots = tuple(sorted(by_pivot))
    return tuple(by_pivot[pivot] for pivot in pivots), pivots


def echelon(rows: Iterable[Mapping[int, Any]], tiny: mpmath.mpf) -> dict[int, dict[int, Any]]:
    """The span of rows by pivot, each row with 1 at its pivot, its largest entry (of equal ones the first).

    All other rows have 0 there; entries up to `tiny` are 0.
    """
    left = [dict(row) for row in rows]
    by_pivot: dict[int, dict[int, Any]] = {}
    while left := [row for row in left if any(abs(c) > tiny for c in row.values())]:
        row = left.pop(0)
        largest = max(abs(c) for c in row.values())
        pivot = min(i for i, c in row.items() if abs(c) > largest * (1 - mpmath.mpf(10) ** -9))
        row = {i: c / row[pivot] for i, c in row.items() if abs(c) > largest * tiny}
        row[pivot] = mpmath.mpf(1)
        left = [without(other, pivot, row, tiny) for other in left]
        by_pivot = {p: without(other, pivot, row, tiny) for p, other in by_pivot.items()}
        by_pivot[pivot] = row
    return by_pivot


def without(row: dict[int, Any], pivot: int, by: dict[int, Any], tiny: mpmath.mpf) -> dict[int, Any]:
    """A row minus the multiple of another one that makes its entry at the pivot 0."""
    factor = row.get(pivot)
    if not factor:
        return row
    new = {i: row.get(i, 0) - factor * by.get(i, 0) for i in sorted({*row, *by} - {pivot})}
    return {i: c for i, c in new.items() if abs(c) > tiny}


def form_text(functional: Functional, names: Sequence[str]) -> str:
    """A linear function in words."""
    parts = [names[i] if abs(c - 1) < NOTHING else f"{mpmath.nstr(c, 6)}*{names[i]}" for i, c in functional.items()]
    return " + ".join(parts)


class Quadratic(NamedTuple):
    """A quadratic function u, in one of two ways.

    Either u = Q(s) + C with Q of degree 2 in linear functions that u keeps and a Casimir function C; or its field is
    sum_c y_c M_c y with components y_c that commute with everything, or y_d = 1.
    """

    function: Any  #: u in the variables
    form: Any  #: Q(s) in the variables; 0 where there are fields
    fields: tuple[tuple[int, Matrix], ...]  #: of (c, M_c)
    slopes: Matrix  #: grad u = slopes y, needed where there are fields


def unmoved(functional: Mapping[int, mpmath.mpf], u: Quadratic) -> bool:
    """Whether a linear function commutes with u, by the fields of u."""
    return not any(
        summed((column, functional[row] * c) for (row, column), c in entries.items() if row in functional)
        for _, entries in u.fields
    )


def commuting(u: Quadratic, other: Quadratic, dimension: int) -> bool:
    """Whether {u, other} = 0, both having fields: at random points, to 40 digits."""
    with mpmath.workdps(DIGITS):
        for n in range(3):
            point = [mpmath.frac(mpmath.sqrt(5 + 3 * n + 7 * j) * 19) + mpmath.mpf(1) / 8 for j in range(dimension)]
            point.append(mpmath.mpf(1))
            slopes = _times(u.slopes, point)
            total = size = mpmath.mpf(0)
            for c, entries in other.fields:
                for row, value in _times(entries, point).items():
                    term = point[c] * value * slopes.get(row, 0)
                    total, size = total + term, max(size, abs(term))
            if abs(total) > NOTHING * (1 + size):
                return False
    return True


def _times(entries: Matrix, y: Sequence[Any]) -> dict[int, Any]:
    return added((row, value * y[column]) for (row, column), value in entries.items())
