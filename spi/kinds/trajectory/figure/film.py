"""The film of vorticity on the torus: all schemes side by side, a row per case."""

import math
from collections.abc import Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from spi.drawing import style
from spi.drawing.film import Film
from spi.drawing.layout import spread

from ..results import Trajectory
from .fields import colour_range, draw_field, field_values

MOST_FRAMES = 200
LARGE, SMALL = 3.0, 2.0  # inches of a field, where they are few and where they are many
_FEW = 4

Screen = tuple[Axes, AxesImage, Trajectory, list[int]]  #: where a path is shown, and by which of its states


def film(title: str, cases: Sequence[Sequence[Trajectory]]) -> Film:
    """The film of the paths of all cases that are vorticities; ValueError if none is."""
    rows = [readings for readings in cases if readings[0].lattice]
    if not rows:
        raise ValueError("the results hold no vorticity, so there is no film; leave out --film")
    columns = max(map(len, rows))
    side = LARGE if len(rows) * columns <= _FEW else SMALL
    fig = Figure()
    axes = fig.subplots(len(rows), columns, squeeze=False)
    screens = [screen for readings, line in zip(rows, axes, strict=True) for screen in _screens(fig, readings, line)]
    for line, readings in zip(axes, rows, strict=True):
        for ax in line[len(readings) :]:
            ax.set_axis_off()
        name = f"{style.plain(readings[0].about.case_title)}\n" if len(rows) > 1 else ""
        line[0].set_ylabel(f"{name}$x_2$")
    for ax in axes[-1]:
        ax.set_xlabel("$x_1$")
    frames = max(len(states) for *_, states in screens)
    style.dress(fig, 1.0 + columns * side + 0.8 * len(rows), len(rows) * (side + 0.5), title, [])
    _show(screens, frames, 0)
    fig.draw_without_rendering()
    fig.set_layout_engine("none")  # so that nothing moves from frame to frame
    return Film(fig, frames, partial(_show, screens, frames))


def _screens(fig: Figure, readings: Sequence[Trajectory], axes: np.ndarray) -> list[Screen]:
    """The fields of one case at the start, in colours that suit all of its frames."""
    states = [spread(len(reading.t), MOST_FRAMES) for reading in readings]
    sizes = [_largest(reading, chosen) for reading, chosen in zip(readings, states, strict=True)]
    largest, beyond = colour_range(readings, sizes)
    found = []
    for ax, reading, chosen in zip(axes, readings, states, strict=False):
        image = draw_field(ax, field_values(reading, [0])[0], largest)
        found.append((ax, image, reading, chosen))
    shown = list(axes[: len(readings)])
    fig.colorbar(image, ax=shown, label=r"vorticity $\omega$", extend=beyond, shrink=0.9, aspect=22, pad=0.02)
    return found


def _largest(reading: Trajectory, states: Sequence[int]) -> np.ndarray:
    """The largest modulus of the vorticity in each of some states, one after the other to spare memory."""
    return np.array([np.abs(field_values(reading, [state])).max() for state in states])


def _show(screens: Sequence[Screen], frames: int, frame: int) -> None:
    """Frame number `frame`; a path with fewer states stays the longer at each."""
    for ax, image, reading, states in screens:
        state = states[frame * len(states) // frames]
        field = field_values(reading, [state])[0]
        image.set_data(field.T)
        between = float(reading.t[states[1]]) if len(states) > 1 else 1.0
        digits = max(0, 1 - math.floor(math.log10(between)))
        lost = "" if np.isfinite(field).all() else ", not finite"
        ax.set_title(f"{style.label(reading.about)}, $t={reading.t[state]:.{digits}f}${lost}")
