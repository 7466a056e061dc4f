"""Formulas of a system written in YAML as sums of terms, and names of its variables."""

import re
from collections.abc import Mapping
from typing import Any

from spi.expressions.arithmetic import NumberError, in_parentheses
from spi.expressions.ranges import entries, indexed, outside, parts, repeated
from spi.expressions.symbols import Exact, expression

_NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)


class Symbols(Exact):
    """Meaning of the grammar in expressions of sympy, those of variables, parameters and the time among them.

    `variables` and `parameters` map names, such as "x(1)", to symbols; `indices` are words with whole values, the sizes
    of the system and the indices of ranges.
    """

    def __init__(
        self,
        variables: Mapping[str, Any] | None = None,
        parameters: Mapping[str, Any] | None = None,
        indices: Mapping[str, int] | None = None,
        time: Any = None,
    ) -> None:
        super().__init__(indices or {})
        self.variables, self.parameters = variables or {}, parameters or {}
        self.families = {name.partition("(")[0] for name in self.variables if "(" in name}
        self.time = time
        in_time = {} if time is None else {"t": time}
        self.constants = {**in_time, **self.parameters, **self.variables, **self.constants}
        self.hidden = [word for word in in_time if self.constants[word] is time]

    def in_time(self, time: Any) -> "Symbols":
        """These symbols with the word t for time, unless a variable, a parameter or a size has this name."""
        if time is not None and "t" in self.constants:
            return self
        return Symbols(self.variables, self.parameters, self.indices, time)

    def unknown(self, word: str) -> NumberError:
        if word == "t":
            return NumberError("t, the time, stands in hamiltonian, pieces, noises and sigma alone")
        return super().unknown(word)

    def variable(self, name: str) -> Any:
        return self.variables.get(name)


def addends(text: str, algebra: Symbols) -> list[Any]:
    """Addends of a text, in its order, those of a ``sum(...)`` one after the other."""
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
    """Parts of a sum, each with its sign; the sign of a factor or in a literal such as 1e-3 does not separate."""
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
    """Names in an entry such as ``P1`` or ``x(i), y(i) for i = 1..n``."""
    names = []
    for body, inner in repeated(text, algebra):
        for part in parts(body):
            word, parenthesis, rest = part.strip().partition("(")
            if not _NAME.fullmatch(word.strip()) or (parenthesis and not rest.endswith(")")):
                raise NumberError(f"'{part.strip()}' is not a name; names have letters from a to z, digits and _")
            names.append(indexed(word.strip(), rest[:-1], inner) if parenthesis else word)
    return names
