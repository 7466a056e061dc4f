"""The rows of JSON and CSV, whose columns are what the record of a result says."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from spi.storage.stored import Entry, Stored

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
