"""Figures of many panels: their places, letters and titles, and one legend."""

import math
from collections.abc import Sequence
from itertools import chain, cycle, zip_longest
from string import ascii_lowercase
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from matplotlib.transforms import ScaledTranslation

from . import fitting, page, plots, style

Case = tuple[list[str], list[list[plots.Plot]]]  #: the heading of a case, and groups of panels


class PanelFigure(Figure):
    """Figure of matplotlib with its panels."""

    panels: tuple[plots.Axes, ...] = ()  #: from left to right and from above, without the axes of colour bars

    def _repr_png_(self) -> bytes:  # for notebooks that know not matplotlib
        from . import as_bytes

        return as_bytes(self, "png")


class _Drawn(NamedTuple):
    """A panel that is drawn."""

    ax: plots.Axes
    entries: list[plots.LegendEntry]  #: of the legend
    ends: list[plots.End]  #: of its lines


class _Legend(NamedTuple):
    """Legend of a figure, and where its lines are named."""

    entries: list[plots.LegendEntry]
    named: bool  #: whether the lines of schemes are named at their ends instead
    beside_slopes: bool  #: whether the names of reference lines stand beside them instead


@np.errstate(all="ignore")
def arranged(title: str, cases: Sequence[Case], facts: list[str]) -> PanelFigure:
    """Figure of the panels of each case; ValueError if there are none, or no room for them in its height."""
    rows, layout = _rows([groups for _, groups in cases]), page.current().layout
    if not rows:
        raise ValueError("the results name no panel that could be drawn")
    columns = max(map(len, rows))
    width = layout.width or columns * layout.panel_width(columns)
    heights = [aspect * width / columns for aspect in _aspects(rows)]
    fig = PanelFigure(layout="constrained")  # which colour bars are to know beforehand
    drawn, lines = _draw(fig, rows, heights, _Titles(cases if len(cases) > 1 else [], rows, width))
    fig.panels = tuple(one.ax for one in drawn)
    legend, place = _legend_of(drawn), page.current().chosen.get("legend", "below")
    if legend.beside_slopes:
        for one in drawn:
            plots.write_slopes(one.ax)
    legend_rows = fitting.legend_rows(legend.entries, width) if place == "below" else []
    height = sum(heights) + layout.panel_line * (lines + len(legend_rows)) + layout.below
    _check_height(len(rows), height - sum(heights))
    beside = layout.names if legend.named and layout.width is None else 0.0
    within = len(legend.entries) if place == "inside" else 0
    least = len(rows) * layout.fair + height - sum(heights) + layout.panel_line * within
    style.dress(fig, width + beside, height, title, facts, least)
    _name_lines(drawn, legend)
    if legend_rows:
        fitting.write_legend(fig, legend_rows)
    if place == "inside" and legend.entries:
        _write_inside(drawn, legend.entries)
    return fig


def _draw(
    fig: Figure, rows: Sequence[Sequence[plots.Plot | None]], heights: Sequence[float], titles: "_Titles"
) -> tuple[list[_Drawn], int]:
    """Draw all panels with their titles; returns them, and the number of lines above the rows together."""
    grid = fig.add_gridspec(len(rows), max(map(len, rows)), height_ratios=heights)
    drawn, lines = [], 0
    for i, row in enumerate(rows):
        above = [1]
        for j, plot in enumerate(row):
            if plot is None:
                continue
            ax = fig.add_subplot(grid[i, j], projection=plot.projection)
            drawn.append(_Drawn(ax, *plot.as_chosen().draw(ax)))
            above.append(titles.write(ax, plot))
            if plot.shared and j:
                ax.set_ylabel("")
                ax.tick_params(labelleft=False)
        lines += max(above)
    return drawn, lines


