"""The figure of long times: how errors of the Casimirs grow, and how far the law of long paths is from its limit."""

from collections.abc import Sequence
from functools import partial
from typing import Any

from matplotlib.figure import Figure

from spi.drawing import layout, style
from spi.drawing.axes import legend_line

from ..results import Equilibrium
from . import averages
from .growth import growth_panel, marks, steps_shown
from .laws import chosen, distance_limits, distance_panel, law_limits, law_panel, moments_panel, scheme_entries

LARGE = (4.6, 3.2)  # inches of a panel of growth or moments, without its legend
SMALL = (2.6, 2.5)  # the same of a panel of one variable
LEAST_LARGE, LEAST_SMALL = 3.2, 1.6  # inches of their widths in a paper

#: What a panel can show, in the words of a spec.
WORDS = ("growth", "law", "distance", "moments", "means", "histogram", "autocorrelation", "heat", "acceptance")


def draw(title: str, cases: Sequence[Sequence[Equilibrium]]) -> Figure:
    """The figure of a study of kind equilibrium.

    For each case a line with ``growth``, a panel per Casimir, and ``moments``, and under it lines of ``law`` and of
    ``distance``, a panel per variable, and of what is known of functions, a panel for each.
    """
    return layout.of_cases(title, cases, _facts, _lines)


def _facts(reading: Equilibrium) -> dict[str, str]:
    steps = style.number(reading.steps_each, steps=True)
    each = "" if reading.averages else f" of ${steps}$ steps"
    return {**style.facts(reading), "paths": f"{style.count(reading.samples)} paths{each}"}


def _lines(readings: Sequence[Equilibrium], looks: style.Looks) -> list[layout.Line]:
    """The lines of panels of one case; what needs the stationary law is left out where that is not known."""
    words, law = readings[0].panels, readings[0].law
    layout.check_panels(words, WORDS)
    lines: list[layout.Line] = []
    large: list[layout.Panel] = []
    if "growth" in words:
        count = max(readings[0].casimir_count, 1)
        large += [partial(growth_panel, readings=readings, c=c, looks=looks) for c in range(count)]
    if law and "moments" in words:
        large.append(partial(moments_panel, readings=readings, names=law.moments, looks=looks))
    if large:
        curves = sum(len(steps_shown(reading)) for reading in readings) if "growth" in words else 0
        size = LARGE[0], LARGE[1] + legend_line() * max(len(readings) + 2, curves)
        lines.append(layout.Line(large, size, legend=[marks(readings)] if "growth" in words else (), least=LEAST_LARGE))
    for word, panel, limits in (("law", law_panel, law_limits), ("distance", distance_panel, distance_limits)):
        if law and word in words:
            names = chosen(law.variables)
            told: dict[str, Any] = {"readings": readings, "limits": limits(readings, names), "looks": looks}
            panels = [partial(panel, name=name, **told) for name in names]
            entries = [scheme_entries(readings, looks, word)]
            lines.append(layout.Line(panels, SMALL, legend=entries, least=LEAST_SMALL, shared=True))
    return lines + averages.lines(readings, looks)
