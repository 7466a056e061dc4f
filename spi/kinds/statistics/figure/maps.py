"""Panels of densities: of the sphere in Mollweide's projection, which keeps areas, and of two functions."""

from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from spi.drawing.spheres import cell_edges, dress_map
from spi.statistics.projection import mollweide

from ..results import Statistics

_COLOURS = "YlGnBu"  # white for no paths
_FINER = 4  # points between the edges of cells, which are curved


def map_panel(ax: Axes, reading: Statistics, m: int, highest: float) -> None:
    """The density at one of the times, with colours up to `highest`."""
    found = reading.density_map
    if found is None:
        return
    look: dict[str, Any] = {"cmap": _COLOURS, "vmin": 0.0, "vmax": highest, "rasterized": True}
    density = np.where(found.density[m] > 0, found.density[m], np.nan)
    if found.is_sphere:  # cells of equal area on the sphere are such cells of an ellipse
        density = np.repeat(np.repeat(density, _FINER, axis=0), _FINER, axis=1)
        places = mollweide(*np.meshgrid(*cell_edges(found, m, _FINER), indexing="ij"))
        mesh = ax.pcolormesh(*places, density, **look)
    else:
        edges = cell_edges(found, m)
        mesh = ax.pcolormesh(*edges, density.T, **look)
        used = [np.flatnonzero(np.isfinite(density).any(axis=across)) for across in (1, 0)]
        if used[0].size:  # as far as there are paths
            xlim, ylim = ((edge[one[0]], edge[one[-1] + 1]) for edge, one in zip(edges, used, strict=True))
            ax.set(xlim=xlim, ylim=ylim)
    dress_map(ax, reading.about, found, m, mesh)


def law_panel(ax: Axes, reading: Statistics, highest: float) -> None:
    """The Gibbs law beside the last of the maps, in its colours."""
    found = reading.density_map
    if found is not None and found.law is not None:
        last = len(found.t) - 1
        density = np.broadcast_to(found.law, found.density.shape)
        map_panel(ax, replace(reading, density_map=replace(found, density=density)), last, highest)
        ax.set_title("Gibbs law, exp($-H/T$)", pad=14)
