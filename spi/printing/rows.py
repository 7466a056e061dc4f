"""Rows of JSON and CSV, whose columns are what the record of a result says."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from spi.storage.stored import Entry, Stored

RowColumns = dict[str, tuple[tuple[str, ...], np.ndarray]]  #: name -> (names of its axes, array)


def rows_of(record: Stored, further: RowColumns | None = None) -> Iterator[dict[str, Any]]:
    """A row for each point of the axes that the record says, with all that it has over some of them.

    Of what has further axes, those of ``row_largest`` give the largest value, and those of ``row_columns`` a column for
    each place; what has others is left out, as are nested records that are apart.  What is not over an axis of
    ``row_last`` stands in the row of its last place only.  `further` are columns that follow from several records.
    """
    places = {axis: record.get(axis) for axis in record.row_axes}
    head, (columns, tail) = _head(record), _entries(record)
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


def _head(record: Stored) -> dict[str, Any]:
    """Columns that say what the record is of, None where they are empty."""
    about = record.about
    head = {"case": about.case, "scheme": about.scheme, "eps": about.eps, "extrapolate": about.extrapolate or None}
    head["estimator"] = about.estimator or record.get("estimator") or None
    return head | (about.swept.places if about.swept else {})


def _entries(record: Stored) -> tuple[RowColumns, dict[str, Any]]:
    """Columns of the arrays, and the facts that are the same in all rows."""
    columns: RowColumns = {}
    facts: dict[str, Any] = {}
    for entry in record.entries:
        value = None if entry.apart or entry.meaning.is_axis else entry.of(record)
        if value is None:
            continue
        if entry.is_fact:
            facts |= {entry.name: value} if entry.meaning.column else {}
        elif entry.field or entry.meaning.column:
            columns |= _columns(record, entry, np.asarray(value))
    return columns, facts


def _columns(record: Stored, entry: Entry, values: np.ndarray) -> RowColumns:
    """Columns of an array: one, or by :func:`_names` some along an axis that is spread; none if it has others."""
    over = entry.axes
    for axis in [axis for axis in over if axis in record.row_largest and values.size]:
        values, over = values.max(over.index(axis)), tuple(other for other in over if other != axis)
    further = [axis for axis in over if axis not in record.row_axes]
    if not further:
        return {entry.name: (over, values)}
    (axis, *others) = further
    if others or axis not in record.row_columns:
        return {}
    rest = tuple(other for other in over if other != axis)
    parts = np.moveaxis(values, over.index(axis), 0)
    return {name: (rest, part) for name, part in zip(_names(record, entry, axis, len(parts)), parts, strict=True)}


def _names(record: Stored, entry: Entry, axis: str, count: int) -> list[str]:
    """Names of the columns along an axis: ``rms_1``, ``rms_2``, ..., where it has texts ``mean[y1]``, ..."""
    labels = record.about.variables if axis == "component" else record.get(axis)
    if labels is not None and len(labels) and isinstance(labels[0], str):
        return [f"{entry.name}[{label}]" for label in labels]
    template = entry.meaning.column or (f"{entry.name}_{{}}" if count > 1 else entry.name)
    return [template.format(number) for number in range(1, count + 1)]
