"""The figure of trajectories: a row of panels per case."""

import math

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.textpath import TextPath
from matplotlib.transforms import ScaledTranslation

from . import style
from .curves import Path
from .panels import WORDS

#: Inches of a panel, by the number of panels side by side.
PANELS = {1: (5.6, 3.6), 2: (4.2, 3.1), 3: (3.5, 2.8), 4: (3.0, 2.6)}
LINE = 0.17  # inches of a line of a legend


def draw(results):
    """The figure of a study of kind trajectory."""
    cases = style.cases(results)
    styles = style.styles(results)
    names = list(dict.fromkeys(group.scheme for group in results.groups))
    rows = []
    for groups in cases:
        paths = [_path(group, *styles[group.scheme], names.index(group.scheme) / len(names)) for group in groups]
        rows.append(_panels(groups[0].attributes, paths))
    if not any(rows):
        raise ValueError("the results name no panel that could be drawn")

    columns, lines, places = _places([len(row) for row in rows])
    if len(rows) == 1 and len(rows[0]) == 4 and cases[0][0].attributes["panels"].split() == ["components"]:
        columns, lines = 2, 2
    width, height = PANELS[columns]
    shared, own = style.split_facts(cases)
    fig = Figure()
    grid = fig.add_gridspec(lines, columns)
    below, above, shown = np.zeros(lines), np.zeros(lines), {}
    for groups, facts, row, place in zip(cases, own, rows, places, strict=True):
        for i, panel in enumerate(row):
            line, column = divmod(place + i, columns)
            ax = fig.add_subplot(grid[line, column], projection="3d" if panel.solid else None)
            ax.set_title(panel.title)
            below[line] = max(below[line], _legend(ax, panel.draw(ax), width))
            if i == 0 and len(cases) > 1:
                room = width * (1 if place % columns else min(len(row), columns))
                above[line] = max(above[line], _case_title(ax, groups[0], facts, room))
            shown |= {path.label: path for path in panel.schemes}
    if shown:
        handles = [Line2D([], [], **(path.look(0) | {"markevery": None})) for path in shown.values()]
        fig.legend(handles, list(shown), loc="outside lower center", ncols=len(shown), frameon=False, handlelength=2.4)
    total = lines * height + LINE * (below.sum() + above.sum()) + (0.3 if shown else 0)
    style.dress(fig, columns * width, total, results.attributes.get("title", ""), shared)
    return fig


def _path(group, marker, colour, turn):
    curves = (np.asarray(group.variables[name][1], dtype=float) for name in ("y", "hamiltonian", "casimirs"))
    return Path(group.scheme, style.label(group), marker, colour, turn, group.coordinates["t"], *curves)


def _panels(attributes, paths):
    """The panels of one case, as the attribute ``panels`` asks."""
    words, panels = attributes["panels"].split(), []
    for word in words:
        if word not in WORDS:
            raise ValueError(f"there is no panel {word!r}; known panels: {', '.join(WORDS)}")
        panels += WORDS[word](attributes, paths)
    return panels


def _places(counts):
    """Columns, lines and where each case starts, for cases of ``counts`` panels each.

    Each case starts a line, unless all of them have one panel: those stand side by side.
    """
    strip = max(counts) == 1
    widest = len(counts) if strip else max(counts)
    columns = math.ceil(widest / math.ceil(widest / max(PANELS)))
    each = [1] * len(counts) if strip else [columns * math.ceil(count / columns) for count in counts]
    places = np.cumsum([0, *each])
    return columns, math.ceil(places[-1] / columns), places[:-1].tolist()


def _legend(ax, notes, width):
    """The legends of a panel's own entries under its axis label, of short and of long ones; their number of lines."""
    lines, place = 0, {"loc": "upper center", "bbox_to_anchor": (0.5, 0), "borderaxespad": 0, "frameon": False}
    spacing = {"columnspacing": 1.2, "handlelength": 1.8, "labelspacing": 0.3}
    room = [TextPath((0, 0), text, size=8).get_extents().width / 72 + 0.45 for _, text in notes]
    for short in (True, False):
        chosen = [i for i, inches in enumerate(room) if (inches < 1.3) == short]
        if not chosen:
            continue
        columns = min(len(chosen), 4, max(1, int(width / max(room[i] for i in chosen))))
        aside = 0 if short else -0.22  # long ones in the middle of panel and axis label
        under = ScaledTranslation(aside, -0.42 - LINE * lines, ax.figure.dpi_scale_trans)
        before = ax.get_legend()
        legend = ax.legend(*zip(*(notes[i] for i in chosen), strict=True), ncols=columns, **place, **spacing)
        legend.set_bbox_to_anchor((0.5, 0), ax.transAxes + under)
        if before:  # axes keep only their latest legend by themselves, and cut other artists off at the frame
            ax.add_artist(before).set_clip_on(False)
        lines += math.ceil(len(chosen) / columns)
    return lines


def _case_title(ax, group, facts, width):
    """The title of a case above the title of its first panel; how many lines it has."""
    title = style.plain(group.attributes.get("case_title") or group.case)
    lines = style.wrapped([title, *facts], ",  ", 9, width)
    ax.set_title("\n".join([*lines, " "]), loc="left", fontweight="bold")
    return len(lines)
