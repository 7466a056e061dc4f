"""What the panels of a trajectory can show."""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from . import style
from .curves import curve, departure, dress_axes, dress_time, lowest, tamed, window
from .sphere import draw_sphere

OUTSIDE, ZERO = "#f6e6e1", "#555555"  #: negative populations, and the line where they begin

#: Colours and lines of the components of one path.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999999")
LINES = ("-", (0, (5, 1.5)), (0, (1, 1)), (0, (5, 1, 1, 1)))

START = {"marker": "*", "color": "black", "markersize": 9, "linestyle": "none"}


class Panel(NamedTuple):
    """One axes that is to be drawn."""

    title: str
    draw: Callable  #: draws on an axes and returns the entries of its legend, (handle, text) each
    schemes: list  #: the paths whose colours and markers must be explained
    solid: bool = False  #: whether it is three-dimensional


def casimirs(attributes, paths):
    """Each Casimir over time."""
    for c, name in enumerate(_casimir_names(paths)):
        curves = [path.casimirs[:, c] for path in paths]
        yield Panel(f"Casimir ${name}$", partial(_over_time, paths, curves, f"${name}(y)$"), paths)


def casimir_errors(attributes, paths):
    """How each Casimir changes over time."""
    for c, name in enumerate(_casimir_names(paths)):
        with np.errstate(invalid="ignore", over="ignore"):
            curves = [path.casimirs[:, c] - path.casimirs[0, c] for path in paths]
        label = f"${name}(y)-{name}(y_0)$"
        yield Panel(f"change of the Casimir ${name}$", partial(_over_time, paths, curves, label, errors=True), paths)


def _casimir_names(paths):
    count = paths[0].casimirs.shape[1]
    return ["C"] if count == 1 else [f"C_{c + 1}" for c in range(count)]


def hamiltonian(attributes, paths):
    """The Hamiltonian over time."""
    curves = [path.hamiltonian for path in paths]
    yield Panel("Hamiltonian $H$", partial(_over_time, paths, curves, "$H(y)$"), paths)


def _over_time(paths, curves, label, ax, errors=False):
    frame = window([(path.scheme, values) for path, values in zip(paths, curves, strict=True)], errors)
    notes = [note for path, values in zip(paths, curves, strict=True) for note in curve(ax, path, values, frame)]
    dress_time(ax, paths[0].t, frame, label, -15 if errors else None)
    return notes


def populations(attributes, paths):
    """Each component over time, all schemes."""
    for i, name in enumerate(style.component_names(attributes, paths[0].y.shape[1])):
        yield Panel(f"population {name}", partial(_population, paths, i, name), paths)


def _population(paths, i, name, ax):
    notes = _over_time(paths, [path.y[:, i] for path in paths], name, ax)
    if lowest(paths, i) < 0:
        notes = [_negative(ax, [ax.axhspan], [ax.axhline], [ax.get_ylim()]), *notes]
    return notes


def _negative(ax, spans, lines, limits):
    """Shade what is below zero, and return a note of it."""
    for span, line, (low, _) in zip(spans, lines, limits, strict=True):
        if low < 0:
            span(low, 0, color=OUTSIDE, linewidth=0, zorder=0)
            line(0, color=ZERO, linewidth=0.7, zorder=1)
    return Patch(color=OUTSIDE), "negative population"


def components(attributes, paths):
    """All components over time, an axes per scheme."""
    names = style.component_names(attributes, paths[0].y.shape[1])
    frame = window([(path.scheme, path.y) for path in paths])
    for path in paths:
        yield Panel(path.label, partial(_components, path, names, frame, attributes.get("model") in style.COMPLEX), [])


def _components(path, names, frame, pairs, ax):
    notes, drawn = [], tamed(path.y, frame)
    for i, name in enumerate(names):
        colour, line = divmod(i, 2) if pairs else (i, i % len(LINES))  # a colour per mode, or per component
        look = {"color": COLOURS[colour % len(COLOURS)], "linestyle": LINES[line]}
        notes += [(handle, name) for handle in ax.plot(path.t, drawn[:, i], zorder=3, **look)]
    dress_time(ax, path.t, frame, "components")
    return notes + departure(ax, path._replace(colour="black"), path.y, frame)


def phase(attributes, paths):
    """The plane of the first two components, all schemes."""
    if paths[0].y.shape[1] < 2:
        raise ValueError("the panel 'phase' needs two components")
    positive = "populations" in attributes["panels"].split()
    yield Panel("phase plane", partial(_plane, paths, style.component_names(attributes, 2), positive), paths)


def _plane(paths, names, positive, ax):
    frames = [window([(path.scheme, path.y[:, i]) for path in paths]) for i in (0, 1)]
    limits = np.array(frames).T
    for path in paths:
        ax.plot(*tamed(path.y[:, :2], limits).T, zorder=3, **path.look(len(path.t)))
    ax.set(xlim=frames[0], ylim=frames[1], xlabel=names[0], ylabel=names[1])
    dress_axes(ax)
    ax.plot(*paths[0].y[0, :2], zorder=5, **START)
    notes = [(Line2D([], [], **START), "start")]
    negative = [lowest(paths, i) < 0 for i in (0, 1)]
    if positive and any(negative):
        notes.append(_negative(ax, [ax.axvspan, ax.axhspan], [ax.axvline, ax.axhline], frames))
    else:
        for line, crossed in zip((ax.axvline, ax.axhline), negative, strict=True):
            if crossed:
                line(0, color=ZERO, linewidth=0.7, zorder=1)
    return notes + [note for path in paths for note in departure(ax, path, path.y[:, :2], limits, plane=True)]


def sphere(attributes, paths):
    """The path of the splitting scheme on its sphere."""
    path = next((path for path in paths if path.scheme.startswith("splitting")), paths[0])
    if path.y.shape[1] != 3:
        raise ValueError("the panel 'sphere' needs three components")
    yield Panel(f"{path.label} on the sphere $|y|=|y_0|$", partial(_sphere, path), [path], True)


def _sphere(path, ax):
    draw_sphere(ax, path.y, path.colour, START)
    return [(Line2D([], [], **START), "start")]


#: The panels, by the words of a spec.
WORDS = {
    "casimirs": casimirs,
    "casimir_errors": casimir_errors,
    "hamiltonian": hamiltonian,
    "components": components,
    "populations": populations,
    "sphere": sphere,
    "phase": phase,
}
