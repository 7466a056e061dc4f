"""Test functions phi of weak errors: expressions in the state such as ``sin(2*pi*y1) + y2^2``.

The grammar is that of ``arithmetic.py`` with the words of ``ranges.py``, y1, ..., yd or y(1), ..., y(d) for the
components of the state, and what else has a meaning: parameters, sizes, H.  An expression is a tree of records; parts
without y are one constant: ``2*pi*y1`` is one product.  NumPy evaluates it for arrays of states.  Overflow gives inf
and undefined values are NaN, but there is never an exception.
"""

import itertools
import math
import re
from collections.abc import Callable
from functools import partial, reduce
from typing import Any, NamedTuple

import numpy as np

from spi.compiler.dispatch import MOST
from spi.numerics import arrays
from spi.numerics.arrays import of_array, whole_power
from spi.numerics.types import FunctionFamily

from .arithmetic import COMPARISONS, NumberError, Numbers, read
from .ranges import FUNCTIONS, TAKEN, Words, parts

__all__ = [
    "Constant",
    "Observable",
    "as_numpy",
    "canonical",
    "has_sum",
    "is_constant",
    "is_step",
    "operations",
    "parse_expression",
    "range_of",
]


# ---------------------------------------------------------------------------------------------------------------------
# Records: their operands, their values for arrays, their texts
# ---------------------------------------------------------------------------------------------------------------------


_MOST_WHOLE = 15
_MOST_RECORDS = 200_000  # of an expression, with the terms of its sums
_DEEPEST = 300  # operations within each other, as Python's recursions end


class Constant(NamedTuple):
    """A number."""

    value: float


class Component(NamedTuple):
    """y_{k+1}."""

    k: int


class Observable(NamedTuple):
    """A function of the state that has a name: H, a Casimir function, or one of the model's or the user's own."""

    name: str
    values: Callable  #: of states (d, ...)


class Each(NamedTuple):
    """A place in the terms of a sum, in which each has its own component or constant."""

    leaves: tuple[Constant, ...] | tuple[Component, ...]


class LikeTerms(NamedTuple):
    """Terms of one shape: `body`, in which an :class:`Each` stands where they differ."""

    body: NamedTuple
    count: int


class Total(NamedTuple):
    """Sum of all terms, added in pairs in an order that their number decides."""

    groups: tuple[LikeTerms, ...]


class WholePower(NamedTuple):
    """a^n, n = 2, ..., 15, which stays a whole power in texts."""

    a: NamedTuple
    exponent: int


class Notation(NamedTuple):
    """Meaning of an operation, for arrays and as text."""

    array: Callable  #: of arrays
    text: str  #: in the grammar
    binds: int  #: how tightly the text binds: 1 sums, 2 products, 3 powers and minus signs, 4 atoms
    operands: tuple[int, ...]  #: how tightly the texts of operands must bind to need no parentheses


def _operation(name, *meaning):
    """Class of the records of an operation, which are their operands, with a class attribute ``meaning``."""
    meaning = Notation(*meaning)
    cls = NamedTuple(name, [(operand, NamedTuple) for operand in "ab"[: len(meaning.operands)]])
    cls.meaning = meaning
    return cls


def _arctangent(x):
    """Angle of tangent x, by the reductions and the polynomial of the library fdlibm."""
    t = np.abs(x)
    near = np.searchsorted(_NEAR, t, "right")
    z = np.where(t < _NEAR[-1], (t - _TANGENTS[near]) / (1.0 + _TANGENTS[near] * t), -1.0 / t)
    square, p = z * z, 0.0
    for coefficient in _ARCTANGENT:
        p = p * square + coefficient
    return np.copysign(_ANGLES[near] - ((z * (square * p) - _REST[near]) - z), x)


