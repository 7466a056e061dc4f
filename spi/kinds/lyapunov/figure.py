"""The figure of Lyapunov exponents: averages until t, with their 95 % intervals."""

from collections.abc import Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from spi.drawing import layout, style
from spi.drawing.axes import INTERVAL, rules
from spi.drawing.spheres import net

from .results import PANELS, Exponents, Pictures

SIZE = (3.4, 2.7)  # inches of a panel
PICTURE = (4.2, 2.6)  # inches of a picture
_ACROSS = 2  # pictures side by side
_FEW = 16  # cells with states that get a circle
_COLOURS = "inferno_r"  # pale for few states


def draw(title: str, cases: Sequence[Sequence[Exponents]]) -> Figure:
    """A panel for each exponent and one for their sum, in a line for each case, and pictures below."""
    looks = style.looks(cases)
    shared, own = style.split_facts([style.facts(readings[0], "samples", "step") for readings in cases])
    lines = []
    for readings, facts in zip(cases, own, strict=True):
        layout.check_panels(readings[0].panels, PANELS)
        count = len(readings[0].number)
        panels = [partial(_panel, readings=readings, looks=looks, k=k) for k in range(count + (count > 1))]
        found = [layout.Line(panels, SIZE, legend=[_entries(readings, looks)], least=2.4)]
        found = [*(found if "lyapunov" in readings[0].panels else []), *_pictures(readings)]
        if found and len(cases) > 1:
            width = len(found[0].panels) * found[0].size[0]
            found[0] = found[0]._replace(title=layout.case_title(readings[0].about, facts, width))
        lines += found
    return layout.arranged(title, lines, shared)


def _entries(readings: Sequence[Exponents], looks: style.Looks) -> list[layout.Entry]:
    found: list[layout.Entry] = []
    for one in readings:
        marker, colour = looks[one.about.variant]
        found.append((Line2D([], [], color=colour, marker=marker, markersize=4), style.label(one.about)))
    return found


def _panel(ax: Axes, readings: Sequence[Exponents], looks: style.Looks, k: int) -> None:
    """Exponent k from 0 on, or behind the last their sum."""
    is_sum = k == len(readings[0].number)
    ax.set_title("sum of the exponents" if is_sum else f"exponent {k + 1}")
    ax.set_xlabel("averaged until time $t$")
    ax.set_ylabel("$\\sum_k \\lambda_k$" if is_sum else f"$\\lambda_{{{k + 1}}}$")
    rules(ax)
    if is_sum and (known := readings[0].total_known) is not None:
        ax.axhline(known, color="#777777", linestyle=(0, (2, 2)), linewidth=1.0, zorder=1)
    ax.axhline(0, color="#aaaaaa", linewidth=0.8, zorder=1)
    for one in readings:
        marker, colour = looks[one.about.variant]
        value = one.total if is_sum else one.exponent[k]
        half = INTERVAL * (one.total_stderr if is_sum else one.exponent_stderr[k])
        ax.fill_between(one.t, value - half, value + half, color=colour, alpha=0.2, linewidth=0)
        ax.plot(one.t, value, color=colour, marker=marker, markersize=4)


def _pictures(readings: Sequence[Exponents]) -> list[layout.Line]:
    """Lines of pictures, those of each scheme for itself, with the same colours."""
    lines = []
    for one in readings:
        if (found := one.pictures) is None or "pullback" not in one.panels:
            continue
        density = found.density
        least, most = density[density > 0].min(initial=np.inf), density.max(initial=0.0)
        norm = LogNorm(least, max(most, 2 * least)) if most > 0 else None
        panels = [partial(_picture, reading=one, i=i, norm=norm) for i in range(len(found.t))]
        circled = any(0 < np.count_nonzero(cells) <= _FEW for cells in found.count)
        few = (
            [[layout.mark("o", "all cells that have states", markerfacecolor="none", markersize=9)]] if circled else []
        )
        lines += [layout.Line(panels[i : i + _ACROSS], PICTURE, least=2.4) for i in range(0, len(panels), _ACROSS)]
        lines[-1] = lines[-1]._replace(legend=few * circled)
    return lines


def _picture(ax: Axes, reading: Exponents, i: int, norm: LogNorm | None) -> None:
    """Where the states are that noise has moved since -t."""
    found = reading.pictures
    assert found is not None
    mesh = _cells(ax, found, i, norm)
    if found.is_sphere:
        net(ax, style.component_names(reading.about, 3))
    else:
        ax.set(xlabel=style.plain(found.sides[0]), ylabel=style.plain(found.sides[1]))
    bar = ax.figure.colorbar(
        mesh,
        ax=ax,
        label="density per steradian" if found.is_sphere else "density",
        shrink=0.8 if found.is_sphere else 1.0,
        pad=0.02,
    )
    bar.outline.set_linewidth(0.4)
    label = f"{style.label(reading.about)}, $t={style.number(float(found.t[i]))}$"
    ax.set_title(label, pad=14 if found.is_sphere else None)


def _cells(ax: Axes, found: Pictures, i: int, norm: LogNorm | None) -> QuadMesh:
    edges = [
        low + width * np.arange(number + 1)
        for low, width, number in zip(found.low[i], found.width[i], found.count.shape[1:], strict=True)
    ]
    cells = np.where(found.count[i] > 0, found.density[i], np.nan)
    if len(few := np.argwhere(found.count[i] > 0)) <= _FEW:  # which alone could not be seen
        places = found.low[i] + found.width[i] * (few + 0.5)
        across, up = places.T[::-1] if found.is_sphere else places.T
        ax.plot(across, up, "o", color="black", markerfacecolor="none", markersize=9, zorder=4)
    if found.is_sphere:
        return ax.pcolormesh(edges[1], edges[0], cells, cmap=_COLOURS, norm=norm, rasterized=True)
    return ax.pcolormesh(*edges, cells.T, cmap=_COLOURS, norm=norm, rasterized=True)
