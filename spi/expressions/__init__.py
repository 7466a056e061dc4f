"""Test functions phi of weak errors: expressions in the state such as ``sin(2*pi*y1) + y2^2``.

The grammar is that of ``arithmetic.py`` with the words y1, ..., yd for the components of the state, and tanh.  An
expression is a tree of records; parts without y are one constant: ``2*pi*y1`` is one product.  NumPy evaluates it for
arrays of states.  Overflow gives inf and undefined values are NaN, but there is never an exception.
"""

import math
import re
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from spi.compiler.dispatch import MOST
from spi.numerics import arrays
from spi.numerics.arrays import of_array, whole_power

from .arithmetic import NumberError, Numbers, read

__all__ = [
    "Constant",
    "as_numpy",
    "canonical",
    "functions_of",
    "is_constant",
    "is_step",
    "parse_expression",
    "range_of",
]


# ---------------------------------------------------------------------------------------------------------------------
# Records: their operands, their values for arrays, their texts
# ---------------------------------------------------------------------------------------------------------------------


_MOST_WHOLE = 15


class Constant(NamedTuple):
    """A number."""

    value: float


class Component(NamedTuple):
    """y_{k+1}."""

    k: int


class WholePower(NamedTuple):
    """a^n, n = 2, ..., 15, which stays a whole power in texts."""

    a: NamedTuple
    exponent: int


class Meaning(NamedTuple):
    """The meaning of an operation, for arrays and as text."""

    array: Callable  #: of arrays
    text: str  #: in the grammar
    binds: int  #: how tightly the text binds: 1 sums, 2 products, 3 powers and minus signs, 4 atoms
    operands: tuple[int, ...]  #: how tightly the texts of operands must bind to need no parentheses


def _operation(name, *meaning):
    """The class of the records of an operation, which are their operands, with a class attribute ``meaning``."""
    meaning = Meaning(*meaning)
    cls = NamedTuple(name, [(operand, NamedTuple) for operand in "ab"[: len(meaning.operands)]])
    cls.meaning = meaning
    return cls


Sum = _operation("Sum", np.add, "{0} + {1}", 1, (1, 2))
Difference = _operation("Difference", np.subtract, "{0} - {1}", 1, (1, 2))
Product = _operation("Product", np.multiply, "{0}*{1}", 2, (2, 3))
Quotient = _operation("Quotient", np.divide, "{0}/{1}", 2, (2, 3))
Power = _operation("Power", np.power, "{0}^{1}", 3, (4, 3))
Negative = _operation("Negative", np.negative, "-{0}", 3, (3,))
Sine = _operation("Sine", partial(of_array, arrays.Sine()), "sin({0})", 4, (0,))
Cosine = _operation("Cosine", partial(of_array, arrays.Cosine()), "cos({0})", 4, (0,))
Tangent = _operation("Tangent", partial(of_array, arrays.Tangent()), "tan({0})", 4, (0,))
HyperbolicTangent = _operation("HyperbolicTangent", partial(of_array, arrays.HyperbolicTangent()), "tanh({0})", 4, (0,))
Exponential = _operation("Exponential", partial(of_array, arrays.Exponential()), "exp({0})", 4, (0,))
Logarithm = _operation("Logarithm", partial(of_array, arrays.Logarithm()), "log({0})", 4, (0,))
SquareRoot = _operation("SquareRoot", np.sqrt, "sqrt({0})", 4, (0,))
Absolute = _operation("Absolute", np.abs, "abs({0})", 4, (0,))
_SIGNS = {"+": Sum, "-": Difference, "*": Product, "/": Quotient, "^": Power}
_FUNCTIONS = {"sin": Sine, "cos": Cosine, "tan": Tangent, "tanh": HyperbolicTangent, "exp": Exponential}
_FUNCTIONS |= {"log": Logarithm, "sqrt": SquareRoot, "abs": Absolute}

# ---------------------------------------------------------------------------------------------------------------------
# From and to text
# ---------------------------------------------------------------------------------------------------------------------


class _Trees(Numbers):
    """The meaning of the grammar in trees; an expression without y stays a number."""

    longest = 400
    functions = tuple(_FUNCTIONS)

    def __init__(self, dimension, names=()):
        within = min(dimension, MOST)  # of an array-state model an expression can name the first components only
        components = {f"y{k + 1}": Component(k) for k in range(within)}
        self.named = {name: Component(k) for k, name in enumerate(names)}
        self.calls = any("(" in name for name in names)
        self.constants = {**Numbers.constants, **components, **self.named}
        self.state = f"y1 .. y{within}" if dimension > 1 else "only y1"

    def call(self, word, inside):
        """The component x(2) of a system whose variables have indices."""
        return self.named.get(f"{word}({inside.replace(' ', '')})", NotImplemented)

    def unknown(self, word):
        if re.fullmatch("[yY][0-9]+", word):
            return NumberError(f"unknown word '{word}', the state has {self.state}")
        return super().unknown(word)

    def negative(self, a):
        if isinstance(a, Negative):
            return a.a
        return Negative(a) if _is_tree(a) else super().negative(a)

    def combine(self, sign, a, b):
        if not _is_tree(a) and not _is_tree(b):
            return super().combine(sign, a, b)
        if sign == "/" and b == 0:
            raise ZeroDivisionError
        if sign == "^" and not _is_tree(b):
            return _power(a, b)
        return _SIGNS[sign](_tree(a), _tree(b))

    def apply(self, function, a):
        return _FUNCTIONS[function](a) if _is_tree(a) else super().apply(function, a)