_NEAR, _TANGENTS = np.array([0.4375, 0.6875, 1.1875, 2.4375]), np.array([0.0, 0.5, 1.0, 1.5, 0.0])
_ANGLES = np.array([0.0, 0.4636476090008061, 0.7853981633974483, 0.982793723247329, 1.5707963267948966])
_REST = np.array([0.0, 2.2698777452961687e-17, 3.061616997868383e-17, 1.3903311031230998e-17, 6.123233995736766e-17])
_ARCTANGENT = (
    *(1.62858201153657823623e-02, -3.65315727442169155270e-02, 4.97687799461593236017e-02, -5.83357013379057348645e-02),
    *(6.66107313738753120669e-02, -7.69187620504482999495e-02, 9.09088713343650656196e-02, -1.11111104054623557880e-01),
    *(1.42857142725034663711e-01, -1.99999999998764832476e-01, 3.33333333333329318027e-01),
)


def _hyperbolic_cosine(x):
    """cosh x = (e^|x| / 2) (1 + e^(-2 |x|))."""
    half = arrays.exp(0.5 * np.abs(x))
    return (0.5 * half) * half * (1.0 + arrays.exp(-2.0 * np.abs(x)))


def _hyperbolic_sine(x):
    """sinh x = tanh x cosh x."""
    return of_array(arrays.Tanh(), x) * _hyperbolic_cosine(x)


def _compared(sign, a, b):
    """1 or 0; NaN where the difference is not finite, as of states that have overflowed."""
    return np.where(np.isfinite(np.subtract(a, b)), COMPARISONS[sign](a, b), np.nan)


Sum = _operation("Sum", np.add, "{0} + {1}", 1, (1, 2))
Difference = _operation("Difference", np.subtract, "{0} - {1}", 1, (1, 2))
Product = _operation("Product", np.multiply, "{0}*{1}", 2, (2, 3))
Quotient = _operation("Quotient", np.divide, "{0}/{1}", 2, (2, 3))
Power = _operation("Power", arrays.power, "{0}^{1}", 3, (4, 3))
Negative = _operation("Negative", np.negative, "-{0}", 3, (3,))
Sine = _operation("Sine", partial(of_array, arrays.Sin()), "sin({0})", 4, (0,))
Cosine = _operation("Cosine", partial(of_array, arrays.Cos()), "cos({0})", 4, (0,))
Tangent = _operation("Tangent", partial(of_array, arrays.Tan()), "tan({0})", 4, (0,))
HyperbolicTangent = _operation("HyperbolicTangent", partial(of_array, arrays.Tanh()), "tanh({0})", 4, (0,))
Exponential = _operation("Exponential", partial(of_array, arrays.Exp()), "exp({0})", 4, (0,))
Logarithm = _operation("Logarithm", partial(of_array, arrays.Log()), "log({0})", 4, (0,))
HyperbolicSine = _operation("HyperbolicSine", _hyperbolic_sine, "sinh({0})", 4, (0,))
HyperbolicCosine = _operation("HyperbolicCosine", _hyperbolic_cosine, "cosh({0})", 4, (0,))
ArcTangent = _operation("ArcTangent", _arctangent, "atan({0})", 4, (0,))
Maximum = _operation("Maximum", np.maximum, "max({0}, {1})", 4, (0, 0))
Minimum = _operation("Minimum", np.minimum, "min({0}, {1})", 4, (0, 0))
Less = _operation("Less", partial(_compared, "<"), "{0} < {1}", 0, (1, 1))
Greater = _operation("Greater", partial(_compared, ">"), "{0} > {1}", 0, (1, 1))
AtMost = _operation("AtMost", partial(_compared, "<="), "{0} <= {1}", 0, (1, 1))
AtLeast = _operation("AtLeast", partial(_compared, ">="), "{0} >= {1}", 0, (1, 1))
SquareRoot = _operation("SquareRoot", np.sqrt, "sqrt({0})", 4, (0,))
Absolute = _operation("Absolute", np.abs, "abs({0})", 4, (0,))
_SIGNS = {"+": Sum, "-": Difference, "*": Product, "/": Quotient, "^": Power}
_SIGNS |= {"<": Less, ">": Greater, "<=": AtMost, ">=": AtLeast}
_OF_ONE = (Sine, Cosine, Tangent, HyperbolicSine, HyperbolicCosine, HyperbolicTangent)
_OF_ONE += (Exponential, Logarithm, SquareRoot, ArcTangent, Absolute)
_FUNCTIONS = dict(zip(FUNCTIONS, _OF_ONE, strict=True))
_LEAVES = (Constant, Component, Observable, Each)


