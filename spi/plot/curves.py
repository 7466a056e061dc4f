"""Curves of paths in a frame that suits those which behave."""

from typing import NamedTuple

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.markers import CARETDOWN, CARETUP
from matplotlib.ticker import MaxNLocator, ScalarFormatter

MARKERS = 14  # along a curve


class Path(NamedTuple):
    """One scheme in one case."""

    scheme: str
    label: str
    marker: str
    colour: str
    turn: float  #: where between two markers of the first scheme this one's stand, from 0 to 1
    t: np.ndarray
    y: np.ndarray  #: (t, component)
    hamiltonian: np.ndarray  #: (t,)
    casimirs: np.ndarray  #: (t, casimir)

    def look(self, points):
        """How a curve of so many points is drawn: with a few markers, which differ in place from scheme to scheme."""
        every = max(1, points // MARKERS)
        marks = {"marker": self.marker, "markerfacecolor": "none", "markersize": 5.5, "markeredgewidth": 1.1}
        return {"color": self.colour, "markevery": (int(every * self.turn), every), **marks}


def window(curves, errors=False):
    """Limits for ``curves``, (scheme, values) each, that suit the schemes which behave.

    Euler-Maruyama and paths that leave the finite numbers may take as much room again on either side; what goes
    further is cut.  The room is that of the values, or with ``errors`` that of their changes, however small.
    """
    finite = [(scheme, values) for scheme, values in curves if np.isfinite(values).all()]
    good = [values for scheme, values in finite if scheme != "euler_maruyama"] or [values for _, values in finite]
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


def tamed(values, frame):
    """Values that matplotlib can draw: those far outside the frame are brought nearer."""
    far = 1000 * (frame[1] - frame[0])
    return np.clip(values, frame[0] - far, frame[1] + far)


def lowest(paths, component):
    """The smallest value of a component."""
    return min(np.nanmin(path.y[:, component], initial=np.inf) for path in paths)


def curve(ax, path, values, frame):
    """Draw ``values`` over time, and return notes on where they leave the frame."""
    ax.plot(path.t, tamed(values, frame), zorder=3, **path.look(len(values)))
    return departure(path, values, frame, ax)


def departure(path, values, frame, ax=None):
    """Notes, (handle, text) each, on where a path leaves the frame or the finite numbers.

    ``frame`` has a column per component of ``values`` if they are several.  The place is marked if ``ax`` is given, on
    which time is horizontal.
    """
    values, (low, high) = values.reshape(len(values), -1), frame
    outside = np.flatnonzero(((values < low) | (values > high)).any(axis=1))
    lost = np.flatnonzero(~np.isfinite(values).all(axis=1))
    text, marker = [], CARETUP
    if len(outside):
        first = outside[0]
        text.append(f"leaves the frame at $t={path.t[first]:.3g}$")
        up = (values[first] > high).any()
        marker = CARETUP if up else CARETDOWN
        if ax is not None:
            place = {"transform": ax.get_xaxis_transform(), "clip_on": False, "zorder": 4}
            ax.plot(path.t[first], 1.0 if up else 0.0, marker=marker, color=path.colour, **place)
    if len(lost):
        text.append(f"not finite from $t={path.t[lost[0]]:.3g}$")
    if not text:
        return []
    handle = Line2D([], [], marker=marker, color=path.colour, linestyle="none")
    return [(handle, f"{path.label} " + ",\n".join(text))]


def dress_time(ax, t, frame, label):
    """Axes on which time is horizontal."""
    ax.set(xlim=(t[0], t[-1] if len(t) > 1 else t[0] + 1), ylim=frame, xlabel="time $t$", ylabel=label)
    dress_axes(ax)


def dress_axes(ax):
    """A pale grid and few round ticks; tiny and huge numbers with one power of ten for all."""
    ax.grid(True, color="#e6e6e6", linewidth=0.6)
    ax.set_axisbelow(True)
    for axis in (ax.xaxis, ax.yaxis):
        formatter = ScalarFormatter(useOffset=False, useMathText=True)
        formatter.set_powerlimits((-3, 4))
        axis.set_major_formatter(formatter)
        axis.set_major_locator(MaxNLocator(5, steps=[1, 2, 2.5, 5, 10]))