def _legend_of(drawn: Sequence[_Drawn]) -> _Legend:
    """Legend of some panels; of many entries those of reference lines leave first, then those of schemes."""
    ends, layout = [one.ends for one in drawn], page.current().layout
    schemes = {end.label for of_lines in ends for end in of_lines}
    handles = _merged([entry for one in drawn for entry in one.entries], schemes)
    explained = len(_with_notes([], ends))  # what is added to the legend
    room = layout.width or layout.names_from
    if len(handles) + explained <= layout.entries or room < layout.names_from:
        return _Legend(_with_notes(handles, ends), named=False, beside_slopes=False)
    fewer = [(handle, text) for handle, text in handles if not text.startswith(plots.SLOPE)]
    if len(fewer) + explained <= layout.entries:
        return _Legend(_with_notes(fewer, ends), named=False, beside_slopes=True)
    return _Legend([entry for entry in handles if entry[1] not in schemes], named=True, beside_slopes=False)


def _check_height(rows: int, around: float) -> None:
    """Raise ValueError if a figure of a given height has no room for its rows of panels, even without a title."""
    layout = page.current().layout
    least = rows * layout.lowest + around
    if layout.height is not None and layout.height < least:
        panels = "its panels" if rows == 1 else f"{rows} rows of panels"
        raise ValueError(f"height: is {layout.height:.3g} inches; {panels} need at least {least:.1f}")


def _name_lines(drawn: Sequence[_Drawn], legend: _Legend) -> None:
    """Write the names of lines that the legend does not show, and their notes, at their ends."""
    looks = {(text, str(getattr(handle, "get_color", str)())) for handle, text in legend.entries}
    lacking = {(end.label, end.colour) for one in drawn for end in one.ends} - looks
    unnamed = lacking if legend.named or len(drawn) > 1 else set()
    for one in sorted(drawn, key=lambda one: -len(one.ends)):
        plots.write_ends(one.ax, one.ends, unnamed, noted=len(drawn) > 1 or legend.named)
        unnamed = unnamed - {(end.label, end.colour) for end in one.ends}


def _write_inside(drawn: Sequence[_Drawn], entries: Sequence[plots.LegendEntry]) -> None:
    """Write a legend into the first panel that has lines; ``fitting.settle`` finds its place, or moves it below."""
    ax = next((one.ax for one in drawn if one.ends), drawn[0].ax)
    handles, texts = zip(*entries, strict=True)
    look: dict[str, Any] = {"frameon": True, "framealpha": 0.85, "edgecolor": "none"}
    legend = ax.legend(handles, texts, loc="upper left", handlelength=page.current().layout.handle, **look)
    legend.set_in_layout(False)
    legend.set_zorder(6)


def _rows(cases: Sequence[list[list[plots.Plot]]]) -> Sequence[Sequence[plots.Plot | None]]:
    """Panels of all cases in rows, at most as high together as a figure may be."""
    count = sum(len(group) for groups in cases for group in groups)
    layout, most = page.current().layout, page.current().columns()
    if layout.width is not None:
        return _in_rows(cases, most)
    each = (_in_rows(cases, number) for number in range(most, max(most, count) + 1))
    return next((rows for rows in each if not rows or _shape(rows) <= layout.tall), [])


def _aspects(rows: Sequence[Sequence[plots.Plot | None]]) -> list[float]:
    """Height over width of the panels of each row; all are lower where rows of fields would make it too high."""
    drawn = [[plot for plot in row if plot] for row in rows]
    whole = [max(plot.aspect for plot in row) for row in drawn]
    curves = [all(plot.series for plot in row) for row in drawn]
    fields = any(plot.shared and not plot.series for plot in chain.from_iterable(drawn))
    layout = page.current().layout
    if not fields or sum(whole) <= layout.tall * max(map(len, rows)):
        return whole
    return [min(aspect, layout.flat if low else layout.low) for aspect, low in zip(whole, curves, strict=True)]


def _in_rows(cases: Sequence[list[list[plots.Plot]]], most: int) -> Sequence[Sequence[plots.Plot | None]]:
    """Panels of all cases, at most `most` in a row; each case begins one, unless cases are few panels."""
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
    """Rows of all cases, short ones of neighbouring cases joined."""
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
    layout = page.current().layout
    full = len(everything) > layout.full * len(rows) * max(map(len, rows))
    return rows if full and _shape(rows) <= layout.tall else _even(everything, most, wide)


