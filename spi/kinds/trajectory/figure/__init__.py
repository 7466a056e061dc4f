"""The figure of trajectories: a row of panels per case."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.transforms import ScaledTranslation
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

from spi.drawing import layout, page, style
from spi.drawing.axes import LEAST, legend_line, under_label
from spi.drawing.layout import Entry
from spi.models.zeitlin.fields import enstrophy
from spi.storage.stored import Description

from ..results import Trajectory
from .fields import (
    Fields,
    Path,
    curve,
    departure,
    draw_spectrum,
    dress_axes,
    dress_time,
    need_lattice,
    spectrum_limits,
    tamed,
    window,
)
from .fields import film as film

# ---------------------------------------------------------------------------------------------------------------------
# The panels of a trajectory.
# ---------------------------------------------------------------------------------------------------------------------

OUTSIDE, ZERO = "#f6e6e1", "#555555"  #: negative populations, and the line where they begin

#: Colours and lines of the components of one path.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999999")
LINES = ("-", (0, (5, 1.5)), (0, (1, 1)), (0, (5, 1, 1, 1)))

GLASS, NET = "#eef2f6", "#9aa5b1"
ELEVATION = 22  # degrees, of the eye

START: dict[str, Any] = {"marker": "*", "color": "black", "markersize": 9, "linestyle": "none"}


class Panel(NamedTuple):
    """One axes that is to be drawn."""

    title: str
    draw: Callable  #: draws on an axes and returns the entries of its legend, (handle, text) each
    schemes: list[Path]  #: the paths whose colours and markers must be explained
    solid: bool = False  #: whether it is three-dimensional


def casimirs(paths: list[Path]) -> Iterator[Panel]:
    """Each Casimir over time."""
    for c, name in enumerate(_casimir_names(paths)):
        curves = [path.reading.casimirs[:, c] for path in paths]
        yield Panel(f"Casimir ${name}$", partial(_over_time, paths, curves, f"${name}(y)$"), paths)


def casimir_errors(paths: list[Path]) -> Iterator[Panel]:
    """The change of each Casimir over time."""
    for c, name in enumerate(_casimir_names(paths)):
        curves = [path.reading.casimir_changes[:, c] for path in paths]
        grown = r"e^{k\gamma t}" if "damping" in paths[0].reading.about.parameters else ""
        label = f"${grown}{name}(y)-{name}(y_0)$"
        yield Panel(f"change of the Casimir ${name}$", partial(_over_time, paths, curves, label, errors=True), paths)


def _casimir_names(paths: list[Path]) -> list[str]:
    count = paths[0].reading.casimirs.shape[1]
    return ["C"] if count == 1 else [f"C_{c + 1}" for c in range(count)]


def _component_names(paths: list[Path]) -> list[str]:
    return style.component_names(paths[0].reading.about, paths[0].reading.y.shape[1])


def hamiltonian(paths: list[Path]) -> Iterator[Panel]:
    """The Hamiltonian over time."""
    curves = [path.reading.hamiltonian for path in paths]
    yield Panel("Hamiltonian $H$", partial(_over_time, paths, curves, "$H(y)$"), paths)


def _over_time(paths: list[Path], curves: list[np.ndarray], label: str, ax: Axes, errors: bool = False) -> list[Entry]:
    frame = window([(path.reading, values) for path, values in zip(paths, curves, strict=True)], errors)
    notes = [note for path, values in zip(paths, curves, strict=True) for note in curve(ax, path, values, frame)]
    dress_time(ax, paths[0].reading.t, frame, label, -15 if errors else None)
    return notes


def populations(paths: list[Path]) -> Iterator[Panel]:
    """Each component over time, all schemes."""
    for i, name in enumerate(_component_names(paths)):
        yield Panel(f"population {name}", partial(_population, paths, i, name), paths)


def _population(paths: list[Path], i: int, name: str, ax: Axes) -> list[Entry]:
    notes = _over_time(paths, [path.reading.y[:, i] for path in paths], name, ax)
    if _lowest(paths, i) < 0:
        notes = [_negative(ax, [ax.axhspan], [ax.axhline], [ax.get_ylim()]), *notes]
    return notes


def _lowest(paths: list[Path], component: int) -> float:
    return min(path.reading.lowest[component] for path in paths)


def _negative(
    ax: Axes, spans: Iterable[Callable], lines: Iterable[Callable], limits: Iterable[tuple[float, float]]
) -> Entry:
    """Shade the region below zero, and return its entry of the legend."""
    for span, line, (low, _) in zip(spans, lines, limits, strict=True):
        if low < 0:
            span(low, 0, color=OUTSIDE, linewidth=0, zorder=0)
            line(0, color=ZERO, linewidth=0.7, zorder=1)
    return Patch(color=OUTSIDE), "negative population"


def components(paths: list[Path]) -> Iterator[Panel]:
    """All components over time, an axes per scheme."""
    names, pairs = _component_names(paths), paths[0].reading.about.model in style.COMPLEX
    frame = window([(path.reading, path.reading.y) for path in paths])
    for path in paths:
        yield Panel(path.label, partial(_components, path, names, frame, pairs), [])


def _components(path: Path, names: list[str], frame: tuple[float, float], pairs: bool, ax: Axes) -> list[Entry]:
    notes, drawn = [], tamed(path.reading.y, frame)
    for i, name in enumerate(names):
        colour, line = divmod(i, 2) if pairs else (i, i % len(LINES))  # a colour per mode, or per component
        look: dict[str, Any] = {"color": COLOURS[colour % len(COLOURS)], "linestyle": LINES[line]}
        notes += [(handle, name) for handle in ax.plot(path.reading.t, drawn[:, i], zorder=3, **look)]
    dress_time(ax, path.reading.t, frame, "components")
    return notes + departure(ax, path._replace(colour="black"), path.reading.y, frame)


def phase(paths: list[Path]) -> Iterator[Panel]:
    """The plane of the first two components, all schemes."""
    names = _component_names(paths)
    if len(names) < 2:
        raise ValueError("the panel 'phase' needs two components")
    positive = "populations" in paths[0].reading.panels
    yield Panel("phase plane", partial(_plane, paths, names[:2], positive), paths)


def _plane(paths: list[Path], names: list[str], positive: bool, ax: Axes) -> list[Entry]:
    frames = [window([(path.reading, path.reading.y[:, i]) for path in paths]) for i in (0, 1)]
    low, high = np.array(frames).T
    limits = low, high
    for path in paths:
        ax.plot(*tamed(path.reading.y[:, :2], limits).T, zorder=3, **path.look(len(path.reading.t)))
    ax.set(xlim=frames[0], ylim=frames[1], xlabel=names[0], ylabel=names[1])
    dress_axes(ax)
    ax.plot(*paths[0].reading.y[0, :2], zorder=5, **START)
    notes: list[Entry] = [(Line2D([], [], **START), "start")]
    negative = [_lowest(paths, i) < 0 for i in (0, 1)]
    if positive and any(negative):
        notes.append(_negative(ax, [ax.axvspan, ax.axhspan], [ax.axvline, ax.axhline], frames))
    else:
        for line, crossed in zip((ax.axvline, ax.axhline), negative, strict=True):
            if crossed:
                line(0, color=ZERO, linewidth=0.7, zorder=1)
    return notes + [note for path in paths for note in departure(ax, path, path.reading.y[:, :2], limits, plane=True)]


def sphere(paths: list[Path]) -> Iterator[Panel]:
    """The first path whose scheme preserves the sphere, or the first of all."""
    path = next((path for path in paths if path.reading.preserves_casimirs), paths[0])
    if path.reading.y.shape[1] != 3:
        raise ValueError("the panel 'sphere' needs three components")
    yield Panel(f"{path.label} on the sphere $|y|=|y_0|$", partial(_sphere, path), [path], True)


def _sphere(path: Path, ax: Any) -> list[Entry]:
    _draw_sphere(ax, path.reading.y, _component_names([path]), path.colour, START)
    return [(Line2D([], [], **START), "start")]


def vorticity(paths: list[Path]) -> Iterator[Fields]:
    """The fields at the chosen times."""
    need_lattice(paths, "vorticity")
    yield Fields(paths)


def spectrum(paths: list[Path]) -> Iterator[Panel]:
    """The energy of the shells at the chosen times, an axes per scheme."""
    need_lattice(paths, "spectrum")
    limits = spectrum_limits([path.reading for path in paths])
    for path in paths:
        yield Panel(path.label, partial(draw_spectrum, path, limits), [])


def enstrophies(paths: list[Path]) -> Iterator[Panel]:
    """The change of the enstrophy over time, relative to that of the first scheme at the start."""
    need_lattice(paths, "enstrophy")
    with np.errstate(all="ignore"):
        values = [enstrophy(path.reading.y) for path in paths]
        first = float(values[0][0])
        changes = [of_path / first - 1 if first else of_path for of_path in values]
    label = "$Z(t)/Z(0)-1$" if first else "$Z(t)$"
    yield Panel(
        f"enstrophy $Z$, $Z(0)={style.number(first)}$", partial(_over_time, paths, changes, label, errors=True), paths
    )


#: The panels, by the words of a spec.
WORDS: dict[str, Callable[[list[Path]], Iterator[Panel | Fields]]] = {
    "casimirs": casimirs,
    "casimir_errors": casimir_errors,
    "hamiltonian": hamiltonian,
    "components": components,
    "populations": populations,
    "sphere": sphere,
    "phase": phase,
    "vorticity": vorticity,
    "spectrum": spectrum,
    "enstrophy": enstrophies,
}


def _draw_sphere(ax: Axes3D, y: np.ndarray, names: list[str], colour: str, start: dict[str, Any]) -> None:
    """Draw the path ``y``, an (n, 3) array, on the sphere through its first point, on 3-D axes with these names."""
    radius = float(np.linalg.norm(y[0])) or 1.0
    near = (np.abs(y) < 1.5 * radius).all(axis=1)  # false also where a path is not finite
    azimuth = _azimuth(y[0], y[near])
    ax.view_init(ELEVATION, azimuth)
    ax.set_proj_type("ortho")  # so that the outline of the sphere is a circle
    ax.computed_zorder = False
    on_screen = page.current().width is None
    ax.set_box_aspect((1, 1, 1), zoom=1.15 if on_screen else 0.83)
    ax.set(xlim=(-radius, radius), ylim=(-radius, radius), zlim=(-radius, radius))

    eye = _eye(azimuth)
    right = np.cross([0.0, 0.0, 1.0], eye) / np.cos(np.radians(ELEVATION))
    up = np.cross(eye, right)
    turn = np.linspace(0, 2 * np.pi, 181)
    outline = radius * (np.cos(turn)[:, None] * right + np.sin(turn)[:, None] * up)
    ax.add_collection3d(Poly3DCollection([outline], facecolor=GLASS, edgecolor=NET, linewidth=0.8, zorder=1))

    circles = [_parallel(radius, turn, latitude) for latitude in np.radians([-60, -30, 0, 30, 60])]
    circles += [_meridian(radius, turn, longitude) for longitude in np.radians(range(0, 180, 30))]
    for points in circles:
        _two_sided(ax, points, eye, NET, 0.4, 2)
    _two_sided(ax, np.where(near[:, None], y, np.nan), eye, colour, 1.0, 3)
    ax.plot(*y[:1].T, zorder=6, **start)

    far = radius if on_screen else radius / 2  # small letters at the corners would lie on one another
    ticks = [-far, 0, far]
    ax.set(xlabel=names[0], ylabel=names[1], zlabel=names[2], xticks=ticks, yticks=ticks, zticks=ticks)
    for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
        axis.set_major_formatter(lambda x, _: f"{x:.3g}".replace("-", "−"))
        axis.set_pane_color((1, 1, 1, 0))
        axis.set_tick_params(labelsize=7, pad=-2)
        axis.labelpad = -7 if on_screen or axis is ax.zaxis else -5
    ax.grid(False)


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


def _parallel(radius: float, turn: np.ndarray, latitude: float) -> np.ndarray:
    flat = np.column_stack([np.cos(turn), np.sin(turn), np.full_like(turn, np.tan(latitude))])
    return radius * np.cos(latitude) * flat


def _meridian(radius: float, turn: np.ndarray, longitude: float) -> np.ndarray:
    """The whole circle through both poles."""
    across = np.outer(np.cos(turn), [np.cos(longitude), np.sin(longitude), 0])
    return radius * (across + np.outer(np.sin(turn), [0, 0, 1]))


def _two_sided(ax: Axes3D, points: np.ndarray, eye: np.ndarray, colour: str, width: float, zorder: int) -> None:
    """A line, paler behind the centre as seen from ``eye``; it takes two places in the order of drawing."""
    segments = np.stack([points[:-1], points[1:]], axis=1)
    whole = np.isfinite(segments).all(axis=(1, 2))
    front = segments.sum(axis=1) @ eye > 0
    for chosen, alpha, order in ((whole & ~front, 0.35, zorder), (whole & front, 1.0, zorder + 1)):
        if chosen.any():
            look: dict[str, Any] = {
                "colors": colour,
                "linewidths": width,
                "alpha": alpha,
                "zorder": order,
                "capstyle": "butt" if alpha < 1 else "round",
            }
            ax.add_collection3d(Line3DCollection(segments[chosen], **look))


#: Inches of a panel, by the number of panels side by side.
SIZES = {1: (5.6, 3.6), 2: (4.2, 3.1), 3: (3.5, 2.8), 4: (3.0, 2.6)}


class Places(NamedTuple):
    """The places of the panels of all cases."""

    columns: int
    width: float  #: inches of a column
    heights: np.ndarray  #: (lines,) inches
    first: list[int]  #: of the panels of each case, counted along the lines; its fields stand above it


def draw(title: str, cases: Sequence[Sequence[Trajectory]]) -> Figure:
    """The figure of a study of kind trajectory."""
    rows = _rows(cases)
    columns, width, heights, places = _places(rows, four=cases[0][0].panels == ("components",))
    shared, own = style.split_facts([style.facts(readings[0], "step", "path") for readings in cases])
    fig = Figure()
    grid = fig.add_gridspec(len(heights), columns, height_ratios=heights)
    below, above = np.zeros(len(heights)), np.zeros(len(heights))
    shown: dict[str, Path] = {}
    for readings, facts, row, place in zip(cases, own, rows, places, strict=True):
        fields, panels = _parted(row)
        first = []  # of each kind: line, axes, and room for a title
        line = place // columns - _lines(fields)
        for field in fields:
            ax = field.draw(fig, grid[line : line + field.lines, :].subgridspec(field.lines, field.columns))
            first.append((line, ax, columns * width))
            line += field.lines
        for i, panel in enumerate(panels):
            line, column = divmod(place + i, columns)
            ax = fig.add_subplot(grid[line, column], projection="3d" if panel.solid else None)
            ax.set_title(panel.title)
            below[line] = max(below[line], _legend(ax, panel.draw(ax), width))
            first.append((line, ax, width * (1 if place % columns else min(len(panels), columns))))
            shown |= {path.label: path for path in panel.schemes}
        if len(cases) > 1:
            line, ax, room = first[0]
            above[line] = max(above[line], _case_title(ax, readings[0].about, facts, room))
    if shown:
        handles = [Line2D([], [], **(path.look(0) | {"markevery": None})) for path in shown.values()]
        layout.legend_under_all(fig, list(zip(handles, shown, strict=True)), columns * width)
    total = heights.sum() + legend_line() * (below.sum() + above.sum()) + (0.3 if shown else 0)
    style.dress(fig, columns * width, total, title, shared)
    return fig


def _parted(row: list[Panel | Fields]) -> tuple[list[Fields], list[Panel]]:
    return [panel for panel in row if isinstance(panel, Fields)], [panel for panel in row if isinstance(panel, Panel)]


def _lines(fields: Iterable[Fields]) -> int:
    """The number of lines that the fields of a case take."""
    return sum(field.lines for field in fields)


def _rows(cases: Sequence[Sequence[Trajectory]]) -> list[list[Panel | Fields]]:
    """The panels of each case."""
    looks = style.looks(cases)
    variants = list(dict.fromkeys(reading.about.variant for readings in cases for reading in readings))
    rows = []
    for readings in cases:
        paths = []
        for reading in readings:
            marker, colour = looks[reading.about.variant]
            turn = variants.index(reading.about.variant) / len(variants)
            paths.append(Path(reading, style.label(reading.about), marker, colour, turn))
        rows.append(_panels(readings[0].panels, paths))
    if not any(rows):
        raise ValueError("the results name no panel that could be drawn")
    return rows


def _panels(words: Iterable[str], paths: list[Path]) -> list[Panel | Fields]:
    """The panels of one case."""
    layout.check_panels(words, WORDS)
    return [panel for word in words for panel in WORDS[word](paths)]


def _places(rows: list[list[Panel | Fields]], four: bool) -> Places:
    """The places of the panels of each case; with `four` four of a single case make a square.

    Each case starts a line, unless all of them have one panel: those stand side by side.
    """
    fields, panels = zip(*map(_parted, rows), strict=True)
    counts, tall = [len(row) for row in panels], [_lines(row) for row in fields]
    strip = max(counts) <= 1 and not any(tall)
    widest = len(counts) if strip else max(1, *counts)
    most, _ = page.current().panels(max(SIZES), SIZES[1], LEAST)
    columns = min(most, 2) if four and counts == [4] else layout.even(widest, most)
    each = [1] * len(counts) if strip else [columns * math.ceil(count / columns) for count in counts]
    ends = np.cumsum(each) + columns * np.cumsum(tall)
    width, height = SIZES[columns]
    wide = max([columns * width, *(field.width for row in fields for field in row)])
    width = (page.current().width or wide) / columns
    heights = np.full(math.ceil(ends[-1] / columns), height)
    first = (ends - each).tolist()
    for place, row in zip(first, fields, strict=True):
        line = place // columns - _lines(row)
        for field in row:
            heights[line : line + field.lines] = field.height(columns * width)
            line += field.lines
    return Places(columns, width, heights, first)


def _legend(ax: Axes, notes: list[layout.Entry], width: float) -> int:
    """Put a panel's own entries, short and long ones, into legends under its axis label; returns their lines."""
    place: dict[str, Any] = {"loc": "upper center", "bbox_to_anchor": (0.5, 0), "borderaxespad": 0, "frameon": False}
    spacing: dict[str, Any] = {"columnspacing": 1.2, "handlelength": 1.8, "labelspacing": 0.3}
    lines = 0
    room = [style.inches(text, "legend.fontsize") + 0.45 for _, text in notes]
    for short in (True, False):
        chosen = [i for i, inches in enumerate(room) if (inches < 1.3) == short]
        if not chosen:
            continue
        columns = min(len(chosen), 4, max(1, int(width / max(room[i] for i in chosen))))
        aside = 0 if short else -0.22  # long ones in the middle of panel and axis label
        under = ScaledTranslation(aside, -under_label() - legend_line() * lines, ax.figure.dpi_scale_trans)
        before = ax.get_legend()
        handles, texts = zip(*(notes[i] for i in chosen), strict=True)
        legend = ax.legend(handles, texts, ncols=columns, **place, **spacing)
        legend.set_bbox_to_anchor((0.5, 0), ax.transAxes + under)
        if before:  # axes keep only their latest legend by themselves, and cut other artists off at the frame
            ax.add_artist(before).set_clip_on(False)
        lines += math.ceil(len(chosen) / columns)
    return lines


def _case_title(ax: Axes, about: Description, facts: list[str], width: float) -> int:
    """Write the title of a case above the title of its first panel; returns the number of its lines."""
    title = layout.case_title(about, facts, width)
    ax.set_title(f"{title}\n ", loc="left", fontweight="bold")
    return title.count("\n") + 1
