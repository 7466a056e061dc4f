"""Systems that depend on time: coefficients c(t) in H, in noises and in their strengths, frozen over each step.

In a Hamiltonian every part that depends on time alone becomes a number of the step.  A factor, c(t) in c(t) f(y),
becomes its mean over the step, so that flows which commute at all times are exact; the time within a function, as in
cos(y1 - w t), is the middle of the step; a strength sigma(t) becomes the root of the mean of its square.
"""

import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

import sympy

from ..ensemble.protocol import INNER_METHODS
from ..numerics.averages import NODES
from .code import Formula
from .keys import KEYS, DefinitionError
from .symbolics import shortened
from .text import NumberError, Symbols, entries, expression

# ---------------------------------------------------------------------------------------------------------------------
# The keys of a definition as texts, lists and mappings of texts; errors with the place of a mistake.
# ---------------------------------------------------------------------------------------------------------------------

T = TypeVar("T")


class Data:
    """A definition, read key by key."""

    def __init__(self, data: Mapping[str, Any]) -> None:
        self.data = data

    def at(self, keys: Sequence[Any], read: Callable[..., T], *arguments: Any) -> T:
        """``read(*arguments)``; its NumberError becomes a DefinitionError about the place to which `keys` lead."""
        try:
            return read(*arguments)
        except NumberError as error:
            cut = "not closed" in str(error) and isinstance(keys[-1], int)
            right = "put an entry with commas in quotes" if cut else "correct it here"
            raise DefinitionError(f"is '{shortened(self.value(keys))}' ({error}); {right}", *keys) from None

    def value(self, keys: Sequence[Any]) -> Any:
        value: Any = self.data
        for key in keys:
            value = value[key]
        return value

    def mapping(self, key: str) -> Mapping[str, str]:
        given = self.data.get(key, {})
        if not isinstance(given, dict) or not all(isinstance(value, str) for value in given.values()):
            _refuse_truth_values(given.items() if isinstance(given, dict) else (), key)
            raise DefinitionError(f"must be a mapping such as {KEYS[key].partition('as in ')[2] or '{a: 1}'}", key)
        return given

    def texts(self, key: str) -> list[tuple[str, tuple[Any, ...]]]:
        """The texts of a list, or the one text, each with its place."""
        given = self.data.get(key, [])
        if isinstance(given, str):
            return [(given, (key,))]
        if not isinstance(given, list) or not all(isinstance(text, str) for text in given):
            _refuse_truth_values(enumerate(given) if isinstance(given, list) else [(None, given)], key)
            raise DefinitionError("must be a list of texts", key)
        return [(text, (key, n)) for n, text in enumerate(given)]

    def expressions(self, key: str, formulas: Symbols) -> Iterator[tuple[tuple[Any, ...], str, Any]]:
        """(place, text, expression) of each formula of a list, ranges written out."""
        for text, keys in self.texts(key):
            for entry, inner in self.at(keys, entries, text, formulas):
                yield keys, entry.strip(), self.at(keys, expression, entry, inner)

    def inner(self) -> str:
        """The key `inner`: the method of compositions for terms without an exact flow."""
        given = self.data.get("inner", "")
        if given not in ("", *INNER_METHODS):
            raise DefinitionError(f"is '{given}'; must be {' or '.join(INNER_METHODS)}", "inner")
        return str(given)


def _refuse_truth_values(given: Iterable[tuple[Any, Any]], key: str) -> None:
    """DefinitionError about the first of some (place, value) that YAML takes for true or false."""
    for place, value in given:
        if isinstance(value, bool):
            words = "yes, on and true" if value else "no, off and false"
            fault = f"has a word that YAML reads as {str(value).lower()}, one of {words}"
            raise DefinitionError(f"{fault}; put it in quotes", key, *([] if place is None else [place]))


TIME = sympy.Symbol("t", real=True)
MEAN, MIDDLE = "mean", "middle"
_HEAD = """from spi.numerics.averages import mean as _mean, signed_root_mean_square as _signed_root_mean_square

__system__ |= {{"driving": {count}, "strengths": {strengths}}}"""


class Driving(NamedTuple):
    """The dependence of a system on time."""

    initial: float  #: the time at the beginning
    strengths: Mapping[int, Any]  #: noise -> sigma(t), of those that change


def driving_of(data: Data, formulas: Symbols, numbers: Symbols, functions: Sequence[Any]) -> Driving | None:
    """The :class:`Driving` of a system whose H and noises are `functions`; None if it does not depend on time.

    In `formulas` parameters are symbols, in `numbers` their values.
    """
    strengths, time = {}, formulas.time
    if time is not None and "sigma" in data.data:
        without_state = Symbols(parameters=formulas.parameters, indices=formulas.indices, time=time)
        values = [value for _, _, value in data.expressions("sigma", without_state)]
        strengths = {k: value for k, value in enumerate(values) if time in value.free_symbols}
    driven = bool(strengths) or any(time in function.free_symbols for function in functions)
    if "initial_time" not in data.data:
        return Driving(0.0, strengths) if driven else None
    if not driven:
        raise DefinitionError("is of no use, nothing depends on the time t; leave it out", "initial_time")
    text = data.data["initial_time"]
    if not isinstance(text, str):
        raise DefinitionError("must be a number", "initial_time")
    value = data.at(("initial_time",), expression, text, numbers)
    if not value.is_number or not value.is_real or not sympy.N(value).is_finite:
        raise DefinitionError(f"is '{shortened(text)}'; must be a finite real number", "initial_time")
    return Driving(float(value), strengths)