def _even(plots: Sequence[plots.Plot], most: int, wide: bool = False) -> list[list[plots.Plot]]:
    """Panels in rows of about the same length, at most `most` long."""
    wanted = most if wide else {4: 2, 5: 3, 6: 3, 9: 3}.get(len(plots), most)
    columns = max(1, math.ceil(len(plots) / max(1, math.ceil(len(plots) / min(wanted, most)))))
    return [list(plots[i : i + columns]) for i in range(0, len(plots), columns)]


class _Titles:
    """Titles of panels: a letter where there are several, and the heading of each case above its first one."""

    def __init__(self, cases: Sequence[Case], rows: Sequence[Sequence[plots.Plot | None]], width: float) -> None:
        self.headings = {id(groups[0][0]): heading for heading, groups in cases if groups}
        self.letters = cycle(ascii_lowercase) if sum(map(len, rows)) > 1 else None
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
        layout = page.current().layout
        pad = layout.panel_pad if ax.axison else layout.bare_pad
        label, room = ax.get_ylabel(), plot.aspect * self.width - layout.around
        is_long = style.inches(label, "axes.labelsize") > room
        above = _wrapped(
            heading, self.reach.get(id(plot), self.width) - layout.margin - (layout.wider if is_long else 0.0)
        )
        under = _wrapped(own, self.width - layout.margin) or [""]
        # empty lines make room for the heading, which may reach over other panels and so takes no part in the layout;
        # lines with formulas are higher
        higher = round(layout.higher * len(above))
        ax.set_title("\n".join([""] * higher + [letter + "\n".join(under)]), loc="left", pad=pad)
        size = page.points("axes.titlesize")
        rise = (pad + layout.heading_spacing * size * len(under)) / 72
        place: Any = ax.transAxes + ScaledTranslation(0, rise, ax.figure.dpi_scale_trans)
        draw: Any = ax.text2D if ax.name == "3d" else ax.text  # type: ignore[attr-defined]
        if above:
            draw(0, 1, "\n".join(above), transform=place, va="bottom", fontsize=size, in_layout=False)
        if is_long:
            ax.set_ylabel(label.replace("  ", "\n"))
        return higher + len(under)


def _wrapped(texts: Sequence[str], width: float) -> list[str]:
    """Texts in lines as wide as a panel, long ones broken."""
    font = FontProperties(size=page.points("axes.titlesize"))
    lines = style.wrapped(texts, ",  ", "axes.titlesize", width)
    return [part for line in lines for part in fitting.broken(line, font, page.current().layout.fill * width)]


def _with_notes(entries: list[plots.LegendEntry], ends: Sequence[Sequence[plots.End]]) -> list[plots.LegendEntry]:
    """Entries of a single panel with the notes of its lines; of several an explanation of the numbers there."""
    if len(ends) == 1:
        notes = {end.label: f"{text}: {end.note}" for end in ends[0] if end.note for text in [end.label]}
        return [(handle, notes.get(text, text)) for handle, text in entries]
    if any(end.note.startswith("order ") for of_lines in ends for end in of_lines):
        entries.append((Line2D([], [], linestyle="none"), "numbers at lines: fitted orders"))
    return entries


def _merged(entries: Sequence[plots.LegendEntry], schemes: set[str]) -> list[plots.LegendEntry]:
    """Entries of all panels, each text once: schemes, other lines, marks."""
    by_text = {text: handle for handle, text in reversed(entries)}
    texts = dict.fromkeys(text for _, text in entries)
    both = {text for text in texts if any(other.endswith(f", or {text}") for other in texts)}  # of two kinds of panels
    merged = [(by_text[text], text) for text in texts if text not in both]
    dashes = {text: getattr(handle, "get_linestyle", lambda: "-")() for handle, text in merged}
    return sorted(merged, key=lambda entry: (entry[1] not in schemes, dashes[entry[1]] == "None"))
