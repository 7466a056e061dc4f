"""Lie-Poisson brackets {y_i, y_j} = sum_k c_ij^k y_k: what they must fulfil, and the fields of linear functions."""

import functools
import itertools
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import mpmath
import sympy

#: Digits to which what is irrational is known; so small is 0 then.
DIGITS = 60
NOTHING = mpmath.mpf(10) ** -40

Linear = dict[int, Any]  #: of a linear function of y, the factor of each component that occurs in it


class BracketError(ValueError):
    """The bracket is none; `keys` lead from the definition to what is wrong, the message says why and what is right."""

    def __init__(self, message: str, *keys: str) -> None:
        super().__init__(message)
        self.keys = keys


class Bracket(NamedTuple):
    """A Lie-Poisson bracket, checked."""

    variables: tuple[str, ...]
    constants: Mapping[tuple[int, int], Linear]  #: (i, j) with i < j -> {y_i, y_j}, exact numbers; none that vanishes
    formulas: Mapping[tuple[int, int], Linear] = {}  #: the same in symbols, for those that depend on parameters

    @property
    def dimension(self) -> int:
        return len(self.variables)

    @property
    def is_cross_product(self) -> bool:
        """Whether B(y) v = y x v, whatever the parameters."""
        return not self.formulas and dict(self.constants) == {(0, 1): {2: -1}, (0, 2): {1: 1}, (1, 2): {0: -1}}

    @property
    def is_kept(self) -> bool:
        """Whether every flow keeps all entries of B, which are then Casimir functions."""
        return not any(self.field(linear) for linear in self.constants.values())

    def of(self, i: int, j: int) -> Linear:
        """{y_i, y_j}."""
        if i <= j:
            return self.constants.get((i, j), {})
        return {k: -c for k, c in self.constants.get((j, i), {}).items()}

    def commute(self, i: int, j: int) -> bool:
        """Whether {y_i, y_j} = 0."""
        return (min(i, j), max(i, j)) not in self.constants

    def field(self, functional: Mapping[int, Any]) -> dict[tuple[int, int], mpmath.mpf]:
        """M, (row, column) -> number, of the field y' = B(y) grad l = M y of l = sum_j functional[j] y_j."""
        entries: dict[tuple[int, int], mpmath.mpf] = {}
        with mpmath.workdps(DIGITS):
            for (i, j), linear in self.constants.items():
                for row, column, sign in ((i, j, 1), (j, i, -1)):
                    if column in functional:
                        for k, c in linear.items():
                            value = sign * precise(c) * functional[column]
                            entries[row, k] = entries.get((row, k), mpmath.mpf(0)) + value
        return {place: value for place, value in entries.items() if abs(value) > NOTHING}

    def commuting(self, first: Mapping[int, Any], second: Mapping[int, Any]) -> bool:
        """Whether two linear functions commute."""
        if len(first) == len(second) == 1:
            (i,), (j,) = first, second
            return self.commute(i, j)
        total: dict[int, mpmath.mpf] = {}
        with mpmath.workdps(DIGITS):
            for (i, a), (j, b) in itertools.product(first.items(), second.items()):
                for k, c in self.of(i, j).items():
                    total[k] = total.get(k, mpmath.mpf(0)) + a * b * precise(c)
        return all(abs(value) < NOTHING for value in total.values())


def precise(number: Any) -> mpmath.mpf:
    """A number of sympy to DIGITS digits."""
    if isinstance(number, mpmath.mpf):
        return number
    if number.is_Integer:
        return mpmath.mpf(int(number))
    return _evaluated(number)


@functools.lru_cache(maxsize=10_000)  # one number stands at many places of a bracket, which are gone through often
def _evaluated(number: Any) -> mpmath.mpf:
    with mpmath.workdps(DIGITS):
        if number.is_Rational:
            return mpmath.mpf(number.p) / number.q
        return mpmath.mpf(sympy.N(number, DIGITS + 5)._mpf_)


def checked(
    variables: Sequence[str],
    given: Iterable[tuple[str, int, int, Linear]],
    values: Mapping[Any, Any] = MappingProxyType({}),
) -> Bracket:
    """The bracket of which (key, i, j, {y_i, y_j}) are given, each pair once or twice, those not given being 0.

    `values` are those of the parameters that occur in it.

    BracketError if {y_i, y_j} is given twice with values that are not opposite, if {y_i, y_i} is not 0, or if Jacobi's
    identity does not hold.  Exact; where a number is irrational, to 40 digits.
    """
    constants: dict[tuple[int, int], Linear] = {}
    formulas: dict[tuple[int, int], Linear] = {}
    for key, i, j, symbolic in given:
        linear = {k: c.xreplace(dict(values)) for k, c in symbolic.items()}
        linear = {k: c for k, c in linear.items() if not _is_zero(c)}
        if any(c.free_symbols for c in symbolic.values()):
            formulas[min(i, j), max(i, j)] = {k: (c if i < j else -c) for k, c in symbolic.items() if k in linear}
        name = "{" + f"{variables[i]}, {variables[j]}" + "}"
        if i == j:
            if linear:
                raise BracketError(
                    f"makes {name} other than 0; a bracket is antisymmetric, leave it out", "bracket", key
                )
            continue
        pair = (min(i, j), max(i, j))
        linear = linear if i < j else {k: -c for k, c in linear.items()}
        if pair in constants and not _equal(constants[pair], linear):
            opposite = "{" + f"{variables[j]}, {variables[i]}" + "}"
            what = f"{name} is not the opposite of {opposite}"
            raise BracketError(f"is not antisymmetric: {what}; give one of them only", "bracket", key)
        constants[pair] = linear
    bracket = Bracket(tuple(variables), {pair: linear for pair, linear in constants.items() if linear}, formulas)
    if violation := _violation(bracket):
        a, b, c = (variables[n] for n in violation)
        what = f"violates Jacobi's identity for {a}, {b}, {c}"
        raise BracketError(f"{what}; {{{a}, {{{b}, {c}}}}} + cyclic permutations must be 0", "bracket")
    return bracket


def _violation(bracket: Bracket) -> tuple[int, int, int] | None:
    """Three components for which Jacobi's identity does not hold; None if there are none."""
    partners: dict[int, set[int]] = {i: set() for i in range(bracket.dimension)}
    for i, j in bracket.constants:
        partners[i].add(j)
        partners[j].add(i)
    triples = {
        tuple(sorted((i, j, k)))
        for (i, j), linear in bracket.constants.items()
        for k in set().union(*(partners[m] for m in linear)) - {i, j}
    }
    for i, j, k in sorted(triples):
        total: Linear = {}
        for a, b, c in ((i, j, k), (j, k, i), (k, i, j)):
            for m, factor in bracket.of(b, c).items():
                for n, other in bracket.of(a, m).items():
                    total[n] = total.get(n, 0) + factor * other
        if any(not _is_zero(value) for value in total.values()):
            return i, j, k
    return None


def _is_zero(number: Any) -> bool:
    return bool(number == 0) or (not number.is_Rational and abs(precise(number)) < NOTHING)


def _equal(first: Linear, second: Linear) -> bool:
    return all(_is_zero(sympy.sympify(first.get(k, 0)) - second.get(k, 0)) for k in {*first, *second})
