"""The figure of trajectories: quantities over time, the phase plane, the sphere, vorticity on the torus, and a film."""

import json
import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib.patches import Patch
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

from spi.drawing import Figure, page, panels, plots, style
from spi.drawing.film import Film
from spi.models.zeitlin.fields import energy_spectrum, vorticity

from .results import Trajectory

Readings = Sequence[Trajectory]

OUTSIDE, ZERO = "#f6e6e1", "#555555"  #: negative populations, and the line where they begin

#: Colours and lines of the components of one path.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999999")
LINES = ("-", (0, (5, 1.5)), (0, (1, 1)), (0, (5, 1, 1, 1)))

GLASS, NET = "#eef2f6", "#9aa5b1"
ELEVATION = 22  # degrees, of the eye
START: dict[str, Any] = {"marker": "*", "color": "black", "markersize": 9, "linestyle": "none"}

# ---------------------------------------------------------------------------------------------------------------------
# Quantities over time.
# ---------------------------------------------------------------------------------------------------------------------


def window(curves: Sequence[tuple[Trajectory, np.ndarray]], errors: bool = False) -> tuple[float, float]:
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


def _times(readings: Readings) -> tuple[float, float]:
    """The limits of the axis of time."""
    t = readings[0].t
    return float(t[0]), float(t[-1] if len(t) > 1 else t[0] + 1)


def _over_time(field: str, label: str, facet: str = "", errors: bool = False, further: Any = None) -> panels.CurvePanel:
    """A quantity of each path over time; `further` changes its panels."""

    def framed(plot: plots.Plot, readings: Readings, place: int) -> plots.Plot:
        curves = [(one, line.y) for one, line in zip(readings, plot.series, strict=True)]
        plot = plot._replace(xlim=_times(readings), ylim=window(curves, errors))
        return further(plot, readings, place) if further else plot

    return panels.CurvePanel(field, "t", facet, label=label, then=framed)


def _but_for_damping(plot: plots.Plot, readings: Readings, place: int) -> plots.Plot:
    return plot._replace(y=rf"$e^{{k\gamma t}}${plot.y}") if "damping" in readings[0].about.parameters else plot


def _enstrophy(plot: plots.Plot, readings: Readings, place: int) -> plots.Plot:
    first = float(readings[0].enstrophy[0])
    return plot._replace(title=f"$Z(0)={style.number(first)}$", y=plot.y if first else "enstrophy  $Z(t)$")


def _populated(plot: plots.Plot, readings: Readings, place: int) -> plots.Plot:
    negative = _lowest(readings, place) < 0
    return plot._replace(own=(lambda ax: _below_zero(ax, "y", True)) if negative else None)


def _components(readings: Readings, looks: style.Looks) -> Iterator[plots.Plot]:
    """All components over time, a panel for each scheme."""
    names, pairs = _names(readings), readings[0].about.model in style.COMPLEX
    frame = window([(one, one.y) for one in readings])
    for k, one in enumerate(readings):
        lines = []
        for i, name in enumerate(names):
            colour, line = divmod(i, 2) if pairs else (i, i % len(LINES))  # a colour per mode, or per component
            look = {"color": COLOURS[colour % len(COLOURS)], "linestyle": LINES[line]}
            lines.append(plots.series(one.t, one.y[:, i], look, name if i < len(COLOURS) else ""))
        axes: dict[str, Any] = {"xlim": _times(readings), "ylim": frame, "shared": k > 0}
        yield plots.Plot(lines, style.label(one.about), style.AXES["t"], "components", **axes)


def _names(readings: Readings) -> list[str]:
    return style.component_names(readings[0].about, readings[0].y.shape[1])


# ---------------------------------------------------------------------------------------------------------------------
# Populations and the phase plane.
# ---------------------------------------------------------------------------------------------------------------------


def _lowest(readings: Readings, component: int) -> float:
    return min(one.lowest[component] for one in readings)


def _below_zero(ax: plots.Axes, across: Sequence[str], shaded: bool) -> list[plots.Entry]:
    """Mark where a component is below zero: shaded, or by a line only; `across` names its axes, "x" or "y"."""
    for axis in across:
        low = (ax.get_xlim() if axis == "x" else ax.get_ylim())[0]
        (ax.axvline if axis == "x" else ax.axhline)(0, color=ZERO, linewidth=0.7, zorder=1)
        if shaded and low < 0:
            (ax.axvspan if axis == "x" else ax.axhspan)(low, 0, color=OUTSIDE, linewidth=0, zorder=0)
    return [(Patch(color=OUTSIDE), "negative population")] if shaded and across else []


