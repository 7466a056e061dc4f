"""The range of an expression over all states, and whether it is piecewise constant."""

import math
from typing import Any

from .trees import (
    Absolute,
    Component,
    Constant,
    Cosine,
    Difference,
    Exponential,
    HyperbolicTangent,
    Logarithm,
    Negative,
    Power,
    Product,
    Quotient,
    Sine,
    SquareRoot,
    Sum,
    WholePower,
    canonical,
)

_ALL = -math.inf, math.inf
_WITHIN_ONE = -1.0, 1.0

Range = tuple[float, float]


def range_of(expression: Any) -> Range:
    """(lowest, highest) value, by interval arithmetic, so that the true range may be narrower; -inf, inf if unknown.

    x/|x| and |x|/x are signs, so that (1 + (y1 - 1)/abs(y1 - 1))/2 lies between 0 and 1.
    """
    if isinstance(expression, Constant):
        return expression.value, expression.value
    if isinstance(expression, Component):
        return _ALL
    if isinstance(expression, WholePower):
        return _power(range_of(expression.a), expression.exponent)
    if isinstance(expression, Quotient) and _is_sign(expression.a, expression.b):
        return _WITHIN_ONE
    low, high = _of_operation(expression, *(range_of(operand) for operand in expression))
    return (low, high) if low <= high else _ALL  # false for NaN


def is_step(expression: Any) -> bool:
    """Whether an expression is piecewise constant, as (1 + (y1 - 3)/abs(y1 - 3))/2 is."""
    if isinstance(expression, Constant | Component):
        return isinstance(expression, Constant)
    if isinstance(expression, WholePower):
        return is_step(expression.a)
    if isinstance(expression, Quotient) and _is_sign(expression.a, expression.b):
        return True
    return all(map(is_step, expression))


def _is_sign(a: Any, b: Any) -> bool:
    """Whether a/b is x/abs(x) or abs(x)/x, where a difference x may have its terms exchanged."""
    # Compared by their texts: as tuples sin(y1) and exp(y1) are equal.
    return any(canonical(x) == canonical(y) for x, y in (*_alike(a, b), *_alike(b, a)))


def _alike(a: Any, b: Any) -> list[tuple[Any, Any]]:
    """Pairs of trees: if those of any pair are equal and b is abs(x), a is +-x."""
    if not isinstance(b, Absolute):
        return []
    return [(a, b.a), (a, Difference(b.a.b, b.a.a))] if isinstance(b.a, Difference) else [(a, b.a)]


def _of_operation(expression: Any, a: Range, b: Range = _ALL) -> Range:
    match expression:
        case Sum():
            return a[0] + b[0], a[1] + b[1]
        case Difference():
            return a[0] - b[1], a[1] - b[0]
        case Negative():
            return -a[1], -a[0]
        case Product():
            return _product(a, b)
        case Quotient() if b[0] > 0.0 or b[1] < 0.0:
            return _product(a, (1.0 / b[1], 1.0 / b[0]))
        case Absolute():
            return _absolute(a)
        case Exponential():
            return _increasing(math.exp, a)
        case HyperbolicTangent():
            return _increasing(math.tanh, a)
        case Logarithm():
            return _increasing(math.log, a) if a[0] > 0.0 else (-math.inf, _increasing(math.log, a)[1])
        case SquareRoot():
            return _increasing(math.sqrt, (max(a[0], 0.0), a[1]))
        case Power() if b[0] == b[1] and b[0] > 0.0:  # NaN below 0, so that what is left of a is at least 0
            return _increasing(lambda x: x ** b[0], (max(a[0], 0.0), a[1]))
        case Sine() | Cosine():
            return _WITHIN_ONE
    return _ALL


def _absolute(a: Range) -> Range:
    return (0.0 if a[0] <= 0.0 <= a[1] else min(abs(a[0]), abs(a[1]))), max(abs(a[0]), abs(a[1]))


def _product(a: Range, b: Range) -> Range:
    each = [0.0 if 0.0 in (x, y) else x * y for x in a for y in b]  # 0 times what is as large as one likes is 0
    return min(each), max(each)


def _power(a: Range, exponent: int) -> Range:
    if exponent % 2 == 0:
        a = _absolute(a)
    return _increasing(lambda x: x**exponent, a)


def _increasing(function: Any, a: Range) -> Range:
    """The range of an increasing function over `a`; infinity where it overflows or is not defined."""

    def at(x: float, beyond: float) -> float:
        try:
            return float(function(x))
        except (OverflowError, ValueError):
            return beyond

    low = 0.0 if function is math.exp and a[0] == -math.inf else at(a[0], -math.inf)
    return low, at(a[1], math.inf)
