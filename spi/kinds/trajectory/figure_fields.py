"""Vorticity on the torus: fields side by side, spectra of their energy, and the film of all schemes."""

import math
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import matplotlib
import numpy as np

from spi.drawing import Figure, plots, style
from spi.drawing.film import Film
from spi.models.zeitlin.fields import energy_spectrum, vorticity

from .results import Trajectory

Readings = Sequence[Trajectory]

SIGNED, ONE_SIGN = "RdBu_r", "viridis"  #: colours of vorticity: blue negative, white 0, red positive; of one sign
TIMES = "viridis"  #: colours of spectra, from early to late

_CYCLE = 2 * np.pi
_ROUNDING = float(np.finfo(float).eps)  # of the largest energy: what is less is no longer seen in the energy
_SPARE = 1e-3  # of the smallest energy at the last time: how far down the spectra at earlier times are shown
_INERTIAL = -3.0  # the power of k with which the energy falls where enstrophy goes to small scales
_LEAST_SHELLS = 6  # for a line of this slope
_STEEP = 6.0  # a spectrum whose slope differs by more has no line of that slope beside it
_SEEN = 0.01  # by which a field must exceed the range of the colours so that the colour bar shows it

# ---------------------------------------------------------------------------------------------------------------------
# Fields.
# ---------------------------------------------------------------------------------------------------------------------


class Colours(NamedTuple):
    """The colours of some fields."""

    low: float
    high: float
    beyond: Any  #: the sides on which fields go beyond, in matplotlib's words

    @property
    def look(self) -> dict[str, Any]:
        """The options of matplotlib's ``imshow``; fields of one sign have sequential colours."""
        return {"cmap": SIGNED if self.low < 0 < self.high else ONE_SIGN, "vmin": self.low, "vmax": self.high}


def need_lattice(readings: Readings, panel: str) -> None:
    """Raise ValueError if the states are no vorticity."""
    if readings[0].lattice is None:
        raise ValueError(f"the panel '{panel}' needs a vorticity on the torus, as of sine_euler and zeitlin")


def field_values(reading: Trajectory, states: Sequence[int]) -> np.ndarray:
    """(states, G, G) the fields of some states, on a grid that is finer than the smallest waves."""
    n = reading.lattice or 3
    with np.errstate(all="ignore"):
        return vorticity(reading.y[list(states)], max(128, 1 << (4 * n - 1).bit_length()))


def colours_of(readings: Readings, ends: Sequence[tuple[float, float]]) -> Colours:
    """The colours for fields with these least and largest values.

    They suit the schemes that preserve something, if there are any, and the others may go beyond them.
    """
    good = [pair for reading, pair in zip(readings, ends, strict=True) if not reading.preserves_nothing] or ends
    low, high = min(pair[0] for pair in good), max(pair[1] for pair in good)
    largest = max(-low, high) or 1.0
    beyond = max(max(-pair[0], pair[1]) for pair in ends) > (1 + _SEEN) * largest
    if low < 0 < high or low == high:
        low, high = -largest, largest
    else:
        low, high = (0.0, largest) if high > 0 else (-largest, 0.0)
    return Colours(low, high, "both" if beyond else "neither")


def _ends(values: np.ndarray) -> tuple[float, float]:
    finite = values[np.isfinite(values)]
    return float(finite.min(initial=0.0)), float(finite.max(initial=0.0))


def vorticities(readings: Readings, looks: style.Looks) -> Iterator[list[plots.Plot]]:
    """The fields at the chosen times, a row of panels for each scheme."""
    need_lattice(readings, "vorticity")
    shown = [field_values(one, one.shown) for one in readings]
    colours = colours_of(readings, [_ends(values) for values in shown])
    for one, values in zip(readings, shown, strict=True):
        row = []
        for i, (field, t) in enumerate(zip(values, one.t[one.shown].tolist(), strict=True)):
            title = ", ".join([style.label(one.about)] * (i == 0) + [f"$t={style.number(t)}$"])
            own = _field(field, colours, last=i == len(values) - 1)
            row.append(plots.Plot(title=title, x="$x_1$", y="$x_2$", own=own, aspect=0.95, shared=i > 0))
        yield row


def _field(field: np.ndarray, colours: Colours, last: bool) -> plots.Draw:
    def own(ax: plots.Axes) -> list[plots.Entry]:
        image = draw_field(ax, field, colours)
        if last:
            place = ax.inset_axes((1.04, 0, 0.05, 1))
            ax.figure.colorbar(image, cax=place, label=r"vorticity $\omega$", extend=colours.beyond)
        return []

    return own


def draw_field(ax: plots.Axes, field: np.ndarray, colours: Colours) -> Any:
    """Draw the vorticity (G, G) on the torus, x_1 to the right and x_2 up; returns the image."""
    look: dict[str, Any] = {"interpolation": "bilinear", "origin": "lower", "aspect": "equal"} | colours.look
    image = ax.imshow(field.T, extent=(0, _CYCLE, 0, _CYCLE), **look)
    if not np.isfinite(field).all():
        ax.text(0.5, 0.5, "not finite", transform=ax.transAxes, ha="center", va="center", color=plots.GREY)
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_ticks([0, np.pi, _CYCLE], ["0", r"$\pi$", r"$2\pi$"])
    return image