def _phase(readings: Readings, looks: style.Looks) -> Iterator[plots.Plot]:
    """The plane of the first two components, all schemes."""
    names = _names(readings)
    if len(names) < 2:
        raise ValueError("the panel 'phase' needs two components")
    shaded = "populations" in readings[0].panels
    frames = [window([(one, one.y[:, i]) for one in readings]) for i in (0, 1)]
    below = "".join(axis for i, axis in enumerate("xy") if _lowest(readings, i) < 0)
    lines = [
        plots.Series(one.y[:, 0], one.y[:, 1], panels.scheme_look(one, looks), style.label(one.about))
        for one in readings
    ]

    def own(ax: plots.Axes) -> list[plots.Entry]:
        ax.plot(*readings[0].y[0, :2], zorder=5, **START)
        return [(plots.Line2D([], [], **START), "start"), *_below_zero(ax, below, shaded)]

    yield plots.Plot(lines, x=names[0], y=names[1], xlim=frames[0], ylim=frames[1], own=own)


# ---------------------------------------------------------------------------------------------------------------------
# A path on the sphere through its first point.
# ---------------------------------------------------------------------------------------------------------------------


def _sphere(readings: Readings, looks: style.Looks) -> Iterator[plots.Plot]:
    """The first path whose scheme preserves the sphere, or the first of all."""
    one = next((one for one in readings if one.preserves_casimirs), readings[0])
    if one.y.shape[1] != 3:
        raise ValueError("the panel 'sphere' needs three components")
    title = f"{style.label(one.about)} on $|y|=|y_0|$"
    yield plots.Plot(
        title=title, own=_on_sphere(one.y, _names([one]), looks[one.about.variant][1]), projection="3d", aspect=0.9
    )


def _on_sphere(y: np.ndarray, names: Sequence[str], colour: str) -> Callable[[Any], list[plots.Entry]]:
    """A function that draws the path ``y``, (n, 3), on 3-D axes."""

    def own(ax: Any) -> list[plots.Entry]:
        radius = float(np.linalg.norm(y[0])) or 1.0
        near = (np.abs(y) < 1.5 * radius).all(axis=1)  # false also where a path is not finite
        azimuth = _azimuth(y[0], y[near])
        ax.view_init(ELEVATION, azimuth)
        ax.set_proj_type("ortho")  # so that the outline of the sphere is a circle
        ax.computed_zorder = False
        on_screen = page.current().width is None
        ax.set_box_aspect((1, 1, 1), zoom=1.05 if on_screen else 0.83)
        ax.set(xlim=(-radius, radius), ylim=(-radius, radius), zlim=(-radius, radius))
        eye = _eye(azimuth)
        right = np.cross([0.0, 0.0, 1.0], eye) / np.cos(np.radians(ELEVATION))
        turn = np.linspace(0, 2 * np.pi, 181)
        circle = np.cos(turn)[:, None], np.sin(turn)[:, None]
        outline = radius * (circle[0] * right + circle[1] * np.cross(eye, right))
        ax.add_collection3d(Poly3DCollection([outline], facecolor=GLASS, edgecolor=NET, linewidth=0.8, zorder=1))
        for latitude in np.radians([-60, -30, 0, 30, 60]):
            flat = np.hstack([*circle, np.full_like(circle[0], np.tan(latitude))])
            _two_sided(ax, radius * np.cos(latitude) * flat, eye, NET, 0.4, 2)
        for longitude in np.radians(range(0, 180, 30)):  # a whole circle through both poles
            across = circle[0] * [np.cos(longitude), np.sin(longitude), 0]
            _two_sided(ax, radius * (across + circle[1] * [0, 0, 1]), eye, NET, 0.4, 2)
        _two_sided(ax, np.where(near[:, None], y, np.nan), eye, colour, 1.0, 3)
        ax.plot(*y[:1].T, zorder=6, **START)
        far = radius if on_screen else radius / 2  # small letters at the corners would lie on one another
        ends = [-far, 0, far]
        ax.set(xlabel=names[0], ylabel=names[1], zlabel=names[2], xticks=ends, yticks=ends, zticks=ends)
        for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
            axis.set_major_formatter(lambda x, _: f"{x:.3g}".replace("-", "\N{MINUS SIGN}"))
            axis.set_pane_color((1, 1, 1, 0))
            axis.set_tick_params(labelsize=7, pad=-2)
            axis.labelpad = -7 if on_screen or axis is ax.zaxis else -5
        ax.grid(False)
        return [(plots.Line2D([], [], **START), "start")]

    return own


