"""Words that stand for several terms, and indices, in every meaning of the grammar.

x(i+1)                          a variable with an index, x(mod(i, n) + 1) on a ring of n
sum(x(i)*x(i+1) for i = 1..n-1) a sum; "for i = 1..n, j = 1..i" runs over pairs; sum(a, b, c) has these terms
max(x(1), x(2), 0), min(a, b)   the largest or the least of several
x(i), y(i) for i = 1..n         in a list, as many entries as the ranges say
"""

import copy
import difflib
import itertools
import re
from collections import ChainMap
from collections.abc import Callable, Collection, Container, Iterable, Iterator, Mapping
from fractions import Fraction
from typing import Any, Self, TypeVar

from .arithmetic import NumberError, Numbers, read

FUNCTIONS = ("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "log", "sqrt", "atan", "abs")
OF_SEVERAL = ("max", "min")
_WORDS = (*OF_SEVERAL, "mod", "sum")
#: Names that no variable, parameter or size can have, and what they mean.
TAKEN = {**dict.fromkeys((*FUNCTIONS, *_WORDS), "a function"), "pi": "a constant", "for": "a word of ranges"}
#: Words with a meaning in formulas about states, which no variable, parameter, size or function of a file can have.
RESERVED = {
    **TAKEN,
    "H": "the energy",
    r"C\d*": "a Casimir function",
    "T": "the temperature",
    "t": "the time",
    r"y\d+": "a component by its number",
    r"energy_current\d*": "the current of energy",
}
_LONGEST = 100_000  # characters of a formula in which others are written out
_MOST = 10_000  # entries that one range may stand for
_RANGE = re.compile(r"\s*([A-Za-z_]\w*)\s*=\s*(.+?)\s*\.\.\s*(.+?)\s*$")


def meaning_of(name: str) -> str:
    """What a name that is taken means in formulas; "" for one that is free."""
    return next((meaning for word, meaning in RESERVED.items() if re.fullmatch(word, name)), "")


def taken_name(variables: Iterable[str]) -> tuple[str, str] | None:
    """(name, meaning) of the first variable, such as T or H(3), whose word is taken; y2 may be the second."""
    found = ((name, meaning_of(name.partition("(")[0])) for n, name in enumerate(variables, 1) if name != f"y{n}")
    return next(((name, meaning) for name, meaning in found if meaning), None)


AnyWords = TypeVar("Algebra", bound="Words")


class Words:
    """Part of an algebra that gives these words their meaning.

    `families` are the names before the parentheses of variables with indices, `indices` the words with whole values:
    sizes and the indices of ranges, which may hide the words in `hidden`.  :meth:`total` adds terms, :meth:`several`
    finds the largest or the least, and :meth:`variable` finds a variable by its name, None if there is none.
    """

    calls = True
    functions = (*FUNCTIONS, *_WORDS)
    constants: Mapping[str, Any]
    indices: Mapping[str, int]
    families: Collection[str] = ()
    hidden: Collection[str] = ()
    number: Callable[[str], Any]
    total: Callable[[list[Any]], Any]
    several: Callable[[str, list[Any]], Any]
    variable: Callable[[str], Any]

    def within(self, indices: Mapping[str, int]) -> Self:
        """This algebra with further indices."""
        inner = copy.copy(self)
        inner.indices = {**self.indices, **indices}
        inner.constants = ChainMap({word: self.number(str(k)) for word, k in indices.items()}, self.constants)  # type: ignore[arg-type]
        inner.hidden = {*self.hidden} - {*indices}
        return inner

    def unknown(self, word: str) -> NumberError:
        """Error about a word without a meaning."""
        words = [*self.constants, *(family for family in self.families if family != word), *self.functions]
        near = difflib.get_close_matches(word, words, 1)
        return NumberError(f"unknown word '{word}'" + (f", did you mean '{near[0]}'?" if near else ""))

    def call(self, word: str, inside: str) -> Any:
        """Value of a word with this text in parentheses; NotImplemented for a function of one argument."""
        if word == "sum":
            return self.total([read(body, algebra) for body, algebra in entries(inside, self)])
        if word == "mod":
            arguments = [whole(part, self) for part in parts(inside)]
            if len(arguments) != 2 or arguments[1] <= 0:
                raise NumberError("mod needs two whole numbers, as in mod(i, n)")
            return self.number(str(arguments[0] % arguments[1]))
        if word in OF_SEVERAL:
            values = [read(part, self) for part in parts(inside)]
            if len(values) < 2:
                raise NumberError(f"{word} needs two values or more, as in {word}(a, b)")
            return self.several(word, values)
        if word not in self.families:
            return NotImplemented
        if (value := self.variable(name := indexed(word, inside, self))) is None:
            raise NumberError(f"there is no {name}; on a ring of n write {word}(mod(i, n) + 1) for the next")
        return value


class _Indices(Words, Numbers):
    """Meaning of the grammar in whole numbers, with fractions on the way."""

    def __init__(self, indices: Mapping[str, int]) -> None:
        self.indices, self.constants = indices, indices  # type: ignore[assignment]

    def combine(self, sign: str, a: Any, b: Any) -> Any:
        if sign == "^" and abs(b) > 100:
            raise OverflowError
        return (
            Fraction(a, b) if sign == "/" and isinstance(a, int) and isinstance(b, int) else super().combine(sign, a, b)
        )

    def total(self, terms: list[Any]) -> Any:
        return sum(terms)

    def several(self, word: str, values: list[Any]) -> Any:
        return max(values) if word == "max" else min(values)


def whole(text: str, algebra: Words) -> int:
    """Whole number that an index stands for."""
    value = read(text, _Indices(algebra.indices))
    if value != int(value):
        raise NumberError(f"'{text.strip()}' is not an integer")
    return int(value)


def indexed(word: str, inside: str, algebra: Words) -> str:
    """Name of a variable with indices: x(i, 2) with i = 1 is "x(1,2)"."""
    return f"{word}({','.join(str(whole(part, algebra)) for part in parts(inside))})"


def entries(text: str, algebra: AnyWords) -> list[tuple[str, AnyWords]]:
    """Texts in an entry such as ``x(i)^2, y(i) for i = 1..n``, each with the values of its indices."""
    return [(part, inner) for body, inner in repeated(text, algebra) for part in parts(body)]


def repeated(text: str, algebra: AnyWords) -> Iterator[tuple[str, AnyWords]]:
    """(body, algebra with the indices bound) for ``body for i = a..b, j = c..d``; a text without ``for`` once."""
    separator = re.search(r"\bfor\b", outside(text))
    if not separator:
        yield text, algebra
        return
    body, ranges = text[: separator.start()], text[separator.end() :]
    bound = [algebra]
    for part in parts(ranges):
        if not (match := _RANGE.match(part)):
            raise NumberError(f"'{part.strip()}' is not a range such as i = 1..n")
        name, low, high = match.groups()
        taken = name in algebra.constants and name not in algebra.hidden
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


def has_range(text: Any) -> bool:
    """Whether a text stands for several entries, as ``x(i) for i = 1..n`` does."""
    return isinstance(text, str) and re.search(r"\bfor\b", text) is not None


def without_ranges(texts: list[Any], words: Mapping[str, float]) -> list[Any]:
    """Texts in which ``cos(2*pi*i/n), 0 for i = 1..n`` is written out as numbers; the others stay as they are.

    Of the `words` those with whole values may stand in them.  NumberError if one cannot be read.
    """
    if not any(map(has_range, texts)):
        return texts
    from .symbols import Exact, expression  # which takes a third of a second

    exact = Exact({word: value for word, value in words.items() if isinstance(value, int)})
    numbers: list[Any] = []
    for text in texts:
        some = [expression(entry, inner) for entry, inner in entries(text, exact)] if has_range(text) else None
        numbers += [text] if some is None else [repr(float(value)) for value in some]
    return numbers


def numbered(functions: Mapping[str, Any], words: Mapping[str, float]) -> dict[str, Any]:
    """Formulas by name in which ``E(k) for k = 1..3`` under the name E has become E1, E2 and E3.

    Those of several indices are E1_2 and so on, and -1 is m1.  Of the `words` those with whole values may stand in
    ranges.  NumberError if a range cannot be read, or if two functions have one name.
    """
    algebra, each = _Indices({word: k for word, k in words.items() if isinstance(k, int)}), dict[str, Any]()
    for name, text in functions.items():
        ranged = isinstance(text, str) and has_range(outside(text))
        for number, body in _by_numbers(text, algebra) if ranged else [("", text)]:
            if name + number in each:
                raise NumberError(f"there are two functions {name + number}")
            each[name + number] = body
    return each


def _by_numbers(text: str, algebra: Words) -> Iterator[tuple[str, str]]:
    """(values of the indices as part of a name, body with these in place of the indices)."""

    def with_values(body: str, values: Mapping[str, int]) -> str:
        return re.sub(r"[A-Za-z_]\w*", lambda word: str(values.get(word[0], word[0])), body).strip()

    for body, inner in repeated(text, algebra):
        values = {word: k for word, k in inner.indices.items() if word not in algebra.indices}
        yield "_".join(map(str, values.values())).replace("-", "m"), with_values(body, values)


def written_out(functions: Mapping[str, Any], words: Container[str]) -> dict[str, Any]:
    """Formulas by name in which the names of others stand for their formulas; words with a meaning of their own stay.

    An entry may be a mapping with texts.  NumberError if formulas name each other in a circle, or grow too long.
    """
    named = [name for name, text in functions.items() if isinstance(text, str) and name not in words]
    word = re.compile(rf"\b({'|'.join(map(re.escape, named))})\b(?!\s*\()") if named else None

    def replaced(text: str, within: tuple[str, ...]) -> str:
        indices = re.findall(r"\b(\w+)\s*=", text)

        def formula(match: re.Match[str]) -> str:
            if match[1] in indices:
                return match[1]
            if match[1] in within:
                raise NumberError(f"{' names '.join((*within, match[1]))}")
            return f"({replaced(functions[match[1]], (*within, match[1]))})"

        written = word.sub(formula, text) if word else text
        if len(written) > _LONGEST:
            raise NumberError(f"more than {_LONGEST} characters with the formulas of other functions")
        return written

    def own(name: str, text: Any) -> Any:
        if isinstance(text, Mapping):
            return {key: own("", inner) for key, inner in text.items()}
        return replaced(text, (name,) if name else ()) if isinstance(text, str) and text.strip() != name else text

    return {name: own(name, text) for name, text in functions.items()}


def parts(text: str, separators: str = ",") -> list[str]:
    """Parts of a text between separators outside of parentheses."""
    ends = [n for n, c in enumerate(outside(text)) if c in separators]
    return [text[start + 1 : end] for start, end in zip([-1, *ends], [*ends, len(text)], strict=True)]


def outside(text: str) -> str:
    """Text with all that stands in parentheses, and these, replaced by characters without a meaning."""
    depth = itertools.accumulate({"(": 1, ")": -1}.get(c, 0) for c in text)
    return "".join("\0" if d or c == ")" else c for c, d in zip(text, depth, strict=True))
