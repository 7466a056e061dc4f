"""Formulas as expressions of sympy, in which numbers are exact: 0.1 is 1/10, cos(pi/2) is 0.

The grammar is that of ``arithmetic.py`` with the words of ``ranges.py``.  A text is parsed, never evaluated as Python.
Importing this takes a third of a second.
"""

import sys
from collections.abc import Mapping
from typing import Any

import sympy

from .arithmetic import COMPARISONS, NumberError, read
from .ranges import Words

_LARGEST = sympy.Float(sys.float_info.max)
_DEEPEST = 50  # functions within functions; the recursions of SymPy end somewhere above 100


class Exact(Words):
    """Meaning of the grammar in expressions of sympy; `indices` are words with whole values, sizes and indices."""

    longest = 20_000
    compares = True

    def __init__(self, indices: Mapping[str, int]) -> None:
        self.indices = indices
        self.constants = {"pi": sympy.pi, **{name: sympy.Integer(value) for name, value in indices.items()}}

    def number(self, literal: str) -> Any:
        """Decimals are exact: 0.1 is 1/10."""
        return sympy.Rational(literal)

    def negative(self, a: Any) -> Any:
        return -a

    def combine(self, sign: str, a: Any, b: Any) -> Any:
        """a + b, a - b, a * b, a / b or a ^ b."""
        if sign in COMPARISONS:
            raise NumberError(f"'{sign}' has jumps and stands in functions alone")
        if sign == "/" and b == 0:
            raise ZeroDivisionError
        if sign == "^":
            if a == 0 and (b.is_negative or b == 0):
                raise ZeroDivisionError
            if b.is_number and not (abs(b) <= 100):
                raise OverflowError
            return a**b
        return {"+": a + b, "-": a - b, "*": a * b}[sign] if sign != "/" else a / b

    def apply(self, function: str, a: Any) -> Any:
        return sympy.Abs(a) if function == "abs" else getattr(sympy, function)(a)

    def total(self, terms: list[Any]) -> Any:
        return sympy.Add(*terms)

    def several(self, word: str, values: list[Any]) -> Any:
        try:
            return (sympy.Max if word == "max" else sympy.Min)(*values)
        except ValueError:
            raise NumberError("it has no finite real value") from None


def expression(text: str, algebra: Exact) -> Any:
    """Expression that a text stands for; NumberError, with a short reason, if it is none."""
    value = read(text, algebra)
    if value.has(sympy.I, sympy.zoo, sympy.nan, sympy.oo):
        raise NumberError("it has no finite real value")
    if any(abs(number) > _LARGEST for number in value.atoms(sympy.Number)):
        raise NumberError("too large")
    if _depth(value) > _DEEPEST:
        raise NumberError("too deeply nested")
    return value


def _depth(value: Any) -> int:
    return 1 + max(map(_depth, value.args), default=0)