def _is_tree(value):
    return hasattr(type(value), "meaning") or isinstance(value, Component | WholePower)


def _tree(value):
    """A tree, or a number as a Constant."""
    if isinstance(value, complex):
        raise NumberError("complex")
    return value if _is_tree(value) else Constant(float(value))


def _power(a, exponent):
    """A tree to the power of a number."""
    if isinstance(exponent, complex):
        raise NumberError("complex")
    if exponent in (0, 1):
        return 1 if exponent == 0 else a
    if exponent == 0.5:
        return SquareRoot(a)
    if exponent in range(2, _MOST_WHOLE + 1):
        return WholePower(a, int(exponent))
    if -exponent in range(1, _MOST_WHOLE + 1):
        return Quotient(Constant(1.0), _power(a, -exponent))
    return Power(a, _tree(exponent))


def parse_expression(text, dimension, names=()):
    """The tree of an expression in y1, ..., y_dimension; NumberError, with a short reason, if it is none.

    The components may also be called by the `names` that the system gives them.
    """
    return _tree(read(text, _Trees(dimension, names)))


def is_constant(expression):
    """Whether no component of the state occurs in it."""
    return isinstance(expression, Constant)


def canonical(expression):
    """The text of a tree, from which ``parse_expression`` makes the same tree."""
    return _written(expression, 0)


def _written(expression, binds):
    """The text of a tree, in parentheses if it binds less tightly than `binds`."""
    if isinstance(expression, Constant):
        own, text = 3 if math.copysign(1.0, expression.value) < 0.0 else 4, repr(expression.value)
        text = text if text == "-0.0" else text.removesuffix(".0")
    elif isinstance(expression, Component):
        own, text = 4, f"y{expression.k + 1}"
    elif isinstance(expression, WholePower):
        own, text = 3, f"{_written(expression.a, 4)}^{expression.exponent}"
    else:
        meaning = expression.meaning
        own = meaning.binds
        text = meaning.text.format(*map(_written, expression, meaning.operands))
    return text if own >= binds else f"({text})"


# ---------------------------------------------------------------------------------------------------------------------
# Values
# ---------------------------------------------------------------------------------------------------------------------


def singular_parts(expression):
    """[(u, p)] of a tree: parts u at whose zeros it may have no derivatives but behaves like |u|^p.

    These are u in abs(u), u^0.3, log(u), 1/u, and cos of tan; p = 0 stands for jumps and poles.  Within a part of power
    p the powers of other parts are multiplied by p where p < 1: sqrt(abs(u)) has 1/2.
    """
    if isinstance(expression, Constant | Component):
        return []
    if isinstance(expression, WholePower):
        return singular_parts(expression.a)
    own, power = None, 0.0
    if isinstance(expression, Absolute | SquareRoot | Logarithm):
        own, power = expression.a, {Absolute: 1.0, SquareRoot: 0.5}.get(type(expression), 0.0)
    elif isinstance(expression, Tangent):
        own = Cosine(expression.a)
    elif isinstance(expression, Quotient):
        own = expression.b
    elif isinstance(expression, Power):
        constant = isinstance(expression.b, Constant)
        power = max(expression.b.value, 0.0) if constant else 0.0
        own = None if constant and expression.b.value >= 0 and power % 1 == 0 else expression.a
    parts = [] if own is None or is_constant(own) else [(own, power)]
    for operand in expression:
        share = 1.0 if own is None or operand is not own else min(power, 1.0)
        parts += [(u, share * p) for u, p in singular_parts(operand)]
    return parts


def as_numpy(expression):
    """The function phi(y) of arrays y of shape (d, ...) with values of shape (...).

    Its attribute ``singular`` has such functions of its :func:`singular_parts`, each with its ``power``.
    """

    def value(e, y):
        if isinstance(e, Constant):
            return np.full(y.shape[1:], e.value)
        if isinstance(e, Component):
            return y[e.k]
        if isinstance(e, WholePower):
            return whole_power(value(e.a, y), e.exponent)
        return e.meaning.array(*(value(operand, y) for operand in e))

    def phi(y):
        with np.errstate(all="ignore"):
            return np.array(value(expression, np.asarray(y, float)))  # never a view of y

    parts = singular_parts(expression)
    phi.singular = tuple(as_numpy(part) for part, _ in parts)
    for part, (_, power) in zip(phi.singular, parts, strict=True):
        part.power = power
    return phi


def functions_of(texts, dimension):
    """:func:`as_numpy` of each of some texts.

    Functions with an ``lru_cache`` take texts as arguments: as trees sin(y1) and exp(y1) are equal tuples.
    """
    return [as_numpy(parse_expression(text, dimension)) for text in texts]


# ---------------------------------------------------------------------------------------------------------------------
# The range of an expression over all states, and whether it is piecewise constant
# ---------------------------------------------------------------------------------------------------------------------


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
        return _range_of_power(range_of(expression.a), expression.exponent)
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


def _range_of_power(a: Range, exponent: int) -> Range:
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
