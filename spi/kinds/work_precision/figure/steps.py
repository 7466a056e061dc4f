"""Step sizes beside the ends of lines, where they cover as little as possible."""

from collections.abc import Iterable
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke
from matplotlib.textpath import TextPath

from spi.drawing import style

SIZE = 7  #: points, of the text
#: Where a label may lie, the most wanted first: directions, and distances in points.
_AWAY = ((0.0, 1.0), (1.0, 0.6), (-1.0, 0.6), (0.0, -1.0), (-1.0, -0.6), (1.0, -0.6), (1.0, 0.0), (-1.0, 0.0))
_DISTANCES = (5.0, 9.0, 14.0)
_PAD = 2.0  # points, around a label: markers are wider than the points they stand for


class LabelledLine(NamedTuple):
    """A line whose first and last points are labelled with their step sizes."""

    h: np.ndarray
    x: np.ndarray
    y: np.ndarray
    half: np.ndarray  #: of the bars
    colour: str


def step_labels(ax: Axes, lines: Iterable[LabelledLine], levels: Iterable[float] = ()) -> None:
    """Label the ends of lines on an axes whose place and limits are final.

    Each label takes the place inside the axes that covers the fewest points of lines, bars, other labels and horizontal
    lines at the heights `levels`.
    """
    lines = list(lines)
    scale = 72 / ax.figure.dpi
    paths = [scale * ax.transData.transform(np.column_stack([line.x, line.y])) for line in lines]
    frame = scale * np.array(ax.get_window_extent().extents)
    low, high = ax.get_ylim()
    bars = [
        scale * ax.transData.transform([(x, max(y - half, low)), (x, min(y + half, high))])
        for line in lines
        for x, y, half in zip(line.x, line.y, line.half, strict=True)
    ]
    across = [scale * ax.transData.transform([(x, level) for x in ax.get_xlim()]) for level in levels]
    covered = np.concatenate([np.empty((0, 2)), *map(_dense, [*paths, *bars, *across])])
    taken: list[np.ndarray] = []
    for end in (0, -1):
        for line, path in zip(lines, paths, strict=True):
            if end == 0 or len(path) > 1:
                text = f"${style.number(float(line.h[end]), steps=True)}$"
                extent = TextPath((0, 0), text, size=SIZE).get_extents()
                offset, box, clashes = _best(path[end], np.array([extent.width, extent.height]), covered, taken, frame)
                if clashes:
                    continue  # where lines are many a label may find no room
                taken.append(box)
                _annotate(ax, text, (line.x[end], line.y[end]), offset, line.colour)


def _annotate(ax: Axes, text: str, at: tuple[float, float], offset: tuple[float, float], colour: str) -> None:
    place: dict[str, Any] = {
        "textcoords": "offset points",
        "xytext": offset,
        "ha": "center",
        "va": "center",
        "annotation_clip": False,
    }
    label = ax.annotate(text, at, fontsize=SIZE, color=colour, zorder=5, **place)
    label.set_path_effects([withStroke(linewidth=1.5, foreground="white")])
    label.set_in_layout(False)


def _dense(path: np.ndarray) -> np.ndarray:
    """Points along a line, a few points of the page apart; the corners, which have markers, count several times."""
    between = [np.linspace(a, b, 2 + int(np.hypot(*(b - a)) / 3)) for a, b in pairwise(path)]
    return np.concatenate([*between, *[path] * 4])


def _best(
    at: np.ndarray, extent: np.ndarray, covered: np.ndarray, taken: list[np.ndarray], frame: np.ndarray
) -> tuple[tuple[float, float], np.ndarray, int]:
    """Offset of the centre of a label, its box (left, bottom, right, top), in points, and how many others it is on."""
    choices = []
    for distance in _DISTANCES:
        for rank, (right, up) in enumerate(_AWAY):
            offset = np.array([right, up]) * (distance + 0.5 * extent)
            box = np.concatenate([at + offset - 0.5 * extent - _PAD, at + offset + 0.5 * extent + _PAD])
            outside = (box[:2] < frame[:2]).any() or (box[2:] > frame[2:]).any()
            hidden = ((covered > box[:2]) & (covered < box[2:])).all(axis=1).sum()
            clashes = sum(bool((box[:2] < other[2:]).all() and (box[2:] > other[:2]).all()) for other in taken)
            cost = 50.0 * outside + 2.0 * hidden + 20.0 * clashes + 0.1 * rank + 0.1 * distance
            choices.append((cost, (float(offset[0]), float(offset[1])), box, clashes))
    return min(choices, key=lambda choice: choice[0])[1:]