def _equal(a, b):
    """Equality of records, by their classes too: as tuples sin(y1) and exp(y1) are equal."""
    return type(a) is type(b) and tuple.__eq__(a, b)


def _hash(a):
    return hash((type(a).__name__, *a))


for _record in (*_LEAVES, LikeTerms, Total, WholePower, *_SIGNS.values(), *_OF_ONE, Maximum, Minimum):
    _record.__eq__, _record.__hash__ = _equal, _hash
    _record.__ne__ = lambda a, b: not _equal(a, b)

# ---------------------------------------------------------------------------------------------------------------------
# From and to text
# ---------------------------------------------------------------------------------------------------------------------


class _Trees(Words, Numbers):
    """Meaning of the grammar in trees; an expression without y stays a number.

    `words` are further words and their values, trees or numbers, of which whole ones may stand in indices.
    """

    longest = math.inf  # the number of records is bounded instead
    compares = True
    hidden = ("i", "t")

    def __init__(self, dimension, names=(), words=None):
        self.dimension, within = dimension, min(dimension, MOST)
        # Of an array-state model plain words can name the first components only.
        components = {f"y{k + 1}": Component(k) for k in range(within)}
        self.named = {name: Component(k) for k, name in enumerate(names)}
        words = {word: value for word, value in (words or {}).items() if word not in TAKEN}
        self.with_arguments = {word: words.pop(word) for word in [*words] if isinstance(words[word], FunctionFamily)}
        observables = {word: value for word, value in words.items() if isinstance(value, Observable)}
        self.constants = {**Numbers.constants, **words, **components, **self.named, **observables}
        self.indices = {word: value for word, value in words.items() if isinstance(value, int)}
        self.families = {name.partition("(")[0] for name in names if "(" in name}
        self.families |= {*self.with_arguments}
        if "y" not in self.constants:
            self.families |= {"y"}
        self.state = f"y1 .. y{within}" if dimension > 1 else "only y1"
        self.records = itertools.count(1)

    def variable(self, name):
        """Component x(2) of a system whose variables have indices; y(2) is the second of any other."""
        if name in self.named or "y(" in "".join(self.named):
            return self.named.get(name)
        k = name.removeprefix("y(").removesuffix(")")
        return Component(int(k) - 1) if k.isdigit() and 1 <= int(k) <= self.dimension else None

    def call(self, word, inside):
        """As of all words; of a family the member with these numbers, which may be indices of ranges."""
        if word not in self.with_arguments:
            return super().call(word, inside)
        arguments = [read(part, self) for part in parts(inside)]
        if any(_is_tree(a) or isinstance(a, complex) for a in arguments):
            raise NumberError(f"'{word}' takes numbers")
        name = f"{word}({','.join(map(repr, arguments))})"
        return self.counted(Observable(name, self.with_arguments[word].member(*arguments)))

    def counted(self, record):
        """Record; NumberError if there are too many."""
        if next(self.records) > _MOST_RECORDS:
            raise NumberError(f"more than {_MOST_RECORDS} operations and terms of sums")
        return record

    def unknown(self, word):
        if word in self.with_arguments:
            return NumberError(f"'{word}' without parentheses")
        if self.dimension and re.fullmatch("[yY][0-9]+", word):
            return NumberError(f"unknown word '{word}', the state has {self.state}")
        return super().unknown(word)

    def negative(self, a):
        if isinstance(a, Negative):
            return a.a
        return self.counted(Negative(a)) if _is_tree(a) else super().negative(a)

    def combine(self, sign, a, b):
        if sign in COMPARISONS and isinstance(a, complex) | isinstance(b, complex):
            raise NumberError("complex")
        if not _is_tree(a) and not _is_tree(b):
            return int(COMPARISONS[sign](a, b)) if sign in COMPARISONS else super().combine(sign, a, b)
        if sign == "/" and b == 0:
            raise ZeroDivisionError
        if sign == "^" and not _is_tree(b):
            return self.counted(_power(a, b))
        return self.counted(_SIGNS[sign](_tree(a), _tree(b)))

    def apply(self, function, a):
        return self.counted(_FUNCTIONS[function](a)) if _is_tree(a) else super().apply(function, a)

    def total(self, terms):
        if any(map(_is_tree, terms)):
            return _total([self.counted(_tree(term)) for term in terms])
        return sum(self.counted(term) for term in terms)

    def several(self, word, values):
        if any(map(_is_tree, values)):
            return reduce(Maximum if word == "max" else Minimum, map(_tree, values))
        return (max if word == "max" else min)(_tree(value).value for value in values)


