"""Brackets that are polynomials, mostly {y_i, y_j} = sum_k c_ij^k y_k: their conditions and their fields.

A bracket is one of coordinates w: w_i = log y_i for some variables, see ``coordinates``, and w_i = y_i for the others.
"""

import functools
import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import mpmath
import sympy

#: Digits of irrational numbers, and the size below which they count as 0.
DIGITS = 60
NOTHING = mpmath.mpf(10) ** -40

Monomial = tuple[int, ...]  #: w1^2*w3 is (0, 0, 2), and 1 is ()
Polynomial = dict[Monomial, Any]  #: the factor of each monomial
Linear = dict[int, Any]  #: of an affine function of w, the factor of each coordinate, and the constant at the place d
Entry = dict[Any, Any]  #: an affine function with further monomials of degree 2 and more
Matrix = Mapping[tuple[int, int], mpmath.mpf]  #: (row, column) -> number
Field = Mapping[tuple[int, Monomial], mpmath.mpf]  #: (row, monomial of the w_i) -> factor


def added(terms: Iterable[tuple[Any, Any]]) -> dict[Any, Any]:
    """Terms (key, value) with equal keys added up."""
    sums: dict[Any, Any] = {}
    for key, value in terms:
        sums[key] = sums.get(key, 0) + value
    return sums


def summed(terms: Iterable[tuple[Any, Any]]) -> dict[Any, Any]:
    """Terms (key, number) with equal keys added up, without those that vanish."""
    return {key: value for key, value in added(terms).items() if abs(value) > NOTHING}


class BracketError(ValueError):
    """The bracket is none; `keys` lead from the definition to the mistake, the message has the reason and advice."""

    def __init__(self, message: str, *keys: str) -> None:
        super().__init__(message)
        self.keys = keys


class Bracket(NamedTuple):
    """A bracket, checked."""

    variables: tuple[str, ...]
    constants: Mapping[tuple[int, int], Linear]  #: (i, j) with i < j -> {w_i, w_j}, exact numbers; none that vanishes
    formulas: Mapping[tuple[int, int], Entry] = {}  #: in symbols, those that depend on parameters
    higher: Mapping[tuple[int, int], Polynomial] = {}  #: the terms of {w_i, w_j} of degree 2 and more
    logarithmic: frozenset[int] = frozenset()  #: the variables whose logarithms are coordinates; no bracket has these

    @property
    def dimension(self) -> int:
        return len(self.variables)

    @property
    def coordinates(self) -> tuple[str, ...]:
        """The names of the coordinates."""
        return tuple(f"log({name})" if i in self.logarithmic else name for i, name in enumerate(self.variables))

    @property
    def is_lie(self) -> bool:
        """Whether it is a Lie-Poisson bracket: linear, without constants."""
        constant = any(self.dimension in linear for linear in self.constants.values())
        return not (self.higher or self.logarithmic or constant)

    @property
    def is_cross_product(self) -> bool:
        """Whether B(y) v = y x v, whatever the parameters."""
        right = {(0, 1): {2: -1}, (0, 2): {1: 1}, (1, 2): {0: -1}}
        return self.dimension == 3 and self.is_lie and not self.formulas and dict(self.constants) == right

    @property
    def is_kept(self) -> bool:
        """Whether every flow keeps all entries of B, which are then Casimir functions."""
        moving = any(self.field(linear) for linear in self.constants.values())
        return not (moving or self.higher or self.logarithmic)

    def of(self, i: int, j: int) -> Linear:
        """{w_i, w_j} without its terms of higher degree."""
        if i <= j:
            return self.constants.get((i, j), {})
        return {k: -c for k, c in self.constants.get((j, i), {}).items()}

    def entries(self, symbolic: bool = False) -> Iterator[tuple[int, int, Polynomial]]:
        """(i, j, {w_i, w_j}) with i < j, in numbers or with the parameters as symbols."""
        for pair in dict.fromkeys((*self.constants, *self.higher)):
            entry: Entry = {**self.constants.get(pair, {}), **self.higher.get(pair, {})}
            if symbolic:
                entry = self.formulas.get(pair, entry)
            yield *pair, {self.monomial(k): c for k, c in entry.items()}

    def monomial(self, k: Any) -> Monomial:
        """The monomial of the key of a factor in an entry."""
        return k if isinstance(k, tuple) else () if k == self.dimension else (k,)

    def commute(self, i: int, j: int) -> bool:
        """Whether {w_i, w_j} = 0."""
        pair = (min(i, j), max(i, j))
        return pair not in self.constants and pair not in self.higher

    def is_affine(self, i: int) -> bool:
        """Whether y_i is a coordinate whose brackets are affine."""
        return i not in self.logarithmic and not any(i in pair for pair in self.higher)

    def field(self, functional: Mapping[int, Any]) -> Matrix:
        """M, (row, column) -> number, of the field w' = M (w, 1) of l = sum_j functional[j] w_j, if it is affine."""
        return field_of(self.constants, functional)

    def curved(self, functional: Mapping[int, Any]) -> Field:
        """The terms of degree 2 and more of the field of a linear function, (row, monomial) -> number."""
        return field_of(self.higher, functional)

    def polynomial_field(self, functional: Mapping[int, Any]) -> Field:
        """The whole field of a linear function."""
        return {**self.as_field(self.field(functional)), **self.curved(functional)}

    def as_field(self, entries: Matrix) -> Field:
        """M (w, 1) by row and monomial."""
        return {(row, self.monomial(k)): c for (row, k), c in entries.items()}

    def moves(self, functional: Mapping[int, Any]) -> bool:
        """Whether a linear function of w has a field other than 0."""
        return bool(self.field(functional) or self.curved(functional))

    def commuting(self, first: Mapping[int, Any], second: Mapping[int, Any]) -> bool:
        """Whether two linear functions of w commute."""
        if len(first) == len(second) == 1:
            (i,), (j,) = first, second
            return self.commute(i, j)
        with mpmath.workdps(DIGITS):
            pairs = itertools.product(first.items(), second.items())
            terms: list[Any] = [(k, a * b * precise(c)) for (i, a), (j, b) in pairs for k, c in self.of(i, j).items()]
            curved = self.curved(second) if self.higher else {}
            terms += [(monomial, first.get(row, 0) * c) for (row, monomial), c in curved.items()]
            return not summed(terms)

    def at(self, point: Sequence[Any]) -> dict[tuple[int, int], Any]:
        """{w_i, w_j}, i < j, where w has these values; those of logarithms do not matter."""
        values = {}
        for i, j, polynomial in self.entries():
            terms = (math.prod((point[k] for k in monomial), start=precise(c)) for monomial, c in polynomial.items())
            values[i, j] = mpmath.fsum(terms)
        return values


