"""Quadratic and linear terms that stay one piece of H, as the flow of their sum is known.

Let f be a sum of such terms with B grad f = c (M y + b), where c is 1, or a component that commutes with everything.
The flow of f is that of an affine equation: rotations, hyperbolic rotations, scalings and shears, whatever the signs of
the numbers in f.  Where its terms commute, they are moved by together in any case.  Where they do not, separate flows
of them would be an approximation, and the flow of f takes their place if a step then takes at most twice as long.
"""

import contextlib
import itertools
import math
import re
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import mpmath
import numpy as np
import sympy

from .brackets import DIGITS, Symbolics, monomials
from .code import NumberCode
from .driving import split_in_time
from .flow_code import generators, motion, motions
from .rows import connected
from .spectrum import Block, Inseparable, sizes
from .splitting import (
    Constants,
    Flow,
    NoExactFlow,
    Term,
    affine_rates,
    by_affine_field,
    degree,
    diagonalised,
    merged,
    parts,
    rates_of,
    single,
    without_flow,
)

MOST_SLOWER = 2  #: times as long may a step take
_LARGEST_BLOCK = 8  # components that are linked; more would always take too long
_MOST_LOSS = 1e6  # of roundings
# Times, in additions of one lane: of a flow for each component, which is loaded and stored; of a function whose
# argument differs between lanes; of a normal number, as a step has one at least where there is a noise.
_COMPONENT, _FUNCTION, _NORMAL = 1, 20, 40


class Split(NamedTuple):
    """Flows of H, and the sums of terms that might have been joined."""

    flows: list[Flow]
    apart: list[tuple[Any, str]]  #: (sum, why its terms have flows of their own)


def split(addends: Sequence[Any], world: Symbolics, constants: Constants) -> Split:
    """Flows into which a sum splits, in the order of its addends; the last may be that of all that has none."""
    terms, crossing, lacking = parts(addends, world)
    apart, groups = [], _candidates(terms, crossing, world)
    while groups:
        together, linked = groups.pop(0)
        own = [term for term in terms if term.expression in together]
        products = [product for product in crossing if product in together]
        cut = merged(diagonalised(own, products, world, Constants()), world.bracket)
        if len(cut) < 2 or not world.used(sympy.Add(*together)):
            continue
        whole, reason = _joined(together, linked, cut, world)
        if whole is None:  # perhaps without the terms that link components, such as those of a chain
            apart.append((sympy.Add(*together), reason))
            of_one = [term for term in own if len(world.used(term.expression)) == 1]
            groups += _candidates(of_one, [], world) if len(of_one) < len(together) else []
            continue
        terms = _with_whole(terms, own, whole)
        crossing = [product for product in crossing if product not in together]
    flows = merged(diagonalised(terms, crossing, world, constants), world.bracket)
    if lacking:
        rest, reason = sympy.Add(*(addend for addend, _ in lacking)), lacking[0][1]
        flows += [without_flow(rest, reason, world)] if world.used(rest) else []
    return Split(flows, apart)


def _with_whole(terms: Sequence[Term], own: Sequence[Term], whole: Term) -> list[Term]:
    """Terms with their sum in the place of the first of its own, or at the end if it has none."""
    place = terms.index(own[0]) if own else len(terms)
    before, behind = ([term for term in side if term not in own] for side in (terms[:place], terms[place:]))
    return [*before, whole, *behind]


Links = list[tuple[int, ...]]  #: components that are linked


def _candidates(terms: Sequence[Term], crossing: Sequence[Any], world: Symbolics) -> list[tuple[list[Any], Links]]:
    """Terms and products with affine fields and one factor of time that brackets link, and what the fields link."""
    groups = []
    by_factor: dict[Any, list[tuple[Any, Links]]] = {}
    for expression in (*(term.expression for term in terms), *crossing):
        factor, rest = split_in_time(expression, world.time)
        if links := affine_links(rest, world):
            by_factor.setdefault(factor, []).append((expression, links))
    for alike in by_factor.values():
        for group in connected(_linked([expression for expression, _ in alike], world)):
            if len(group) > 1 or alike[min(group)][0] in crossing:
                together = [alike[n] for n in sorted(group)]
                linked = itertools.chain.from_iterable(of_one for _, of_one in together)
                groups.append(([expression for expression, _ in together], list(linked)))
    return groups


