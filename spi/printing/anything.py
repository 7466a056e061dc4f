"""Tables of results of a kind that this program does not know, from the stored groups as they are."""

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from spi.storage.records import Group

from .text import new_table, print_whole, short

if TYPE_CHECKING:
    from rich.console import Console


def rows(groups: Iterable[Group]) -> Iterator[dict[str, Any]]:
    """A record per point of the first axis; further axes are spread over columns."""
    for group in groups:
        yield from _rows(group)


def _rows(group: Group) -> Iterator[dict[str, Any]]:
    if not group.coordinates:
        return
    first = next(iter(group.coordinates))
    for i in range(len(group.coordinates[first])):
        record = {"case": group.case, "scheme": group.variant, first: group.coordinates[first][i].item()}
        for name, (axes, values) in group.variables.items():
            if axes == (first,):
                record[name] = values[i].item()
            elif axes[:1] == (first,):
                record.update({f"{name}[{','.join(map(str, j))}]": v.item() for j, v in np.ndenumerate(values[i])})
        yield record


def show(console: "Console", groups: Iterable[Group]) -> None:
    """Print a table of all numbers of each group, and its attributes."""
    for group in groups:
        records = list(_rows(group))
        title = f"{group.case}: {group.attributes.get('scheme_label', group.variant)}"
        columns = [key for key in (records[0] if records else ()) if key not in ("case", "scheme")]
        table = new_table(title, columns)
        for record in records:
            table.add_row(*(short(v, ".6g") if isinstance(v, float) else str(v) for v in map(record.get, columns)))
        print_whole(console, table)
        scalars = {name: values.item() for name, (axes, values) in group.variables.items() if not axes}
        for name, value in {**scalars, **group.attributes}.items():
            console.print(f"{name}: {value}", markup=False, soft_wrap=True)
        console.print()
