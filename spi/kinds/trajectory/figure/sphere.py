"""A path on a sphere, seen from outside: what lies behind is paler."""

from typing import Any

import numpy as np
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

from spi.drawing import page

GLASS, LINES = "#eef2f6", "#9aa5b1"
ELEVATION = 22  # degrees, of the eye


def draw_sphere(ax: Axes3D, y: np.ndarray, names: list[str], colour: str, start: dict[str, Any]) -> None:
    """Draw the path ``y``, an (n, 3) array, on the sphere through its first point, on 3-D axes with these names."""
    radius = float(np.linalg.norm(y[0])) or 1.0
    near = (np.abs(y) < 1.5 * radius).all(axis=1)  # false also where a path is not finite
    azimuth = _azimuth(y[0], y[near])
    ax.view_init(ELEVATION, azimuth)
    ax.set_proj_type("ortho")  # so that the outline of the sphere is a circle
    ax.computed_zorder = False
    on_screen = page.current().width is None
    ax.set_box_aspect((1, 1, 1), zoom=1.15 if on_screen else 0.83)
    ax.set(xlim=(-radius, radius), ylim=(-radius, radius), zlim=(-radius, radius))

    eye = _eye(azimuth)
    right = np.cross([0.0, 0.0, 1.0], eye) / np.cos(np.radians(ELEVATION))
    up = np.cross(eye, right)
    turn = np.linspace(0, 2 * np.pi, 181)
    outline = radius * (np.cos(turn)[:, None] * right + np.sin(turn)[:, None] * up)
    ax.add_collection3d(Poly3DCollection([outline], facecolor=GLASS, edgecolor=LINES, linewidth=0.8, zorder=1))

    circles = [_parallel(radius, turn, latitude) for latitude in np.radians([-60, -30, 0, 30, 60])]
    circles += [_meridian(radius, turn, longitude) for longitude in np.radians(range(0, 180, 30))]
    for points in circles:
        _two_sided(ax, points, eye, LINES, 0.4, 2)
    _two_sided(ax, np.where(near[:, None], y, np.nan), eye, colour, 1.0, 3)
    ax.plot(*y[:1].T, zorder=6, **start)

    far = radius if on_screen else radius / 2  # small letters at the corners would lie on one another
    ticks = [-far, 0, far]
    ax.set(xlabel=names[0], ylabel=names[1], zlabel=names[2], xticks=ticks, yticks=ticks, zticks=ticks)
    for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
        axis.set_major_formatter(lambda x, _: f"{x:.3g}".replace("-", "−"))
        axis.set_pane_color((1, 1, 1, 0))
        axis.set_tick_params(labelsize=7, pad=-2)
        axis.labelpad = -7 if on_screen or axis is ax.zaxis else -5
    ax.grid(False)


def _eye(azimuth: float) -> np.ndarray:
    """The direction of the eye."""
    a, e = np.radians([azimuth, ELEVATION])
    return np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])


def _azimuth(start: np.ndarray, y: np.ndarray) -> int:
    """Where to look from: the start and most of the path are in front, no axis is seen end on."""
    return max(
        (a for a in range(0, 360, 5) if 25 <= a % 90 <= 65),
        key=lambda a: (start @ _eye(a) > 0.3 * np.linalg.norm(start), (y @ _eye(a) > 0).sum()),
    )


def _parallel(radius: float, turn: np.ndarray, latitude: float) -> np.ndarray:
    flat = np.column_stack([np.cos(turn), np.sin(turn), np.full_like(turn, np.tan(latitude))])
    return radius * np.cos(latitude) * flat


def _meridian(radius: float, turn: np.ndarray, longitude: float) -> np.ndarray:
    """The whole circle through both poles."""
    across = np.outer(np.cos(turn), [np.cos(longitude), np.sin(longitude), 0])
    return radius * (across + np.outer(np.sin(turn), [0, 0, 1]))


def _two_sided(ax: Axes3D, points: np.ndarray, eye: np.ndarray, colour: str, width: float, zorder: int) -> None:
    """A line, paler behind the centre as seen from ``eye``; it takes two places in the order of drawing."""
    segments = np.stack([points[:-1], points[1:]], axis=1)
    whole = np.isfinite(segments).all(axis=(1, 2))
    front = segments.sum(axis=1) @ eye > 0
    for chosen, alpha, order in ((whole & ~front, 0.35, zorder), (whole & front, 1.0, zorder + 1)):
        if chosen.any():
            look: dict[str, Any] = {
                "colors": colour,
                "linewidths": width,
                "alpha": alpha,
                "zorder": order,
                "capstyle": "butt" if alpha < 1 else "round",
            }
            ax.add_collection3d(Line3DCollection(segments[chosen], **look))
