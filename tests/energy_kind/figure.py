"""The figure of mean energies."""

from collections.abc import Sequence

from matplotlib.figure import Figure

from spi.drawing import style
from spi.drawing.axes import INTERVAL, PANEL, error_axes, legend_under

from .results import Energies


def draw(title: str, cases: Sequence[Sequence[Energies]]) -> Figure:
    fig, looks = Figure(), style.looks(cases)
    style.dress(fig, PANEL[0] * len(cases), PANEL[1] + 1.0, title, [])
    for ax, readings in zip(fig.subplots(1, len(cases), squeeze=False).flat, cases, strict=True):
        error_axes(ax, readings[0].h)
        ax.set_yscale("linear")
        for reading in readings:
            marker, colour = looks[reading.about.variant]
            bars = INTERVAL * reading.energy_stderr
            ax.errorbar(reading.h, reading.energy, bars, marker=marker, color=colour, label=style.label(reading.about))
        legend_under(ax)
    return fig
