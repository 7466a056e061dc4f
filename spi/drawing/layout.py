"""Lines of panels one under the other, each line with a title and a legend of its own."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure, FigureBase, SubFigure
from matplotlib.lines import Line2D
from matplotlib.markers import CARETDOWN, CARETUP

from spi.storage.stored import Description

from ..statistics.claims import FAILED, INCONCLUSIVE, PASSED, VERDICTS, Verdict
from . import page, style
from .axes import LEAST, legend_line

# ---------------------------------------------------------------------------------------------------------------------
# The verdicts on claims in a figure: a few small lines under its panels.
# ---------------------------------------------------------------------------------------------------------------------

_WORDS = {PASSED: "Claims passed", INCONCLUSIVE: "Claims inconclusive", FAILED: "Claims failed"}
_COLOURS = {PASSED: "#444444", INCONCLUSIVE: "#8a6d00", FAILED: "#c00000"}


def write_under(fig: Figure, verdicts: Sequence[Verdict]) -> None:
    """Write under a figure which claims passed, are inconclusive or failed; nothing if there are none."""
    summaries = [(verdict, _summary(verdicts, verdict)) for verdict in VERDICTS]
    style.note_under(fig, ((f"{_WORDS[verdict]}: {text}.", _COLOURS[verdict]) for verdict, text in summaries if text))


def write_note(fig: Figure, text: str) -> None:
    """Write a warning about the results under a figure, in red; nothing if the text is empty."""
    style.note_under(fig, [(text, _COLOURS[FAILED])] * bool(text))


def _summary(verdicts: Iterable[Verdict], wanted: str) -> str:
    """``order 1/2 (splitting; midpoint), order 1 (AP splitting: 3 of 4)``: the claims with this verdict."""
    counts: dict[str, dict[str, list[bool]]] = {}
    for verdict in verdicts:
        label = replace(verdict.found.about, eps=None).label if verdict.found else verdict.claim.scheme
        counts.setdefault(verdict.claim.text, {}).setdefault(label, []).append(verdict.verdict == wanted)
    texts = []
    for claim, schemes in counts.items():
        whose = [
            label if all(hits) else f"{label}: {sum(hits)} of {len(hits)}"
            for label, hits in schemes.items()
            if any(hits)
        ]
        if whose:
            texts.append(f"{claim} ({'; '.join(whose)})")
    return ", ".join(texts)


Panel = Callable[[Axes], None]  #: draws on an axes
Entry = tuple[Artist, str]  #: of a legend, a handle and a text

NARROWEST = 5.0  # inches of a figure
SIDE_BY_SIDE = 3  # panels
PALEST = 0.62  # of white in the last of several shades
BLANK: Entry = Line2D([], [], linestyle="none"), " "  # fills a row of a legend


class Line(NamedTuple):
    """Panels side by side."""

    panels: Sequence[Panel]
    size: tuple[float, float]  #: inches of one panel, with its label and legend
    title: str = ""
    legend: Sequence[list[Entry]] = ()  #: under the panels: rows of entries
    least: float = LEAST  #: inches of the width of a panel in a paper
    shared: bool = False  #: whether all panels have the same vertical axis, so that it is named once


def arranged(title: str, lines: list[Line], facts: list[str]) -> Figure:
    """The figure of ``lines`` under a title and a line of facts."""
    if not lines:
        raise ValueError("the results name no panel that could be drawn")
    lines = [part for line in side_by_side(lines) for part in _parts(line)]
    width = page.current().width or max(NARROWEST, *(len(line.panels) * line.size[0] for line in lines))
    heights = [_height(line, width) for line in lines]
    fig = Figure()
    style.dress(fig, width, sum(heights), title, facts)
    areas = fig.subfigures(len(lines), 1, height_ratios=heights, squeeze=False).flat
    for area, line in zip(areas, lines, strict=True):
        _draw(area, line, width)
    return fig


def _parts(line: Line) -> list[Line]:
    """The lines into which a line is divided where the figure has a given width."""
    columns, size = page.current().panels(len(line.panels), line.size, line.least)
    if page.current().width is not None:
        facts = line.title.replace("\n", ",  ").split(",  ")
        line = line._replace(title="\n".join(style.wrapped(facts, ",  ", "axes.titlesize", columns * size[0])))
    starts = range(0, len(line.panels), columns)
    parts = [line._replace(panels=line.panels[i : i + columns], size=size) for i in starts]
    return [
        part._replace(title=line.title if part is parts[0] else "", legend=line.legend if part is parts[-1] else ())
        for part in parts
    ]


def of_cases(
    title: str,
    cases: Sequence[Sequence[Any]],
    facts_of: Callable[[Any], dict[str, str]],
    lines_of: Callable[[Any, style.Looks], list[Line]],
) -> Figure:
    """The figure of the readings of each case in lines of its own, titled where there are several cases.

    `facts_of` a reading stand above, those that all cases share once for all.
    """
    looks = style.looks(cases)
    shared, own = style.split_facts([facts_of(readings[0]) for readings in cases])
    lines = []
    for readings, facts in zip(cases, own, strict=True):
        case_lines = lines_of(readings, looks)
        if case_lines and len(cases) > 1:
            width = len(case_lines[0].panels) * case_lines[0].size[0]
            case_lines[0] = case_lines[0]._replace(title=case_title(readings[0].about, facts, width))
        lines += case_lines
    return arranged(title, lines, shared)


def even(count: int, most: int) -> int:
    """The number of panels side by side, at most `most`, that divides `count` panels evenly among lines."""
    return math.ceil(count / max(1, math.ceil(count / most)))


def in_lines(panels: Sequence[Panel], columns: int, size: tuple[float, float], **more: Any) -> list[Line]:
    """Panels in lines of `columns` each; `more` are fields of each line."""
    return [Line(panels[i : i + columns], size, **more) for i in range(0, len(panels), max(1, columns))]


def check_panels(words: Iterable[str], allowed: Iterable[str]) -> None:
    """Raise ValueError if one of the words is not the name of an `allowed` panel."""
    for word in words:
        if word not in allowed:
            raise ValueError(f"{word!r} is not a known panel; known panels: {', '.join(allowed)}")


def side_by_side(lines: list[Line]) -> list[Line]:
    """Lines of one panel each, if there are several, in fewer lines, their titles above the panels."""
    if len(lines) == 1 or any(len(line.panels) != 1 for line in lines):
        return lines
    columns = 2 if len(lines) == 4 else min(len(lines), SIDE_BY_SIDE)
    size = tuple(np.max([line.size for line in lines], axis=0).tolist())
    panels = [partial(_titled, panel=line.panels[0], title=line.title, room=size[0] - 0.4) for line in lines]
    parts = [panels[i : i + columns] for i in range(0, len(lines), columns)]
    return [Line(part, size, legend=lines[-1].legend if part is parts[-1] else ()) for part in parts]


def _titled(ax: Axes, panel: Panel, title: str, room: float) -> None:
    panel(ax)
    titles = [line for line in [*title.split("\n"), ax.get_title()] if line]
    ax.set_title(
        "\n".join(part for line in titles for part in style.wrapped(line.split(",  "), ",  ", "axes.titlesize", room))
    )


def _rows(legend: Sequence[list[Entry]], width: float) -> list[list[Entry]]:
    """The rows of the legend, broken into shorter ones as far as the width demands, all filled up to one length."""
    for most in range(max(map(len, legend)), 0, -1):
        rows = [part for row in legend for part in _broken(row, most)]
        longest = max(map(len, rows))
        rows = [[*row, *[BLANK] * (longest - len(row))] for row in rows]
        columns = [
            max(style.inches(text, "legend.fontsize") for _, text in column) for column in zip(*rows, strict=True)
        ]
        if sum(columns) + 0.65 * longest < width - 0.2:
            break
    return rows


def _broken(row: list[Entry], most: int) -> list[list[Entry]]:
    columns = even(len(row), most)
    return [row[i : i + columns] for i in range(0, len(row), columns)]


def _height(line: Line, width: float) -> float:
    titles = len(line.title.split("\n")) if line.title else 0
    legend = 0.12 + legend_line() * len(_rows(line.legend, width)) if line.legend else 0.0
    return line.size[1] + 0.2 * titles + legend


def _draw(area: SubFigure, line: Line, width: float) -> None:
    own = len(line.panels) * line.size[0]
    inner = area
    if own < width:
        spare = (width - own) / 2
        inner = area.subfigures(1, 3, width_ratios=[spare, own, spare], squeeze=False)[0, 1]
    axes = list(inner.subplots(1, len(line.panels), squeeze=False).flat)
    for panel, ax in zip(line.panels, axes, strict=True):
        panel(ax)
    if line.shared:
        for ax in [ax for ax in axes if ax.axison][1:]:
            ax.set_ylabel("")
            ax.tick_params(labelleft=False)
    if line.title:
        size = page.points("axes.titlesize")
        area.suptitle(line.title, x=0.015, ha="left", fontsize=size, fontweight="bold")
    if line.legend:
        _legend_under(area, _rows(line.legend, width))


def legend_under_all(fig: Figure, entries: list[Entry], width: float) -> None:
    """A legend under all panels of a figure of some inches, in as many rows as it needs."""
    _legend_under(fig, _rows([entries], width))


def _legend_under(area: FigureBase, rows: Sequence[list[Entry]]) -> None:
    by_column = [entry for column in zip(*rows, strict=True) for entry in column]
    handles, texts = zip(*by_column, strict=True)
    look: dict[str, Any] = {"frameon": False, "handlelength": 2.4, "columnspacing": 1.6}
    area.legend(handles, texts, loc="outside lower center", ncols=len(rows[0]), **look)


def case_title(about: Description, facts: list[str], width: float) -> str:
    """The title of a case and its own facts, in lines as wide as its panels."""
    title = style.plain(about.case_title)
    return "\n".join(style.wrapped([title, *facts], ",  ", "axes.titlesize", width))


def shade(colour: str, i: int, count: int) -> str:
    """Number i of ``count`` shades of a colour, from itself to a pale one."""
    white = PALEST * i / max(count - 1, 1)
    red, green, blue = ((1 - white) * np.array(to_rgb(colour)) + white).tolist()
    return to_hex((red, green, blue))


def spread(count: int, most: int = 4) -> list[int]:
    """At most `most` of the numbers 0, ..., count - 1, among them the first and the last."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int)).tolist()


