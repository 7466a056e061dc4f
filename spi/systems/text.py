"""Formulas of a system written in YAML, read into symbols of sympy, and names.

The grammar is that of ``spi.expressions.arithmetic`` with the words of ``spi.expressions.ranges``, and the variables
and parameters of the system.  A text is parsed, never evaluated as Python.
"""

import re
import sys
from collections.abc import Mapping
from typing import Any

import sympy

from ..expressions.arithmetic import COMPARISONS, NumberError, in_parentheses, read
from ..expressions.ranges import Words, entries, indexed, outside, parts, repeated

_LARGEST = sympy.Float(sys.float_info.max)
_DEEPEST = 50  # functions within functions; the recursions of SymPy end somewhere above 100
_NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)


class Symbols(Words):
    """The meaning of the grammar in expressions of sympy.

    `variables` and `parameters` map names, such as "x(1)", to symbols; `indices` are words with whole values, the sizes
    of the system and the indices of ranges.
    """

    longest = 20_000
    compares = True

    def __init__(
        self,
        variables: Mapping[str, Any] | None = None,
        parameters: Mapping[str, Any] | None = None,
        indices: Mapping[str, int] | None = None,
        time: Any = None,
    ) -> None:
        self.variables, self.parameters, self.indices = variables or {}, parameters or {}, indices or {}
        self.families = {name.partition("(")[0] for name in self.variables if "(" in name}
        self.time = time
        in_time = {} if time is None else {"t": time}
        self.constants = {"pi": sympy.pi, **in_time, **self.parameters, **self.variables}
        self.constants |= {name: sympy.Integer(value) for name, value in self.indices.items()}
        self.hidden = [word for word in in_time if self.constants[word] is time]

    def in_time(self, time: Any) -> "Symbols":
        """These symbols with the word t for time, unless a variable, a parameter or a size has this name."""
        if time is not None and "t" in self.constants:
            return self
        return Symbols(self.variables, self.parameters, self.indices, time)

    def number(self, literal: str) -> Any:
        """Decimals are exact: 0.1 is 1/10."""
        return sympy.Rational(literal)

    def unknown(self, word: str) -> NumberError:
        if word == "t":
            return NumberError("t, the time, stands in hamiltonian, pieces, noises and sigma alone")
        return super().unknown(word)

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

    def variable(self, name: str) -> Any:
        return self.variables.get(name)


def expression(text: str, algebra: Symbols) -> Any:
    """The expression that a text stands for; NumberError, with a short reason, if it is none."""
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


def addends(text: str, algebra: Symbols) -> list[Any]:
    """The addends of a text, in its order, those of a ``sum(...)`` one after the other."""
    terms = []
    for sign, part in _signed(text):
        start = part.find("(")
        inside, end = in_parentheses(part, start) if part[: max(start, 0)].strip() == "sum" else ("", 0)
        if inside and not part[end:].strip():
            inner = [x for body, bound in entries(inside, algebra) for x in addends(body, bound)]
        else:
            inner = [expression(part, algebra)]
        terms += [-x for x in inner] if sign == "-" else inner
    return terms


def _signed(text: str) -> list[tuple[str, str]]:
    """The parts of a sum, each with its sign; the sign of a factor or in a literal such as 1e-3 does not separate."""
    signed_parts, before, of_factor = [["+", ""]], "", False
    for n, (c, outer) in enumerate(zip(text, outside(text), strict=True)):
        if not c.isspace():
            of_factor = outer in "+-" and (before in ("^", "*", "/") or (of_factor and before in ("+", "-")))
            before = c
        if outer not in "+-" or of_factor or c.isspace() or re.search(r"[\d.][eE]$", text[:n]):
            signed_parts[-1][1] += c
        elif signed_parts[-1][1].strip():
            signed_parts.append([c, ""])
        else:
            signed_parts[-1][0] = "-" if (signed_parts[-1][0] == "-") != (c == "-") else "+"
    return [(sign, part) for sign, part in signed_parts]


def names(text: str, algebra: Symbols) -> list[str]:
    """The names in an entry such as ``P1`` or ``x(i), y(i) for i = 1..n``."""
    names = []
    for body, inner in repeated(text, algebra):
        for part in parts(body):
            word, parenthesis, rest = part.strip().partition("(")
            if not _NAME.fullmatch(word.strip()) or (parenthesis and not rest.endswith(")")):
                raise NumberError(f"'{part.strip()}' is not a name; names have letters from a to z, digits and _")
            names.append(indexed(word.strip(), rest[:-1], inner) if parenthesis else word)
    return names