def field_of(brackets: Mapping[tuple[int, int], Entry], functional: Mapping[int, Any]) -> Entry:
    """(row, term) -> number, of w_i' = sum_j functional[j] {w_i, w_j} where {w_i, w_j} = sum of entry[term] * term."""
    with mpmath.workdps(DIGITS):
        return summed(
            ((row, term), sign * precise(c) * functional[column])
            for (i, j), entry in brackets.items()
            for row, column, sign in ((i, j, 1), (j, i, -1))
            if column in functional
            for term, c in entry.items()
        )


def precise(number: Any) -> mpmath.mpf:
    """A number of sympy to DIGITS digits."""
    if isinstance(number, mpmath.mpf):
        return number
    if number.is_Integer:
        return mpmath.mpf(int(number))
    return _evaluated(number)


@functools.lru_cache(maxsize=10_000)  # a number occurs at many places of a bracket, which are visited often
def _evaluated(number: Any) -> mpmath.mpf:
    with mpmath.workdps(DIGITS):
        if number.is_Rational:
            return mpmath.mpf(number.p) / number.q
        return mpmath.mpf(sympy.N(number, DIGITS + 5)._mpf_)


def checked(
    variables: Sequence[str],
    given: Iterable[tuple[str, int, int, Entry]],
    values: Mapping[Any, Any] = MappingProxyType({}),
    logarithmic: frozenset[int] = frozenset(),
) -> Bracket:
    """The bracket with given (key, i, j, {w_i, w_j}), each pair once or twice, those not given being 0.

    `values` are those of its parameters.

    BracketError if {w_i, w_j} is given twice with values that are not opposite, if {w_i, w_i} is not 0, or if Jacobi's
    identity does not hold.  Exact; where a number is irrational, to 40 digits.
    """
    by_pair: dict[tuple[int, int], Entry] = {}
    formulas: dict[tuple[int, int], Entry] = {}
    for key, i, j, symbolic in given:
        entry = at_values(symbolic, values)
        if any(c.free_symbols for c in symbolic.values()):
            formulas[min(i, j), max(i, j)] = {k: (c if i < j else -c) for k, c in symbolic.items() if k in entry}
        name = "{" + f"{variables[i]}, {variables[j]}" + "}"
        if i == j:
            if entry:
                raise BracketError(
                    f"makes {name} other than 0; a bracket is antisymmetric, leave it out", "bracket", key
                )
            continue
        pair = (min(i, j), max(i, j))
        entry = entry if i < j else {k: -c for k, c in entry.items()}
        before = by_pair.get(pair, entry)
        if not all(_is_zero(sympy.sympify(before.get(k, 0)) - entry.get(k, 0)) for k in {*before, *entry}):
            opposite = "{" + f"{variables[j]}, {variables[i]}" + "}"
            fault = f"{name} is not the opposite of {opposite}"
            raise BracketError(f"is not antisymmetric: {fault}; give one of them only", "bracket", key)
        by_pair[pair] = entry
    constants = {pair: {k: c for k, c in entry.items() if isinstance(k, int)} for pair, entry in by_pair.items()}
    higher = {pair: {k: c for k, c in entry.items() if not isinstance(k, int)} for pair, entry in by_pair.items()}
    bracket = Bracket(
        tuple(variables),
        {pair: linear for pair, linear in constants.items() if linear},
        formulas,
        {pair: polynomial for pair, polynomial in higher.items() if polynomial},
        logarithmic,
    )
    if violation := _violation(bracket) if not bracket.higher else _violation_of_polynomials(bracket):
        a, b, c = (variables[n] for n in violation)
        fault = f"violates Jacobi's identity for {a}, {b}, {c}"
        raise BracketError(f"{fault}; {{{a}, {{{b}, {c}}}}} + cyclic permutations must be 0", "bracket")
    return bracket