# ---------------------------------------------------------------------------------------------------------------------
# Spectra.
# ---------------------------------------------------------------------------------------------------------------------


def spectra(readings: Readings, looks: style.Looks) -> Iterator[plots.Plot]:
    """The energy of the shells at the chosen times, a panel for each scheme."""
    need_lattice(readings, "spectrum")
    limits = spectrum_limits(readings)
    for k, one in enumerate(readings):
        energies, chosen = spectra_of(one), one.shown
        shells = np.arange(1, energies.shape[1] + 1)
        lines = []
        for values, i, colour in zip(
            energies, chosen, matplotlib.colormaps[TIMES](np.linspace(0, 0.88, len(chosen))), strict=True
        ):
            lost = "" if np.isfinite(values).all() else ", not finite"
            look = {"color": matplotlib.colors.to_hex(colour), "marker": "o", "markersize": 3.0}
            drawn = np.where(np.isfinite(values) & (values > 0), values, np.nan)
            lines.append(plots.series(shells, drawn, look, f"$t={style.number(float(one.t[i]))}${lost}"))
        if len(slope := _slope(energies[-1], limits)):
            look = {"color": plots.GREY, "linestyle": "--", "linewidth": 1.0}
            lines.append(plots.series(shells[-len(slope) :], slope, look, f"$k^{{{_INERTIAL:g}}}$"))
        seen = shells[(np.nan_to_num(energies) > limits[0]).any(axis=0)].max(initial=1)
        title, ends = style.label(one.about), (0.9, max(2.2, 1.1 * float(seen)))
        yield plots.Plot(lines, title, "wave number $k$", "energy $E(k)$", "log", True, ends, limits, shared=k > 0)


def _slope(energies: np.ndarray, limits: tuple[float, float]) -> np.ndarray:
    """Values with the slope of the inertial range above the end of a spectrum; none where it is too short."""
    k = np.arange(1, len(energies) + 1)
    chosen = np.isfinite(energies) & (energies > limits[0]) & (k > math.sqrt(len(k)))
    if len(k) < _LEAST_SHELLS or chosen.sum() < 2:
        return np.zeros(0)
    steepness = np.polyfit(np.log(k[chosen]), np.log(energies[chosen]), 1)[0]
    if abs(steepness - _INERTIAL) > _STEEP:
        return np.zeros(0)
    height = 1.5 * (energies[chosen] * k[chosen] ** -_INERTIAL).max()
    return np.asarray(height * k[k > math.sqrt(len(k))] ** _INERTIAL)


def spectra_of(reading: Trajectory) -> np.ndarray:
    """(times, shells) the energy of each shell at the chosen times."""
    with np.errstate(all="ignore"):
        return energy_spectrum(reading.y[reading.shown])


def spectrum_limits(readings: Readings) -> tuple[float, float]:
    """The limits of energies in spectra, which suit the schemes that preserve something, if there are any.

    They end where rounding errors begin, and not far below the energies at the last time.
    """
    good = [reading for reading in readings if not reading.preserves_nothing] or readings
    each = [spectra_of(reading) for reading in good]
    values = _positive(np.concatenate([energies.ravel() for energies in each]))
    if not values.size:
        return 0.1, 10.0
    largest, last = float(values.max()), _positive(np.concatenate([energies[-1] for energies in each]))
    deepest = _SPARE * float(last[last > _ROUNDING * largest].min(initial=largest))
    return max(float(values.min()), _ROUNDING * largest, deepest) / 3, 3 * largest


def _positive(energies: np.ndarray) -> np.ndarray:
    """The energies that a logarithmic axis can show."""
    return energies[np.isfinite(energies) & (energies > 0)]


# ---------------------------------------------------------------------------------------------------------------------
# The film.
# ---------------------------------------------------------------------------------------------------------------------

MOST_FRAMES = 200
LARGE, SMALL = 3.0, 2.0  # inches of a field, where they are few and where they are many
_FEW = 4

Screen = tuple[plots.Axes, Any, Trajectory, list[int]]  #: axes and image of a path, and the states that are shown


def film(title: str, cases: Sequence[Readings]) -> Film:
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


def _screens(fig: Figure, readings: Readings, axes: np.ndarray) -> list[Screen]:
    """The fields of one case at the start, in colours that suit all of its frames."""
    states = [plots.spread(len(reading.t), MOST_FRAMES) for reading in readings]
    colours = colours_of(readings, [_extremes(one, chosen) for one, chosen in zip(readings, states, strict=True)])
    screens = []
    for ax, reading, chosen in zip(axes, readings, states, strict=False):
        image = draw_field(ax, field_values(reading, [0])[0], colours)
        screens.append((ax, image, reading, chosen))
    look: dict[str, Any] = {"extend": colours.beyond, "shrink": 0.9, "aspect": 22, "pad": 0.02}
    fig.colorbar(image, ax=list(axes[: len(readings)]), label=r"vorticity $\omega$", **look)
    return screens


def _extremes(reading: Trajectory, states: Sequence[int]) -> tuple[float, float]:
    """The least and the largest vorticity in some states, one after the other to spare memory."""
    return _ends(np.array([_ends(field_values(reading, [state])) for state in states]))


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
