"""What a sphere in Mollweide's projection has around it: a net, the names of its axes, and no frame."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from ..statistics.projection import heights, mollweide

_LINES = "#777777"


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
