"""Functions of Casimir functions and of linear functions that commute, such as (y1^2 + y2^2)^2 on so(3).

Where C = c v^2 + rest is a Casimir function and f is even in the variable v, f = g(C, l_1, ..., l_r) with
v^2 = (C - rest)/c.  C is kept by every flow, so that the flow of f is that of g with the value of C as a number.
"""

import contextlib
import itertools
from collections.abc import Iterator, Sequence
from typing import Any

import sympy

from .functionals import NoExactFlow
from .splitting import Term, single
from .symbolics import Symbolics

_MOST = 12  # variables that are tried in the place of v, over all Casimir functions


def by_invariants(expression: Any, world: Symbolics, casimirs: Sequence[Any]) -> Term | None:
    """The term that a function is when the values of Casimir functions are numbers; None if there is no such term."""
    places = itertools.islice(_squares(expression, world, casimirs), _MOST)
    for n, (casimir, variable, factor) in enumerate(places):
        kept = sympy.Symbol(f"γ{n + 1}", real=True)
        rest = sympy.expand(casimir - factor * variable**2)
        root = sympy.Symbol("ρ", positive=True)
        even = expression.xreplace({variable: root})
        if sympy.expand(even - expression.xreplace({variable: -root})) != 0:
            continue
        found = even.subs(root, sympy.sqrt((kept - rest) / factor))
        for form in (found, sympy.expand(found)):
            if variable not in form.free_symbols and len(world.used(form)) < len(world.used(expression)):
                with contextlib.suppress(NoExactFlow):
                    return single(form, world, {kept: casimir})._replace(original=expression)
    return None


def _squares(expression: Any, world: Symbolics, casimirs: Sequence[Any]) -> Iterator[tuple[Any, Any, Any]]:
    """(Casimir function, variable v, factor of v^2) where the function is quadratic and v occurs as v^2 alone."""
    for casimir in casimirs:
        if not casimir.is_polynomial(*world.variables) or casimir.free_symbols & set(world.parameters):
            continue
        poly = sympy.Poly(casimir, *world.variables)
        for i in world.used(casimir):
            powers = {monomial[i]: sum(monomial) for monomial in poly.monoms() if monomial[i]}
            variable = world.variables[i]
            if powers == {2: 2} and variable in expression.free_symbols:
                yield casimir, variable, poly.coeff_monomial(variable**2)
