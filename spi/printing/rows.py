"""The rows of JSON and CSV, whose columns are what the record of a result says, and results of unknown kinds."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from spi.storage.records import Group
from spi.storage.stored import Array, Derived, Stored, layout

from .tables import Cell, Grid
from .text import interval_text

Columns = Mapping[str, tuple[tuple[str, ...], np.ndarray]]  #: name -> (names of its axes, array)


def rows_of(record: Stored, further: Columns | None = None) -> Iterator[dict[str, Any]]:
    """A row for each point of the axes that the record says, with all that it has over some of them.

    Of what has further axes, those of ``row_largest`` give the largest value, and those of ``row_columns`` a column for
    each place; what has others is left out, as are nested records that are apart.  What is not over an axis of
    ``row_last`` stands in the row of its last place only.  `further` are columns that follow from several records.
    """
    axes, spread = record.row_axes, record.row_columns
    apart: dict[str, Any] = {field.name: None for field in record.described if field.meaning.apart}
    group = replace(record, **apart).group()
    named = {(entry.name, entry.is_fact): entry.meaning.column for entry in layout(type(record))}
    head = {"case": group.case, "scheme": group.attributes["scheme"]}
    head |= {name: group.attributes.get(name) for name in ("eps", "extrapolate")}
    head["estimator"] = group.attributes.get("estimator") or None
    if (swept := record.about.swept) is not None:
        head |= swept.places
    tail = {name: value for name, value in group.attributes.items() if named.get((name, True))}
    components = group.attributes.get("variables")
    labels = group.coordinates | ({"component": np.array(components)} if components else {})
    columns: dict[str, tuple[tuple[str, ...], np.ndarray]] = {}
    arrays = dict(_reduced(group.variables, record.row_largest)) | dict(_derived(record)) | dict(further or {})
    for name, (over, values) in arrays.items():
        if set(over) <= {*axes, *spread}:
            columns.update(_spread(name, over, values, axes, labels, named.get((name, False))))
    for place in np.ndindex(*(len(group.coordinates[axis]) for axis in axes)):
        at = dict(zip(axes, place, strict=True))
        needed = {axis for axis in record.row_last if at[axis] < len(group.coordinates[axis]) - 1}
        row = head | {axis: group.coordinates[axis][i].item() for axis, i in at.items()}
        row |= {
            name: values[tuple(at[axis] for axis in over)].item()
            for name, (over, values) in columns.items()
            if needed <= set(over)
        }
        yield {name: value for name, value in (row | tail).items() if value is not None}


def _derived(record: Stored) -> Iterator[tuple[str, tuple[tuple[str, ...], np.ndarray]]]:
    """The properties of a record that have a column."""
    for name, member in vars(type(record)).items():
        if isinstance(member, Derived) and member.meaning.column:
            yield member.meaning.column, (member.meaning.axes, np.asarray(getattr(record, name)))


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


def tables_of_groups(groups: Iterable[Group]) -> Iterator[Grid | Cell]:
    """A table of all numbers of each group of results of an unknown kind, and its attributes."""
    for group in groups:
        records = list(rows_of_group(group))
        title = f"{group.case}: {group.attributes.get('scheme_label', group.variant)}"
        columns = [key for key in (records[0] if records else ()) if key not in ("case", "scheme")]
        cells = [[interval_text(record.get(name, ""), form=".6g") for name in columns] for record in records]
        yield Grid(title, columns, [[[*map(Cell, row)] for row in cells]], 0)
        scalars = {name: values.item() for name, (axes, values) in group.variables.items() if not axes}
        yield from (Cell(f"{name}: {value}") for name, value in {**scalars, **group.attributes}.items())
