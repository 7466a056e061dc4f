"""Figures of many panels: their places, letters and titles, and one legend."""

import math
from collections.abc import Sequence
from itertools import zip_longest
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from matplotlib.transforms import ScaledTranslation

from . import fitting, page, plots, style

WIDTHS = {1: 5.0, 2: 4.1, 3: 3.6, 4: 3.2}  #: inches of a panel, by the number side by side
NARROW = 2.8  # of more than four side by side
LEAST = 2.1  #: inches of a panel in a paper, where as many stand side by side as fit
ENTRIES = 8  #: of a legend at most; lines are named at their ends where there are more schemes

_COLUMNS = 4  # panels side by side, unless the figure would be too high
_TALL = 1.25  # height over width of all panels at most, so that with titles it is 1.4
_FLAT, _LOW = 0.6, 0.88  # height over width of panels of curves and of fields in a figure with many rows of fields
_FULL = 0.75  # share of the places in rows of groups that are to be filled
_WIDE = 5.0  # inches of a figure that has room for names of lines
_NAMES = 1.6  # inches for the names of lines at their ends
_AROUND = 0.8  # inches above and below the frame of a panel
_MARGIN = 0.5  # inches to the left of a panel, for its vertical axis
_WIDER = 0.6  # inches more, where the label of that axis has two lines
_HIGHER = 1.25  # height of a line with formulas, in lines
_BESIDE = 0.45  # inches of a handle of the legend and the room around it

Case = tuple[list[str], list[list[plots.Plot]]]  #: the heading of a case, and groups of panels


@np.errstate(all="ignore")
def arranged(title: str, cases: Sequence[Case], facts: list[str]) -> Figure:
    """The figure of the panels of each case; ValueError if there are none."""
    rows = _rows([groups for _, groups in cases])
    if not rows:
        raise ValueError("the results name no panel that could be drawn")
    columns = max(map(len, rows))
    width = page.current().width or columns * WIDTHS.get(columns, NARROW)
    heights = [aspect * width / columns for aspect in _aspects(rows)]
    fig = Figure(layout="constrained")  # which colour bars are to know beforehand
    grid = fig.add_gridspec(len(rows), columns, height_ratios=heights)
    titles = _Titles(cases if len(cases) > 1 else [], rows, width)
    axes: list[plots.Axes] = []
    entries, ends, lines = [], [], 0
    for i, row in enumerate(rows):
        above = [1]
        for j, plot in enumerate(row):
            if plot is None:
                continue
            ax = fig.add_subplot(grid[i, j], projection=plot.projection)
            own, of_lines = plot.draw(ax)
            axes.append(ax)
            entries += own
            ends.append(of_lines)
            above.append(titles.write(ax, plot))
            if plot.shared and j:
                ax.set_ylabel("")
                ax.tick_params(labelleft=False)
        lines += max(above)
    schemes = {end.label for of_lines in ends for end in of_lines}
    handles, room = _merged(entries, schemes), page.current().width or _WIDE
    explained = len(_with_notes([], ends))  # what is added to the legend
    many = len(handles) + explained > ENTRIES and room >= _WIDE
    fewer = [(handle, text) for handle, text in handles if not text.startswith(plots.SLOPE)]
    named = many and len(fewer) + explained > ENTRIES
    if many and not named:
        handles = fewer
        for ax in axes:
            plots.write_slopes(ax)
    if named:
        handles = [(handle, text) for handle, text in handles if text not in schemes]
    else:
        handles = _with_notes(handles, ends)
    legend = _legend_rows(handles, width)
    beside = _NAMES * named if page.current().width is None else 0.0
    style.dress(fig, width + beside, sum(heights) + 0.17 * (lines + len(legend)) + 0.1, title, facts)
    looks = {(text, str(getattr(handle, "get_color", str)())) for handle, text in handles}
    lacking = {(end.label, end.colour) for of_lines in ends for end in of_lines} - looks
    unnamed = lacking if named or len(axes) > 1 else set()  # a look that the legend does not show is named at its line
    for ax, of_lines in sorted(zip(axes, ends, strict=True), key=lambda pair: -len(pair[1])):
        plots.write_ends(ax, of_lines, unnamed, noted=len(axes) > 1 or named)
        unnamed = unnamed - {(end.label, end.colour) for end in of_lines}
    if legend:
        artists, texts = zip(*(entry for column in zip(*legend, strict=True) for entry in column), strict=True)
        look: dict[str, Any] = {"frameon": False, "handlelength": 2.4, "columnspacing": 1.6}
        fig.legend(artists, texts, loc="outside lower center", ncols=len(legend[0]), **look)
    return fig