def _is_tree(value):
    return hasattr(type(value), "meaning") or isinstance(value, Component | Observable | Total | WholePower)


def _tree(value):
    """A tree, or a number as a Constant."""
    if isinstance(value, complex):
        raise NumberError("complex")
    return value if _is_tree(value) else Constant(float(value))


def _total(terms):
    """Sum of trees, those of one shape together."""
    groups = {}
    for term in terms:
        groups.setdefault(_shape(term), []).append(term)
    return Total(tuple(LikeTerms(_merged(group), len(group)) for group in groups.values()))


def _shape(e):
    """What trees have in common that differ in components and constants alone."""
    if isinstance(e, Constant | Component):
        return type(e)
    if isinstance(e, Observable | Total):
        return e
    return type(e), *(part if isinstance(part, int) else _shape(part) for part in e)


def _merged(trees):
    """Body of trees of one shape."""
    first = trees[0]
    if isinstance(first, Constant | Component):
        return first if len(set(map(repr, trees))) == 1 else Each(tuple(trees))
    if isinstance(first, Observable | Total | int):
        return first
    return type(first)(*map(_merged, zip(*trees, strict=True)))


def _term(e, k):
    """Term k of a body."""
    if isinstance(e, Each):
        return e.leaves[k]
    if isinstance(e, Constant | Component | Observable | Total | int):
        return e
    return type(e)(*(_term(part, k) for part in e))


def terms_of(total):
    """Terms of a sum."""
    return [_term(group.body, k) for group in total.groups for k in range(group.count)]


def has_sum(e):
    """Whether a sum over terms stands in a tree: what was written is then shorter than its text."""
    return isinstance(e, Total) or (not isinstance(e, _LEAVES) and any(has_sum(a) for a in e if not isinstance(a, int)))


def operations(e):
    """(operations, observables): how often a tree computes with numbers, and how many observables it evaluates."""
    if isinstance(e, Constant | Component | Each | int):
        return 0, 0
    if isinstance(e, Observable):
        return 0, 1
    if isinstance(e, Total):
        parts = [[group.count * number for number in operations(group.body)] for group in e.groups]
        return sum(part[0] for part in parts) + sum(group.count for group in e.groups), sum(part[1] for part in parts)
    own, named = zip(*map(operations, e), strict=True)
    return 1 + sum(own), sum(named)


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


def parse_expression(text, dimension, names=(), words=None):
    """Tree of an expression in y1, ..., y_dimension; NumberError, with a short reason, if it is none.

    The components may also be called by the `names` that the system gives them; `words` has the values of others.
    """
    tree = _tree(read(text, _Trees(dimension, names, words)))
    _check_depth(tree, _DEEPEST)
    return tree


def _check_depth(e, left):
    if not left:
        raise NumberError(f"more than {_DEEPEST} operations within each other; sum(a, b, c) has many terms")
    for part in () if isinstance(e, _LEAVES) else [g.body for g in e.groups] if isinstance(e, Total) else e:
        if not isinstance(part, int):
            _check_depth(part, left - 1)


def is_constant(expression):
    """Whether no component of the state occurs in it."""
    return isinstance(expression, Constant)


def canonical(expression):
    """Text of a tree, from which ``parse_expression`` makes the same tree."""
    return _written(expression, 0)