def at_values(symbolic: Mapping[Any, Any], values: Mapping[Any, Any]) -> dict[Any, Any]:
    """Factors at some values of the parameters, without those that are 0."""
    numbers = {k: c.xreplace(dict(values)) for k, c in symbolic.items()}
    return {k: c for k, c in numbers.items() if not _is_zero(c)}


def _violation(bracket: Bracket) -> tuple[int, int, int] | None:
    """Three components for which Jacobi's identity does not hold; None if there are none."""
    partners: dict[int, set[int]] = {i: set() for i in range(bracket.dimension + 1)}
    for i, j in bracket.constants:
        partners[i].add(j)
        partners[j].add(i)
    triples = {
        tuple(sorted((i, j, k)))
        for (i, j), linear in bracket.constants.items()
        for k in set().union(*(partners[m] for m in linear)) - {i, j}
    }
    for i, j, k in sorted(triples):
        jacobi = added(
            (n, factor * other)
            for a, b, c in ((i, j, k), (j, k, i), (k, i, j))
            for m, factor in bracket.of(b, c).items()
            for n, other in bracket.of(a, m).items()
        )
        if not all(map(_is_zero, jacobi.values())):
            return i, j, k
    return None


def _violation_of_polynomials(bracket: Bracket) -> tuple[int, int, int] | None:
    """Three such components of a bracket with terms of degree 2 and more."""
    entries: dict[tuple[int, int], Polynomial] = {}
    for i, j, polynomial in bracket.entries():
        entries[i, j], entries[j, i] = polynomial, {monomial: -c for monomial, c in polynomial.items()}
    for i, j, k in itertools.combinations(range(bracket.dimension), 3):
        jacobi = added(
            (tuple(sorted(monomial[:place] + monomial[place + 1 :] + other)), factor * number)
            for a, b, c in ((i, j, k), (j, k, i), (k, i, j))
            for monomial, factor in entries.get((b, c), {}).items()
            for place, m in enumerate(monomial)  # {w_a, w_m} times the derivative by w_m, power by power
            for other, number in entries.get((a, m), {}).items()
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

Given = tuple[str, int, int, Polynomial]  #: key, i, j, {x_i, x_j} with its parameters as symbols


def simplified(
    given: Iterable[Given], values: Mapping[Any, Any], unit: int
) -> tuple[list[tuple[str, int, int, Entry]], frozenset[int]]:
    """(the brackets of the coordinates, the variables whose logarithms are coordinates).

    The key of a monomial of degree 1 is its variable, that of 1 is `unit`.  `values` are those of the parameters.
    """
    nonzero = []
    for key, i, j, polynomial in given:
        numbers = at_values(polynomial, values)
        nonzero.append((key, i, j, {monomial: c for monomial, c in polynomial.items() if monomial in numbers}))
    chosen = _logarithmic([(i, j, monomial) for _, i, j, polynomial in nonzero for monomial in polynomial])
    entries = []
    for key, i, j, polynomial in nonzero:
        divided = {_divided(i, j, monomial, chosen): c for monomial, c in polynomial.items()}
        entries.append((key, i, j, {(m if len(m) > 1 else m[0] if m else unit): c for m, c in divided.items()}))
    return entries, frozenset(chosen)


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
