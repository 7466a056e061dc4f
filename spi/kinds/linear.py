"""Functions whose expectations are known because the equation is linear and they are polynomials."""

import functools
from collections.abc import Sequence
from typing import Any

from spi.ensemble.protocol import dimension
from spi.exact.linear import MomentEquations
from spi.expressions.polynomials import polynomial

_MOST_TERMS = 2_000  # of a function


def linear_moments(model: Any, trees: Sequence[Any], times: Sequence[float]) -> MomentEquations | None:
    """Moments that the expressions `trees` in the state need; None where they are not known by them.

    That is where the equation is not linear, where an expression is no polynomial, and where it would take long.
    """
    polynomials = [polynomial(tree, dimension(model), _MOST_TERMS) for tree in trees]
    wanted = tuple(tuple(each.items()) for each in polynomials if each is not None)
    found = _moments(model, wanted) if len(wanted) == len(polynomials) else None
    return found if found and found.reaches(times) else None


@functools.lru_cache(maxsize=64, typed=True)  # as models of two classes may be equal tuples
def _moments(model: Any, polynomials: tuple) -> MomentEquations | None:
    return MomentEquations.of(model, [dict(each) for each in polynomials])
