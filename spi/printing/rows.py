"""Tables of exports: CSV, JSON, LaTeX and pandas have all that the records of a result declare, with its intervals.

What is over the same axes is one table, with a row for each case, scheme and place along the axes, and is named by the
first number in it.  The main table has the axes that the record says (``row_axes``) and also all that is over some of
these, such as fitted orders, and facts that have a column.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from spi.storage.records import Variables
from spi.storage.stored import Stored

from .tables import StyledText, TextTable
from .text import interval_text, power_of_two, short


@dataclass
class DataTable:
    """Numbers over the same axes; rows are made when they are asked for."""

    name: str
    axes: tuple[str, ...]
    #: Records, the values along their axes, columns and facts.
    parts: list[tuple[Stored, Mapping[str, Any], Variables, dict[str, Any]]] = field(default_factory=list)
    further: Callable[[dict[str, Any]], dict[str, Any]] = lambda row: {}  #: columns that follow from a row
    own: Sequence[dict[str, Any]] = ()  #: rows that are of several records together

    @property
    def numbers(self) -> list[str]:
        """Names of the columns with numbers of the records."""
        return list(dict.fromkeys(name for _, _, columns, _ in self.parts for name in columns))

    @cached_property
    def rows(self) -> list[dict[str, Any]]:
        """One for each case, scheme and place along the axes; what a record lacks is left out."""
        made = (row for part in self.parts for row in _rows(self.axes, *part))
        return [*(row | self.further(row) for row in made), *self.own]

    @property
    def columns(self) -> list[str]:
        """Names of all columns."""
        return list(dict.fromkeys(name for row in self.rows for name in row))

    def _inside(self, measured: Sequence[str]) -> set[str]:
        """Columns that the others say: ends of intervals, standard errors, and the case where there is one only."""
        ends = {f"{name}_{end}" for name in measured for end in ("low", "high")}
        errors = {f"{name[:-4]}_{end}" for name in ends for end in ("stderr", "half", "bound")}
        return ends | errors | ({"case"} if len({row.get("case") for row in self.rows}) < 2 else set())

    def as_text(self, title: str = "") -> TextTable:
        """As it is printed: numbers with their 95 % intervals, without standard errors and what is in no row."""
        measured = [name for name in self.columns if _has_interval(name, self.columns)]
        inside = self._inside(measured)
        shown = [name for name in self.columns if name not in inside]
        headings = [f"{name} (95 %)" if name in measured else name for name in shown]
        rows = [[StyledText(self._text(row, name)) for name in shown] for row in self.rows]
        keys = sum(name in ("case", "scheme", *self.axes) for name in shown)
        return TextTable(title or self.name, headings, [rows], sum(name in ("case", "scheme") for name in shown), keys)

    def _text(self, row: Mapping[str, Any], name: str) -> str:
        value = row.get(name, "")
        if isinstance(value, float) and name in self.axes:
            return power_of_two(value) if name == "h" else f"{value:.7g}"
        ends = row.get(f"{name}_low"), row.get(f"{name}_high")
        return interval_text(value, None if None in ends else ends, lambda number: short(number, ".5g"))


def _has_interval(name: str, columns: Iterable[str]) -> bool:
    return f"{name}_low" in columns and f"{name}_high" in columns


def tables_of(records: Sequence[Stored]) -> dict[str, DataTable]:
    """Tables of records of one kind by name, the main one first; of others only those that have rows."""
    found: dict[tuple[str, ...], DataTable] = {}
    for record in records:
        exported = record.exported()
        along = {name: exported.pop(name)[1] for name, (over, _) in [*exported.items()] if over == (name,)}
        for axes, columns in _by_axes(record, exported, records).items():
            is_main = axes == record.row_axes
            if is_main or any(values.size for _, values in columns.values()):
                table = found.setdefault(axes, DataTable(_name(record, exported, axes), axes))
                table.parts.append((record, record.axes | along, columns, _facts(record) if is_main else {}))
    return {table.name: table for table in found.values()}


def _name(record: Stored, exported: Variables, axes: tuple[str, ...]) -> str:
    """First array over the axes, in the main table also one that is spread over columns."""
    spread = record.row_columns if axes == record.row_axes else ()
    overs = {name: tuple(axis for axis in over if axis not in spread) for name, (over, _) in exported.items()}
    return next((name for name, over in overs.items() if over == axes), "facts")


def _by_axes(record: Stored, exported: Variables, records: Sequence[Stored]) -> dict[tuple[str, ...], Variables]:
    """Columns by the axes of their tables, those of the main one first; there the numbers over all its axes go first.

    In the main table those along an axis of ``row_columns`` are a column for each place, and of those along an axis of
    ``row_largest`` there is the largest; where there are several, all are in a table of their own as well.
    """
    main: Variables = {}
    found: dict[tuple[str, ...], Variables] = {record.row_axes: main}
    for name, (over, values) in exported.items():
        further = [axis for axis in over if axis not in record.row_axes]
        at = over.index(further[0]) if further else 0
        rest = over[:at] + over[at + 1 :] if further else over
        if not further:
            main[name] = over, values
        elif len(further) == 1 and further[0] in record.row_columns:
            names = _names(record, name, further[0], values.shape[at])
            main |= {one: (rest, part) for one, part in zip(names, np.moveaxis(values, at, 0), strict=True)}
        elif len(further) == 1 and further[0] in record.row_largest and values.size:
            main[name] = rest, values.max(at)
            if values.shape[at] > 1:
                found.setdefault(over, {})[name] = over, values
        else:
            found.setdefault(over, {})[name] = over, values
    main |= record.beside(records)
    found[record.row_axes] = dict(sorted(main.items(), key=lambda column: column[1][0] != record.row_axes))
    return found


def _names(record: Stored, name: str, axis: str, count: int) -> list[str]:
    """Names of the columns along an axis: ``rms_1``, ``rms_2``, ..., where it has texts ``mean[y1]``, ..."""
    labels = record.about.variables if axis == "component" else record.axes.get(axis)
    if labels is not None and len(labels) and isinstance(labels[0], str):
        return [f"{name}[{label}]" for label in labels]
    template = record.by_name[name].meaning.column or (f"{name}_{{}}" if count > 1 else name)
    return [template.format(number) for number in range(1, count + 1)]


def _head(record: Stored) -> dict[str, Any]:
    """Columns that say what the record is of, None where they are empty."""
    about = record.about
    head = {"case": about.case, "scheme": about.scheme, "eps": about.eps, "extrapolate": about.extrapolate or None}
    head["estimator"] = about.estimator or record.get("estimator") or None
    return head | (about.swept.places if about.swept else {})


def _facts(record: Stored) -> dict[str, Any]:
    """Facts that are in all rows of the main table."""
    shown = (entry for entry in record.entries if entry.is_fact and entry.meaning.column)
    return {entry.name: entry.of(record) for entry in shown}


def _rows(
    axes: tuple[str, ...], record: Stored, along: Mapping[str, Any], columns: Variables, facts: Mapping[str, Any]
) -> Iterator[dict[str, Any]]:
    """A row for each place along the axes; an axis without values has numbers from 0."""
    sizes = {axis: len(values) for axis, values in along.items()}
    for over, values in columns.values():
        sizes |= {axis: size for axis, size in zip(over, values.shape, strict=True) if axis in axes}
    places = {axis: ((axis,), np.asarray(along[axis] if axis in along else range(sizes[axis]))) for axis in axes}
    shape = tuple(sizes[axis] for axis in axes)
    lists = {name: _along(over, values, axes, shape) for name, (over, values) in (places | columns).items()}
    head, tail = ({name: it for name, it in some.items() if it is not None} for some in (_head(record), facts))
    for row in zip(*lists.values(), strict=True):
        yield head | dict(zip(lists, row, strict=True)) | tail


def _along(over: tuple[str, ...], values: np.ndarray, axes: tuple[str, ...], shape: tuple[int, ...]) -> list[Any]:
    """Values over some of the axes as a list over all of them."""
    ordered = values.transpose([over.index(axis) for axis in axes if axis in over])
    sizes = [size if axis in over else 1 for axis, size in zip(axes, shape, strict=True)]
    whole: list[Any] = np.broadcast_to(ordered.reshape(sizes), shape).ravel().tolist()
    return whole
