"""What tests read off printed tables and figures."""

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex

from spi.drawing import page
from spi.report import views
from spi.schemes import SCHEMES as ROWS

SCHEMES = ("euler_maruyama", "midpoint", "splitting")
GREEN = ROWS["splitting"].look[1].lower()


def edge(ax, marker):
    """The marks of one kind at the edges of a panel: (x, colour) each."""
    lines = [line for line in ax.lines if line.get_marker() == marker and len(line.get_xdata())]
    return sorted((float(x), to_hex(line.get_color())) for line in lines for x in line.get_xdata())


def texts(legend):
    return [text.get_text() for text in legend.get_texts() if text.get_text().strip()]


def legend_texts(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def legends(fig):
    return [texts(legend) for legend in [*fig.legends, *(one for area in fig.subfigs for one in area.legends)]]


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


def inches_of_panels(fig):
    """(width, height) of each panel once the figure is laid out."""
    fig.draw_without_rendering()
    boxes = [ax.get_window_extent().transformed(fig.dpi_scale_trans.inverted()) for ax in fig.axes]
    return [(box.width, box.height) for box in boxes]
