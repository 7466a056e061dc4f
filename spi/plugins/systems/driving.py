"""Systems that depend on time: coefficients c(t) in H, in noises and in their strengths, frozen over each step.

In a Hamiltonian every part that depends on time alone becomes a number of the step.  A factor, c(t) in c(t) f(y),
becomes its mean over the step, so that flows which commute at all times are exact; the time within a function, as in
cos(y1 - w t), is the middle of the step; a strength sigma(t) becomes the root of the mean of its square.
"""

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import sympy

from spi.numerics.averages import NODES

from .code import Formula

TIME = sympy.Symbol("t", real=True)
MEAN, MIDDLE = "mean", "middle"


class Driving(NamedTuple):
    """Dependence of a system on time."""

    initial: float  #: the time at the beginning
    strengths: Mapping[int, Any]  #: noise -> sigma(t), of those that change


def split_in_time(expression: Any, time: Any) -> tuple[Any, Any]:
    """(factor that depends on time alone, the rest); the factor is 1 if there is none."""
    if time is None or time not in expression.free_symbols:
        return sympy.Integer(1), expression
    alone = [f for f in sympy.Mul.make_args(expression) if time in f.free_symbols and _of_time(f, time)]
    rest = [f for f in sympy.Mul.make_args(expression) if f not in alone]
    return sympy.Mul(*alone), sympy.Mul(*rest)


def _of_time(expression: Any, time: Any) -> bool:
    """Whether no variable occurs in it: these have names that users cannot write."""
    return all(symbol == time or str(symbol).isascii() for symbol in expression.free_symbols)


class Coefficients:
    """Parts of the formulas of a system that are numbers of the step, and the code that computes these."""

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
        """Symbol in place of a function of time."""
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

    def function(self) -> list[str]:
        """Function of the values at a time."""
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
        """Method ``frozen`` of a class of this name and with these fields before `time`."""
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
        """Treatment of time, for people."""
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
