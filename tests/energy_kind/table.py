"""Tables of mean energies."""

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from spi.printing.rows import rows_of
from spi.printing.text import INTERVAL, new_table, power_of_two, print_whole, with_interval

from .results import Energies

if TYPE_CHECKING:
    from rich.console import Console


def rows(readings: Iterable[Energies]) -> Iterator[dict[str, Any]]:
    for reading in readings:
        yield from rows_of(reading, ["h"])


def show(console: "Console", heading: str, readings: Sequence[Energies]) -> None:
    table = new_table(heading, ["scheme", "h", "mean of H (95 %)"], left=1)
    for reading in readings:
        for row in rows([reading]):
            half = INTERVAL * row["energy_stderr"]
            table.add_row(reading.about.label, power_of_two(row["h"]), with_interval(row["energy"], half))
    print_whole(console, table)
