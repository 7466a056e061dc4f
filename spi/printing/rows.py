"""The rows of JSON and CSV, whose columns are what the record of a result says, and results of unknown kinds."""

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from spi.storage.records import Group
from spi.storage.stored import Entry, Stored

from .tables import Cell, Grid
from .text import interval_text

Columns = dict[str, tuple[tuple[str, ...], np.ndarray]]  #: name -> (names of its axes, array)


def rows_of(record: Stored, further: Columns | None = None) -> Iterator[dict[str, Any]]:
    """A row for each point of the axes that the record says, with all that it has over some of them.

    Of what has further axes, those of ``row_largest`` give the largest value, and those of ``row_columns`` a column for
    each place; what has others is left out, as are nested records that are apart.  What is not over an axis of
    ``row_last`` stands in the row of its last place only.  `further` are columns that follow from several records.
    """
    about, places = record.about, {axis: record.get(axis) for axis in record.row_axes}
    head = {"case": about.case, "scheme": about.scheme, "eps": about.eps, "extrapolate": about.extrapolate or None}
    head["estimator"] = about.estimator or record.get("estimator") or None
    head |= about.swept.places if about.swept else {}
    tail: dict[str, Any] = {}
    columns: Columns = {}
    for entry in record.entries:
        value = None if entry.apart or entry.meaning.is_axis else entry.of(record)
        if value is None:
            continue
        if not entry.is_fact and (entry.field or entry.meaning.column):
            columns |= _columns(record, entry, np.asarray(value))
        elif entry.is_fact and entry.meaning.column:
            tail[entry.name] = value
    columns |= further or {}
    for place in np.ndindex(*map(len, places.values())):
        at = dict(zip(places, place, strict=True))
        needed = {axis for axis in record.row_last if at[axis] < len(places[axis]) - 1}
        row = head | {axis: np.asarray(places[axis])[i].item() for axis, i in at.items()}
        row |= {
            name: values[tuple(at[axis] for axis in over)].item()
            for name, (over, values) in columns.items()
            if needed <= set(over)
        }
        yield {name: value for name, value in (row | tail).items() if value is not None}


def _columns(record: Stored, entry: Entry, values: np.ndarray) -> Columns:
    """The columns of an array: ``rms_1``, ``rms_2``, ..., of texts ``mean[y1]``, ... along an axis that is spread."""
    over, name, template = entry.axes, entry.name, entry.meaning.column
    for axis in [axis for axis in over if axis in record.row_largest and values.size]:
        values, over = values.max(over.index(axis)), tuple(other for other in over if other != axis)
    further = [axis for axis in over if axis not in record.row_axes]
    if not further:
        return {name: (over, values)}
    (axis, *others) = further
    if others or axis not in record.row_columns:
        return {}
    rest = tuple(other for other in over if other != axis)
    parts = np.moveaxis(values, over.index(axis), 0)
    labels = record.about.variables if axis == "component" else record.get(axis)
    if labels is not None and len(labels) and isinstance(labels[0], str):
        return {f"{name}[{label}]": (rest, part) for label, part in zip(labels, parts, strict=True)}
    template = template or (f"{name}_{{}}" if len(parts) > 1 else name)
    return {template.format(number): (rest, part) for number, part in enumerate(parts, 1)}


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
        rows = [dict(list(row.items())[2:]) for row in rows_of_group(group)]  # without case and scheme
        cells = [[Cell(interval_text(value, form=".6g")) for value in row.values()] for row in rows]
        title = f"{group.case}: {group.attributes.get('scheme_label', group.variant)}"
        yield Grid(title, list(rows[0]) if rows else [], [cells], 0)
        scalars = {name: values.item() for name, (axes, values) in group.variables.items() if not axes}
        yield from (Cell(f"{name}: {value}") for name, value in {**scalars, **group.attributes}.items())
