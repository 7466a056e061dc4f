"""The generators of a flow: y(t) = exp(t sum_j a_j M_j) y with constant matrices M_j and numbers a_j that it keeps.

Where logarithms are coordinates, y stands for these; where fields are not affine, M_j stands for a field.
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

#: Blocks, series by component, and the variables whose logarithms are coordinates.
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
    """The generators of the linear functions that a flow depends on, by their pivots, then of the quadratic ones."""
    bracket = world.bracket
    generators = []
    key: tuple[Any, ...]
    for f, pivot in zip(*flow.reduced(), strict=True):
        if bracket.moves(f):
            key = (pivot, tuple((i, mpmath.nstr(c, 40)) for i, c in f.items()))
            curved = bracket.polynomial_field(f) if bracket.curved(f) else {}
            text = form_text(f, bracket.coordinates)
            slope = rate(flow, pivot, world)
            generators.append(Generator(bracket.field(f), slope, key, tuple(f), text, "linear", curved))
    for term in flow.terms:
        for symbol, u in term.inner.items():
            slope, text = (term.slope(symbol), world.name(u.function)) if u.fields else (None, "")
            for c, entries in u.fields:
                key = (c, tuple((place, mpmath.nstr(value, 40)) for place, value in sorted(entries.items())))
                turned = sympy.Mul(world.coordinate(c), slope)
                used = world.used(u.function)
                generators.append(Generator(entries, turned, ("quadratic", *key), used, text, "quadratic"))
    return _added(generators)


def rate(flow: Flow, pivot: int, world: Symbolics) -> Any:
    """The factor a_j of the linear function with this pivot that a flow depends on."""
    return world.by_coordinate(flow.slope(world.variables[pivot]), pivot)


def _added(generators: Sequence[Generator]) -> list[Generator]:
    """Generators with equal matrices added up to one with the sum of their rates."""
    merged: dict[tuple[Any, ...], Generator] = {}
    for generator in generators:
        before = merged.get(generator.key)
        merged[generator.key] = generator if before is None else before._replace(rate=before.rate + generator.rate)
    return list(merged.values())


def motions(generators: Sequence[Generator], bracket: Bracket) -> Moving:
    """The motions by commuting matrices, block by block, and by series."""
    if any(generator.curved for generator in generators):
        fields = [generator.curved or bracket.as_field(generator.entries) for generator in generators]
        return [], series(fields), bracket.logarithmic
    steady, matrices = constant_rates([generator.entries for generator in generators], bracket.dimension)
    return blocks(matrices), steady, bracket.logarithmic
