"""Summands of an expression whose rare values the others may hide.

Of q + 100 (q > c) no sample may show that the second summand is 100 now and then: it has to be looked at by itself.
"""

import math
from functools import reduce
from typing import Any

import numpy as np

from . import (
    Component,
    Constant,
    Cosine,
    Difference,
    Each,
    Negative,
    Observable,
    Product,
    Quotient,
    Sine,
    Sum,
    Total,
    WholePower,
    range_of,
    terms_of,
)

_MOST = 8  # summands that are looked at one by one


def hidden_summands(expression: Any) -> list[Any]:
    """Summands of an expression that are no polynomials, sines or cosines, where it has other summands beside them.

    Products with sums are multiplied out, so that q (1 + 100 (q > c)) has q 100 (q > c).  More than _MOST are one sum.
    """
    found = [*dict.fromkeys(_hidden(expression))]
    return found if len(found) <= _MOST else [reduce(Sum, found)]


def unbounded_rest(expression: Any) -> Any | None:
    """Sum without those of :func:`hidden_summands` whose range is known; None where there are none, or no others.

    Of q + 100 (q > c) that is q.
    """
    parts = [part for part in _summands(expression) if not _is_fixed(part)]
    others = [part for part in parts if is_plain(part) or not math.isfinite(float(np.ptp(range_of(part))))]
    return reduce(Sum, others) if 0 < len(others) < len(parts) else None


def _hidden(expression: Any) -> list[Any]:
    parts = [part for part in _summands(expression) if not _is_fixed(part)]
    steep = [part for part in parts if not is_plain(part)]
    return (steep if len(parts) > 1 else []) + [hidden for part in steep for hidden in _multiplied_out(part)]


def _multiplied_out(part: Any) -> list[Any]:
    """Terms of a product in which a factor that is a sum gives more than one that is not constant."""
    if isinstance(part, Quotient) and _is_fixed(part.b):
        part = part.a
    if not isinstance(part, Product):
        return []
    found = []
    for factor, other in ((part.a, part.b), (part.b, part.a)):
        terms = [] if is_plain(factor) else _summands(factor)
        changing = [term for term in terms if not _is_fixed(term)]
        if len(terms) > 1 and (len(changing) > 1 or not _is_fixed(other)):
            found += [Product(term, other) for term in changing if not is_plain(term)]
    return found


def _summands(expression: Any) -> list[Any]:
    """Terms of a sum, also of a multiple of one; of another expression this alone."""
    if isinstance(expression, Sum):
        return [*_summands(expression.a), *_summands(expression.b)]
    if isinstance(expression, Difference):
        return [*_summands(expression.a), *map(Negative, _summands(expression.b))]
    if isinstance(expression, Negative):
        return [*map(Negative, _summands(expression.a))]
    if isinstance(expression, Quotient) and isinstance(expression.b, Constant):
        return [Quotient(term, expression.b) for term in _summands(expression.a)]
    if isinstance(expression, Product) and isinstance(expression.a, Constant):
        return [Product(expression.a, term) for term in _summands(expression.b)]
    if isinstance(expression, Total):
        return [part for term in terms_of(expression) for part in _summands(term)]
    return [expression]


def _is_fixed(expression: Any) -> bool:
    """Whether an expression has no component of the state."""
    if isinstance(expression, Component | Observable | Each | Total):
        return False
    return isinstance(expression, Constant | int) or all(map(_is_fixed, expression))


def is_plain(expression: Any) -> bool:
    """Whether an expression is a polynomial, a sine or a cosine of one, or a polynomial in these."""
    if isinstance(expression, Constant | Component | Observable | Each):
        return True
    if isinstance(expression, Total):
        return all(is_plain(group.body) for group in expression.groups)
    if isinstance(expression, WholePower):
        return is_plain(expression.a)
    if isinstance(expression, Quotient):
        return is_plain(expression.a) and _is_fixed(expression.b)
    of_plain = isinstance(expression, Sum | Difference | Product | Negative | Sine | Cosine)
    return of_plain and all(map(is_plain, expression))
