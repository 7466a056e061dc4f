"""Arithmetic in the numbers of a spec file: ``2/3``, ``cos(1.1)``, ``2^-16``, ``10^9``, ``0.1+0.3i``.

    whole   = sum [ (<|>|<=|>=) sum ]            which has the value 1 or 0, in formulas alone
    sum     = term { (+|-) term }
    term    = factor { (*|/) factor }
    factor  = (+|-) factor | power
    power   = atom [ (^|**) factor ]             so -2^2 = -4, 2^3^2 = 512, 2^-3 = 1/8
    atom    = literal[i] | pi | i | function ( whole ) | ( whole )

Whole numbers stay whole under + - * and powers, so that 10^9 and 2^64-1 are exact.

:class:`Numbers` defines the operations; ``__init__.py`` and ``symbols.py`` give the same grammar other meanings, in
which the words of ``ranges.py`` stand for several terms.
"""

import cmath
import difflib
import math
import operator
import re
from types import MappingProxyType
from typing import Any

from spi.numerics.types import NumberError

_TOKEN = re.compile(
    r"\s*(?:(?P<literal>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)(?P<imaginary>i\b)?"
    r"|(?P<word>[A-Za-z_]\w*)|(?P<sign>\*\*|[<>]=|[-+*/^()<>])|(?P<end>$)|(?P<other>\S))"
)


def parse(text: str) -> int | float | complex:
    """Value of arithmetic: an int, a finite float, or a complex number if ``i`` occurs in it.

    Raises NumberError for everything else, such as division by zero, overflow or an unknown word.
    """
    return read(text, Numbers())


def read(text: str, algebra: Any) -> Any:
    """Value of `text` in an algebra such as :class:`Numbers`; NumberError if it has none."""
    if len(text) > algebra.longest:
        raise NumberError(f"longer than {algebra.longest} characters")
    try:
        return _Parser(text, algebra).parse()
    except ZeroDivisionError:
        raise NumberError("division by zero") from None
    except OverflowError:
        raise NumberError("too large") from None
    except RecursionError:
        raise NumberError("too deeply nested") from None


class Numbers:
    """Meaning of the grammar in numbers: int, finite float, complex."""

    longest = 200
    compares = False  #: whether comparisons have a value
    calls = False  #: whether a word before a parenthesis is first looked up by :meth:`call`
    functions = ("sin", "cos", "tan", "exp", "log", "sqrt", "abs")
    constants = MappingProxyType({"pi": math.pi, "i": 1j})

    def unknown(self, word: str) -> NumberError:
        """Error about a word that is neither a function nor a constant."""
        near = difflib.get_close_matches(word, (*self.functions, *self.constants), 1)
        return NumberError(f"unknown word '{word}'" + (f", did you mean '{near[0]}'?" if near else ""))

    def number(self, literal: str) -> Any:
        return _finite(int(literal) if literal.isdigit() else float(literal))

    def negative(self, a: Any) -> Any:
        return -a

    def combine(self, sign: str, a: Any, b: Any) -> Any:
        """a + b, a - b, a * b, a / b or a ^ b."""
        return _power(a, b) if sign == "^" else _finite(_ARITHMETIC[sign](a, b))

    def apply(self, function: str, a: Any) -> Any:
        return _apply(function, a)


_ARITHMETIC = {"+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv}
COMPARISONS = {"<": operator.lt, ">": operator.gt, "<=": operator.le, ">=": operator.ge}


class _Parser:
    def __init__(self, text: str, algebra: Any) -> None:
        self.text, self.algebra = text, algebra
        self.position = 0
        self.next()

    def next(self) -> None:
        token = _TOKEN.match(self.text, self.position)
        assert token  # whatever comes is in one of the groups
        self.token, self.position = token, token.end()

    def take(self, *signs: str) -> str | None:
        """Sign at hand if it is one of these, moving on; else None."""
        sign = self.token["sign"]
        if sign not in signs:
            return None
        self.next()
        return sign

    def parse(self) -> Any:
        value = self.whole()
        if self.token["end"] is None:
            raise self.unexpected()
        return value

    def unexpected(self) -> NumberError:
        token = self.token[0].strip()
        return NumberError(f"unexpected '{token}'" if token else "it ends too early")

    def whole(self) -> Any:
        value = self.sum()
        sign = self.take(*COMPARISONS) if self.algebra.compares else None
        return self.algebra.combine(sign, value, self.sum()) if sign else value

    def sum(self) -> Any:
        value = self.term()
        while sign := self.take("+", "-"):
            value = self.algebra.combine(sign, value, self.term())
        return value

    def term(self) -> Any:
        value = self.factor()
        while sign := self.take("*", "/"):
            value = self.algebra.combine(sign, value, self.factor())
        return value

    def factor(self) -> Any:
        if sign := self.take("+", "-"):
            value = self.factor()
            return value if sign == "+" else self.algebra.negative(value)
        base = self.atom()
        return self.algebra.combine("^", base, self.factor()) if self.take("^", "**") else base

    def atom(self) -> Any:
        token = self.token
        if literal := token["literal"]:
            self.next()
            value = self.algebra.number(literal)
            if not token["imaginary"]:
                return value
            unit = self.algebra.constants.get("i")
            if not isinstance(unit, complex):  # a variable, a size or an index has the name
                raise NumberError(f"unexpected '{literal}i'" + (f", write {literal}*i" if unit is not None else ""))
            return value * unit
        if self.take("("):
            return self.closing()
        if not (word := token["word"]):
            raise self.unexpected()
        if self.algebra.calls and self.text.startswith("(", self.position):
            inside, end = in_parentheses(self.text, self.position)
            if (value := self.algebra.call(word, inside)) is not NotImplemented:
                self.position = end
                self.next()
                return value
        self.next()
        if word in self.algebra.constants:
            return self.algebra.constants[word]
        if word not in self.algebra.functions:
            raise self.algebra.unknown(word)
        if not self.take("("):
            raise NumberError(f"'{word}' without parentheses")
        return self.algebra.apply(word, self.closing())

    def closing(self) -> Any:
        value = self.whole()
        if not self.take(")"):
            raise self.unexpected() if self.token["end"] is None else NumberError("a parenthesis is not closed")
        return value


def in_parentheses(text: str, start: int) -> tuple[str, int]:
    """Text in the parentheses that open at `start`, and the position after them."""
    depth = 0
    for position in range(start, len(text)):
        depth += {"(": 1, ")": -1}.get(text[position], 0)
        if depth == 0:
            return text[start + 1 : position], position + 1
    raise NumberError("a parenthesis is not closed")


def _finite(value: Any) -> Any:
    """Value itself; OverflowError if it is infinite, or an int beyond the floats."""
    if isinstance(value, int):
        float(value)
    elif not cmath.isfinite(value):
        raise OverflowError
    return value


def _power(base: Any, exponent: Any) -> Any:
    if isinstance(base, int) and isinstance(exponent, int) and base.bit_length() * max(exponent, 0) > 2048:
        # An exact result could fill the memory; floats overflow at once, and are exact for 0, 1 and -1.
        base = float(base)
    value = _finite(base**exponent)
    if isinstance(value, complex) and not isinstance(base, complex) and not isinstance(exponent, complex):
        raise NumberError(f"({base})^{exponent} has no real value")
    return value


def _apply(name: str, argument: Any) -> Any:
    if name == "abs":
        return abs(argument)
    try:
        return _finite(getattr(cmath if isinstance(argument, complex) else math, name)(argument))
    except ValueError:
        raise NumberError(f"{name}({argument}) has no value") from None