def _rows(cases: Sequence[list[list[plots.Plot]]]) -> Sequence[Sequence[plots.Plot | None]]:
    """The panels of all cases in rows, at most as high together as a figure may be."""
    count = sum(len(group) for groups in cases for group in groups)
    if page.current().width is not None:
        return _in_rows(cases, page.current().columns(_COLUMNS, LEAST))
    each = (_in_rows(cases, most) for most in range(_COLUMNS, max(_COLUMNS, count) + 1))
    return next((rows for rows in each if not rows or _shape(rows) <= _TALL), [])


def _aspects(rows: Sequence[Sequence[plots.Plot | None]]) -> list[float]:
    """Height over width of the panels of each row; all are lower where rows of fields would make it too high."""
    whole = [max(plot.aspect for plot in row if plot) for row in rows]
    curves = [all(plot is None or plot.series for plot in row) for row in rows]
    fields = any(plot and plot.shared and not plot.series for row in rows for plot in row)
    if not fields or sum(whole) <= _TALL * max(map(len, rows)):
        return whole
    return [min(aspect, _FLAT if low else _LOW) for aspect, low in zip(whole, curves, strict=True)]


def _in_rows(cases: Sequence[list[list[plots.Plot]]], most: int) -> Sequence[Sequence[plots.Plot | None]]:
    """The panels of all cases, at most `most` in a row; each case begins one, unless cases are few panels."""
    plots = [[plot for group in groups for plot in group] for groups in cases]
    longest = max(map(len, plots))
    if len(cases) == 1:
        return _matrix(cases[0], most)
    if longest <= 1:
        return _even([plot for own in plots for plot in own], most)
    if longest <= len(cases) <= most:
        return list(zip_longest(*plots))  # a column for each case
    return _packed([_matrix(groups, most, wide=True) for groups in cases], most)


def _packed(cases: Sequence[list[list[plots.Plot]]], most: int) -> list[list[plots.Plot]]:
    """The rows of all cases, short ones of neighbouring cases joined."""
    rows: list[list[plots.Plot]] = []
    for own in cases:
        if rows and len(own) == 1 and len(rows[-1]) + len(own[0]) <= most:
            rows[-1] = rows[-1] + own[0]
        else:
            rows += own
    return rows


def _shape(rows: Sequence[Sequence[plots.Plot | None]]) -> float:
    return sum(_aspects(rows)) / max(map(len, rows))


def _matrix(groups: list[list[plots.Plot]], most: int, wide: bool = False) -> list[list[plots.Plot]]:
    """A row for each group of several panels, and single panels together in rows; `wide` rows are as long as can be."""
    rows: list[list[plots.Plot]] = []
    single: list[plots.Plot] = []
    everything = [plot for group in groups for plot in group]
    if sum(len(group) > 1 for group in groups) < 2 or max(map(len, groups)) < 3:
        return _even(everything, most, wide)
    for group in groups:
        if len(group) == 1:
            single += group
            continue
        rows += _even(single, most) + ([group] if len(group) <= most else _even(group, most))
        single = []
    rows += _even(single, most)
    full = len(everything) > _FULL * len(rows) * max(map(len, rows))
    return rows if full and _shape(rows) <= _TALL else _even(everything, most, wide)


def _even(plots: Sequence[plots.Plot], most: int, wide: bool = False) -> list[list[plots.Plot]]:
    """Panels in rows of about the same length, at most `most` long."""
    wanted = most if wide else {4: 2, 5: 3, 6: 3, 9: 3}.get(len(plots), most)
    columns = max(1, math.ceil(len(plots) / max(1, math.ceil(len(plots) / min(wanted, most)))))
    return [list(plots[i : i + columns]) for i in range(0, len(plots), columns)]