def _eye(azimuth: float) -> np.ndarray:
    """The direction of the eye."""
    a, e = np.radians([azimuth, ELEVATION])
    return np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])


def _azimuth(start: np.ndarray, y: np.ndarray) -> int:
    """The azimuth of the eye: the start and most of the path are in front, no axis is seen end on."""
    return max(
        (a for a in range(0, 360, 5) if 25 <= a % 90 <= 65),
        key=lambda a: (start @ _eye(a) > 0.3 * np.linalg.norm(start), (y @ _eye(a) > 0).sum()),
    )


def _two_sided(ax: Any, points: np.ndarray, eye: np.ndarray, colour: str, width: float, zorder: int) -> None:
    """A line, paler behind the centre as seen from ``eye``; it takes two places in the order of drawing."""
    segments = np.stack([points[:-1], points[1:]], axis=1)
    whole = np.isfinite(segments).all(axis=(1, 2))
    front = segments.sum(axis=1) @ eye > 0
    for chosen, alpha, order in ((whole & ~front, 0.35, zorder), (whole & front, 1.0, zorder + 1)):
        if chosen.any():
            look: dict[str, Any] = {"colors": colour, "linewidths": width, "alpha": alpha, "zorder": order}
            ax.add_collection3d(Line3DCollection(segments[chosen], capstyle="butt" if alpha < 1 else "round", **look))


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

#: Axes of a path, the function that shows its state of a number, the path, and the states that are shown.
Screen = tuple[plots.Axes, Callable[[int], None], Trajectory, list[int]]


def film(title: str, cases: Sequence[Readings]) -> Film:
    """The film of the paths of all cases that are vorticities or spins in the plane; ValueError if none is."""
    rows = [readings for readings in cases if readings[0].lattice or _places(readings[0]) is not None]
    if not rows:
        raise ValueError("the results hold no vorticity and no spins in two dimensions; leave out --film")
    columns = max(map(len, rows))
    side = LARGE if len(rows) * columns <= _FEW else SMALL
    fig = Figure()
    axes = fig.subplots(len(rows), columns, squeeze=False)
    screens = [screen for readings, line in zip(rows, axes, strict=True) for screen in _screens(fig, readings, line)]
    for line, readings in zip(axes, rows, strict=True):
        for ax in line[len(readings) :]:
            ax.set_axis_off()
        name = f"{style.plain(readings[0].about.case_title)}\n" if len(rows) > 1 else ""
        line[0].set_ylabel(f"{name}$x_2$" if readings[0].lattice else name)
    for ax in axes[-1] if rows[-1][0].lattice else ():
        ax.set_xlabel("$x_1$")
    frames = max(len(states) for *_, states in screens)
    style.dress(fig, 1.0 + columns * side + 0.8 * len(rows), len(rows) * (side + 0.5), title, [])
    _show(screens, frames, 0)
    fig.draw_without_rendering()
    fig.set_layout_engine("none")  # so that nothing moves from frame to frame
    return Film(fig, frames, partial(_show, screens, frames))


def _screens(fig: Figure, readings: Readings, axes: np.ndarray) -> list[Screen]:
    """The fields or spins of one case at the start, fields in colours that suit all of its frames."""
    states = [plots.spread(len(reading.t), MOST_FRAMES) for reading in readings]
    shows: list[Callable[[int], Any]]
    if (places := _places(readings[0])) is not None:
        points = [_draw_spins(ax, places, _layer(one, 0)) for ax, one in zip(axes, readings, strict=False)]
        shows = [partial(_recolour, image, one) for image, one in zip(points, readings, strict=True)]
        return list(zip(axes, shows, readings, states, strict=False))
    colours = colours_of(readings, [_extremes(one, chosen) for one, chosen in zip(readings, states, strict=True)])
    images = [draw_field(ax, field_values(one, [0])[0], colours) for ax, one in zip(axes, readings, strict=False)]
    shows = [partial(_refill, image, one) for image, one in zip(images, readings, strict=True)]
    look: dict[str, Any] = {"extend": colours.beyond, "shrink": 0.9, "aspect": 22, "pad": 0.02}
    fig.colorbar(images[-1], ax=list(axes[: len(readings)]), label=r"vorticity $\omega$", **look)
    return list(zip(axes, shows, readings, states, strict=False))