def _written(expression, binds):
    """Text of a tree, in parentheses if it binds less tightly than `binds`."""
    if isinstance(expression, Constant):
        own, text = 3 if math.copysign(1.0, expression.value) < 0.0 else 4, repr(expression.value)
        text = text if text == "-0.0" else text.removesuffix(".0")
    elif isinstance(expression, Component):
        own, text = 4, f"y{expression.k + 1}" if expression.k < MOST else f"y({expression.k + 1})"
    elif isinstance(expression, Observable):
        own, text = 4, expression.name
    elif isinstance(expression, Total):
        own, text = 4, f"sum({', '.join(_written(term, 0) for term in terms_of(expression))})"
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

    These are u in abs(u), u^0.3, log(u), 1/u, cos of tan, and u - v in max(u, v) and u > v; p = 0 stands for jumps and
    poles.  Within a part of power p the powers of other parts are multiplied by p where p < 1: sqrt(abs(u)) has 1/2.
    """
    if isinstance(expression, Constant | Component | Observable):
        return []
    if isinstance(expression, WholePower):
        return singular_parts(expression.a)
    if isinstance(expression, Total):
        return [part for term in terms_of(expression) for part in singular_parts(term)]
    own, power = _singular_part(expression)
    parts = [] if own is None or is_constant(own) else [(own, power)]
    for operand in expression:
        share = 1.0 if own is None or operand is not own else min(power, 1.0)
        parts += [(u, share * p) for u, p in singular_parts(operand)]
    return parts


def _singular_part(operation):
    """(u, p) of an operation, whatever its operands are of; u is None where it has derivatives everywhere."""
    match operation:
        case Absolute():
            return operation.a, 1.0
        case SquareRoot():
            return operation.a, 0.5
        case Tangent():
            return Cosine(operation.a), 0.0
        case Maximum() | Minimum():
            return Difference(*operation), 1.0
        case Less() | Greater() | AtMost() | AtLeast():
            return Difference(*operation), 0.0
        case Quotient():
            return operation.b, 0.0
        case Power(b=Constant(value=p)) if p >= 0:
            return None if p % 1 == 0 else operation.a, p
        case Power() | Logarithm():
            return operation.a, 0.0
    return None, 0.0


def _added(terms):
    """Sum along the first axis in pairs: the order does not depend on the other axes, as that of NumPy does."""
    while len(terms) > 1:
        half, odd = divmod(len(terms), 2)
        pairs = terms[:half] + terms[half : 2 * half]
        terms = np.concatenate((pairs, terms[-1:])) if odd else pairs
    return terms[0]


def as_numpy(expression):
    """Function phi(y) of arrays y of shape (d, ...) with values of shape (...).

    Its attribute ``singular`` has such functions of its :func:`singular_parts`, each with its ``power``.
    """

    def value(e, y):
        if isinstance(e, Constant):
            return np.full(y.shape[1:], e.value)
        if isinstance(e, Component):
            return y[e.k]
        if isinstance(e, WholePower):
            return whole_power(value(e.a, y), e.exponent)
        if isinstance(e, Observable):
            return e.values(y)
        if isinstance(e, Each):
            leaves = np.array([leaf[0] for leaf in e.leaves])
            return y[leaves] if isinstance(e.leaves[0], Component) else leaves.reshape(-1, *[1] * (y.ndim - 1))
        if isinstance(e, Total):
            terms = [np.broadcast_to(value(g.body, y), (g.count, *y.shape[1:])) for g in e.groups]
            return _added(np.concatenate(terms))
        return e.meaning.array(*(value(operand, y) for operand in e))

    def phi(y):
        with np.errstate(all="ignore"):
            return np.array(value(expression, np.asarray(y, float)))  # never a view of y

    parts = singular_parts(expression)
    phi.singular = tuple(as_numpy(part) for part, _ in parts)
    for part, (_, power) in zip(phi.singular, parts, strict=True):
        part.power = power
    return phi


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
    if isinstance(expression, Component | Observable):
        return _ALL
    if isinstance(expression, Total):
        ranges = [range_of(term) for term in terms_of(expression)]
        return sum(low for low, _ in ranges), sum(high for _, high in ranges)
    if isinstance(expression, WholePower):
        return _range_of_power(range_of(expression.a), expression.exponent)
    if isinstance(expression, Quotient) and _is_sign(expression.a, expression.b):
        return _WITHIN_ONE
    ranges = [range_of(operand) for operand in expression]
    low, high = _of_function(expression, *ranges) if len(ranges) == 1 else _of_operation(expression, *ranges)
    return (low, high) if low <= high else _ALL  # false for NaN


def is_step(expression: Any) -> bool:
    """Whether an expression is piecewise constant, as (1 + (y1 - 3)/abs(y1 - 3))/2 is."""
    if isinstance(expression, _LEAVES):
        return isinstance((expression.leaves if isinstance(expression, Each) else [expression])[0], Constant)
    if isinstance(expression, Less | Greater | AtMost | AtLeast):
        return True
    if isinstance(expression, Total):
        return all(is_step(group.body) for group in expression.groups)
    if isinstance(expression, WholePower):
        return is_step(expression.a)
    if isinstance(expression, Quotient) and _is_sign(expression.a, expression.b):
        return True
    return all(map(is_step, expression))


def _is_sign(a: Any, b: Any) -> bool:
    """Whether a/b is x/abs(x) or abs(x)/x, where a difference x may have its terms exchanged."""
    return any(x == y for x, y in (*_alike(a, b), *_alike(b, a)))


def _alike(a: Any, b: Any) -> list[tuple[Any, Any]]:
    """Pairs of trees: if those of any pair are equal and b is abs(x), a is +-x."""
    if not isinstance(b, Absolute):
        return []
    return [(a, b.a), (a, Difference(b.a.b, b.a.a))] if isinstance(b.a, Difference) else [(a, b.a)]


_INCREASING = {HyperbolicSine: math.sinh, ArcTangent: math.atan, Exponential: math.exp, HyperbolicTangent: math.tanh}


def _of_function(expression: Any, a: Range) -> Range:
    """Range of a function of one operand."""
    if increasing := _INCREASING.get(type(expression)):
        return _increasing(increasing, a)
    match expression:
        case Negative():
            return -a[1], -a[0]
        case Absolute():
            return _absolute(a)
        case HyperbolicCosine():
            return _increasing(math.cosh, _absolute(a))
        case Logarithm():
            return _increasing(math.log, a) if a[0] > 0.0 else (-math.inf, _increasing(math.log, a)[1])
        case SquareRoot():
            return _increasing(math.sqrt, (max(a[0], 0.0), a[1]))
        case Sine() | Cosine():
            return _WITHIN_ONE
    return _ALL


def _of_operation(expression: Any, a: Range, b: Range) -> Range:
    """Range of an operation on two operands."""
    match expression:
        case Sum():
            return a[0] + b[0], a[1] + b[1]
        case Difference():
            return a[0] - b[1], a[1] - b[0]
        case Product():
            return _product(a, b)
        case Quotient() if b[0] > 0.0 or b[1] < 0.0:
            return _product(a, (1.0 / b[1], 1.0 / b[0]))
        case Maximum():
            return max(a[0], b[0]), max(a[1], b[1])
        case Minimum():
            return min(a[0], b[0]), min(a[1], b[1])
        case Less() | Greater() | AtMost() | AtLeast():
            return 0.0, 1.0
        case Power() if b[0] == b[1] and b[0] > 0.0:  # NaN below 0, so that what is left of a is at least 0
            return _increasing(lambda x: x ** b[0], (max(a[0], 0.0), a[1]))
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
    """Range of an increasing function over `a`; infinity where it overflows or is not defined."""

    def at(x: float, beyond: float) -> float:
        try:
            return float(function(x))
        except (OverflowError, ValueError):
            return beyond

    low = 0.0 if function is math.exp and a[0] == -math.inf else at(a[0], -math.inf)
    return low, at(a[1], math.inf)
