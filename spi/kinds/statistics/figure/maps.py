"""Panels of densities: of the sphere in Mollweide's projection, which keeps areas, and of two functions."""

from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh

from spi.drawing import style

from ..results import DensityMap, Statistics

_COLOURS = "YlGnBu"  # white for no paths
_LINES = "#777777"
_FINER = 4  # points between the edges of cells, which are curved
_TABLE = np.linspace(-np.pi / 2, np.pi / 2, 2001)  # auxiliary angles a with 2 a + sin 2 a = pi sin(latitude)
_HEIGHT = (2 * _TABLE + np.sin(2 * _TABLE)) / np.pi


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
    z, longitude = (
        low + width * np.linspace(0, number, _FINER * number + 1)
        for low, width, number in zip(found.low[m], found.width[m], (rows, columns), strict=True)
    )
    density = np.where(found.density[m] > 0, found.density[m], np.nan)
    density = np.repeat(np.repeat(density, _FINER, axis=0), _FINER, axis=1)
    mesh = ax.pcolormesh(*mollweide(*np.meshgrid(z, longitude, indexing="ij")), density, **look)
    thin: dict[str, Any] = {"color": _LINES, "linewidth": 0.4, "alpha": 0.6}
    whole = np.linspace(-1, 1, 201)
    for meridian in np.pi * np.array([-0.5, 0, 0.5]):
        ax.plot(*mollweide(whole, np.full_like(whole, meridian)), **thin)
    for height in (-0.5, 0, 0.5):
        ax.plot(*mollweide(np.full_like(whole, height), np.pi * whole), **thin)
    for side in (-np.pi, np.pi):
        ax.plot(*mollweide(whole, np.full_like(whole, side)), color="black", linewidth=0.7)
    ends = {
        (0, 0): names[0],
        (0, 0.5): names[1],
        (0, -0.5): _minus(names[1]),
        (1, 0): names[2],
        (-1, 0): _minus(names[2]),
    }
    for (height, turn), name in ends.items():
        x, y = mollweide(np.array(height, float), np.pi * np.array(turn))
        ax.plot(x, y, marker="+", color="black", markersize=4, markeredgewidth=0.7)
        above, shift = height >= 0, (0, 3 if height >= 0 else -3)
        ax.annotate(name, (x, y), shift, textcoords="offset points", ha="center", va="bottom" if above else "top")
    ax.set_aspect("equal")
    ax.set_axis_off()
    return mesh


def _minus(name: str) -> str:
    return f"$-${name}"


def mollweide(z: np.ndarray, longitude: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The point of the plane for one at this height on the unit sphere, with this longitude in [-pi, pi]."""
    angle = np.interp(z, _HEIGHT, _TABLE)
    return 2 * np.sqrt(2) / np.pi * longitude * np.cos(angle), np.sqrt(2) * np.sin(angle)


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
