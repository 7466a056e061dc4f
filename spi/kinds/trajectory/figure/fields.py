"""Vorticity on the torus: fields side by side, spectra of their energy, and the film of all schemes."""

import math
import re
from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.gridspec import GridSpecBase
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.markers import CARETDOWN, CARETUP
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter, ScalarFormatter

from spi.drawing import page, style
from spi.drawing.axes import rules
from spi.drawing.film import Film
from spi.drawing.layout import Entry, spread
from spi.models.zeitlin.fields import energy_spectrum, vorticity

from ..results import Trajectory, diverged, losses

# ---------------------------------------------------------------------------------------------------------------------
# Curves of paths in a frame that suits those which stay bounded.
# ---------------------------------------------------------------------------------------------------------------------

Bound = float | np.ndarray
Frame = tuple[Bound, Bound]  #: the lowest and the highest value, or those of each column

MARKERS = 14  # along a curve


class Path(NamedTuple):
    """A trajectory with its look in a figure."""

    reading: Trajectory
    label: str
    marker: str
    colour: str
    turn: float  #: where between two markers of the first scheme this one's stand, from 0 to 1

    def look(self, points: int) -> dict[str, Any]:
        """The look of a curve of `points` points: a few markers, whose places differ from scheme to scheme."""
        every = max(1, points // MARKERS)
        marks = {"marker": self.marker, "markerfacecolor": "none", "markersize": 5.5, "markeredgewidth": 1.1}
        return {"color": self.colour, "markevery": (int(every * self.turn), every), **marks}


def window(curves: list[tuple[Trajectory, np.ndarray]], errors: bool = False) -> tuple[float, float]:
    """Limits for ``curves``, (reading, values) each, that suit the schemes which preserve something.

    Schemes that preserve nothing and diverging paths may take as much room again on either side;
    values beyond are cut.  The room is that of the values, or with ``errors`` that of their changes, however small.
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
    clipped = np.clip(everything, low - room, high + room)
    low, high = min(low, clipped.min(initial=low)), max(high, clipped.max(initial=high))
    least = tiny if errors else 0.1 * max(abs(low), abs(high)) or tiny
    spare = max(0.06 * (high - low), (least - (high - low)) / 2)
    return float(low - spare), float(high + spare)


def tamed(values: np.ndarray, frame: Frame) -> np.ndarray:
    """Values (t,) or (t, component) as they are drawn: nan where one is not finite, so that a curve has a gap there.

    A curve far outside the frame is drawn on its way out and on its way in, at a distance that can be drawn.
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
        texts = [str(losses(path.reading, values) or ""), diverged(path.reading)]
        shown = [re.sub(r"t = (.*)", r"$t=\1$", text) for text in texts if text]
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


COLOURS = "RdBu_r"  #: of vorticity: blue negative, white 0, red positive
TIMES = "viridis"  #: of spectra, from early to late

#: Inches of a field, by the number of fields side by side; more are smaller.
SIDES = {1: 3.2, 2: 2.9, 3: 2.6, 4: 2.3}
SMALLEST, LARGEST = 1.9, 3.8
LEAST = 1.6  # inches of a field and its margins in a paper
MARGIN = 1.6  # inches beside the fields of a row: labels, numbers, the colour bar
AROUND, BETWEEN = 0.75, 0.1  # inches above and below all fields of a case, and between two of them

_CYCLE = 2 * np.pi
_ROUNDING = float(np.finfo(float).eps)  # of the largest energy: what is less is no longer seen in the energy
_SPARE = 1e-3  # of the smallest energy at the last time: how far down the spectra at earlier times are shown
_INERTIAL = -3  # the power of k with which the energy falls where enstrophy goes to small scales
_LEAST_SHELLS = 6  # for a line of this slope
_SEEN = 0.01  # by which a field must exceed the range of the colours so that the colour bar shows it


class Fields(NamedTuple):
    """The fields of one case: a row per scheme, a column per time."""

    paths: Sequence[Path]

    @property
    def columns(self) -> int:
        """The number of fields side by side."""
        return page.current().panels(self.times, (LARGEST, LARGEST), LEAST)[0]

    @property
    def times(self) -> int:
        """The number of fields of one scheme."""
        return max(len(path.reading.shown) for path in self.paths)

    @property
    def lines(self) -> int:
        """The number of lines that all fields take."""
        return len(self.paths) * math.ceil(self.times / self.columns)

    @property
    def least(self) -> float:
        """Inches of the side of a field, at least."""
        return SIDES.get(self.columns, SMALLEST)

    @property
    def width(self) -> float:
        """Inches that all columns need."""
        return MARGIN + self.columns * self.least

    def height(self, width: float) -> float:
        """Inches of one line of fields in a figure of some width."""
        return AROUND / self.lines + BETWEEN + min(LARGEST, (width - MARGIN) / self.columns)

    def draw(self, fig: Figure, place: GridSpecBase) -> Axes:
        """Draw all fields in a grid of so many lines and columns, with one colour bar; returns the first axes."""
        shown = [field_values(path.reading, path.reading.shown) for path in self.paths]
        largest, beyond = colour_range([path.reading for path in self.paths], shown)
        axes = place.subplots(squeeze=False)
        each = axes.reshape(len(self.paths), -1)
        for path, fields, row in zip(self.paths, shown, each, strict=True):
            for ax, field in zip(row, fields, strict=False):
                image = draw_field(ax, field, largest)
            for ax in row[len(fields) :]:
                ax.set_axis_off()
            label = "\n".join(style.wrapped(path.label.split(), " ", "axes.labelsize", self.least))
            row[0].set_ylabel(f"{label}\n$x_2$")
        titled = each if len(axes) > len(each) else each[:1]  # once for all schemes if their fields stand in columns
        for row in titled:
            for ax, t in zip(row, self.paths[0].reading.t[self.paths[0].reading.shown].tolist(), strict=False):
                ax.set_title(f"$t={style.number(t)}$")
        for ax in axes[:, 1:].flat:
            ax.tick_params(labelleft=False)
        for ax in axes[:-1].flat:
            ax.tick_params(labelbottom=False)
        for ax in axes[-1]:
            ax.set_xlabel("$x_1$")
        if page.current().width is None:
            where: dict[str, Any] = {"ax": axes, "shrink": 0.9, "aspect": 22, "pad": 0.015}
        else:  # as high as a field, which need not be as high as its place
            where = {"cax": axes[0, -1].inset_axes((1.08, 0, 0.07, 1))}
        fig.colorbar(image, label=r"vorticity $\omega$", extend=beyond, **where)
        return axes[0, 0]


def need_lattice(paths: Sequence[Path], panel: str) -> int:
    """N of the lattice of paths; ValueError if their states are no vorticity."""
    n = paths[0].reading.lattice
    if n is None:
        raise ValueError(f"the panel '{panel}' needs a vorticity on the torus, as of sine_euler and zeitlin")
    return n


def field_values(reading: Trajectory, states: Sequence[int]) -> np.ndarray:
    """(states, G, G) the fields of some states, on a grid that is finer than the smallest waves."""
    n = reading.lattice or 3
    with np.errstate(all="ignore"):
        return vorticity(reading.y[list(states)], max(128, 1 << (4 * n - 1).bit_length()))


def colour_range(readings: Sequence[Trajectory], fields: Sequence[np.ndarray]) -> tuple[float, Any]:
    """The largest value of the colours, and the sides on which fields go beyond it, in matplotlib's words.

    It suits the schemes that preserve something, if there are any, and the others may leave it.
    """
    sizes = [np.abs(values[np.isfinite(values)]).max(initial=0.0) for values in fields]
    good = [size for reading, size in zip(readings, sizes, strict=True) if not reading.preserves_nothing]
    largest = float(max(good or sizes)) or 1.0
    return largest, "both" if max(sizes) > (1 + _SEEN) * largest else "neither"


def draw_field(ax: Axes, field: np.ndarray, largest: float) -> AxesImage:
    """The vorticity (G, G) on the torus, x_1 to the right and x_2 up."""
    look: dict[str, Any] = {"cmap": COLOURS, "vmin": -largest, "vmax": largest, "interpolation": "bilinear"}
    image = ax.imshow(field.T, origin="lower", extent=(0, _CYCLE, 0, _CYCLE), aspect="equal", **look)
    if not np.isfinite(field).all():
        ax.text(0.5, 0.5, "not finite", transform=ax.transAxes, ha="center", va="center", color="#777777")
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_ticks([0, np.pi, _CYCLE], ["0", r"$\pi$", r"$2\pi$"])
    return image


def draw_spectrum(path: Path, limits: tuple[float, float], ax: Axes) -> list[Entry]:
    """Draw the energy by shell at the chosen times; returns the entries of the legend."""
    chosen = path.reading.shown
    spectra = spectra_of(path.reading)
    k = np.arange(1, spectra.shape[1] + 1)
    entries: list[Entry] = []
    for energies, number, colour in zip(
        spectra, chosen, matplotlib.colormaps[TIMES](np.linspace(0, 0.88, len(chosen))), strict=True
    ):
        there = np.isfinite(energies) & (energies > 0)
        (line,) = ax.plot(k[there], energies[there], "o-", markersize=3, color=colour)
        lost = "" if np.isfinite(energies).all() else ", not finite"
        entries.append((Line2D([], [], **_look(line)), f"$t={style.number(float(path.reading.t[number]))}${lost}"))
    entries += _slope(ax, spectra[-1], limits)
    seen = k[(np.nan_to_num(spectra) > limits[0]).any(axis=0)].max(initial=1)
    ax.set(xscale="log", yscale="log", xlim=(0.9, max(2.2, 1.1 * seen)), ylim=limits)
    ax.set(xlabel="wave number $k$", ylabel="energy $E(k)$")
    ax.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    ax.xaxis.set_major_formatter(lambda x, _: f"{x:g}")
    ax.xaxis.set_minor_formatter(NullFormatter())
    rules(ax)
    return entries


def _slope(ax: Axes, energies: np.ndarray, limits: tuple[float, float]) -> list[Entry]:
    """A line with the slope of the inertial range above a spectrum, towards its end; returns its legend."""
    k = np.arange(1, len(energies) + 1)
    chosen = np.isfinite(energies) & (energies > limits[0]) & (k > math.sqrt(len(k)))
    if len(k) < _LEAST_SHELLS or not chosen.any():
        return []
    height = 3 * (energies[chosen] * k[chosen] ** -float(_INERTIAL)).max()
    (line,) = ax.plot(k[chosen], height * k[chosen] ** float(_INERTIAL), color="#777777", dashes=(4, 2), linewidth=1)
    return [(Line2D([], [], color=line.get_color(), dashes=(4, 2), linewidth=1), f"$k^{{{_INERTIAL}}}$")]


def _look(line: Line2D) -> dict[str, Any]:
    return {"color": line.get_color(), "marker": line.get_marker(), "markersize": line.get_markersize()}


def spectra_of(reading: Trajectory) -> np.ndarray:
    """(times, shells) the energy of each shell at the chosen times."""
    with np.errstate(all="ignore"):
        return energy_spectrum(reading.y[reading.shown])


def spectrum_limits(readings: Sequence[Trajectory]) -> tuple[float, float]:
    """The limits of energies in spectra, which suit the schemes that preserve something, if there are any.

    They end where rounding errors begin, and not far below the energies at the last time.
    """
    good = [reading for reading in readings if not reading.preserves_nothing] or readings
    spectra = [spectra_of(reading) for reading in good]
    values = _positive(np.concatenate([energies.ravel() for energies in spectra]))
    if not values.size:
        return 0.1, 10.0
    largest, last = float(values.max()), _positive(np.concatenate([energies[-1] for energies in spectra]))
    deepest = _SPARE * float(last[last > _ROUNDING * largest].min(initial=largest))
    return max(float(values.min()), _ROUNDING * largest, deepest) / 3, 3 * largest


def _positive(energies: np.ndarray) -> np.ndarray:
    """The energies that a logarithmic axis can show."""
    return energies[np.isfinite(energies) & (energies > 0)]


MOST_FRAMES = 200
LARGE, SMALL = 3.0, 2.0  # inches of a field, where they are few and where they are many
_FEW = 4

Screen = tuple[Axes, AxesImage, Trajectory, list[int]]  #: axes and image of a path, and the states that are shown


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
    screens = []
    for ax, reading, chosen in zip(axes, readings, states, strict=False):
        image = draw_field(ax, field_values(reading, [0])[0], largest)
        screens.append((ax, image, reading, chosen))
    shown = list(axes[: len(readings)])
    fig.colorbar(image, ax=shown, label=r"vorticity $\omega$", extend=beyond, shrink=0.9, aspect=22, pad=0.02)
    return screens


def _largest(reading: Trajectory, states: Sequence[int]) -> np.ndarray:
    """The largest modulus of the vorticity in each of some states, one after the other to spare memory."""
    return np.array([np.abs(field_values(reading, [state])).max() for state in states])


def _show(screens: Sequence[Screen], frames: int, frame: int) -> None:
    """Show frame number `frame`; a path with fewer states stays longer at each."""
    for ax, image, reading, states in screens:
        state = states[frame * len(states) // frames]
        field = field_values(reading, [state])[0]
        image.set_data(field.T)
        between = float(reading.t[states[1]]) if len(states) > 1 else 1.0
        digits = max(0, 1 - math.floor(math.log10(between)))
        lost = "" if np.isfinite(field).all() else ", not finite"
        ax.set_title(f"{style.label(reading.about)}, $t={reading.t[state]:.{digits}f}${lost}")
