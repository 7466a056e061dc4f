"""What tests read off printed tables and figures."""

import re

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex

from spi import views
from spi.drawing import page

SCHEMES = ("euler_maruyama", "midpoint", "splitting")


def edge(ax, marker):
    """The marks of one kind at the edges of a panel: (x, colour) each."""
    lines = [line for line in ax.lines if line.get_marker() == marker and len(line.get_xdata())]
    return sorted((float(x), to_hex(line.get_color())) for line in lines for x in line.get_xdata())


def texts(legend):
    return [text.get_text() for text in legend.get_texts() if text.get_text().strip()]


def legend_texts(fig):
    """The entries of the one legend of a figure, row by row."""
    (legend,) = fig.legends
    columns = np.array([text.get_text() for text in legend.get_texts()]).reshape(legend._ncols, -1)
    return [text for text in columns.T.ravel().tolist() if text.strip()]


def title(ax):
    """The title of a panel without its letter."""
    return re.sub(r"^\(\w\)  ", "", ax.get_title("left").lstrip("\n"))


def heading(ax):
    """The heading of a case above a panel; empty if there is none."""
    return "".join(text.get_text() for text in ax.texts if not text.get_in_layout())


def line_of(ax, label):
    """The line of a panel with a label."""
    (line,) = (line for line in ax.lines if line.get_label() == label)
    return line


def points_of(ax, label):
    """(x, y) of the points of a line that are drawn."""
    x, y = line_of(ax, label).get_data()
    return np.array([x, y])[:, np.isfinite(y)].T


def bars_of(ax, label):
    """(x, low, high) of the bars in the colour of a line."""
    colour = to_hex(line_of(ax, label).get_color())
    found = [
        (segment[0, 0], segment[:, 1].min(), segment[:, 1].max())
        for lines in ax.collections
        if hasattr(lines, "get_segments") and len(lines.get_segments()) and to_hex(lines.get_color()[0]) == colour
        for segment in lines.get_segments()
    ]
    return np.array(sorted(found)).T


def lines_of(text, scheme):
    """The cells of the lines of a scheme in a printed table."""
    lines = text.splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith(scheme))
    block = [lines[start].removeprefix(scheme)]
    for line in lines[start + 1 :]:
        if not line.strip():
            return [one.split() for one in block]
        block.append(line)


def save(results, folder, stem):
    return views.save(views.figure(results), folder, stem)


def rendered(fig):
    """The figure, drawn to the last pixel as a file of it would be, which takes twice as long to write."""
    with page.applied():
        FigureCanvasAgg(fig).draw()
    return fig
