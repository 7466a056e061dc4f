"""Lattices of spins in the figure and in the film of trajectories."""

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
from matplotlib.collections import PolyCollection

from spi.drawing import Figure, panels, plots, style
from spi.expressions import as_numpy, parse_expression
from spi.kinds.trajectory.figure import TrajectoryReadings
from spi.kinds.trajectory.film import Filmed, Screen, states_shown
from spi.kinds.trajectory.results import Trajectory

_MOST_ARROWS = 41  # along a side


def colours_of_spins(s: np.ndarray) -> np.ndarray:
    """(..., 3) red, green and blue of spins (..., 3): the angle of (x, y) as hue, z as lightness, black at z = -1."""
    hue = np.arctan2(s[..., 1], s[..., 0])[..., np.newaxis] - np.array([0.0, 2.0, 4.0]) * np.pi / 3
    pure = np.clip(0.5 + np.cos(hue), 0.0, 1.0)
    light = 0.5 * (1 + s[..., 2:3])
    return np.asarray(np.clip(np.where(light < 0.5, 2 * light * pure, 1 - 2 * (1 - light) * (1 - pure)), 0.0, 1.0))


def _places(one: Trajectory) -> np.ndarray | None:
    """(sites, 2): where the spins of the first layer are; None for chains and other states."""
    lattice = one.place
    if lattice.get("on") != "lattice" or len(lattice["size"]) < 2:
        return None
    sites, vectors = np.array(lattice["sites"]), np.array(lattice["vectors"])
    cells = np.stack(np.meshgrid(*map(np.arange, lattice["size"][:2]), indexing="ij"), axis=-1).reshape(-1, 2)
    places: np.ndarray = (cells @ vectors[:2])[:, np.newaxis, :2] + sites[:, :2]
    return places.reshape(-1, 2)


def _cells(one: Trajectory) -> list[np.ndarray]:
    """Of each site of a cell of the lattice the corners (C, 2) around it of the points that are nearest to it.

    They are no farther than 3/4 of the least distance of two sites, so that squares and hexagons fill the plane and the
    holes of a kagome lattice stay.
    """
    sites, vectors = np.array(one.place["sites"])[:, :2], np.array(one.place["vectors"])[:2, :2]
    shifts = np.stack(np.meshgrid(*[np.arange(-2, 3)] * 2), axis=-1).reshape(-1, 2) @ vectors
    cells = []
    for site in sites:
        others = (shifts[:, np.newaxis] + sites - site).reshape(-1, 2)
        lengths = np.linalg.norm(others, axis=1)
        others, lengths = others[lengths > 1e-9], lengths[lengths > 1e-9]
        angle = 2 * np.pi * np.arange(24) / 24
        corners = 0.75 * lengths.min() * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        for other, length in zip(others, lengths, strict=True):
            beyond = corners @ other / length - length / 2  # the bisector cuts off what is beyond it
            cut = []
            for p, q, a, b in zip(corners, np.roll(corners, -1, 0), beyond, np.roll(beyond, -1), strict=True):
                if a <= 0:
                    cut.append(p)
                if a * b < 0:
                    cut.append(p + (q - p) * a / (a - b))
            corners = np.array(cut)
        cells.append(corners)
    return cells


def _layer(one: Trajectory, state: int) -> np.ndarray:
    """(sites, 3): the spins of the first layer."""
    lattice = one.place
    size = (*lattice["size"], 1)[:3]
    return one.y[state].reshape(*size, len(lattice["sites"]), 3)[:, :, 0].reshape(-1, 3)


def _spins(readings: TrajectoryReadings, looks: style.Looks) -> Iterator[plots.Plot]:
    """Spins of each scheme at the chosen times, of a lattice in space its first layer; of a chain all times."""
    for one in (one for one in readings if one.place.get("on") == "lattice"):
        places = _places(one)
        if places is None:
            yield plots.Plot(title=style.label(one.about), x="site", y="time $t$", own=partial(_chain, one))
            continue
        for i in one.shown:
            own = partial(_picture, one, places, _layer(one, i))
            yield plots.Plot(title=f"{style.label(one.about)}, $t={one.t[i]:.4g}$", own=own, aspect=0.9)


def _draw_spins(ax: plots.Axes, one: Trajectory, places: np.ndarray, s: np.ndarray) -> Any:
    """Spins at their places in colours, each in its part of the plane."""
    ax.set(aspect="equal", xticks=[], yticks=[], xlim=(places[:, 0].min() - 1, places[:, 0].max() + 1))
    ax.set_ylim(places[:, 1].min() - 1, places[:, 1].max() + 1)
    cells = _cells(one)
    around = [place + cells[n % len(cells)] for n, place in enumerate(places)]
    look: dict[str, Any] = {"edgecolors": "face", "linewidths": 0.2, "rasterized": True}
    return ax.add_collection(PolyCollection(around, facecolors=colours_of_spins(s), **look))


