"""Brackets of noises that do not commute: which have exact flows, and whether they are multiples of one function.

What the Lévy area of two noises contributes is along the field of {Ĥ_l, Ĥ_k}, see ``schemes/stages.py``.
"""

import contextlib
import itertools
from typing import Any

import sympy

from .code import Formula
from .splitting import Flow, NoExactFlow, commute, single
from .symbolics import Symbolics
from .system import System

#: The most pairs of noises that are looked at; each flow is a function of its own in the generated module.
MOST = 16

Brackets = dict[tuple[int, int], Any]  #: (k, l), k < l -> {Ĥ_l, Ĥ_k}


def brackets_of(system: System) -> Brackets:
    """Those of all pairs that do not commute; none where there are more than MOST."""
    noises = list(enumerate(system.noises))
    pairs = [
        (k, other)
        for (k, a), (other, b) in itertools.combinations(noises, 2)
        if not commute(a.terms, b.terms, system.world.bracket)
    ]
    if len(pairs) > MOST:
        return {}
    of = [flow.expression for flow in system.noises]
    return {(k, other): poisson_bracket(of[other], of[k], system.world) for k, other in pairs}


def poisson_bracket(f: Any, g: Any, world: Symbolics) -> Any:
    """{f, g} = sum_ij df/dy_i {y_i, y_j} dg/dy_j, expanded."""
    bracket, y = world.bracket, world.variables
    factor = [y[i] if i in bracket.logarithmic else sympy.Integer(1) for i in range(bracket.dimension)]
    terms = []
    for i, j, polynomial in bracket.entries(symbolic=True):
        entry = sympy.Add(*(c * sympy.Mul(*(y[k] for k in monomial)) for monomial, c in polynomial.items()))
        turned = sympy.diff(f, y[i]) * sympy.diff(g, y[j]) - sympy.diff(f, y[j]) * sympy.diff(g, y[i])
        terms.append(factor[i] * factor[j] * entry * turned)
    return sympy.expand(sympy.Add(*terms))


def flows_of(brackets: Brackets, world: Symbolics) -> dict[tuple[int, int], Flow]:
    """The flows of those brackets that have an exact one."""
    found = {}
    for pair, expression in brackets.items():
        with contextlib.suppress(NoExactFlow):
            if world.used(expression):
                found[pair] = Flow((single(expression, world),))
    return found


def factors_of(brackets: Brackets, count: int, names: Any, world: Symbolics) -> list[str]:
    """The method ``bracket_factors`` of so many noises, where all brackets are multiples of one of them."""
    if len(brackets) < 2:
        return []
    first = sympy.Poly(next(iter(brackets.values())), *world.variables).terms() if _polynomial(brackets, world) else []
    found: dict[tuple[int, int], Any] = {}
    for pair, expression in brackets.items() if first else ():
        terms = sympy.Poly(expression, *world.variables).terms()
        ratios = {sympy.cancel(c / d) for (_, c), (_, d) in zip(terms, first, strict=False)}
        if [monomial for monomial, _ in terms] != [monomial for monomial, _ in first] or len(ratios) != 1:
            return []
        found[pair] = ratios.pop()
    if not found or any(world.time in ratio.free_symbols for ratio in found.values()):
        return []
    codes = [
        Formula(names, ()).code(found.get(pair, sympy.Integer(0))) for pair in itertools.combinations(range(count), 2)
    ]
    return ["", "def bracket_factors(model):", f"    return {', '.join(codes)}"]


def _polynomial(brackets: Brackets, world: Symbolics) -> bool:
    """Whether all are polynomials other than 0."""
    return all(e != 0 and e.is_polynomial(*world.variables) for e in brackets.values())
