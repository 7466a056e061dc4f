"""Maps of densities in cells, of two quantities or of the sphere in Mollweide's projection."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm

from ..statistics.cells import heights, mollweide
from ..storage.stored import Description
from . import style
from .plots import GREY, Array

_FINER = 4  # points between the edges of cells of a sphere, which are curved


def cell_edges(maps: Any, i: int, finer: int = 1) -> list[Array]:
    """The edges of the cells of map `i` along both of its sides, each cell divided into `finer` parts."""
    ends = zip(maps.low[i], maps.width[i], maps.density.shape[1:], strict=True)
    return [low + width * np.linspace(0, number, finer * number + 1) for low, width, number in ends]


def on_sphere(maps: Any, i: int, density: Array) -> tuple[Array, Array, Array]:
    """Places and densities in Mollweide's plane of the cells of map `i`, by height and longitude on a sphere."""
    density = np.repeat(np.repeat(density, _FINER, axis=0), _FINER, axis=1)
    sides, longitude = cell_edges(maps, i)[0], cell_edges(maps, i, _FINER)[1]
    z = np.append([heights(*side, _FINER + 1)[:-1] for side in pairwise(sides.tolist())], sides[-1])
    return *mollweide(*np.meshgrid(z, longitude, indexing="ij")), density


def log_colours(least: float, most: float) -> dict[str, Any]:
    """Logarithmic colours from pale for the least density to dark for the largest."""
    return {"cmap": "inferno_r", "norm": LogNorm(least, max(most, 2 * least))}


def draw_cells(ax: Axes, about: Description, maps: Any, cells: Sequence[Array], look: dict[str, Any]) -> None:
    """Draw cells (edges or corners across and up, densities), with the names of their sides and a colour bar."""
    mesh = ax.pcolormesh(*cells, rasterized=True, **look)
    if maps.is_sphere:
        net(ax, style.component_names(about, 3))
        below = ax.inset_axes((0.15, -0.2, 0.7, 0.05))
        bar = ax.figure.colorbar(mesh, cax=below, label="density per steradian", orientation="horizontal")
    else:
        ax.set(xlabel=style.maths(maps.sides[0], about.variables), ylabel=style.maths(maps.sides[1], about.variables))
        bar = ax.figure.colorbar(mesh, ax=ax, label="density", pad=0.02)
    bar.minorticks_off()
    bar.outline.set_linewidth(0.4)


def net(ax: Axes, names: Sequence[str]) -> None:
    """Draw meridians, parallels, the outline and the points where the axes with these `names` leave the sphere."""
    thin: dict[str, Any] = {"color": GREY, "linewidth": 0.4, "alpha": 0.6}
    whole, up = np.linspace(-1, 1, 201), heights(-1, 1, 201)
    for longitude in np.pi * np.array([-1.0, -0.5, 0, 0.5, 1.0]):
        outline = {"color": "black", "linewidth": 0.7} if abs(longitude) > 3 else thin
        ax.plot(*mollweide(up, np.full_like(up, longitude)), **outline)
    for height in (-0.5, 0, 0.5):
        ax.plot(*mollweide(np.full_like(whole, height), np.pi * whole), **thin)
    ends = {
        (0, 0): names[0],
        (0, 0.5): names[1],
        (0, -0.5): f"$-${names[1]}",
        (1, 0): names[2],
        (-1, 0): f"$-${names[2]}",
    }
    for (height, turn), name in ends.items():
        x, y = mollweide(np.array(height, float), np.pi * np.array(turn))
        ax.plot(x, y, marker="+", color="black", markersize=4, markeredgewidth=0.7)
        above = height >= 0
        place: dict[str, Any] = {"textcoords": "offset points", "ha": "center", "va": "bottom" if above else "top"}
        ax.annotate(name, (x, y), (0, 3 if above else -3), **place)
    ax.set_aspect("equal")
    ax.set_axis_off()
