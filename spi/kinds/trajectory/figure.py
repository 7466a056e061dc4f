"""Figure of trajectories: quantities over time, the phase plane, the sphere, sections."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.patches import Patch
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

from spi.drawing import page, panels, plots, style
from spi.specs.panels import Panels

from .film import film as film
from .results import Trajectory

TrajectoryReadings = Sequence[Trajectory]

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


def times_shown(readings: TrajectoryReadings) -> tuple[float, float]:
    """Limits of the axis of time, which ends a little behind the last path if all of them diverged."""
    t = readings[0].t
    ends = [one.nonfinite_from for one in readings if one.nonfinite_from is not None]
    if len(ends) == len(readings) and len(t) > 1:
        return float(t[0]), float(min(t[-1], t[0] + 1.1 * (max(ends) - t[0])))
    return float(t[0]), float(t[-1] if len(t) > 1 else t[0] + 1)


def _over_time(
    field: str, label: str, facet: str = "", errors: bool = False, further: Any = None, conserved: bool = False
) -> panels.CurvePanel:
    """A quantity of each path over time; `further` changes its panels."""

    def framed(plot: plots.Plot, readings: TrajectoryReadings, place: int) -> plots.Plot:
        curves = [(one, line.y) for one, line in zip(readings, plot.series, strict=True)]
        plot = plot._replace(xlim=times_shown(readings), ylim=window(curves, errors))
        return further(plot, readings, place) if further else plot

    return panels.CurvePanel(field, "t", facet, label=label, then=framed, conserved=conserved)


def _but_for_damping(plot: plots.Plot, readings: TrajectoryReadings, place: int) -> plots.Plot:
    return plot._replace(y=rf"$e^{{k\gamma t}}${plot.y}") if "damping" in readings[0].about.parameters else plot


def _populated(plot: plots.Plot, readings: TrajectoryReadings, place: int) -> plots.Plot:
    negative = _lowest(readings, place) < 0
    return plot._replace(own=(lambda ax: _below_zero(ax, "y", True)) if negative else None)


def _components(readings: TrajectoryReadings, looks: style.Looks) -> Iterator[plots.Plot]:
    """All components over time, a panel for each scheme."""
    names, pairs = _names(readings), style.modes_of(readings[0].about)
    frame = window([(one, one.y) for one in readings])
    for k, one in enumerate(readings):
        lines = []
        for i, name in enumerate(names):
            colour, line = divmod(i, 2) if pairs else (i, i % len(LINES))  # a colour per mode, or per component
            look = {"color": COLOURS[colour % len(COLOURS)], "linestyle": LINES[line]}
            lines.append(plots.series(one.t, one.y[:, i], look, name if i < len(COLOURS) else ""))
        axes: dict[str, Any] = {"xlim": times_shown(readings), "ylim": frame, "shared": k > 0}
        yield plots.Plot(lines, style.label(one.about), style.AXES["t"], "components", **axes)


def _names(readings: TrajectoryReadings) -> list[str]:
    return style.component_names(readings[0].about, readings[0].y.shape[1])


# ---------------------------------------------------------------------------------------------------------------------
# Populations and the phase plane.
# ---------------------------------------------------------------------------------------------------------------------


def _lowest(readings: TrajectoryReadings, component: int) -> float:
    return min(one.lowest[component] for one in readings)


def _below_zero(ax: plots.Axes, across: Sequence[str], shaded: bool) -> list[plots.LegendEntry]:
    """Mark where a component is below zero: shaded, or by a line only; `across` names its axes, "x" or "y"."""
    for axis in across:
        low = (ax.get_xlim() if axis == "x" else ax.get_ylim())[0]
        (ax.axvline if axis == "x" else ax.axhline)(0, color=ZERO, linewidth=0.7, zorder=1)
        if shaded and low < 0:
            (ax.axvspan if axis == "x" else ax.axhspan)(low, 0, color=OUTSIDE, linewidth=0, zorder=0)
    return [(Patch(color=OUTSIDE), "negative population")] if shaded and across else []


def _phase(readings: TrajectoryReadings, looks: style.Looks) -> Iterator[plots.Plot]:
    """Plane of the first two components, all schemes."""
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

    def own(ax: plots.Axes) -> list[plots.LegendEntry]:
        ax.plot(*readings[0].y[0, :2], zorder=5, **START)
        return [(plots.Line2D([], [], **START), "start"), *_below_zero(ax, below, shaded)]

    yield plots.Plot(lines, x=names[0], y=names[1], xlim=frames[0], ylim=frames[1], own=own)


# ---------------------------------------------------------------------------------------------------------------------
# A path on the sphere through its first point.
# ---------------------------------------------------------------------------------------------------------------------


def _sphere(readings: TrajectoryReadings, looks: style.Looks) -> Iterator[plots.Plot]:
    """The first path whose scheme preserves the sphere, or the first of all."""
    one = next((one for one in readings if one.preserves_casimirs), readings[0])
    if one.y.shape[1] != 3:
        raise ValueError("the panel 'sphere' needs three components")
    title = f"{style.label(one.about)} on $|y|=|y_0|$"
    yield plots.Plot(
        title=title, own=_on_sphere(one.y, _names([one]), looks[one.about.variant][1]), projection="3d", aspect=0.9
    )


def _on_sphere(y: np.ndarray, names: Sequence[str], colour: str) -> Callable[[Any], list[plots.LegendEntry]]:
    """A function that draws the path ``y``, (n, 3), on 3-D axes."""

    def own(ax: Any) -> list[plots.LegendEntry]:
        radius = float(np.linalg.norm(y[0])) or 1.0
        near = (np.abs(y) < 1.5 * radius).all(axis=1)  # false also where a path is not finite
        azimuth = _azimuth(y[0], y[near])
        ax.view_init(ELEVATION, azimuth)
        ax.set_proj_type("ortho")  # so that the outline of the sphere is a circle
        ax.computed_zorder = False
        on_screen = not page.current().is_paper
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
    """Direction of the eye."""
    a, e = np.radians([azimuth, ELEVATION])
    return np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])


def _azimuth(start: np.ndarray, y: np.ndarray) -> int:
    """Azimuth of the eye: the start and most of the path are in front, no axis is seen end on."""
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


# ---------------------------------------------------------------------------------------------------------------------
# Sections.
# ---------------------------------------------------------------------------------------------------------------------


def _section(readings: TrajectoryReadings, looks: style.Looks) -> Iterator[plots.Plot]:
    """The first two quantities that are stored at crossings, or the only one against the time."""

    def own(ax: plots.Axes) -> list[plots.LegendEntry]:
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


PANELS: dict[str, Any] = {
    "functions": [panels.CurvePanel("value", "t", "function", label="${f}$", conserved=True)],
    "section": [panels.OwnPanels(_section)],
    "casimirs": [_over_time("casimirs", "{name}$(y)$", "casimir", conserved=True)],
    "casimir_errors": [_over_time("changes", "{name}$(y)-${name}$(y_0)$", "casimir", True, _but_for_damping)],
    "hamiltonian": [_over_time("hamiltonian", "$H(y)$", conserved=True)],
    "components": [panels.OwnPanels(_components)],
    "populations": [_over_time("y", "{name}", "component", further=_populated)],
    "sphere": [panels.OwnPanels(_sphere)],
    "phase": [panels.OwnPanels(_phase)],
}

draw = panels.Figures(Panels("trajectory", PANELS), ("step", "path"))
