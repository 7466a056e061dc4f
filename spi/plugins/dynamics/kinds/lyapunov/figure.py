"""Figure of Lyapunov exponents: averages until t with their 95 % intervals, and pull-back pictures."""

from typing import Any

import numpy as np

from spi.drawing import panels, plots
from spi.plugins.dynamics.drawing import maps

_FEW = 16  # cells with states that get a circle, since they could not be seen


def _picture(ax: plots.Axes, reading: Any, i: Any, readings: Any) -> list[plots.LegendEntry]:
    """A picture of the states that noise has moved since -t."""
    pictures = reading.pictures
    density = pictures.density[i]
    seen = [one.pictures.density[one.pictures.density > 0] for one in readings]
    least, most = (end([end(values) for values in seen]) for end in (np.min, np.max))
    maps.draw_cells(ax, reading.about, pictures, i, density, maps.log_colours(least, most))
    few = np.argwhere(density > 0)
    if not 0 < len(few) <= _FEW:
        return []
    up, across = (pictures.low[i] + pictures.width[i] * (few + 0.5)).T
    if pictures.is_sphere:
        across, up = maps.mollweide(up, across)
    else:
        across, up = up, across
    ax.plot(across, up, "o", color="black", markerfacecolor="none", markersize=9, zorder=4)
    return [plots.mark("o", "all cells that have states", markerfacecolor="none", markersize=9)]


_UNTIL = "averaged until time $t$"
PANELS: dict[str, Any] = {
    "lyapunov": [
        panels.CurvePanel("exponent", "t", "number", zero=True, label="${f}$", x=_UNTIL),
        panels.CurvePanel(
            "total",
            "t",
            zero=True,
            label=r"$\sum_k \lambda_k$",
            x=_UNTIL,
            reference="total_known",
            reference_name="sum, of the equation",
            only=lambda reading, _: len(reading.number) > 1,
        ),
    ],
    "pullback": [maps.MapPanel("pictures", _picture)],
}

draw = panels.Figures(PANELS, ("samples", "step"))
