"""What a flow moves by: y(t) = exp(t sum_j a_j M_j) y with constant matrices M_j and numbers a_j that it keeps.

Where logarithms are coordinates, y stands for these; where fields are not affine, for a matrix stands a field.
"""

from collections.abc import Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import mpmath
import sympy

from .brackets import Bracket
from .spectrum import Block, blocks
from .splitting import Field, Flow, Series, constant_rates, series
from .symbolics import Entries, Symbolics, form_text

#: What moves block by block, what moves by series, and the variables whose logarithms are coordinates.
Moving = tuple[list[Block], dict[int, Series], frozenset[int]]


class Generator(NamedTuple):
    """One of the matrices."""

    entries: Entries
    rate: Any  #: a_j, a function of y
    key: tuple[Any, ...]  #: equal for equal matrices
    components: tuple[int, ...]  #: of the linear or quadratic function whose field it is
    text: str  #: that function in words
    kind: str  #: linear or quadratic
    curved: Field = MappingProxyType({})  #: the whole field where it is not affine


def generators(flow: Flow, world: Symbolics) -> list[Generator]:
    """Those of the linear functions that a flow depends on, by their pivots, then those of quadratic ones."""
    bracket = world.bracket
    found = []
    key: tuple[Any, ...]
    for f, pivot in zip(*flow.reduced(), strict=True):
        if bracket.moves(f):
            key = (pivot, tuple((i, mpmath.nstr(c, 40)) for i, c in f.items()))
            curved = bracket.polynomial_field(f) if bracket.curved(f) else {}
            text = form_text(f, bracket.coordinates)
            slope = rate(flow, pivot, world)
            found.append(Generator(bracket.field(f), slope, key, tuple(f), text, "linear", curved))
    for term in flow.terms:
        for symbol, u in term.inner.items():
            slope, text = (term.slope(symbol), world.name(u.function)) if u.fields else (None, "")
            for c, entries in u.fields:
                key = (c, tuple((place, mpmath.nstr(value, 40)) for place, value in sorted(entries.items())))
                turned = sympy.Mul(world.coordinate(c), slope)
                used = world.used(u.function)
                found.append(Generator(entries, turned, ("quadratic", *key), used, text, "quadratic"))
    return _added(found)


def rate(flow: Flow, pivot: int, world: Symbolics) -> Any:
    """The number of the linear function with this pivot, of those that a flow depends on."""
    return world.by_coordinate(flow.slope(world.variables[pivot]), pivot)


def _added(found: Sequence[Generator]) -> list[Generator]:
    """Equal matrices once, with the sum of their numbers."""
    merged: dict[tuple[Any, ...], Generator] = {}
    for one in found:
        known = merged.get(one.key)
        merged[one.key] = one if known is None else known._replace(rate=known.rate + one.rate)
    return list(merged.values())


def motions(found: Sequence[Generator], bracket: Bracket) -> Moving:
    """By matrices that commute, block by block, and by series."""
    if any(one.curved for one in found):
        return [], series([one.curved or bracket.as_field(one.entries) for one in found]), bracket.logarithmic
    steady, matrices = constant_rates([one.entries for one in found], bracket.dimension)
    return blocks(matrices), steady, bracket.logarithmic
