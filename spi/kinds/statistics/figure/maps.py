"""Panels of densities: of the sphere in Mollweide's projection, which keeps areas, and of two functions."""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh

from spi.drawing import style
from spi.drawing.spheres import net
from spi.statistics.projection import heights, mollweide

from ..results import DensityMap, Statistics

_COLOURS = "YlGnBu"  # white for no paths
_FINER = 4  # points between the edges of cells, which are curved


def map_panel(ax: Axes, reading: Statistics, m: int, highest: float) -> None:
    """The density at one of the times, with colours up to `highest`."""
    found = reading.density_map
    if found is None:
        return
    look: dict[str, Any] = {"cmap": _COLOURS, "vmin": 0.0, "vmax": highest, "rasterized": True}
    if found.is_sphere:
        mesh, label = _sphere(ax, found, m, style.component_names(reading.about, 3), look), "density per steradian"
    else:
        mesh, label = _plane(ax, found, m, look), "density"
    bar = ax.figure.colorbar(mesh, ax=ax, label=label, shrink=0.8 if found.is_sphere else 1.0, pad=0.02)
    bar.outline.set_linewidth(0.4)
    ax.set_title(
        f"{style.label(reading.about)}, $t={style.number(float(found.t[m]))}$", pad=14 if found.is_sphere else None
    )


def law_panel(ax: Axes, reading: Statistics, highest: float) -> None:
    """The Gibbs law beside the last of the maps, in its colours."""
    found = reading.density_map
    if found is not None and found.law is not None:
        last = len(found.t) - 1
        density = np.broadcast_to(found.law, found.density.shape)
        map_panel(ax, replace(reading, density_map=replace(found, density=density)), last, highest)
        ax.set_title("Gibbs law, exp($-H/T$)", pad=14)


def _sphere(ax: Axes, found: DensityMap, m: int, names: list[str], look: dict[str, Any]) -> QuadMesh:
    """Cells of equal area on the sphere as such cells of an ellipse, with its axes named."""
    rows, columns = found.density.shape[1:]
    (south, west), (high, wide) = found.low[m], found.width[m]
    sides = south + high * np.arange(rows + 1)
    z = np.append([heights(*side, _FINER + 1)[:-1] for side in pairwise(sides)], sides[-1])
    longitude = west + wide * np.linspace(0, columns, _FINER * columns + 1)
    density = np.where(found.density[m] > 0, found.density[m], np.nan)
    density = np.repeat(np.repeat(density, _FINER, axis=0), _FINER, axis=1)
    mesh = ax.pcolormesh(*mollweide(*np.meshgrid(z, longitude, indexing="ij")), density, **look)
    net(ax, names)
    return mesh


def _plane(ax: Axes, found: DensityMap, m: int, look: dict[str, Any]) -> QuadMesh:
    """Cells of two functions, as far as there are paths."""
    density = found.density[m]
    edges = [
        low + width * np.arange(number + 1)
        for low, width, number in zip(found.low[m], found.width[m], density.shape, strict=True)
    ]
    mesh = ax.pcolormesh(*edges, np.where(density > 0, density, np.nan).T, **look)
    used = [np.flatnonzero(density.any(axis=across)) for across in (1, 0)]
    if used[0].size:
        xlim, ylim = ((edge[one[0]], edge[one[-1] + 1]) for edge, one in zip(edges, used, strict=True))
        ax.set(xlim=xlim, ylim=ylim)
    ax.set(xlabel=style.plain(found.sides[0]), ylabel=style.plain(found.sides[1]))
    return mesh
