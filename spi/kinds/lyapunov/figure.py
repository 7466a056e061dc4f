"""The figure of Lyapunov exponents: averages until t, with their 95 % intervals."""

from collections.abc import Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from spi.drawing import layout, style
from spi.drawing.axes import cell_edges, dress_map, rules

from .results import PANELS, Exponents

SIZE = (3.4, 2.7)  # inches of a panel
PICTURE = (4.2, 2.6)  # inches of a picture
_ACROSS = 2  # pictures side by side
_FEW = 16  # cells with states that get a circle
_COLOURS = "inferno_r"  # pale for few states


def draw(title: str, cases: Sequence[Sequence[Exponents]]) -> Figure:
    """A panel for each exponent and one for their sum, in a line for each case, and pictures below."""
    return layout.of_cases(title, cases, lambda reading: style.facts(reading, "samples", "step"), _lines)


def _lines(readings: Sequence[Exponents], looks: style.Looks) -> list[layout.Line]:
    layout.check_panels(readings[0].panels, PANELS)
    if "lyapunov" not in readings[0].panels and (pictures := _pictures(readings)):  # none yet of a run that goes on
        return pictures
    count = len(readings[0].number)
    panels = [partial(_panel, readings=readings, looks=looks, k=k) for k in range(count + (count > 1))]
    legend = [[layout.scheme_entry(reading.about, looks, markersize=4) for reading in readings]]
    return [layout.Line(panels, SIZE, legend=legend, least=2.4), *_pictures(readings)]


def _panel(ax: Axes, readings: Sequence[Exponents], looks: style.Looks, k: int) -> None:
    """Exponent k from 0 on, or behind the last their sum."""
    is_sum = k == len(readings[0].number)
    ax.set_title("sum of the exponents" if is_sum else f"exponent {k + 1}")
    ax.set_xlabel("averaged until time $t$")
    ax.set_ylabel("$\\sum_k \\lambda_k$" if is_sum else f"$\\lambda_{{{k + 1}}}$")
    rules(ax)
    if is_sum and (exact := readings[0].total_known) is not None:
        ax.axhline(exact, color="#777777", linestyle=(0, (2, 2)), linewidth=1.0, zorder=1)
    ax.axhline(0, color="#aaaaaa", linewidth=0.8, zorder=1)
    for reading in readings:
        marker, colour = looks[reading.about.variant]
        value = reading.total if is_sum else reading.exponent[k]
        half = reading.total_half if is_sum else reading.exponent_half[k]
        ax.fill_between(reading.t, value - half, value + half, color=colour, alpha=0.2, linewidth=0)
        ax.plot(reading.t, value, color=colour, marker=marker, markersize=4)


def _pictures(readings: Sequence[Exponents]) -> list[layout.Line]:
    """Lines of pictures, those of each scheme for itself, with the same colours."""
    lines = []
    for reading in readings:
        if (pictures := reading.pictures) is None or "pullback" not in reading.panels:
            continue
        density = pictures.density
        least, most = density[density > 0].min(initial=np.inf), density.max(initial=0.0)
        norm = LogNorm(least, max(most, 2 * least)) if most > 0 else None
        panels = [partial(_picture, reading=reading, i=i, norm=norm) for i in range(len(pictures.t))]
        few = layout.mark("o", "all cells that have states", markerfacecolor="none", markersize=9)
        circled = any(0 < np.count_nonzero(cells) <= _FEW for cells in pictures.count)
        lines += layout.in_lines(panels, _ACROSS, PICTURE, least=2.4)
        lines[-1] = lines[-1]._replace(legend=[[few]] if circled else ())
    return lines


def _picture(ax: Axes, reading: Exponents, i: int, norm: LogNorm | None) -> None:
    """A picture of the states that noise has moved since -t."""
    pictures = reading.pictures
    assert pictures is not None
    edges = cell_edges(pictures, i)
    cells = np.where(pictures.count[i] > 0, pictures.density[i], np.nan)
    if len(few := np.argwhere(pictures.count[i] > 0)) <= _FEW:  # which alone could not be seen
        places = pictures.low[i] + pictures.width[i] * (few + 0.5)
        across, up = places.T[::-1] if pictures.is_sphere else places.T
        ax.plot(across, up, "o", color="black", markerfacecolor="none", markersize=9, zorder=4)
    shown = (edges[1], edges[0], cells) if pictures.is_sphere else (*edges, cells.T)
    dress_map(ax, reading.about, pictures, i, ax.pcolormesh(*shown, cmap=_COLOURS, norm=norm, rasterized=True))
