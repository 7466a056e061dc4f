"""Which values a formula can have, whatever the state: an interval, and whether there are only some values."""

import math
from typing import Any, NamedTuple

from . import trees


class Range(NamedTuple):
    """The values of a formula lie in [low, high]."""

    low: float
    high: float
    jumps: bool = False  #: whether it is constant but for jumps, as abs(y1 - 1)/(y1 - 1)

    @property
    def width(self) -> float:
        """How far apart two values can be."""
        return self.high - self.low


_ALL = Range(-math.inf, math.inf)
_WITHIN = {trees.Sine: (-1.0, 1.0), trees.Cosine: (-1.0, 1.0), trees.HyperbolicTangent: (-1.0, 1.0)}
_NOT_NEGATIVE = trees.Exponential, trees.SquareRoot


def range_of(tree: Any) -> Range:
    """The range of a tree by interval arithmetic: it holds all values, but may be wider."""
    if isinstance(tree, trees.Constant):
        return Range(tree.value, tree.value, True)
    if isinstance(tree, trees.Component):
        return _ALL
    if isinstance(tree, trees.Quotient) and _is_sign(tree.a, tree.b):
        return Range(-1.0, 1.0, True)
    if isinstance(tree, trees.WholePower):
        one = range_of(tree.a)
        ends = [_power(end, tree.exponent) for end in (one.low, one.high)]
        low = 0.0 if tree.exponent % 2 == 0 and one.low <= 0.0 <= one.high else min(ends)
        return Range(low, max(ends), one.jumps)
    each = [range_of(operand) for operand in tree]
    jumps = all(one.jumps for one in each)
    if isinstance(tree, trees.Sum | trees.Difference | trees.Product):
        return _ordered(_combined(type(tree), *each), jumps)
    if isinstance(tree, trees.Quotient) and (each[1].low > 0.0 or each[1].high < 0.0):
        inverse = Range(1.0 / each[1].high, 1.0 / each[1].low)
        return _ordered(_combined(trees.Product, each[0], inverse), jumps)
    one = each[0]
    if isinstance(tree, trees.Negative):
        return Range(-one.high, -one.low, jumps)
    if isinstance(tree, trees.Absolute):
        least = 0.0 if one.low <= 0.0 <= one.high else min(abs(one.low), abs(one.high))
        return Range(least, max(abs(one.low), abs(one.high)), jumps)
    if type(tree) in _WITHIN:
        return Range(*_WITHIN[type(tree)], jumps)
    return Range(0.0, math.inf, jumps) if isinstance(tree, _NOT_NEGATIVE) else _ALL._replace(jumps=jumps)


def _is_sign(a: Any, b: Any) -> bool:
    """Whether a/b is the sign of something: x/abs(x) or abs(x)/x, perhaps with the difference turned round."""
    inner, other = (b.a, a) if isinstance(b, trees.Absolute) else (a.a if isinstance(a, trees.Absolute) else None, b)
    turned = trees.Difference(inner.b, inner.a) if isinstance(inner, trees.Difference) else None
    found = (trees.canonical(one) for one in (inner, turned) if one is not None)  # trees are tuples, equal too soon
    return trees.canonical(other) in found


def _power(x: float, exponent: int) -> float:
    try:
        return x**exponent
    except OverflowError:
        return math.copysign(math.inf, x) if exponent % 2 else math.inf


def _combined(operation: Any, a: Range, b: Range) -> list[float]:
    if operation is trees.Sum:
        return [a.low + b.low, a.high + b.high]
    if operation is trees.Difference:
        return [a.low - b.high, a.high - b.low]
    return [0.0 if 0.0 in (x, y) else x * y for x in (a.low, a.high) for y in (b.low, b.high)]


def _ordered(ends: list[float], jumps: bool) -> Range:
    return _ALL._replace(jumps=jumps) if any(map(math.isnan, ends)) else Range(min(ends), max(ends), jumps)
