"""What a flow moves by: y(t) = exp(t sum_j a_j M_j) y with constant matrices M_j and numbers a_j that it keeps."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import mpmath
import sympy

from .axes import Axis, axes, clusters
from .functionals import form_text
from .kept import Entries
from .spectrum import Block, blocks
from .splitting import Flow, connected
from .symbolics import Symbolics


class Generator(NamedTuple):
    """One of the matrices."""

    entries: Entries
    rate: Any  #: a_j, a function of y
    key: tuple[Any, ...]  #: equal for equal matrices
    components: tuple[int, ...]  #: of the linear or quadratic function whose field it is
    text: str  #: that function in words
    kind: str  #: linear or quadratic


def generators(flow: Flow, world: Symbolics) -> list[Generator]:
    """Those of the linear functions that a flow depends on, by their pivots, then those of quadratic ones."""
    names, variables = world.bracket.variables, world.variables
    found = []
    key: tuple[Any, ...]
    for f, pivot in zip(*flow.reduced(), strict=True):
        if field := world.bracket.field(f):
            key = (pivot, tuple((i, mpmath.nstr(c, 40)) for i, c in f.items()))
            found.append(Generator(field, flow.slope(variables[pivot]), key, tuple(f), form_text(f, names), "linear"))
    for term in flow.terms:
        for symbol, u in term.inner.items():
            slope, text = (term.slope(symbol), world.name(u.function)) if u.fields else (None, "")
            for c, entries in u.fields:
                key = (c, tuple((place, mpmath.nstr(value, 40)) for place, value in sorted(entries.items())))
                rate = sympy.Mul(variables[c], slope)
                used = world.used(u.function)
                found.append(Generator(entries, rate, ("quadratic", *key), used, text, "quadratic"))
    return _added(found)


def _added(found: Sequence[Generator]) -> list[Generator]:
    """Equal matrices once, with the sum of their numbers."""
    merged: dict[tuple[Any, ...], Generator] = {}
    for one in found:
        known = merged.get(one.key)
        merged[one.key] = one if known is None else known._replace(rate=known.rate + one.rate)
    return list(merged.values())


def motions(matrices: Sequence[Entries]) -> list[Block | Axis]:
    """What moves under some matrices, block by block: first those that commute, then those that turn about an axis."""
    apart = clusters(matrices)
    turning = {n for cluster in apart for n in cluster}
    found: list[Block | Axis] = [*blocks([{} if n in turning else entries for n, entries in enumerate(matrices)])]
    for cluster in apart:
        parts = connected([place for n in cluster for place in matrices[n]])
        turned = axes(matrices, cluster, parts)
        assert turned is not None  # or the term was none
        found += turned
    return found
