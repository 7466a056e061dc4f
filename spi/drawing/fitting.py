"""The texts of a figure fitted into the room they have, and the height that panels in a column of a paper need."""

import re
from collections.abc import Sequence
from itertools import combinations, pairwise, product
from operator import itemgetter
from typing import Any
from weakref import WeakSet

import numpy as np
from matplotlib import ticker
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text

from . import page, plots, style

_BREAKS = re.compile(r"(?<=,\\,)|(?= [+-] )")  # within a formula: behind a comma, before a sign

_CORNERS: Any = ("upper left", "upper right", "lower right", "lower left", "upper center", "lower center")  # of legends
_ROOM, _MOST_ROOM = 0.04, 0.6  # shares of the height of a panel: beside its legend, and for that at most

_ROUNDS = 4  # of changes of the height, of which each moves all panels a little
_EXACT = 0.03  # inches of the height

_SETTLED: WeakSet[Figure] = WeakSet()  #: figures whose panels have their places for good


def settle(fig: Figure) -> None:
    """Give all panels their places, and break titles that are too long there.

    In a figure of a given width also break other long texts and leave out labels of ticks; in a paper choose the
    height.
    """
    engine = fig.get_layout_engine()
    if engine is None or fig in _SETTLED:
        return
    engine.execute(fig)
    for ax in fig.axes:
        _break_titles(ax)
    if _free_legends(fig):
        engine.execute(fig)
    if page.current().layout.width is None:
        return
    _break_legends(fig)
    engine.execute(fig)
    for ax in fig.axes:
        _break_labels(ax)
    for _ in range(_ROUNDS):
        engine.execute(fig)
        for ax in fig.axes:
            _break_titles(ax)  # again, since panels move when the labels beside them change
        if not page.current().is_paper or not _fit_height(fig):
            break
    for ax in fig.axes:
        for axis in (ax.xaxis, ax.yaxis):
            _thin(axis)
    engine.execute(fig)
    if _free_legends(fig):
        engine.execute(fig)
        if page.current().is_paper and _fit_height(fig):
            engine.execute(fig)
    for ax in fig.axes:
        plots.part_ends(ax)
    _SETTLED.add(fig)


def _place(ax: Axes) -> tuple[float, float]:
    """Left and the right end, in pixels, of the part of the figure that is the panel's with all its texts."""
    width, place = ax.figure.bbox.width, ax.get_subplotspec()
    if place is None:
        return 0.0, width
    columns = place.get_gridspec().ncols
    return width * place.colspan.start / columns, width * place.colspan.stop / columns


def _break_titles(ax: Axes) -> None:
    left, right = _place(ax)
    box = ax.get_window_extent()
    for title in (child for child in ax.get_children() if isinstance(child, Text) and child not in ax.texts):
        centred = title.get_horizontalalignment() == "center"
        middle = (box.x0 + box.x1) / 2
        room = 2 * min(middle - left, right - middle) if centred else right - box.x0
        _break(title, room)


def _break_legends(fig: Figure) -> None:
    """Break the entries of a legend that is wider than the figure."""
    for legend in fig.legends:
        texts = legend.get_texts()
        beside = legend.get_window_extent().width - max(text.get_window_extent().width for text in texts)
        for text in texts:
            _break(text, page.current().layout.legend_fill * fig.bbox.width - beside)


def _break_labels(ax: Axes) -> None:
    """Break labels; in a figure of a given height words without their formula stand where both have no room."""
    left, right = _place(ax)
    label, whole, room = ax.yaxis.label, ax.yaxis.label.get_text(), ax.get_window_extent().height
    _break(ax.xaxis.label, right - left)
    _break(label, room)
    if page.current().layout.height is not None and label.get_window_extent().height > room:
        label.set_text(re.split(r"\n|  ", whole)[0])
        _break(label, room)


def _free_legends(fig: Figure) -> bool:
    """Move legends within panels to where they cover no line, else no results, else above these.

    One that has no room there moves below the figure; returns whether one did.
    """
    moved = False
    for ax in fig.axes:
        legend = ax.get_legend()
        if legend is None:
            continue
        results = [line for line in ax.lines if not str(line.get_label()).startswith(plots.SLOPE)]
        for lines, place in product((ax.lines, results), _CORNERS):
            legend.set_loc(place)
            box = legend.get_window_extent()
            paths = (line.get_transform().transform_path(line.get_path()) for line in lines)
            if not any(path.intersects_bbox(box, filled=False) for path in paths):
                break
        else:
            room = ax.get_window_extent()
            share = box.height / room.height + _ROOM
            if share < _MOST_ROOM and box.width < room.width and "ylim" not in page.current().chosen:
                legend.set_loc(_CORNERS[0])
                _raise_top(ax, share)
            else:
                texts = [text.get_text() for text in legend.get_texts()]
                entries: Any = list(zip(legend.legend_handles, texts, strict=True))
                legend.remove()
                write_legend(fig, legend_rows(entries, float(fig.get_size_inches()[0])))
                moved = True
    return moved


def _raise_top(ax: Axes, share: float) -> None:
    """Give a panel a share of its height above what it shows."""
    scale = ax.yaxis.get_transform()
    low, high = scale.transform(np.array(ax.get_ylim()))
    ax.set_ylim(top=float(scale.inverted().transform(low + (high - low) / (1.0 - share))))
    plots.part_ends(ax)


