"""What must hold of every figure at every size: no text lies on another, on a legend or on a panel, nor is it cut."""

from itertools import combinations
from unittest import mock

from matplotlib.backends.backend_agg import FigureCanvasAgg
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
    """The box of a text, without the empty line that keeps the title of a case above that of its first panel."""
    box = text.get_window_extent()
    lines = text.get_text().split("\n")
    spare = 0 if lines[-1].strip() else box.height / len(lines)
    return Bbox([[box.x0, box.y0 + spare], box.max])


def _name(text):
    return repr(text.get_text())


def _overlap(one: Bbox, other: Bbox, slack: float) -> bool:
    common = Bbox.intersection(one, other)
    return common is not None and common.width > slack and common.height > slack


def _within(box: Bbox, page: Bbox, slack: float) -> bool:
    return bool((box.min >= page.min - slack).all() and (box.max <= page.max + slack).all())