class _Titles:
    """The titles of panels: a letter where there are several, and the heading of each case above its first one."""

    def __init__(self, cases: Sequence[Case], rows: Sequence[Sequence[plots.Plot | None]], width: float) -> None:
        self.headings = {id(groups[0][0]): heading for heading, groups in cases if groups}
        self.letters = iter("abcdefghijklmnopqrstuvwxyz" * 9) if sum(map(len, rows)) > 1 else None
        self.width = width / max(map(len, rows))
        self.reach: dict[int, float] = {}  # inches of the panels that belong to a heading, by the first of them
        for row in rows:
            begins = [k for k, plot in enumerate(row) if id(plot) in self.headings]
            for k, end in zip(begins, [*begins[1:], len(row)], strict=False):
                self.reach[id(row[k])] = self.width * (end - k)

    def write(self, ax: plots.Axes, plot: plots.Plot) -> int:
        """Write the title of a panel, and break its label if it is too long; returns the number of lines above."""
        heading, own = self.headings.get(id(plot), []), plot.title.split("\n") if plot.title else []
        letter = f"({next(self.letters)})  " if self.letters else ""
        label, room = ax.get_ylabel(), plot.aspect * self.width - _AROUND
        is_long = style.inches(label, "axes.labelsize") > room
        above = _wrapped(heading, self.reach.get(id(plot), self.width) - _MARGIN - _WIDER * is_long)
        under = _wrapped(own, self.width - _MARGIN) or [""]
        # empty lines make room for the heading, which may reach over other panels and so takes no part in the layout;
        # lines with formulas are higher
        ax.set_title(
            "\n" * round(_HIGHER * len(above)) + letter + "\n".join(under), loc="left", pad=6 if ax.axison else 15
        )
        size = page.points("axes.titlesize")
        rise = ((6 if ax.axison else 15) + 1.3 * size * len(under)) / 72
        place: Any = ax.transAxes + ScaledTranslation(0, rise, ax.figure.dpi_scale_trans)
        draw: Any = ax.text2D if ax.name == "3d" else ax.text  # type: ignore[attr-defined]
        if above:
            draw(0, 1, "\n".join(above), transform=place, va="bottom", fontsize=size, in_layout=False)
        if is_long:
            ax.set_ylabel(label.replace("  ", "\n"))
        return round(_HIGHER * len(above)) + len(under)


def _wrapped(texts: Sequence[str], width: float) -> list[str]:
    """Texts in lines as wide as a panel, long ones broken."""
    font = FontProperties(size=page.points("axes.titlesize"))
    lines = style.wrapped(texts, ",  ", "axes.titlesize", width)
    return [part for line in lines for part in fitting.broken(line, font, 0.95 * width)]


def _with_notes(entries: list[plots.Entry], ends: Sequence[Sequence[plots.End]]) -> list[plots.Entry]:
    """The entries of a single panel with the notes of its lines; of several an explanation of the numbers there."""
    if len(ends) == 1:
        notes = {end.label: f"{text}: {end.note}" for end in ends[0] if end.note for text in [end.label]}
        return [(handle, notes.get(text, text)) for handle, text in entries]
    if any(end.note.startswith("order ") for of_lines in ends for end in of_lines):
        entries.append((Line2D([], [], linestyle="none"), "numbers at lines: fitted orders"))
    return entries


def _merged(entries: Sequence[plots.Entry], schemes: set[str]) -> list[plots.Entry]:
    """The entries of all panels, each text once: schemes, other lines, marks."""
    by_text = {text: handle for handle, text in reversed(entries)}
    texts = dict.fromkeys(text for _, text in entries)
    both = {text for text in texts if any(other.endswith(f", or {text}") for other in texts)}  # of two kinds of panels
    merged = [(by_text[text], text) for text in texts if text not in both]
    dashes = {text: getattr(handle, "get_linestyle", lambda: "-")() for handle, text in merged}
    return sorted(merged, key=lambda entry: (entry[1] not in schemes, dashes[entry[1]] == "None"))


def _legend_rows(entries: Sequence[plots.Entry], width: float) -> list[list[plots.Entry]]:
    """The entries in as few rows as a figure of some inches has room for, all filled up to one length."""
    if not entries:
        return []
    blank: plots.Entry = Line2D([], [], linestyle="none"), " "
    for columns in range(len(entries), 0, -1):
        rows = [list(entries[i : i + columns]) for i in range(0, len(entries), columns)]
        rows[-1] += [blank] * (columns - len(rows[-1]))
        widths = [
            max(style.inches(text, "legend.fontsize") for _, text in column) for column in zip(*rows, strict=True)
        ]
        if sum(widths) + (_BESIDE + 0.2) * columns < width - 0.2:
            break
    return rows
