"""Film of trajectories: states in the plane, case by case, of what their components belong to."""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from spi.drawing import Figure, page, plots, style
from spi.drawing.film import Film
from spi.plugins import Registry

from .results import Trajectory

FilmReadings = Sequence[Trajectory]

MOST_FRAMES = 200

#: Axes of a path, the function that shows its state of a number, the path, and the states that are shown.
Screen = tuple[plots.Axes, Callable[[int], None], Trajectory, list[int]]


class Filmed(NamedTuple):
    """How states are shown in a film that belong to a torus, a lattice, ..."""

    screens: Callable[[Figure, FilmReadings, np.ndarray], list[Screen]]  #: of a figure, the paths of a case, and axes
    is_seen: Callable[[Trajectory], bool] = lambda one: True
    names: tuple[str, str] = ("", "")  #: of the axes


#: What states belong to, ``on`` of their geometry -> :class:`Filmed`.
FILMED = Registry("films")


def _filmed(one: Trajectory) -> Any:
    """How the states of a path are shown; None if they are not."""
    on = one.place.get("on", "")
    return FILMED[on] if on in FILMED and FILMED[on].is_seen(one) else None


def film(title: str, cases: Sequence[FilmReadings]) -> Film:
    """Film of the paths of all cases whose states are seen in the plane; ValueError if none is."""
    rows = [readings for readings in cases if _filmed(readings[0])]
    if not rows:
        kinds = " or ".join(f"a {on}" for on in sorted(FILMED))
        raise ValueError(f"a film shows states in two dimensions, on {kinds}, and the results have none")
    columns = max(map(len, rows))
    layout = page.current().layout
    side = layout.film_large if len(rows) * columns <= layout.film_few else layout.film_small
    fig = Figure()
    axes = fig.subplots(len(rows), columns, squeeze=False)
    screens = [
        screen
        for readings, line in zip(rows, axes, strict=True)
        for screen in _filmed(readings[0]).screens(fig, readings, line)
    ]
    for line, readings in zip(axes, rows, strict=True):
        for ax in line[len(readings) :]:
            ax.set_axis_off()
        name = f"{style.plain(readings[0].about.case_title)}\n" if len(rows) > 1 else ""
        line[0].set_ylabel(f"{name}{_filmed(readings[0]).names[1]}")
    if name := _filmed(rows[-1][0]).names[0]:
        for ax in axes[-1]:
            ax.set_xlabel(name)
    frames = max(len(states) for *_, states in screens)
    width = layout.width or layout.film_left + columns * side + layout.film_bar * len(rows)
    style.dress(fig, width, len(rows) * (side + layout.film_row), title, [])
    _show(screens, frames, 0)
    fig.draw_without_rendering()
    fig.set_layout_engine("none")  # so that nothing moves from frame to frame
    return Film(fig, frames, partial(_show, screens, frames))


def states_shown(readings: FilmReadings) -> list[list[int]]:
    """States of each path that the film shows."""
    return [plots.spread(len(one.t), MOST_FRAMES) for one in readings]


def _show(screens: Sequence[Screen], frames: int, frame: int) -> None:
    """Show frame number `frame`; a path with fewer states stays longer at each."""
    for ax, show, reading, states in screens:
        state = states[frame * len(states) // frames]
        show(state)
        between = float(reading.t[states[1]]) if len(states) > 1 else 1.0
        digits = max(0, 1 - math.floor(math.log10(between)))
        lost = "" if np.isfinite(reading.y[state]).all() else ", not finite"
        ax.set_title(f"{style.label(reading.about)}, $t={reading.t[state]:.{digits}f}${lost}")
