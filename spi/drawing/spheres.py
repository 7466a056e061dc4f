"""Maps of densities in cells, of two quantities or of the sphere in Mollweide's projection."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh

from ..statistics.cells import heights, mollweide
from ..storage.records import Description
from . import style

_LINES = "#777777"


def cell_edges(found: Any, i: int, finer: int = 1) -> list[np.ndarray]:
    """Between which values the cells of map `i` are along both of its sides, with so many places in each."""
    ends = zip(found.low[i], found.width[i], found.density.shape[1:], strict=True)
    return [low + width * np.linspace(0, number, finer * number + 1) for low, width, number in ends]


def dress_map(ax: Axes, about: Description, found: Any, i: int, mesh: QuadMesh) -> None:
    """Give map `i` of `found`, at one of its times `t`, its title, the names of its sides, and a colour bar."""
    name = f"{style.label(about)}, $t={style.number(float(found.t[i]))}$"
    if found.is_sphere:
        net(ax, style.component_names(about, 3))
        ax.set_title(name, pad=14)
        bar = ax.figure.colorbar(mesh, ax=ax, label="density per steradian", shrink=0.8, pad=0.02)
    else:
        ax.set(xlabel=style.plain(found.sides[0]), ylabel=style.plain(found.sides[1]))
        ax.set_title(name)
        bar = ax.figure.colorbar(mesh, ax=ax, label="density", pad=0.02)
    bar.outline.set_linewidth(0.4)


def net(ax: Axes, names: Sequence[str]) -> None:
    """Draw meridians, parallels, the outline and where the axes with these `names` leave the sphere."""
    thin: dict[str, Any] = {"color": _LINES, "linewidth": 0.4, "alpha": 0.6}
    whole = np.linspace(-1, 1, 201)
    up = heights(-1, 1, 201)
    for meridian in np.pi * np.array([-0.5, 0, 0.5]):
        ax.plot(*mollweide(up, np.full_like(up, meridian)), **thin)
    for height in (-0.5, 0, 0.5):
        ax.plot(*mollweide(np.full_like(whole, height), np.pi * whole), **thin)
    for side in (-np.pi, np.pi):
        ax.plot(*mollweide(up, np.full_like(up, side)), color="black", linewidth=0.7)
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


def _minus(name: str) -> str:
    return f"$-${name}"
