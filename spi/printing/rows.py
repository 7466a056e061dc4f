"""The rows of JSON and CSV, whose columns are what the record of a result says, and results of unknown kinds."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from spi.storage.records import Group
from spi.storage.stored import Array, Stored, layout

from .text import new_table, print_whole, short

if TYPE_CHECKING:
    from rich.console import Console

Columns = Mapping[str, tuple[tuple[str, ...], np.ndarray]]  #: name -> (names of its axes, array)


def rows_of(
    record: Stored,
    axes: Sequence[str],
    largest: Sequence[str] = (),
    spread: Sequence[str] = (),
    derived: Columns | None = None,
) -> Iterator[dict[str, Any]]:
    """A row for each point of the `axes`, with all that the record has over some of them.

    Of what has further axes, those in `largest` give the largest value, and those in `spread` a column for each place;
    what has others is left out.  `derived` are columns that the record does not store.
    """
    group = record.group()
    columns_named = {(entry.name, entry.is_fact): entry.meaning.column for entry in layout(type(record))}
    head = {"case": group.case, "scheme": group.attributes["scheme"]}
    head |= {name: group.attributes.get(name) for name in ("eps", "extrapolate")}
    head["estimator"] = group.attributes.get("estimator") or None
    if (swept := record.about.swept) is not None:
        head |= swept.places
    tail = {name: value for name, value in group.attributes.items() if columns_named.get((name, True))}
    named = group.attributes.get("variables")
    labels = group.coordinates | ({"component": np.array(named)} if named else {})
    held = dict(_reduced(group.variables, largest)) | dict(derived or {})
    columns: dict[str, tuple[tuple[str, ...], np.ndarray]] = {}
    for name, (over, values) in held.items():
        if set(over) <= {*axes, *spread}:
            columns.update(_spread(name, over, values, axes, labels, columns_named.get((name, False))))
    for place in np.ndindex(*(len(group.coordinates[axis]) for axis in axes)):
        at = dict(zip(axes, place, strict=True))
        row = head | {axis: group.coordinates[axis][i].item() for axis, i in at.items()}
        row |= {name: values[tuple(at[axis] for axis in over)].item() for name, (over, values) in columns.items()}
        yield {name: value for name, value in (row | tail).items() if value is not None}


def _reduced(variables: Columns, largest: Sequence[str]) -> Iterator[tuple[str, tuple[tuple[str, ...], Array]]]:
    """The variables without the axes of which the largest value counts; nothing of what has none."""
    for name, (over, values) in variables.items():
        gone = tuple(i for i, axis in enumerate(over) if axis in largest)
        if values.size or not gone:
            yield name, (tuple(axis for axis in over if axis not in largest), values.max(axis=gone) if gone else values)


def _spread(
    name: str,
    over: tuple[str, ...],
    values: np.ndarray,
    axes: Sequence[str],
    coordinates: Mapping[str, np.ndarray],
    template: str | None,
) -> Iterator[tuple[str, tuple[tuple[str, ...], np.ndarray]]]:
    """A variable as columns over the `axes` alone: ``rms_1``, ``rms_2``, ..., of texts ``mean[y1]``, ..."""
    further = [axis for axis in over if axis not in axes]
    if not further:
        yield name, (over, values)
        return
    (axis,) = further
    rest = tuple(one for one in over if one != axis)
    template = template or (f"{name}_{{}}" if values.shape[over.index(axis)] > 1 else name)
    for i, part in enumerate(np.moveaxis(values, over.index(axis), 0)):
        label = coordinates[axis][i]
        yield f"{name}[{label}]" if isinstance(label, str) else template.format(i + 1), (rest, part)


def rows_of_group(group: Group) -> Iterator[dict[str, Any]]:
    """A row per point of the first axis of results of an unknown kind; further axes are spread over columns."""
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


def show_groups(console: "Console", groups: Iterable[Group]) -> None:
    """Print a table of all numbers of each group of results of an unknown kind, and its attributes."""
    for group in groups:
        records = list(rows_of_group(group))
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
