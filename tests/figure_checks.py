"""What must hold of every figure at every size: no text lies on another, on a legend or on a panel, nor is it cut."""

from itertools import combinations
from unittest import mock

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgba
from matplotlib.legend import Legend
from matplotlib.text import Text
from matplotlib.transforms import Bbox

_SLACK = 1.0  # points, by which two boxes may overlap: they are a little larger than the ink in them


def collisions(fig):
    """What lies on what in a figure, and what is cut off at its edge: a list of sentences, empty if all is well."""
    drawn = _drawn(fig)
    slack = _SLACK * fig.dpi / 72
    inside = {text for ax in fig.findobj(lambda artist: hasattr(artist, "get_xlim")) for text in ax.texts}
    legends = [legend for legend in fig.findobj(Legend) if legend.get_visible()]
    of_legend = {text: legend for legend in legends for text in legend.findobj(Text)}
    boxes = {text: _box(text) for text in drawn}
    found = [f"{_name(a)} lies on {_name(b)}" for a, b in combinations(drawn, 2) if _overlap(boxes[a], boxes[b], slack)]
    page = fig.bbox
    found += [f"{_name(text)} is cut off" for text, box in boxes.items() if not _within(box, page, slack)]
    areas = [
        (f"the legend of {_name(legend.get_texts()[0])}", legend, legend.get_window_extent()) for legend in legends
    ]
    for what, legend, box in areas:
        found += [] if _within(box, page, slack) else [f"{what} is cut off"]
        others = [text for text in drawn if of_legend.get(text) is not legend]
        found += [f"{_name(text)} lies on {what}" for text in others if _overlap(boxes[text], box, slack)]
    panels = [ax for ax in fig.axes if ax.axison and ax.name != "3d"]
    for number, ax in enumerate(panels):
        box = ax.get_window_extent()
        found += [f"{what} lies on panel {number}" for what, _, other in areas if _overlap(other, box, slack)]
        outer = [text for text in drawn if text not in inside]
        found += [f"{_name(text)} lies on panel {number}" for text in outer if _overlap(boxes[text], box, slack)]
    return found


def _drawn(fig):
    """The texts that a figure really draws, at their places: not all that it knows are visible."""
    drawn = {}
    draw = Text.draw

    def noticed(self, renderer, *args, **kwargs):
        if self.get_visible() and self.get_text().strip():
            drawn[self] = None
        return draw(self, renderer, *args, **kwargs)

    with mock.patch.object(Text, "draw", noticed):
        FigureCanvasAgg(fig).draw()
    return list(drawn)


def _box(text):
    """The box of a text, without the empty lines that make room for the heading of a case above it."""
    box = text.get_window_extent()
    lines = text.get_text().split("\n")
    spare = next(i for i, line in enumerate(lines) if line.strip()) * box.height / len(lines)
    return Bbox([box.min, [box.x1, box.y1 - spare]])


def _name(text):
    return repr(text.get_text())


def _overlap(one: Bbox, other: Bbox, slack: float) -> bool:
    common = Bbox.intersection(one, other)
    return common is not None and common.width > slack and common.height > slack


def _within(box: Bbox, page: Bbox, slack: float) -> bool:
    return bool((box.min >= page.min - slack).all() and (box.max <= page.max + slack).all())


_APART = 8.0  # of lightness, from 0 to 100, by which shades of one scheme differ


def lightness(colours):
    """L* of CIELAB, from 0 (black) to 100 (white), of rgba colours (n, 4)."""
    rgb = np.asarray(colours)[:, :3]
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    y = linear @ [0.2126, 0.7152, 0.0722]
    return np.where(y > 216 / 24389, 116 * np.cbrt(y) - 16, 24389 / 27 * y)


def alike_without_colours(fig):
    """The pairs of curves in a panel that only a person who sees colours can tell apart: texts, none if all is well."""
    found = []
    for ax in fig.findobj(lambda artist: hasattr(artist, "get_xlim")):
        named = [line for line in ax.lines if line.get_label() and not line.get_label().startswith("_")]
        for a, b in combinations(named, 2):
            shades = lightness([to_rgba(a.get_color()), to_rgba(b.get_color())])
            if _shape(a) == _shape(b) and a.get_color() != b.get_color() and abs(np.diff(shades)[0]) < _APART:
                found.append(f"{a.get_label()!r} and {b.get_label()!r}")
    return found


def _shape(line):
    hollow = to_rgba(line.get_markerfacecolor())[3] == 0
    return line.get_marker(), line.get_markersize(), line.get_linestyle(), hollow