def _refill(image: Any, one: Trajectory, state: int) -> None:
    image.set_data(field_values(one, [state])[0].T)


def _recolour(image: Any, one: Trajectory, state: int) -> None:
    image.set_facecolors(colours_of_spins(_layer(one, state)))


def _extremes(reading: Trajectory, states: Sequence[int]) -> tuple[float, float]:
    """The least and the largest vorticity in some states, one after the other to spare memory."""
    return _ends(np.array([_ends(field_values(reading, [state])) for state in states]))


def _show(screens: Sequence[Screen], frames: int, frame: int) -> None:
    """Show frame number `frame`; a path with fewer states stays longer at each."""
    for ax, show, reading, states in screens:
        state = states[frame * len(states) // frames]
        show(state)
        between = float(reading.t[states[1]]) if len(states) > 1 else 1.0
        digits = max(0, 1 - math.floor(math.log10(between)))
        lost = "" if np.isfinite(reading.y[state]).all() else ", not finite"
        ax.set_title(f"{style.label(reading.about)}, $t={reading.t[state]:.{digits}f}${lost}")


# ---------------------------------------------------------------------------------------------------------------------
# Sections, and lattices of spins.
# ---------------------------------------------------------------------------------------------------------------------


def _section(readings: Readings, looks: style.Looks) -> Iterator[plots.Plot]:
    """The first two quantities that are stored at crossings, or the only one against the time."""

    def own(ax: plots.Axes) -> list[plots.Entry]:
        entries = []
        for one, section in ((one, one.section) for one in readings if one.section):
            x, y = section.value[:2] if len(section.stored) > 1 else (section.t, section.value[0])
            colour = looks[one.about.variant][1]
            ax.plot(x, y, linestyle="none", marker=".", markersize=2.5, color=colour)
            entries.append(plots.mark(".", style.label(one.about), color=colour))
        return entries

    first = readings[0]
    if first.section is not None and first.section.stored:
        names = [style.maths(name, first.about.variables) for name in (*first.section.stored, *first.section.stored)]
        x, y = names[:2] if len(first.section.stored) > 1 else ("time $t$", names[0])
        title = f"section {style.maths(first.section.of, first.about.variables)}$=0$"
        yield plots.Plot(title=title, x=x, y=y, own=own, aspect=0.9)


_MOST_ARROWS = 41  # along a side


def colours_of_spins(s: np.ndarray) -> np.ndarray:
    """(..., 3) red, green and blue of spins (..., 3): the angle of (x, y) as hue, z as lightness, black at z = -1."""
    hue = np.arctan2(s[..., 1], s[..., 0])[..., np.newaxis] - np.array([0.0, 2.0, 4.0]) * np.pi / 3
    pure = np.clip(0.5 + np.cos(hue), 0.0, 1.0)
    light = 0.5 * (1 + s[..., 2:3])
    return np.asarray(np.clip(np.where(light < 0.5, 2 * light * pure, 1 - 2 * (1 - light) * (1 - pure)), 0.0, 1.0))


def _places(one: Trajectory) -> np.ndarray | None:
    """(sites, 2): where the spins of the first layer are; None for chains and other states."""
    lattice = json.loads(one.lattice_of_spins or "{}")
    if len(lattice.get("size", ())) < 2:
        return None
    sites, vectors = np.array(lattice["sites"]), np.array(lattice["vectors"])
    cells = np.stack(np.meshgrid(*map(np.arange, lattice["size"][:2]), indexing="ij"), axis=-1).reshape(-1, 2)
    places: np.ndarray = (cells @ vectors[:2])[:, np.newaxis, :2] + sites[:, :2]
    return places.reshape(-1, 2)


def _layer(one: Trajectory, state: int) -> np.ndarray:
    """(sites, 3): the spins of the first layer."""
    lattice = json.loads(one.lattice_of_spins)
    size = (*lattice["size"], 1)[:3]
    return one.y[state].reshape(*size, len(lattice["sites"]), 3)[:, :, 0].reshape(-1, 3)


def _spins(readings: Readings, looks: style.Looks) -> Iterator[plots.Plot]:
    """The spins of each scheme at the chosen times, of a lattice in space its first layer; of a chain all times."""
    for one in (one for one in readings if one.lattice_of_spins):
        places = _places(one)
        if places is None:
            yield plots.Plot(title=style.label(one.about), x="site", y="time $t$", own=partial(_chain, one))
            continue
        for i in one.shown:
            own = partial(_picture, places, _layer(one, i))
            yield plots.Plot(title=f"{style.label(one.about)}, $t={one.t[i]:.4g}$", own=own, aspect=0.9)


def _draw_spins(ax: plots.Axes, places: np.ndarray, s: np.ndarray) -> Any:
    """Spins at their places in colours."""
    span = float(np.ptp(places, axis=0).max()) or 1.0
    ax.set(aspect="equal", xticks=[], yticks=[], xlim=(places[:, 0].min() - 1, places[:, 0].max() + 1))
    ax.set_ylim(places[:, 1].min() - 1, places[:, 1].max() + 1)
    look: dict[str, Any] = {"marker": "s", "linewidths": 0, "rasterized": True}
    return ax.scatter(places[:, 0], places[:, 1], c=colours_of_spins(s), s=(180 / span) ** 2, **look)


def _picture(places: np.ndarray, s: np.ndarray, ax: plots.Axes) -> list[plots.Entry]:
    """Spins in colours, with arrows where they are few, and the key of the colours."""
    _draw_spins(ax, places, s)
    span = float(np.ptp(places, axis=0).max()) or 1.0
    if len(places) < _MOST_ARROWS**2:
        ax.quiver(*places.T, *s[:, :2].T, pivot="mid", scale=1.3 * span, width=0.004, color="#404040")
    key = ax.inset_axes((1.02, 0.0, 0.18, 0.18), projection="polar")
    angle, radius = np.meshgrid(np.linspace(0, 2 * np.pi, 61), np.linspace(0, 1, 21))
    polar = np.pi * radius
    ball = np.stack([np.sin(polar) * np.cos(angle), np.sin(polar) * np.sin(angle), np.cos(polar)], axis=-1)
    key.pcolormesh(angle, radius, colours_of_spins(ball)[:-1, :-1], rasterized=True)
    key.set(xticks=[], yticks=[])
    key.set_title("$(s_x,s_y)$", fontsize=6, pad=2)
    return []


def _chain(one: Trajectory, ax: plots.Axes) -> list[plots.Entry]:
    """s_z of the sites of a chain at all times."""
    chosen = plots.spread(len(one.t), 512)
    z = one.y[chosen].reshape(len(chosen), -1, 3)[..., 2]
    look: dict[str, Any] = {"cmap": "RdBu_r", "vmin": -1, "vmax": 1, "shading": "nearest", "rasterized": True}
    image = ax.pcolormesh(np.arange(1, z.shape[1] + 1), one.t[chosen], z, **look)
    ax.figure.colorbar(image, ax=ax, label="$s_z$")
    return []


PANELS: dict[str, Any] = {
    "functions": [panels.CurvePanel("value", "t", "function", label="${f}$")],
    "section": [panels.Own(_section)],
    "spins": [panels.Own(_spins)],
    "casimirs": [_over_time("casimirs", "{name}$(y)$", "casimir")],
    "casimir_errors": [_over_time("changes", "{name}$(y)-${name}$(y_0)$", "casimir", True, _but_for_damping)],
    "hamiltonian": [_over_time("hamiltonian", "$H(y)$")],
    "components": [panels.Own(_components)],
    "populations": [_over_time("y", "{name}", "component", further=_populated)],
    "sphere": [panels.Own(_sphere)],
    "phase": [panels.Own(_phase)],
    "vorticity": [panels.Own(vorticities)],
    "spectrum": [panels.Own(spectra)],
    "enstrophy": [_over_time("enstrophy_change", "enstrophy  $Z(t)/Z(0)-1$", errors=True, further=_enstrophy)],
}

draw = panels.Figures(PANELS, ("step", "path"))
