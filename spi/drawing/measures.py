"""Layout of figures: every width, margin, distance, height and size of letters, in one record."""

from typing import NamedTuple

#: Inches of a column, and of the two columns of a page, as in most journals (84 to 90 mm, 174 to 190 mm).
COLUMNS = {"one": 3.35, "two": 7.0}


class Layout(NamedTuple):
    """Measures of a figure, for a screen if not said otherwise; see :data:`PAPER`.

    Lengths are in inches and sizes of letters in points; a shape is a height over a width.
    """

    width: float | None = None  #: of the figure; None: as wide as its panels want to be
    height: float | None = None  #: of the figure; None: as high as its panels want to be

    # Films.
    film_large: float = 3.0  #: side of a field in a film of few
    film_small: float = 2.0  #: side of a field in a film of many
    film_few: int = 4  #: fields that are few
    film_left: float = 1.0  #: beside all fields, for the vertical axis and the colour bars
    film_bar: float = 0.8  #: more for each case
    film_row: float = 0.5  #: above and below a row of fields

    # Letters.
    text: float = 9.0  #: points of all that has no size of its own
    ticks: float = 9.0  #: points of numbers at axes
    title: float = 11.0  #: points of the title of a figure
    facts: float = 8.0  #: points of the parameters below it
    panel_title: float = 9.0  #: points of titles of panels
    label: float = 10.0  #: points of labels of axes
    legend: float = 8.0  #: points of entries of legends
    note: float = 0.85  #: letters of names and notes at lines, as a share of those of legends

    # Panels: their number side by side, and their widths.
    columns: int = 4  #: panels side by side, unless the figure would be too high
    widths: tuple[float, ...] = (5.0, 4.1, 3.6, 3.2)  #: of a panel that is alone in its row, one of two, of three, ...
    narrow: float = 2.8  #: of one of more
    least: float = 2.1  #: of a panel in a figure of a given width, where as many stand side by side as fit
    full: float = 0.75  #: share of the places in rows of groups that are to be filled

    # Panels: their shapes and heights.
    shape: float = 0.74  #: of a panel of curves, with its labels
    map_shape: float = 0.82  #: of a map over two parameters, with its labels
    tall: float = 1.25  #: shape of all panels at most, so that with titles it is 1.4
    flat: float = 0.6  #: shape of panels of curves in a figure with many rows of fields
    low: float = 0.88  #: shape of the panels of fields there
    paper_shape: float = 0.7  #: of the frame of a panel in a paper
    tallest: float = 2.9  #: height of the frame of a panel in a paper at most
    lowest: float = 0.8  #: height of a row of panels in a figure of a given height, at least
    fair: float = 1.3  #: height of a row below which the parameters, and then the title, go into the caption

    # Titles and labels.
    above: float = 0.1  #: above the title of a figure
    title_line: float = 0.22  #: height of a line of the title of a figure
    facts_above: float = 0.12  #: above the title and the parameters together
    facts_line: float = 0.18  #: height of a line of parameters
    heading: float = 0.16  #: above, between and below title and parameters
    heading_spacing: float = 1.3  #: distance of lines of titles and parameters, in their heights
    panel_line: float = 0.17  #: height of a line of titles of panels, and of a row of the legend
    panel_pad: float = 6.0  #: points between a panel and its title
    bare_pad: float = 15.0  #: points between a panel without axes and its title
    fill: float = 0.95  #: share of a line that is filled, as letters on pixels are wider than their outlines
    side: float = 0.2  #: to the left and right of lines of text
    around: float = 0.8  #: above and below the frame of a panel
    margin: float = 0.5  #: to the left of a panel, for its vertical axis
    wider: float = 0.6  #: more, where the label of that axis has two lines
    higher: float = 1.25  #: height of a line with formulas, in lines
    w_pad: float = 0.08  #: to the left and right of panels
    h_pad: float = 0.06  #: above and below panels
    below: float = 0.1  #: below the legend

    # Legends, names and notes.
    entries: int = 8  #: of a legend at most; lines are named at their ends where there are more schemes
    handle: float = 2.4  #: length of a line in the legend, in letters
    between: float = 1.6  #: distance of columns of the legend, in letters
    beside: float = 0.45  #: a handle of the legend and the room around it
    gap: float = 0.2  #: between columns of the legend
    legend_fill: float = 0.94  #: share of the width of a figure in a paper that its legend fills
    names: float = 1.6  #: for the names of lines at their ends
    names_from: float = 5.0  #: width of a figure that has room for names of lines
    names_place: float = 1.02  #: where names of lines stand, in widths of the panel
    names_spacing: float = 1.35  #: distance of names at the ends of lines, in their heights
    tick_gap: float = 2.0  #: points between two numbers at an axis
    ticks_most: int = 9  #: values of a parameter that are written at an axis
    map_ticks_most: int = 7  #: at an axis of a map
    bar_pad: float = 0.02  #: between a map and its colour bar, in widths of the panel

    def with_letters(self, size: float) -> "Layout":
        """Layout with text of some points; other letters and the heights of lines are in proportion."""
        factor = size / self.text
        return self._replace(**{name: factor * getattr(self, name) for name in _WITH_LETTERS})

    def panel_width(self, columns: int) -> float:
        """Width that a panel wants to have in a row of some."""
        return self.widths[columns - 1] if columns <= len(self.widths) else self.narrow


#: What grows with the letters.
_WITH_LETTERS = (
    *("text", "ticks", "title", "facts", "panel_title", "label", "legend", "title_line", "facts_line", "panel_line"),
    *("facts_above", "heading", "beside", "names", "margin", "around", "wider"),
)

SCREEN = Layout()

#: Of a figure in a column of a paper, without title and parameters, which are its caption.
PAPER = Layout(COLUMNS["one"], text=8.0, ticks=7.0, panel_title=8.0, label=8.0, legend=7.0, w_pad=0.03, h_pad=0.03)
