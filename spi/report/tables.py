"""What a kind of experiment prints, as plain tables and lines of text, from which HTML and LaTeX are made."""

import io
import re
from typing import Any, NamedTuple

from rich.console import Console
from rich.table import Table
from rich.text import Text


class Cell(NamedTuple):
    """One cell of a table."""

    text: str
    mark: str = ""  #: "bad" of what stands out in red, "dim" of what counts for little, "bold"


class Row(NamedTuple):
    """One row of a table."""

    cells: tuple[Cell, ...]
    ends_section: bool = False  #: whether a rule follows


class PlainTable(NamedTuple):
    """A table without any look."""

    title: str
    headings: tuple[str, ...]
    left: tuple[bool, ...]  #: which columns are left-justified
    rows: tuple[Row, ...]


class Line(NamedTuple):
    """A line of text between tables."""

    text: str
    mark: str = ""  #: as that of a cell


class Recorder(Console):
    """A console that keeps what is printed to it."""

    def __init__(self) -> None:
        super().__init__(file=io.StringIO(), width=10_000, color_system=None, highlight=False)
        self.items: list[PlainTable | Line] = []

    def print(self, *objects: Any, style: Any = None, **options: Any) -> None:
        """Keep tables as such and all else as lines; empty lines are dropped."""
        for one in objects:
            self.items.append(self._table(one) if isinstance(one, Table) else Line(str(one), _mark(style)))

    def _table(self, table: Table) -> PlainTable:
        """A table without the columns that are empty, heading and all."""
        every = [([self._cell(cell) for cell in column.cells], column) for column in table.columns]
        kept = [(cells, column) for cells, column in every if str(column.header) or any(cell.text for cell in cells)]
        rows = zip(zip(*(cells for cells, _ in kept), strict=True), table.rows, strict=True)
        return PlainTable(
            title=str(table.title or ""),
            headings=tuple(_unbroken(str(column.header)) for _, column in kept),
            left=tuple(column.justify == "left" for _, column in kept),
            rows=tuple(Row(cells, row.end_section) for cells, row in rows),
        )

    def _cell(self, content: Any) -> Cell:
        text = content if isinstance(content, Text) else self.render_str(str(content), highlight=False, emoji=False)
        return Cell(text.plain, _mark(text.style) if text.plain else "")


def _mark(style: Any) -> str:
    words = str(style or "").split()
    return "bad" if "red" in words else next((word for word in ("dim", "bold") if word in words), "")


def _unbroken(heading: str) -> str:
    """A heading without the breaks that make a column narrow on a terminal."""
    return re.sub(r"-\n(?=[a-z])", "", heading).replace("-\n", "-").replace("\n", " ")