def _picture(one: Trajectory, places: np.ndarray, s: np.ndarray, ax: plots.Axes) -> list[plots.LegendEntry]:
    """Spins in colours, with arrows where they are few, and the key of the colours."""
    _draw_spins(ax, one, places, s)
    span = float(np.ptp(places, axis=0).max()) or 1.0
    if len(places) < _MOST_ARROWS**2:
        ax.quiver(*places.T, *s[:, :2].T, pivot="mid", scale=1.3 * span, width=0.004, color="#404040")
    key = ax.inset_axes((1.02, 0.14, 0.18, 0.18), projection="polar")
    angle, radius = np.meshgrid(np.linspace(0, 2 * np.pi, 61), np.linspace(0, 1, 21))
    polar = np.pi * radius
    ball = np.stack([np.sin(polar) * np.cos(angle), np.sin(polar) * np.sin(angle), np.cos(polar)], axis=-1)
    key.pcolormesh(angle, radius, colours_of_spins(ball)[:-1, :-1], rasterized=True)
    key.set(xticks=[], yticks=[])
    key.set_title("$(s_x,s_y)$", fontsize=6, pad=2)
    key.set_xlabel("white: up\nblack: down", fontsize=5)
    return []


def _chain(one: Trajectory, ax: plots.Axes) -> list[plots.LegendEntry]:
    """s_z of the sites of a chain at all times."""
    chosen = plots.spread(len(one.t), 512)
    z = one.y[chosen].reshape(len(chosen), -1, 3)[..., 2]
    look: dict[str, Any] = {"cmap": "RdBu_r", "vmin": -1, "vmax": 1, "shading": "nearest", "rasterized": True}
    image = ax.pcolormesh(np.arange(1, z.shape[1] + 1), one.t[chosen], z, **look)
    ax.figure.colorbar(image, ax=ax, label="$s_z$")
    return []


def _screens(fig: Figure, readings: TrajectoryReadings, axes: np.ndarray) -> list[Screen]:
    """Spins of one case at the start."""
    places: Any = _places(readings[0])
    points = [_draw_spins(ax, one, places, _layer(one, 0)) for ax, one in zip(axes, readings, strict=False)]
    shows = [partial(_recolour, image, one) for image, one in zip(points, readings, strict=True)]
    return list(zip(axes, shows, readings, states_shown(readings), strict=False))


def _recolour(image: Any, one: Trajectory, state: int) -> None:
    image.set_facecolors(colours_of_spins(_layer(one, state)))


FILM = Filmed(_screens, lambda one: _places(one) is not None)
SPINS = [panels.OwnPanels(_spins)]


def _loops(readings: TrajectoryReadings, looks: style.Looks) -> Iterator[plots.Plot]:
    """The mean of the spins along the field over the field, for the first component of it that depends on time.

    Where the spec has the function ``mx``, ``my`` or ``mz`` it is that, the mean of mu s, under its name.
    """
    for one in readings:
        field = np.reshape(np.array(one.about.parameters["field"], object).astype(str), (-1, 3))[0]
        t = one.t + float(one.about.parameters.get("initial_time", 0.0))
        component, b = next((c, b) for c, text in enumerate(field) if np.ptp(b := _course(text, t)) > 0)
        x = "xyz"[component]
        m, name = one.y.reshape(len(one.t), -1, 3)[..., component].mean(axis=1), f"$\\langle s_{x}\\rangle$"
        if one.values and f"m{x}" in one.values.texts:
            f = one.values.texts.index(f"m{x}")
            m, name = one.values.value[f], style.named(one.values.functions[f])
        look = {"color": "#0072B2", "linewidth": 1.0}
        line = plots.series(b, m, look)._replace(x=b, y=m)  # in the order of time
        most = 1.1 * max(1.0, float(np.nanmax(abs(m), initial=0.0)))
        yield plots.Plot([line], style.label(one.about), f"field $B_{x}$", name, ylim=(-most, most))


def _course(text: str, t: np.ndarray) -> np.ndarray:
    """A component of a field at some times."""
    return np.broadcast_to(as_numpy(parse_expression(text, 1, ("t",)))(t[np.newaxis]), t.shape)


LOOP = [panels.OwnPanels(_loops)]
