"""Curves of paths in a frame that suits those which behave."""

import math
import re
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.markers import CARETDOWN, CARETUP
from matplotlib.ticker import MaxNLocator, ScalarFormatter

from spi.drawing.layout import Entry

from ..results import Trajectory, diverged, losses

Bound = float | np.ndarray
Frame = tuple[Bound, Bound]  #: the lowest and the highest value, or those of each column

MARKERS = 14  # along a curve


class Path(NamedTuple):
    """How a trajectory is drawn."""

    reading: Trajectory
    label: str
    marker: str
    colour: str
    turn: float  #: where between two markers of the first scheme this one's stand, from 0 to 1

    def look(self, points: int) -> dict[str, Any]:
        """How a curve of so many points is drawn: with a few markers, which differ in place from scheme to scheme."""
        every = max(1, points // MARKERS)
        marks = {"marker": self.marker, "markerfacecolor": "none", "markersize": 5.5, "markeredgewidth": 1.1}
        return {"color": self.colour, "markevery": (int(every * self.turn), every), **marks}


def window(curves: list[tuple[Trajectory, np.ndarray]], errors: bool = False) -> tuple[float, float]:
    """Limits for ``curves``, (reading, values) each, that suit the schemes which preserve something.

    Schemes that preserve nothing and diverging paths may take as much room again on either side;
    what goes further is cut.  The room is that of the values, or with ``errors`` that of their changes, however small.
    """
    finite = [(reading, values) for reading, values in curves if np.isfinite(values).all()]
    good = [values for reading, values in finite if not reading.preserves_nothing] or [values for _, values in finite]
    everything = np.concatenate([values[np.isfinite(values)] for _, values in curves])
    if good:
        low, high = min(values.min() for values in good), max(values.max() for values in good)
    else:
        low, high = np.quantile(everything, [0.1, 0.9]) if everything.size else (0.0, 0.0)
    tiny = np.finfo(float).eps if errors else 1.0
    room = (high - low if errors else max(high - low, abs(low), abs(high))) or tiny
    kept = np.clip(everything, low - room, high + room)
    low, high = min(low, kept.min(initial=low)), max(high, kept.max(initial=high))
    least = tiny if errors else 0.1 * max(abs(low), abs(high)) or tiny
    spare = max(0.06 * (high - low), (least - (high - low)) / 2)
    return float(low - spare), float(high + spare)


def tamed(values: np.ndarray, frame: Frame) -> np.ndarray:
    """Values (t,) or (t, component) as they are drawn: nan where one is not finite, so that a curve has a gap there.

    What is far outside the frame is drawn on its way out and on its way in, at a distance that can be drawn.
    """
    (low, high), values = frame, np.array(values)
    span = np.subtract(high, low) / 2
    with np.errstate(invalid="ignore"):
        near = ((values >= low - span) & (values <= high + span)).reshape(len(values), -1).all(axis=1)
    lost = ~np.isfinite(values).reshape(len(values), -1).all(axis=1)
    beside = np.convolve(near, [1, 0, 1])[1:-1] > 0
    with np.errstate(over="ignore"):
        values = np.clip(values, low - 200 * span, high + 200 * span)
    values[lost | ~(near | beside)] = np.nan
    return values


def curve(ax: Axes, path: Path, values: np.ndarray, frame: Frame) -> list[Entry]:
    """Draw ``values`` over time, and return notes on where they leave the frame."""
    drawn, t = tamed(values, frame), path.reading.t
    ax.plot(t, drawn, zorder=3, **path.look(len(values)))
    lost = np.isnan(np.concatenate([[np.nan], drawn, [np.nan]]))
    alone = ~lost[1:-1] & lost[:-2] & lost[2:]  # a line of one point cannot be seen
    if alone.any() and len(values) > 1:
        ax.plot(t[alone], drawn[alone], ".", color=path.colour, markersize=3, zorder=3)
    return departure(ax, path, values, frame)


def departure(ax: Axes, path: Path, values: np.ndarray, frame: Frame, plane: bool = False) -> list[Entry]:
    """Mark where a path leaves the frame, is not defined or diverges; returns notes of it, (handle, text) each.

    ``frame`` is (lowest, highest), of each column of ``values`` if they are several.  Time is horizontal on ``ax``,
    unless that shows the ``plane`` of two columns.
    """
    values, (low, high), t = values.reshape(len(values), -1), frame, path.reading.t
    notes: list[Entry] = []
    look: dict[str, Any] = {"color": path.colour, "linestyle": "none"}
    with np.errstate(invalid="ignore"):
        outside = np.flatnonzero((np.isfinite(values) & ((values < low) | (values > high))).any(axis=1))
    lost = np.flatnonzero(~np.isfinite(values).all(axis=1))
    if len(outside):
        first = outside[0]
        up = bool((values[first] > high).any())
        if not plane:
            place: dict[str, Any] = {"transform": ax.get_xaxis_transform(), "clip_on": False, "zorder": 4}
            ax.plot(t[first], float(up), marker=CARETUP if up else CARETDOWN, **place, **look)
        where = f"{path.label} leaves at $t={t[first]:.3g}$"
        notes.append((Line2D([], [], marker="^" if up else "v", **look), where))
    if len(lost):
        first = lost[0]
        if first and not (len(outside) and outside[0] < first):
            x, y = values[first - 1] if plane else (np.full(values.shape[1], t[first - 1]), values[first - 1])
            ax.plot(x, y, marker="X", zorder=4, **look)
        told = [str(losses(path.reading, values) or ""), diverged(path.reading)]
        shown = [re.sub(r"t = (.*)", r"$t=\1$", text) for text in told if text]
        notes += [(Line2D([], [], marker="X", **look), f"{path.label} {how}") for how in shown]
    return notes


def dress_time(ax: Axes, t: np.ndarray, frame: tuple[float, float], label: str, unit: int | None = None) -> None:
    """Axes on which time is horizontal; of tiny or huge values the label names the power of ten that ticks count."""
    largest = max(map(abs, frame))
    exponent = math.floor(math.log10(largest))
    if -3 < exponent < 4:
        exponent = 0
    elif unit is not None and abs(exponent - unit) <= 1:
        exponent = unit
    ax.set(xlim=(t[0], t[-1] if len(t) > 1 else t[0] + 1), ylim=frame, xlabel="time $t$")
    ax.set_ylabel(rf"{label}  in  $10^{{{exponent}}}$" if exponent else label)
    dress_axes(ax)
    if exponent:
        ax.yaxis.set_major_formatter(lambda x, _: f"{x / 10.0**exponent:.4g}".replace("-", "\N{MINUS SIGN}"))


def dress_axes(ax: Axes) -> None:
    """A pale grid and few round ticks."""
    ax.grid(True, color="#e6e6e6", linewidth=0.6)
    ax.set_axisbelow(True)
    for axis in (ax.xaxis, ax.yaxis):
        formatter = ScalarFormatter(useOffset=False, useMathText=True)
        formatter.set_powerlimits((-3, 4))
        axis.set_major_formatter(formatter)
        axis.set_major_locator(MaxNLocator(5, steps=[1, 2, 2.5, 5, 10]))
