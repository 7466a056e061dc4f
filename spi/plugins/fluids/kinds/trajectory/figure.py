"""Vorticity in the figure and in the film of trajectories: fields, spectra, and the enstrophy over time."""

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import matplotlib
import numpy as np

from spi.drawing import Figure, panels, plots, style
from spi.kinds.trajectory.figure import TrajectoryReadings, times_shown, window
from spi.kinds.trajectory.film import Filmed, Screen, states_shown
from spi.kinds.trajectory.results import Trajectory
from spi.plugins.fluids.kinds.trajectory.numbers import part_of, places_of, spectra_of
from spi.plugins.fluids.models.fields import enstrophy, seen_energies, size_of, vorticity

SIGNED, ONE_SIGN = "RdBu_r", "viridis"  #: colours of vorticity: blue negative, white 0, red positive; of one sign

_CYCLE = 2 * np.pi
_INERTIAL = -3.0  # the power of k with which the energy falls where enstrophy goes to small scales
_LEAST_SHELLS = 6  # for a line of this slope
_STEEP = 6.0  # a spectrum whose slope differs by more has no line of that slope beside it
_FEW = 24  # particles that are drawn with their paths
_SEEN = 0.01  # by which a field must exceed the range of the colours so that the colour bar shows it

# ---------------------------------------------------------------------------------------------------------------------
# Fields.
# ---------------------------------------------------------------------------------------------------------------------


class Colours(NamedTuple):
    """Colours of some fields."""

    low: float
    high: float
    beyond: Any  #: the sides on which fields go beyond, in matplotlib's words

    @property
    def look(self) -> dict[str, Any]:
        """Options of matplotlib's ``imshow``; fields of one sign have sequential colours."""
        return {"cmap": SIGNED if self.low < 0 < self.high else ONE_SIGN, "vmin": self.low, "vmax": self.high}


def need_lattice(readings: TrajectoryReadings, panel: str) -> None:
    """Raise ValueError if the states are no vorticity."""
    if readings[0].place.get("on") != "torus":
        raise ValueError(f"the panel '{panel}' needs a vorticity on the torus, as of sine_euler and zeitlin")


def field_values(reading: Trajectory, states: Sequence[int], part: int = 0) -> np.ndarray:
    """(states, G, G) the fields of some states, on a grid that is finer than the smallest waves."""
    y = part_of(reading, part)
    with np.errstate(all="ignore"):
        return vorticity(y[list(states)], max(128, 1 << (4 * size_of(y) - 1).bit_length()))


