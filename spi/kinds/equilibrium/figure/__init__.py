"""The figure of long times: how errors of the Casimirs grow, and how far the law of long paths is from its limit."""

import math
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from spi.drawing import layout, style
from spi.drawing.axes import SLOPE, legend_line, legend_under, limits, rules

from ..results import PANELS, Equilibrium
from . import averages
from .laws import chosen, distance_limits, distance_panel, law_limits, law_panel, moments_panel, scheme_entries

LARGE = (4.6, 3.2)  # inches of a panel of growth or moments, without its legend
SMALL = (2.6, 2.5)  # the same of a panel of one variable
LEAST_LARGE, LEAST_SMALL = 3.2, 1.6  # inches of their widths in a paper

FLOOR = 1e-11  #: errors of what keeps a Casimir but for rounding are held to stay below that
TOP = 1e2  # larger errors are only marked
MARKERS = 9  # along a curve
KEPT = 1e-6  # only a scheme whose errors end below that has reference slopes
STEPS = 3  # step sizes shown at most
SLOPE_LOOKS: tuple[dict[str, Any], ...] = (
    {"color": SLOPE, "linestyle": "--", "linewidth": 1.0},
    {"color": SLOPE, "linestyle": ":", "linewidth": 0.8},
)
FLOOR_LOOK: dict[str, Any] = {"color": "#000000", "linestyle": "-.", "linewidth": 0.8}


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
    layout.check_panels(words, PANELS)
    lines: list[layout.Line] = []
    large: list[layout.Panel] = []
    if "growth" in words:
        count = max(readings[0].casimir_count, 1)
        large += [partial(_growth_panel, readings=readings, c=c, looks=looks) for c in range(count)]
    if law and "moments" in words:
        large.append(partial(moments_panel, readings=readings, names=law.moments, looks=looks))
    if large:
        curves = sum(len(_steps_shown(reading)) for reading in readings) if "growth" in words else 0
        size = LARGE[0], LARGE[1] + legend_line() * max(len(readings) + 2, curves)
        lines.append(
            layout.Line(large, size, legend=[_marks(readings)] if "growth" in words else (), least=LEAST_LARGE)
        )
    for word, panel, limits_of in (("law", law_panel, law_limits), ("distance", distance_panel, distance_limits)):
        if law and word in words:
            names = chosen(law.variables)
            told: dict[str, Any] = {"readings": readings, "limits": limits_of(readings, names), "looks": looks}
            panels = [partial(panel, name=name, **told) for name in names]
            entries = [scheme_entries(readings, looks, word)]
            lines.append(layout.Line(panels, SMALL, legend=entries, least=LEAST_SMALL, shared=True))
    return lines + averages.lines(readings, looks)


def _growth_panel(ax: Axes, readings: Sequence[Equilibrium], c: int, looks: style.Looks) -> None:
    """Root mean square of the relative error of Casimir `c` against the number of steps, and of path 0, thin.

    A line per scheme and step size, with the fitted exponent in the legend.  Slope 1/2 lies just above the errors of
    the scheme that keeps the Casimir best; slope 1 starts with it, and shows what a bias of that size would grow to.
    """
    count = readings[0].casimir_count
    if not count:
        layout.empty(ax, "no Casimir")
        return
    symbol = f"C_{c + 1}" if count > 1 else "C"
    ax.set(xscale="log", yscale="log", xlabel="number of steps $n$")
    ax.set_ylabel(f"rms of ${symbol}(y_n)\\,/\\,{symbol}(y_0)-1$")
    rules(ax)
    n = np.concatenate([reading.n for reading in readings])
    ax.set_xlim(n.min() / 1.5, n.max() * 1.5)
    known = np.concatenate([reading.casimir_rms[..., c].ravel() for reading in readings])
    known = known[(known > 0) & (known <= TOP)]
    ax.set_ylim(limits(np.append(known, FLOOR)))
    for reading in readings:
        marker, colour = looks[reading.about.variant]
        shown = _steps_shown(reading)
        for k, i in enumerate(shown):
            _curves(ax, reading, i, c, marker, layout.shade(colour, k, len(shown)), 3 - 0.1 * k)
    _slopes(ax, readings, c)
    ax.axhline(FLOOR, zorder=1, **FLOOR_LOOK)
    legend_under(ax)


def _steps_shown(reading: Equilibrium) -> list[int]:
    """Numbers of the step sizes that have lines."""
    return layout.spread(len(reading.h), STEPS)


def _marks(readings: Sequence[Equilibrium]) -> list[layout.Entry]:
    """Entries of a legend for what is no curve of a scheme."""
    looks = zip(("1/2", "1"), SLOPE_LOOKS, strict=True)
    found: list[layout.Entry] = [(Line2D([], [], **look), f"slope {text}") for text, look in looks]
    found.append((Line2D([], [], **FLOOR_LOOK), f"${style.power(FLOOR)}$"))
    found.append((Line2D([], [], color="#777777", linewidth=0.6), "thin: path 0"))
    if any((~(reading.casimir_rms <= TOP)).any() for reading in readings):
        found.append(layout.mark("^", f"not finite, or above ${style.power(TOP)}$"))
    return found


def _slopes(ax: Axes, readings: Sequence[Equilibrium], c: int) -> None:
    """Reference slopes at the errors of the scheme with the smallest ones in the end."""
    ends = [(values[-1], reading.n, values) for reading in readings for values in reading.casimir_rms[..., c]]
    kept = [end for end in ends if 0 < end[0] < KEPT]
    if not kept:
        return
    _, n, values = min(kept, key=lambda end: end[0])
    x = np.array(ax.get_xlim())
    first = 1.7 * (values / np.sqrt(n)).max() * np.sqrt(x[0])
    ax.plot(x, first * np.sqrt(x / x[0]), zorder=1, **SLOPE_LOOKS[0])
    ax.plot(x, first * x / x[0], zorder=1, **SLOPE_LOOKS[1])


def _curves(ax: Axes, reading: Equilibrium, i: int, c: int, marker: str, colour: str, zorder: float) -> None:
    """The lines of one scheme at one step size, with a mark where the first leaves the panel."""
    n, top = reading.n, ax.get_ylim()[1]
    rms, one = reading.casimir_rms[i, :, c], np.abs(reading.casimir_one[i, :, c])
    shown, single = (np.where((values > 0) & (values <= top), values, np.nan) for values in (rms, one))
    every = max(1, len(n) // MARKERS)
    look: dict[str, Any] = {"color": colour, "marker": marker, "markersize": 4.5, "markevery": (i % every, every)}
    ax.plot(n, shown, label=_label(reading, i, c), zorder=zorder, **look)
    ax.plot(n, single, color=colour, linewidth=0.5, zorder=2)
    above = ~(rms <= top)
    layout.edge_marks(ax, n[above][:1], rms[above][:1], colour)


def _label(reading: Equilibrium, i: int, c: int) -> str:
    p, low, high = (float(values[i, c]) for values in (reading.growth, reading.growth_low, reading.growth_high))
    text = f"{style.label(reading.about)}, $h={style.number(float(reading.h[i]), steps=True)}$"
    return f"{text}: $n^{{{p:.2f}}}$ [{low:.2f}, {high:.2f}]" if math.isfinite(p) else text
