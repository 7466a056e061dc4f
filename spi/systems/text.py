"""Texts of a system written in YAML: names, index ranges and formulas, read into symbols of sympy.

The grammar is that of ``spi.expressions.arithmetic``, with the variables and parameters of the system as words, and:

    x(i+1)                          a variable with an index, x(mod(i, n) + 1) on a ring of n
    sum(x(i)*x(i+1) for i = 1..n-1) a sum; "for i = 1..n, j = 1..i" runs over pairs
    max(x(1), x(2), 0), min(a, b)   the largest or the least of several
    x(i), y(i) for i = 1..n         in a list, as many entries as the ranges say

A text is parsed, never evaluated as Python.
"""

import difflib
import itertools
import re
import sys
from collections.abc import Iterator, Mapping
from typing import Any

import sympy

from ..expressions.arithmetic import NumberError, in_parentheses, read

FUNCTIONS = {
    **{
        name: getattr(sympy, name)
        for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "log", "sqrt", "atan")
    },
    "abs": sympy.Abs,
}
OF_SEVERAL = {"max": sympy.Max, "min": sympy.Min}
#: Names that no variable, parameter or size can have.
TAKEN = (*FUNCTIONS, *OF_SEVERAL, "pi", "mod", "sum", "for")
_MOST = 10_000  # entries that one range may stand for
_LARGEST = sympy.Float(sys.float_info.max)
_DEEPEST = 50  # functions within functions; the recursions of SymPy end somewhere above 100
_NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)
_RANGE = re.compile(r"\s*([A-Za-z_]\w*)\s*=\s*(.+?)\s*\.\.\s*(.+?)\s*$")


class Symbols:
    """The meaning of the grammar in expressions of sympy.

    `variables` and `parameters` map names, such as "x(1)", to symbols; `indices` are words with whole values, the sizes
    of the system and the indices of ranges.
    """

    longest = 20_000
    calls = True
    functions = (*FUNCTIONS, *OF_SEVERAL, "mod", "sum")

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

    def within(self, indices: Mapping[str, int]) -> "Symbols":
        """These symbols with further indices."""
        return Symbols(self.variables, self.parameters, {**self.indices, **indices}, self.time)

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
        words = [*self.constants, *self.families, *self.functions]
        near = difflib.get_close_matches(word, words, 1)
        return NumberError(f"unknown word '{word}'" + (f", did you mean '{near[0]}'?" if near else ""))

    def negative(self, a: Any) -> Any:
        return -a

    def combine(self, sign: str, a: Any, b: Any) -> Any:
        """a + b, a - b, a * b, a / b or a ^ b."""
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
        return FUNCTIONS[function](a)

    def call(self, word: str, inside: str) -> Any:
        """The value of a word with this text in parentheses; NotImplemented for a function of one argument."""
        if word == "sum":
            return sympy.Add(*(read(body, algebra) for body, algebra in repeated(inside, self)))
        if word == "mod":
            arguments = [whole(part, self) for part in parts(inside)]
            if len(arguments) != 2 or arguments[1] <= 0:
                raise NumberError("mod needs two whole numbers, as in mod(i, n)")
            return sympy.Integer(arguments[0] % arguments[1])
        if word in OF_SEVERAL:
            return self.largest(word, [read(part, self) for part in parts(inside)])
        if word in self.families:
            name = indexed(word, inside, self)
            if name not in self.variables:
                raise NumberError(f"there is no {name}; on a ring of n write {word}(mod(i, n) + 1) for the next")
            return self.variables[name]
        return NotImplemented

    def largest(self, word: str, arguments: list[Any]) -> Any:
        """The largest or the least of some values."""
        if len(arguments) < 2:
            raise NumberError(f"{word} needs two values or more, as in {word}(a, b)")
        try:
            return OF_SEVERAL[word](*arguments)
        except ValueError:
            raise NumberError("it has no finite real value") from None


def indexed(word: str, inside: str, algebra: Symbols) -> str:
    """The name of a variable with indices: x(i, 2) with i = 1 is "x(1,2)"."""
    return f"{word}({','.join(str(whole(part, algebra)) for part in parts(inside))})"


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
            inner = [x for body, bound in repeated(inside, algebra) for x in addends(body, bound)]
        else:
            inner = [expression(part, algebra)]
        terms += [-x for x in inner] if sign == "-" else inner
    return terms


def _signed(text: str) -> list[tuple[str, str]]:
    """The parts of a sum, each with its sign; the sign of a factor or in a literal such as 1e-3 does not separate."""
    signed_parts = [["+", ""]]
    for n, (c, outer) in enumerate(zip(text, _outside(text), strict=True)):
        is_sign = outer in "+-" and text[:n].rstrip()[-1:] not in ("^", "*", "/")
        if not is_sign or re.search(r"[\d.][eE]$", text[:n]):
            signed_parts[-1][1] += c
        elif signed_parts[-1][1].strip():
            signed_parts.append([c, ""])
        else:
            signed_parts[-1][0] = "-" if (signed_parts[-1][0] == "-") != (c == "-") else "+"
    return [(sign, part) for sign, part in signed_parts]


def _outside(text: str) -> str:
    """The text with all that stands in parentheses, and these, replaced by characters without a meaning."""
    depth = itertools.accumulate({"(": 1, ")": -1}.get(c, 0) for c in text)
    return "".join("\0" if d or c == ")" else c for c, d in zip(text, depth, strict=True))


def whole(text: str, algebra: Symbols) -> int:
    """The whole number that an index stands for."""
    value = read(text, Symbols(indices=algebra.indices))
    if not value.is_Integer:
        raise NumberError(f"'{text.strip()}' is not an integer")
    return int(value)


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


def entries(text: str, algebra: Symbols) -> list[tuple[str, Symbols]]:
    """The texts in an entry such as ``x(i)^2, y(i) for i = 1..n``, each with the values of its indices."""
    return [(part, inner) for body, inner in repeated(text, algebra) for part in parts(body)]


def repeated(text: str, algebra: Symbols) -> Iterator[tuple[str, Symbols]]:
    """(body, symbols with the indices bound) for ``body for i = a..b, j = c..d``; a text without ``for`` once."""
    separator = re.search(r"\bfor\b", _outside(text))
    if not separator:
        yield text, algebra
        return
    body, ranges = text[: separator.start()], text[separator.end() :]
    bound = [algebra]
    for part in parts(ranges):
        if not (match := _RANGE.match(part)):
            raise NumberError(f"'{part.strip()}' is not a range such as i = 1..n")
        name, low, high = match.groups()
        taken = name in algebra.constants and algebra.constants[name] is not algebra.time
        if taken or name in algebra.families or name in TAKEN:
            raise NumberError(f"'{name}' is a variable, a parameter or a function; take another word as index")
        bound = [
            inner.within({name: value})
            for inner in bound
            for value in itertools.islice(range(whole(low, inner), whole(high, inner) + 1), _MOST + 1)
        ]
        if len(bound) > _MOST:
            raise NumberError(f"the range runs over more than {_MOST} values")
    for inner in bound:
        yield body, inner


def parts(text: str, separators: str = ",") -> list[str]:
    """The parts of a text between separators outside of parentheses."""
    ends = [n for n, c in enumerate(_outside(text)) if c in separators]
    return [text[start + 1 : end] for start, end in zip([-1, *ends], [*ends, len(text)], strict=True)]


__all__ = [
    *("TAKEN", "NumberError", "Symbols", "addends", "entries", "expression"),
    *("names", "parts", "repeated", "whole"),
]
