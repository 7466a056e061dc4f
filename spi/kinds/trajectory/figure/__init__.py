"""The figure of trajectories: a row of panels per case."""

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.transforms import ScaledTranslation

from spi.drawing import layout, page, style
from spi.drawing.axes import LEAST, legend_line, under_label
from spi.storage.records import Description

from ..results import Trajectory
from .curves import Path
from .fields import Fields
from .fields import film as film
from .panels import WORDS, Panel

#: Inches of a panel, by the number of panels side by side.
SIZES = {1: (5.6, 3.6), 2: (4.2, 3.1), 3: (3.5, 2.8), 4: (3.0, 2.6)}


class Places(NamedTuple):
    """Where the panels of all cases stand."""

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
        for one in fields:
            ax = one.draw(fig, grid[line : line + one.lines, :].subgridspec(one.lines, one.columns))
            first.append((line, ax, columns * width))
            line += one.lines
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
    return [one for one in row if isinstance(one, Fields)], [one for one in row if isinstance(one, Panel)]


def _lines(fields: Iterable[Fields]) -> int:
    """How many lines the fields of a case take."""
    return sum(one.lines for one in fields)


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
    """Where the panels of each case stand; with `four` four of a single case make a square.

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
    wide = max([columns * width, *(one.width for row in fields for one in row)])
    width = (page.current().width or wide) / columns
    heights = np.full(math.ceil(ends[-1] / columns), height)
    first = (ends - each).tolist()
    for place, row in zip(first, fields, strict=True):
        line = place // columns - _lines(row)
        for one in row:
            heights[line : line + one.lines] = one.height(columns * width)
            line += one.lines
    return Places(columns, width, heights, first)


def _legend(ax: Axes, notes: list[layout.Entry], width: float) -> int:
    """Put a panel's own entries, short and long ones, into legends under its axis label; returns how many lines."""
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
    """Write the title of a case above the title of its first panel; returns how many lines it has."""
    title = layout.case_title(about, facts, width)
    ax.set_title(f"{title}\n ", loc="left", fontweight="bold")
    return title.count("\n") + 1
