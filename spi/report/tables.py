"""What a kind of experiment prints, as tables of pandas and lines of text, from which HTML and LaTeX are made."""

import io
import re
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, NamedTuple

from markupsafe import Markup
from rich.console import Console
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:  # pandas takes a while
    from pandas import DataFrame


class Titled(NamedTuple):
    """A table of texts with its title."""

    title: str
    frame: "DataFrame"
    justified: str  #: "l" or "r" for each column

    @classmethod
    def of(cls, title: str, justified: str, headings: Iterable[str], rows: Iterable[Iterable[str]]) -> "Titled":
        """The table with these rows."""
        from pandas import DataFrame

        return cls(title, DataFrame(map(list, rows), columns=list(headings), dtype=object), justified)

    @property
    def html(self) -> Markup:
        """The table as HTML."""
        from pandas import option_context

        with option_context("display.max_colwidth", None):
            return Markup(self.frame.to_html(index=False, border=0))


class Recorder(Console):
    """A console that keeps what is printed to it: tables, and all else as lines."""

    def __init__(self) -> None:
        super().__init__(file=io.StringIO(), width=10_000, color_system=None, highlight=False)
        self.items: list[Titled | str] = []

    def print(self, *objects: Any, **options: Any) -> None:
        """Keep what would be printed, but for empty lines."""
        self.items += [_titled(one) if isinstance(one, Table) else str(one) for one in objects]


def _titled(table: Table) -> Titled:
    """A table without the columns that are empty, heading and all, and without breaks that make a column narrow."""
    every = [(str(column.header), [_plain(cell) for cell in column.cells], column.justify) for column in table.columns]
    headings, cells, justified = zip(*(one for one in every if one[0] or any(one[1])), strict=True)
    unbroken = (re.sub(r"-\n(?=[a-z])", "", one).replace("-\n", "-").replace("\n", " ") for one in headings)
    return Titled.of(str(table.title or ""), "".join(one[0] for one in justified), unbroken, zip(*cells, strict=True))


def _plain(cell: Any) -> str:
    return (cell if isinstance(cell, Text) else Text.from_markup(str(cell))).plain.replace("\n", " ")