def colours_of(readings: TrajectoryReadings, ends: Sequence[tuple[float, float]]) -> Colours:
    """Colours for fields with these least and largest values.

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


def vorticities(readings: TrajectoryReadings, looks: style.Looks) -> Iterator[list[plots.Plot]]:
    """Fields at the chosen times, a row of panels for each scheme."""
    need_lattice(readings, "vorticity")
    yield from _rows(readings, 0, r"vorticity $\omega$")


def tracers(readings: TrajectoryReadings, looks: style.Looks) -> Iterator[list[plots.Plot]]:
    """Tracers at the chosen times, each with a row of panels for each scheme."""
    for j in range(1, 1 + readings[0].place.get("tracers", 0)):
        yield from _rows(readings, j, rf"tracer $\theta_{j}$")


def particles(readings: TrajectoryReadings, looks: style.Looks) -> Iterator[list[plots.Plot]]:
    """Particles on the vorticity at the chosen times, a row of panels for each scheme; few have their paths behind."""
    yield from _rows(readings, 0, r"vorticity $\omega$", draw_particles)


def _rows(
    readings: TrajectoryReadings,
    part: int,
    label: str,
    over: Callable[[Trajectory, int, plots.Axes], None] | None = None,
) -> Iterator[list[plots.Plot]]:
    """A row of panels for each scheme, of one part of states, with what `over` draws over a state by its number."""
    shown = [field_values(one, one.shown, part) for one in readings]
    colours = colours_of(readings, [_ends(values) for values in shown])
    for one, values in zip(readings, shown, strict=True):
        row = []
        for i, (field, state) in enumerate(zip(values, one.shown, strict=True)):
            t = float(one.t[state])
            title = ", ".join([style.label(one.about)] * (i == 0) + [f"$t={style.number(t)}$"])
            own = _field(field, colours, label if i == len(values) - 1 else "", over and partial(over, one, state))
            row.append(plots.Plot(title=title, x="$x_1$", y="$x_2$", own=own, aspect=0.95, shared=i > 0))
        yield row


def draw_particles(one: Trajectory, state: int, ax: plots.Axes) -> None:
    """Draw particles at a stored state, few of them with their paths until then, all on the torus."""
    x = places_of(one)[: state + 1]
    size = 6.0 if x.shape[2] <= _FEW else 1.5
    if x.shape[2] <= _FEW:
        turns, paths = np.floor(x / _CYCLE), x % _CYCLE
        paths[1:][np.repeat((turns[1:] != turns[:-1]).any(axis=1, keepdims=True), 2, axis=1)] = np.nan  # it leaves
        ax.plot(paths[:, 0], paths[:, 1], color="black", linewidth=0.6, alpha=0.7)
    ax.scatter(x[-1, 0] % _CYCLE, x[-1, 1] % _CYCLE, size, color="black", linewidths=0, zorder=3)
    ax.set(xlim=(0, _CYCLE), ylim=(0, _CYCLE))


def _field(
    field: np.ndarray, colours: Colours, label: str, over: Callable[[plots.Axes], None] | None = None
) -> plots.Draw:
    def own(ax: plots.Axes) -> list[plots.LegendEntry]:
        image = draw_field(ax, field, colours)
        if over:
            over(ax)
        if label:
            place = ax.inset_axes((1.04, 0, 0.05, 1))
            ax.figure.colorbar(image, cax=place, label=label, extend=colours.beyond)
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


def spectra(readings: TrajectoryReadings, looks: style.Looks) -> Iterator[plots.Plot]:
    """Energy of the shells at the chosen times, a panel for each scheme."""
    need_lattice(readings, "spectrum")
    limits = spectrum_limits(readings)
    for k, one in enumerate(readings):
        energies, chosen = spectra_of(one), one.shown
        shells = np.arange(1, energies.shape[1] + 1)
        lines = []
        for values, i, colour in zip(energies, chosen, style.shades(len(chosen)), strict=True):
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


def spectrum_limits(readings: TrajectoryReadings) -> tuple[float, float]:
    """Limits of energies in spectra, which suit the schemes that preserve something, if there are any."""
    good = [reading for reading in readings if not reading.preserves_nothing] or readings
    return seen_energies([spectra_of(reading) for reading in good])


# ---------------------------------------------------------------------------------------------------------------------
# The enstrophy.
# ---------------------------------------------------------------------------------------------------------------------


def enstrophy_change(reading: Trajectory) -> np.ndarray:
    """(times,) Z(t)/Z(0) - 1, Z(t) where Z(0) = 0."""
    with np.errstate(all="ignore"):
        values = enstrophy(part_of(reading))
    return values / values[0] - 1 if values[0] else values


def enstrophies(readings: TrajectoryReadings, looks: style.Looks) -> Iterator[plots.Plot]:
    """Change of the enstrophy of each path."""
    need_lattice(readings, "enstrophy")
    curves = [(one, enstrophy_change(one)) for one in readings]
    curves = [(one, values) for one, values in curves if np.isfinite(values).any()]
    if not curves:
        return
    alone: dict[str, Any] = {"marker": ""} if len(curves) == 1 else {}
    lines = [
        plots.series(one.t, values, panels.scheme_look(one, looks, **alone), style.label(one.about))
        for one, values in curves
    ]
    first = float(enstrophy(part_of(curves[0][0])[0]))
    yield plots.Plot(
        lines,
        f"$Z(0)={style.number(first)}$",
        style.AXES["t"],
        "enstrophy  $Z(t)/Z(0)-1$" if first else "enstrophy  $Z(t)$",
        xlim=times_shown(readings),
        ylim=window(curves, True),
    )


# ---------------------------------------------------------------------------------------------------------------------
# The film.
# ---------------------------------------------------------------------------------------------------------------------


def _screens(fig: Figure, readings: TrajectoryReadings, axes: np.ndarray) -> list[Screen]:
    """Fields of one case at the start, in colours that suit all of its frames."""
    states = states_shown(readings)
    colours = colours_of(readings, [_extremes(one, chosen) for one, chosen in zip(readings, states, strict=True)])
    images = [draw_field(ax, field_values(one, [0])[0], colours) for ax, one in zip(axes, readings, strict=False)]
    shows = [partial(_refill, image, one) for image, one in zip(images, readings, strict=True)]
    look: dict[str, Any] = {"extend": colours.beyond, "shrink": 0.9, "aspect": 22, "pad": 0.02}
    fig.colorbar(images[-1], ax=list(axes[: len(readings)]), label=r"vorticity $\omega$", **look)
    return list(zip(axes, shows, readings, states, strict=False))


def _refill(image: Any, one: Trajectory, state: int) -> None:
    image.set_data(field_values(one, [state])[0].T)


def _extremes(reading: Trajectory, states: Sequence[int]) -> tuple[float, float]:
    """Least and the largest vorticity in some states, one after the other to spare memory."""
    return _ends(np.array([_ends(field_values(reading, [state])) for state in states]))


FILM = Filmed(_screens, names=("$x_1$", "$x_2$"))
VORTICITY = [panels.OwnPanels(vorticities)]
TRACER = [panels.OwnPanels(tracers)]
PARTICLES = [panels.OwnPanels(particles)]
SPECTRUM = [panels.OwnPanels(spectra)]
ENSTROPHY = [panels.OwnPanels(enstrophies)]