def edge_marks(ax: Axes, x: np.ndarray, y: np.ndarray, colour: str) -> None:
    """Mark values above the panel, or NaN, at its upper edge, and values below it, hollow, at its lower edge."""
    bottom, top = ax.get_ylim()
    look: dict[str, Any] = {"transform": ax.get_xaxis_transform(), "clip_on": False, "zorder": 4}
    look |= {"color": colour, "linestyle": "none"}
    above, below = ~(y <= top), y < bottom
    if above.any():
        ax.plot(x[above], np.ones(above.sum()), marker=CARETUP, **look)
    if below.any():
        ax.plot(x[below], np.zeros(below.sum()), marker=CARETDOWN, markerfacecolor="none", **look)


def scheme_entry(about: Description, looks: style.Looks, more: str = "", **look: Any) -> Entry:
    """An entry of a legend: a scheme, followed by the text `more`."""
    marker, colour = looks[about.variant]
    return Line2D([], [], color=colour, marker=marker, **look), style.label(about) + more


def mark(marker: str, text: str, **look: Any) -> Entry:
    """An entry of a legend: a black mark and what it means."""
    return Line2D([], [], marker=marker, linestyle="none", color="black", **look), text


def unresolved(marker: str) -> dict[str, Any]:
    """The look of a point that sampling does not resolve: hollow, or pale where its marker, a cross, has no face."""
    return {"markerfacecolor": "none"} if marker in Line2D.filled_markers else {"alpha": 0.4}


def points(
    ax: Axes, x: np.ndarray, values: np.ndarray, half: np.ndarray, poor: np.ndarray, look: dict[str, Any]
) -> None:
    """Points within the panel, hollow where they are poor, with bars that end at its lower edge; no bar for NaN."""
    bottom, top = ax.get_ylim()
    inside = (values >= bottom) & (values <= top)
    for chosen, fill in ((inside & ~poor, {}), (inside & poor, unresolved(look["marker"]))):
        if chosen.any():
            up = np.where(np.isfinite(half), half, 0.0)[chosen]
            bars = np.array([np.minimum(up, values[chosen] - bottom), up])
            ax.errorbar(x[chosen], values[chosen], bars, linestyle="none", elinewidth=0.8, zorder=3, **look | fill)


def zero_mark() -> Entry:
    """The entry of a legend for unresolved points of a difference."""
    return mark("o", "hollow, or pale crosses: zero within 2 standard errors", markerfacecolor="none")


def empty(ax: Axes, text: str) -> None:
    """An empty panel, with the reason."""
    ax.set_axis_off()
    ax.text(0.5, 0.5, text, transform=ax.transAxes, ha="center", va="center", color="#777777")