def split_in_time(expression: Any, time: Any) -> tuple[Any, Any]:
    """(factor that depends on time alone, the rest); the factor is 1 if there is none."""
    if time is None or time not in expression.free_symbols:
        return sympy.Integer(1), expression
    alone = [f for f in sympy.Mul.make_args(expression) if time in f.free_symbols and _of_time(f, time)]
    rest = [f for f in sympy.Mul.make_args(expression) if f not in alone]
    return sympy.Mul(*alone), sympy.Mul(*rest)


def by_factor(products: Sequence[Any], time: Any) -> dict[Any, list[Any]]:
    """The rests of some products by the factor that depends on time alone."""
    rests: dict[Any, list[Any]] = {}
    for product in products:
        factor, rest = split_in_time(product, time)
        rests.setdefault(factor, []).append(rest)
    return rests


def _of_time(expression: Any, time: Any) -> bool:
    """Whether no variable occurs in it: these have names that users cannot write."""
    return all(symbol == time or str(symbol).isascii() for symbol in expression.free_symbols)


class Coefficients:
    """The parts of the formulas of a system that are numbers of the step, and the code that computes these."""

    def __init__(self, names: dict[Any, str], strengths: Mapping[int, Any]) -> None:
        self.names = names  #: of symbols in code; those of coefficients are added
        self.entries: dict[tuple[Any, str], Any] = {}
        self.strengths = strengths

    def frozen(self, expression: Any, kind: str = MEAN) -> Any:
        """An expression with symbols in place of the parts that depend on time alone."""
        if TIME not in expression.free_symbols:
            return expression
        if expression.is_Add:
            return sympy.Add(*(self.frozen(term, kind) for term in expression.args))
        alone, rest = split_in_time(expression, TIME)
        if not expression.is_Mul:
            if alone != 1:
                return self._symbol(expression, kind)
            return expression.func(*(self.frozen(argument, MIDDLE) for argument in expression.args))
        factors = [f for f in sympy.Mul.make_args(rest) if TIME in f.free_symbols]
        linear = kind == MEAN and alone == 1 and len(factors) == 1 and factors[0].is_Add
        inner = [self.frozen(f, MEAN if linear else MIDDLE) for f in sympy.Mul.make_args(rest)]
        return sympy.Mul(self._symbol(alone, kind), *inner)

    def _symbol(self, expression: Any, kind: str) -> Any:
        """The symbol in place of a function of time."""
        if not expression.free_symbols:
            return expression
        if expression.is_Add:
            return self.frozen(expression, kind)
        key = sympy.powsimp(expression), kind  # one for exp(a) exp(b) and exp(a + b)
        if key not in self.entries:
            symbol = sympy.Symbol(f"δ{len(self.entries) + 1}", real=True)
            self.names[symbol] = f"model.driving[{len(self.entries)}]"
            self.entries[key] = symbol
        return self.entries[key]

    def head(self) -> str:
        """Further lines at the beginning of a module."""
        return _HEAD.format(count=len(self.entries), strengths=list(self.strengths))

    def function(self) -> list[str]:
        """The function of the values at a time."""
        expressions = [*(e for e, _ in self.entries), *self.strengths.values()]
        lines, codes = Formula({**self.names, TIME: "t"}, ()).lines(expressions)
        return [
            "",
            "@device",
            "def _driving(model, t):",
            '    """What depends on time alone."""',
            *("    " + line for line in lines),
            f"    return {', '.join(codes)},",
        ]

    def method(self, name: str, fields: Sequence[str], noises: int) -> list[str]:
        """The method ``frozen`` of a class of this name and with these fields before `time`."""
        lines = ["", "def frozen(model, begin, h):", "    start = model.time + begin"]
        at = "abcde"
        lines += [f"    {v} = _driving(model, start + {node!r} * h)" for v, node in zip(at, NODES, strict=True)]
        driving = []
        for n, (_, kind) in enumerate(self.entries):
            driving.append(f"c[{n}]" if kind == MIDDLE else _average("_mean", at, n))
        place = {k: len(self.entries) + n for n, k in enumerate(self.strengths)}
        sigma = [
            _average("_signed_root_mean_square", at, place[k]) if k in place else f"model.sigma[{k}]"
            for k in range(noises)
        ]
        lines += [f"    driving = ({''.join(f'{code}, ' for code in driving)})"]
        lines += [f"    sigma = ({''.join(f'{code}, ' for code in sigma)})"]
        values = "".join(f"model.{field}, " for field in fields)
        return [*lines, f"    return {name}({values}start, driving, sigma)"]

    def report(self) -> str:
        """The treatment of time, for people."""
        parts = []
        for kind, how in ((MEAN, "by its mean over a step"), (MIDDLE, "at the middle of a step")):
            if texts := [str(e).replace("**", "^") for e, k in self.entries if k == kind]:
                parts.append(f"{', '.join(texts)} {how}")
        if self.strengths:
            texts = [f"sigma of noise {k + 1}, {str(e).replace('**', '^')}," for k, e in self.strengths.items()]
            parts.append(f"{' '.join(texts)} by its root mean square")
        return textwrap.shorten("time: " + "; ".join(parts), 300, placeholder=" ...")


def _average(function: str, at: str, n: int) -> str:
    return f"{function}({', '.join(f'{v}[{n}]' for v in at)})"