def _linked(expressions: Sequence[Any], world: Symbolics) -> Iterable[tuple[int, ...]]:
    """Numbers of each expression by itself, and of each pair with variables whose bracket is not 0."""
    users: dict[int, list[int]] = {}
    for n, expression in enumerate(expressions):
        yield (n,)
        for i in world.used(expression):
            users.setdefault(i, []).append(n)
    for i, j in world.bracket.entries:
        for n in users.get(i, []):
            yield from ((n, m) for m in users.get(j, []))


def affine_links(function: Any, world: Symbolics) -> list[tuple[int, ...]] | None:
    """What the field of a polynomial links if it is affine, or that times a component that nothing moves: each row.

    None for other functions.  Whatever the values of the parameters, so that none of them is special.
    """
    used, bracket = world.used(function), world.bracket
    if world.time in function.free_symbols or degree(function, world) > 2 or not all(map(bracket.is_affine, used)):
        return None
    found = affine_rates(rates_of(function, world), world)
    return found and [(row, *world.used(change)) for row, change in found[1].items() if change != 0]


def affine(function: Any, world: Symbolics) -> Term | None:
    """A function with such a field, perhaps times a function of time alone, as a term; None if it is none."""
    factor, rest = split_in_time(function, world.time)
    if function.xreplace(dict(world.parameters)).has(sympy.I, sympy.zoo, sympy.nan, sympy.oo):
        return None  # at these parameters, which Reader.read refuses
    with contextlib.suppress(NoExactFlow):
        return single(function, world)
    if affine_links(rest, world) is None:
        return None
    # a parameter that is a factor of all, as in w*(q^2 + p^2), stays a symbol
    coefficients = monomials(rest, world.variables)
    first = next(iter(coefficients.values()))
    ratios = {monomial: sympy.cancel(c / first) for monomial, c in coefficients.items()}
    if world.varies(first) and all(c.is_number for c in ratios.values()):
        factor *= first
        rest = sympy.Add(*(c * sympy.Mul(*(world.variables[i] for i in m)) for m, c in ratios.items()))
    with mpmath.workdps(DIGITS):
        u = by_affine_field(rest, world)
    symbol, varying = sympy.Symbol("ζ1", real=True), bool(world.bracket.formulas) or world.varies(rest)
    joined = len(sympy.Add.make_args(function))
    return Term(function, (), (), varying, {symbol: u}, factor * symbol, joined) if u else None


def _joined(together: Sequence[Any], linked: Links, cut: Sequence[Flow], world: Symbolics) -> tuple[Term | None, str]:
    """(the sum of terms as one term, None if they stay apart; why). `cut`: the flows that they have by themselves."""
    largest = max(map(len, connected(linked)))
    if largest > _LARGEST_BLOCK:
        return None, f"it would move {largest} components by one matrix, more than {_LARGEST_BLOCK}"
    factor, _ = split_in_time(together[0], world.time)
    rest = sympy.Add(*(split_in_time(expression, world.time)[1] for expression in together))
    if (whole := affine(factor * rest, world)) is None:
        return None, "its terms move by different components"
    try:
        by = generators(Flow((whole,)), world)
        if (lost := max(map(_lost, motions(by, world.bracket)[0]), default=1.0)) > _MOST_LOSS:
            return None, f"each step would lose {math.log10(lost):.0f} of 16 digits"
        slower = (_NORMAL + _time(Flow((whole,)), world)) / (_NORMAL + sum(_time(flow, world) for flow in cut))
    except Inseparable as error:
        return None, str(error)
    if slower > MOST_SLOWER:
        return None, f"with it a step would take {slower:.2g} times as long"
    return whole._replace(joined=len(sympy.Add.make_args(rest))), ""


def _lost(block: Block) -> float:
    """By how much roundings grow in a time in which the largest factor of the field moves by 1.

    That is long before the slowest turn where one is very slow, as in a weak magnetic field.
    """
    if block.turn is not None:
        return 1.0
    return float(np.max(sum(sizes(space, 1.0 / block.fastest, block.components) for space in block.spaces)))


def _time(flow: Flow, world: Symbolics) -> float:
    """Time that a flow takes, in additions."""
    by = generators(flow, world)
    made = motion(*motions(by, world.bracket), len(by), NumberCode(), flow.varying)
    text = " ".join(made.lines)
    time = _COMPONENT * len(made.components) + len(re.findall(r" [-+*/] ", text)) + 3 * text.count("times(")
    if rates := [generator.rate for generator in by if world.used(generator.rate)]:
        functions = re.findall(r"(?:sin_versine|expm1|sinh_coshm1)\(", text)
        time += sum(map(sympy.count_ops, rates)) + _FUNCTION * len(functions)
    return float(time)