def legend_rows(entries: Sequence[plots.LegendEntry], width: float) -> list[list[plots.LegendEntry]]:
    """Entries in as few rows as a figure of some inches has room for, all filled up to one length."""
    if not entries:
        return []
    layout = page.current().layout
    blank: plots.LegendEntry = Line2D([], [], linestyle="none"), " "
    for columns in range(len(entries), 0, -1):
        rows = [list(entries[i : i + columns]) for i in range(0, len(entries), columns)]
        rows[-1] += [blank] * (columns - len(rows[-1]))
        widths = [
            max(style.inches(text, "legend.fontsize") for _, text in column) for column in zip(*rows, strict=True)
        ]
        if sum(widths) + (layout.beside + layout.gap) * columns < width - layout.side:
            break
    return rows


def write_legend(fig: Figure, rows: Sequence[Sequence[plots.LegendEntry]]) -> None:
    """Write a legend below all panels."""
    layout = page.current().layout
    artists, texts = zip(*(entry for column in zip(*rows, strict=True) for entry in column), strict=True)
    look: dict[str, Any] = {"frameon": False, "handlelength": layout.handle, "columnspacing": layout.between}
    fig.legend(artists, texts, loc="outside lower center", ncols=len(rows[0]), **look)


def _break(text: Text, room: float) -> None:
    """Break the lines of a text that are longer than `room` pixels where there are spaces."""
    font, lines = text.get_fontproperties(), text.get_text().split("\n")
    text.set_text("\n".join(part for line in lines for part in broken(line, font, room / text.figure.dpi)))


def broken(line: str, font: Any, room: float) -> Sequence[str]:
    """The parts of a line, each no longer than `room` inches unless it is one word."""

    def fits(part: str) -> bool:
        return page.inches_of(part.rstrip(), font) <= room

    if fits(line):
        return [line]
    parts = [""]
    for word in style.WORD.findall(line):
        for part in [word] if fits(word) else _parts(word):
            if parts[-1] and not fits(parts[-1] + part):
                parts.append("")
            parts[-1] += part
    return [part.rstrip() for part in parts]


def _parts(word: str) -> list[str]:
    """A formula that is too long for a line, in formulas; other words as they are."""
    formula = re.fullmatch(r"\$([^$]*)\$(\W*)", word)
    if not formula:
        return [word]
    parts = [""]
    for piece in _BREAKS.split(formula[1]):
        if parts[-1].count("{") == parts[-1].count("}") and parts[-1]:
            parts.append("")
        parts[-1] += piece
    return [*(f"${part}$" for part in parts[:-1]), f"${parts[-1]}${formula[2]}"]


def _fit_height(fig: Figure) -> bool:
    """Give every row of panels the height that it should have; returns whether that changed anything."""
    if page.current().layout.height is not None:
        return False
    rows: dict[int, list[Axes]] = {}
    grid: Any = None
    for ax in fig.axes:
        if (place := ax.get_subplotspec()) is not None:
            rows.setdefault(place.rowspan.start, []).append(ax)
            grid = place.get_gridspec()
    have = [max(_size(ax)[1] for ax in rows[n]) for n in sorted(rows)]
    want = [max(map(_wanted, rows[n])) for n in sorted(rows)]
    if abs(lacking := sum(want) - sum(have)) < _EXACT:
        return False
    grid.set_height_ratios(want)
    width, height = fig.get_size_inches()
    fig.set_size_inches(width, height + lacking)
    return True


def _size(ax: Axes) -> tuple[float, float]:
    """Inches of the place of a panel, which one that has a shape of its own need not fill."""
    box, area = ax.get_position(original=True), ax.figure.bbox
    return box.width * area.width / ax.figure.dpi, box.height * area.height / ax.figure.dpi


def _wanted(ax: Axes) -> float:
    """Inches of height that suit a panel."""
    width, _ = _size(ax)
    if ax.name == "3d":
        return width
    if ax.get_aspect() != "auto":
        ax.apply_aspect()
        box = ax.get_window_extent()
        return width * box.height / box.width
    label = ax.yaxis.label.get_window_extent().height / ax.figure.dpi if ax.get_ylabel() else 0.0
    layout = page.current().layout
    return max(min(layout.paper_shape * width, layout.tallest), label)


def _thin(axis: Any) -> None:
    """Leave out every other label of the ticks of an axis until none touches the next."""
    while len(shown := _labels(axis)) > 1 and _touch(axis, [label for _, label in shown]):
        places = [place for place, _ in shown][::2]
        if isinstance(axis.get_major_formatter(), ticker.FixedFormatter):
            axis.set_ticks(places, labels=[label.get_text() for _, label in shown][::2])
        else:
            axis.set_major_locator(ticker.FixedLocator(places))
        axis.set_minor_formatter(ticker.NullFormatter())


def _labels(axis: Any) -> list[tuple[float, Text]]:
    """Places and labels of the ticks that can be seen, in order."""
    low, high = sorted(axis.get_view_interval())
    axis.get_tightbbox()  # which brings the ticks up to date
    ticks = [*axis.get_major_ticks(), *axis.get_minor_ticks()]
    shown = [(float(tick.get_loc()), tick.label1) for tick in ticks if low <= tick.get_loc() <= high]
    visible = (entry for entry in shown if entry[1].get_visible() and entry[1].get_text())
    return sorted(visible, key=itemgetter(0))


def _touch(axis: Any, labels: list[Text]) -> bool:
    gap = page.current().layout.tick_gap / 72 * axis.figure.dpi
    boxes = [label.get_window_extent() for label in labels]
    if axis.axis_name == "x":
        pairs = combinations(sorted(boxes, key=lambda box: box.x0), 2)
        return any(one.x1 + gap > other.x0 and one.y0 < other.y1 and other.y0 < one.y1 for one, other in pairs)
    return any(one.y1 > other.y0 for one, other in pairwise(sorted(boxes, key=lambda box: box.y0)))
