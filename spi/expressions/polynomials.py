"""Expressions as polynomials in the components of the state."""

import itertools
from typing import Any

import numpy as np

from . import (
    Component,
    Constant,
    Difference,
    Negative,
    Observable,
    Product,
    Quotient,
    Sum,
    Total,
    WholePower,
    terms_of,
)

#: Coefficients by monomials: the numbers of the components in increasing order, each as often as its power.
Polynomial = dict[tuple[int, ...], float]

_CLOSE = 1e-12  # relative distance of a named function from the quadratic one through its values
_TRIALS = 4


def polynomial(expression: Any, dimension: int, most: int) -> Polynomial | None:
    """Polynomial of an expression in y1, ..., yd, None if it is none or has more than `most` terms on the way.

    A named function, such as H, is one where it is quadratic.
    """
    found = _polynomial(expression, dimension, most)
    return None if found is None or len(found) > most else found


def _polynomial(e: Any, d: int, most: int) -> Polynomial | None:
    if isinstance(e, Constant):
        return {(): e.value}
    if isinstance(e, Component):
        return {(e.k,): 1.0}
    if isinstance(e, Observable):
        return _quadratic(e.values, d)
    if isinstance(e, Total):
        return _combined([(1.0, polynomial(term, d, most)) for term in terms_of(e)])
    if isinstance(e, WholePower):
        return _product([polynomial(e.a, d, most)] * e.exponent, most)
    if isinstance(e, Negative):
        return _combined([(-1.0, polynomial(e.a, d, most))])
    if isinstance(e, Sum | Difference):
        sign = 1.0 if isinstance(e, Sum) else -1.0
        return _combined([(1.0, polynomial(e.a, d, most)), (sign, polynomial(e.b, d, most))])
    if isinstance(e, Product):
        return _product([polynomial(e.a, d, most), polynomial(e.b, d, most)], most)
    if isinstance(e, Quotient):
        divisor = polynomial(e.b, d, most)
        if divisor is not None and set(divisor) <= {()} and divisor.get((), 0.0):
            dividend = polynomial(e.a, d, most)
            return None if dividend is None else {m: c / divisor[()] for m, c in dividend.items()}
    return None


def _combined(terms: list[tuple[float, Polynomial | None]]) -> Polynomial | None:
    total: Polynomial = {}
    for factor, part in terms:
        if part is None:
            return None
        for monomial, coefficient in part.items():
            total[monomial] = total.get(monomial, 0.0) + factor * coefficient
    return total


def _product(factors: list[Polynomial | None], most: int) -> Polynomial | None:
    total: Polynomial = {(): 1.0}
    for factor in factors:
        if factor is None or len(total) * len(factor) > most**2:
            return None
        product: Polynomial = {}
        for (m, a), (n, b) in itertools.product(total.items(), factor.items()):
            monomial = tuple(sorted(m + n))
            product[monomial] = product.get(monomial, 0.0) + a * b
        total = product
    return total


def _quadratic(values: Any, d: int) -> Polynomial | None:
    """Quadratic polynomial through values of a function of states (d, ...), None if the function is another one."""
    one = np.eye(d)
    pairs = list(itertools.combinations(range(d), 2))
    states = np.vstack([np.zeros((1, d)), one, -one, *(one[[i]] + one[[j]] for i, j in pairs)]).T
    with np.errstate(all="ignore"):
        at = np.asarray(values(states), float)
        origin, plus, minus = at[0], at[1 : d + 1], at[d + 1 : 2 * d + 1]
        linear, square = 0.5 * (plus - minus), 0.5 * (plus + minus) - origin
        found: Polynomial = {(): float(origin)}
        found |= {(i,): float(c) for i, c in enumerate(linear) if c}
        found |= {(i, i): float(c) for i, c in enumerate(square) if c}
        for (i, j), value in zip(pairs, at[2 * d + 1 :], strict=True):
            if mixed := float(value - plus[i] - plus[j] + origin):
                found[i, j] = mixed
        trials = np.random.default_rng(1).standard_normal((d, _TRIALS))
        true, size = np.asarray(values(trials), float), np.abs(at).max() * d * d
        predicted = sum(c * np.prod(trials[list(m)], axis=0) for m, c in found.items())
    return found if np.all(np.abs(true - predicted) <= _CLOSE * (size + np.abs(true))) else None
