"""One table for every kind of experiment: what stands in its columns is declared by the record of a result.

    tables = (Table("h", [Column("error", "strong error (95 %)", resolved="resolved"), Column("casimir_drift")]),)

A :class:`Table` has a line for each place along some axes and, for each scheme, the fields of its columns with their
95 % intervals.  It becomes a :class:`TextTable` of texts, which is printed, or shown in a report.
"""

import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from itertools import groupby, takewhile, zip_longest
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..statistics.claims import CONFIRMED, CONSISTENT, CONTRADICTED, VERDICTS, Quantity, Verdict
from ..statistics.rounding import all_exact
from ..storage.stored import Estimate, Stored, last
from .text import (
    LABEL,
    angle_note,
    duration,
    interval_text,
    narrowed,
    new_table,
    order_text,
    power_of_two,
    print_lines,
    print_whole,
    room,
    short,
    with_interval,
)

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table as RichTable


class StyledText(NamedTuple):
    """A text with its style, as ``rich`` names it."""

    text: str
    style: str = ""


_MANY = 8  # columns


class TextTable(NamedTuple):
    """A table of texts."""

    title: str
    headings: Sequence[str]
    sections: Sequence[Sequence[Sequence[StyledText]]]  #: the lines of each scheme
    left: int  #: so many columns are left-justified; the first of them, of labels, may wrap
    keys: int = 1  #: so many columns tell what a line is of

    @property
    def rows(self) -> list[list[str]]:
        """Texts of all lines."""
        return [[cell.text for cell in row] for section in self.sections for row in section]

    def styles(self, heading: str = "") -> set[str]:
        """Styles of the cells in the columns of this heading, or of all."""
        chosen = [i for i, one in enumerate(self.headings) if one == heading or not heading]
        return {row[i].style for section in self.sections for row in section for i in chosen}

    def as_rich(self) -> "RichTable":
        """As it is printed."""
        from rich.text import Text

        table = new_table(self.title, self.headings, self.left, labels=0)
        for section in self.sections:
            for row in section:
                table.add_row(*(Text(cell.text, style=cell.style) for cell in row))
            if len(section) > 1:
                table.add_section()
        if len(self.headings) > _MANY:
            table.padding = 0  # else it is too wide
        return table

    def folded(self, console: "Console") -> Iterator["TextTable"]:
        """Tables of some columns each, as many as a terminal has room for, with those that tell what a line is of."""
        shown = [*range(self.keys)]
        whole, title = math.isinf(room(console)), self.title
        for i in range(self.keys, len(self.headings)):
            more = self.of([*shown, i])
            if not whole and len(shown) > self.keys and narrowed(console, more.as_rich()) > room(console):
                yield self.of(shown)._replace(title=title)
                shown, title = [*range(self.keys)], ""
            shown.append(i)
        yield self.of(shown)._replace(title=title)

    def of(self, columns: Sequence[int]) -> "TextTable":
        """Grid of these of its columns."""
        sections = [[[row[i] for i in columns] for row in section] for section in self.sections]
        return self._replace(headings=[self.headings[i] for i in columns], sections=sections)


def unbroken(heading: str) -> str:
    """A heading without the breaks that make its column narrow."""
    return re.sub(r"-\n(?=[a-z])", "", heading).replace("-\n", "-").replace("\n", " ")


class Column(NamedTuple):
    """A column of a table, or one for each place along a further axis."""

    #: A field or derived property of the record, by its name in files; or a function of the record and all records of
    #: the case that gives texts, numbers or an :class:`Estimate` over the first axes of the table, None for none.
    field: str | Callable[[Any, Sequence[Any]], Any]
    heading: str  #: with {} for the place along the further axis
    over: str = ""  #: the further axis
    among: Sequence[str] = ()  #: the places along it that have columns, where any of them are there
    form: str | Callable[[Any], str] = ".1e"  #: of a number without ±, and of ends
    interval: str = "±"  #: "[]" shows it by its ends, as is one that is not symmetric; "" not at all
    resolved: str = ""  #: the field with whether a number is resolved; else it stands in brackets
    missing: str = "-"  #: the text for NaN
    red: float = math.inf  #: numbers, without their sign, above this are worrying
    why: str = ""  #: what such a number means
    always: bool = False  #: whether the column stands even if no number in it is finite

    def parts(self, record: Stored, readings: Sequence[Stored], axes: Sequence[str]) -> dict[str, Estimate]:
        """Numbers by heading; along axes that the table lacks the last time or the largest number."""
        if callable(self.field):
            values = self.field(record, readings)
            if isinstance(values, Estimate):
                return {self.heading: values}
            array = np.asarray(values, object)
            numbers = None if values is None else Estimate(tuple(axes[: array.ndim]), array, array, array)
        else:
            numbers = record.estimate(self.field)
        if numbers is None:
            return {}
        for axis in [axis for axis in numbers.axes if axis not in (*axes, self.over)]:
            numbers = numbers.without(axis, last if axis in ("t", "n", "lag") else _largest)
        if not self.over:
            return {self.heading: numbers}
        names = places(record, self.over, [numbers]) if numbers.value.size else []
        return {
            self.heading.format(name): numbers.without(self.over, partial(np.take, indices=i))
            for i, name in enumerate(names)
            if name in self.among or not {*names} & {*self.among}
        }

    def cell(self, record: Stored, numbers: Estimate, at: Mapping[str, int]) -> StyledText:
        """Cell at a place, given by its number along each axis."""
        place = tuple(at[axis] for axis in numbers.axes)
        if any(i >= size for i, size in zip(place, numbers.value.shape, strict=True)):
            return StyledText("-")
        value = numbers.value[place]
        if isinstance(value, str):
            return StyledText(value)
        ends = (numbers.low[place], numbers.high[place]) if self.interval and not numbers.exact else None
        text = self.missing if value != value else interval_text(value, ends, self.form, self.interval == "[]")
        if self.resolved and not record.get(self.resolved)[place]:
            return StyledText(f"({text})", "dim")
        return StyledText(text, "bold red" if abs(value) > self.red else "")


def _largest(values: np.ndarray, axis: int) -> np.ndarray:
    return values.max(axis) if values.shape[axis] else np.full(np.delete(values.shape, axis), np.nan)


class Table(NamedTuple):
    """A table with a line for each place along some axes."""

    axes: str  #: their names, separated by spaces
    columns: Sequence[Column]
    title: str = ""  #: behind that of the case, which the first table of a case has
    lines: Callable[[Any], Iterable[tuple[int, ...]]] | None = None  #: the places that have lines, if not all
    #: A line on the records of a case that says enough in place of the table; "" where it does not.
    instead: Callable[[Sequence[Any]], str] = lambda readings: ""

    def items(self, title: str, readings: Sequence[Stored], everything: bool) -> Iterator[TextTable | StyledText]:
        """Table of the records of a case, and what its brackets and its large numbers mean; or a line instead."""
        if not everything and (line := self.instead(readings)):
            yield StyledText(line)
            return
        if (grid := self.grid(title, readings)) is None:
            return
        yield grid
        if "dim" in grid.styles():
            yield StyledText("( ): not resolved", "dim")
        for column in self.columns:
            if column.why and "bold red" in grid.styles(column.heading):
                yield StyledText(f"{unbroken(column.heading)} above {column.red:g}: {column.why}", "bold red")

    def grid(self, title: str, readings: Sequence[Stored]) -> TextTable | None:
        """Table of the records of a case, without columns in which there is nothing; None if none is left."""
        axes = self.axes.split()
        columns, parts = self._parts(readings, axes)
        sections = [
            list(self._section(record, own, axes, columns)) for record, own in zip(readings, parts, strict=True) if own
        ]
        headings = ["scheme", *(_heading(axis, readings) for axis in axes), *columns]
        may_be_dashes = [False] * (1 + len(axes)) + [column.always for column in columns.values()]
        shown = _with_contents(sections, may_be_dashes)
        if shown[-1] <= len(axes):
            return None
        left = sum(1 for _ in takewhile(_LEFT.__contains__, ["scheme", *axes]))
        counts = sum(i < left for i in shown), sum(i <= len(axes) for i in shown)
        return TextTable(": ".join(filter(None, (title, self.title))), headings, sections, *counts).of(shown)

    def _parts(
        self, readings: Sequence[Stored], axes: Sequence[str]
    ) -> tuple[dict[str, Column], list[dict[str, Estimate]]]:
        """Columns by heading, and for each record its numbers by heading."""
        columns: dict[str, Column] = {}
        parts: list[dict[str, Estimate]] = [{} for _ in readings]
        for column in self.columns:
            for record, own in zip(readings, parts, strict=True):
                own |= (more := column.parts(record, readings, axes))
                columns |= dict.fromkeys(more, column)
        return columns, parts

    def _section(
        self, record: Stored, parts: Mapping[str, Estimate], axes: Sequence[str], columns: Mapping[str, Column]
    ) -> Iterator[list[StyledText]]:
        """Lines of one scheme, with labels where they differ from those of the line above."""
        names = {axis: places(record, axis, parts.values()) for axis in axes}
        lines = list(np.ndindex(*map(len, names.values())) if self.lines is None else self.lines(record))
        schemes, whole = record.about.parts(), record.about.subject()
        if len(lines) < len(schemes):
            schemes = [whole if len(whole) <= LABEL else ",\n".join(schemes)]
        before: list[str] = []
        for scheme, place in zip_longest(schemes, lines, fillvalue=""):
            at = dict(zip(axes, place, strict=True))
            labels = [names[axis][i] for axis, i in at.items()]
            same = next((i for i, label in enumerate(labels) if before[i : i + 1] != [label]), len(labels))
            before = labels
            cells = [
                columns[name].cell(record, parts[name], at) if name in parts else StyledText("") for name in columns
            ]
            yield [StyledText(scheme), *[StyledText("")] * same, *map(StyledText, labels[same:]), *cells]


def _with_contents(sections: Sequence[Sequence[Sequence[StyledText]]], may_be_dashes: Sequence[bool]) -> list[int]:
    """Numbers of the columns that are not empty, nor full of dashes where they may not be; the first is one."""
    rows = [row for section in sections for row in section]
    empty = [("",) if may else ("", "-") for may in may_be_dashes]
    return [i for i, texts in enumerate(empty) if not i or any(row[i].text not in texts for row in rows)]


class OwnTable(NamedTuple):
    """A table of a kind's own."""

    items: Callable[[str, Sequence[Any], bool], Iterator[TextTable | StyledText]]  #: as :meth:`Table.items`


#: How the places along an axis are called in tables, and its heading if that is not the name of the axis.
_PLACES: dict[str, Callable[[Any], str]] = {"h": power_of_two, "level": power_of_two, "t": "{:.5g}".format}
_HEADINGS = {"level": "larger\nstep", "casimir": "Cas-\nimir"}
_LEFT = ("scheme", "function", "h", "level", "casimir")  # whose columns are left-justified


def places(record: Stored, axis: str, numbers: Iterable[Estimate]) -> list[str]:
    """Names of the places along an axis; "" where there is one without a name, as of a single Casimir function."""
    if (values := record.get(axis)) is None:
        count = max((one.value.shape[one.axes.index(axis)] for one in numbers if axis in one.axes), default=0)
        return [f"C{i}" for i in range(1, count + 1)] if count > 1 else [""]
    label = record.by_name[axis].meaning.label
    form = label.format if label else _PLACES.get(axis, "{:g}".format)
    names = [value if isinstance(value, str) else form(value) for value in values]
    return [""] if names == ["phi"] else names


def _heading(axis: str, readings: Sequence[Any]) -> str:
    return readings[0].word if axis == "value" else _HEADINGS.get(axis, axis)


# ---------------------------------------------------------------------------------------------------------------------
# A case: its tables and the lines under them
# ---------------------------------------------------------------------------------------------------------------------


def printed(title: str, readings: Sequence[Stored], everything: bool = False) -> Iterator[TextTable | StyledText]:
    """Tables of the records of a case, the lines on each record, and those on the case."""
    for table in readings[0].tables:
        for item in table.items(title, readings, everything):
            title = "" if isinstance(item, TextTable) else title
            yield item
    yield from map(StyledText, _clipped(readings))
    for record in readings:
        yield from map(StyledText, _lines(record))
    yield from map(StyledText, readings[0].remarks_of_case(readings))


_WHOLE = 0.99995  # a share that is printed as 100 %


def _clipped(readings: Sequence[Any]) -> Iterator[str]:
    """Share of the variance of increments that clipping leaves at the largest step, where it is not all of it."""
    about = readings[0].about
    if not about.truncate_noise:
        return
    from ..ensemble.increments import clipped_variance  # not needed to start the program

    sizes = [one.get(name) for one in readings for name in ("h", "step")]
    h = max((float(np.max(size)) for size in sizes if size is not None and np.size(size)), default=0.0)
    if h > 0.0 and (left := clipped_variance(h)) < _WHOLE:
        then = ", by the root of which they are divided" if "temperature" in about.parameters else ""
        yield f"truncate_noise: clipped increments over h = {power_of_two(h)} have {left:.2%} of their variance{then}"


def show_items(console: "Console", items: Iterable[TextTable | StyledText]) -> None:
    """Print tables and lines, however long, with an empty line behind each table and block of lines."""
    for is_table, members in groupby(items, lambda item: isinstance(item, TextTable)):
        for item in members:
            if isinstance(item, TextTable):
                for part in item.folded(console):
                    print_whole(console, part.as_rich())
                    console.print()
            else:
                print_lines(console, [item.text], item.style or None)
        if not is_table:
            console.print()


def _lines(record: Stored) -> Iterator[str]:
    """Common lines on a record, after its label, and its own."""
    for number, line in enumerate(_common(record)):
        yield f"    {line}" if number else f"{record.about.subject()}: {line}"
    yield from record.remarks()


def _common(record: Stored) -> Iterator[str]:
    """Order, paths, angles of flows and solvers of equations, of records that have them, by their names in files.

    A kind of one's own has any of them, and each is said without the others.
    """
    yield from _order(record)
    if note := record.get("note"):
        yield note
    yield from _paths(record)
    if count := record.get("reference_nonfinite"):
        yield f"{count} reference paths diverged (NaN or infinity)"
    angle = record.get("largest_angle")
    if angle is not None and np.ndim(angle) < 2 and (remark := angle_note(float(np.max(angle)))):
        yield remark
    yield from _accepted(record)
    yield from _solver(record)


def _order(record: Stored) -> Iterator[str]:
    """A single fitted order, unless all errors are exact."""
    low = record.get("order_low")
    if low is None or np.ndim(low) or all_exact(record.get("note") or ""):
        return
    order, high, expected, points = map(record.get, ("order", "order_high", "expected_order", "points_in_fit"))
    size = np.size(record.get("h"))
    few = math.isfinite(order) and points < size
    yield order_text(order, low, high, expected) + (f", through the finest {points} of {size}" if few else "")


def _paths(record: Stored) -> Iterator[str]:
    """Number of paths of one step size, and the time of a step."""
    step, samples, times, nonfinite, ns = map(record.get, ("step", "samples", "t", "nonfinite", "ns_per_step"))
    if step is None or samples is None:
        return
    until = "" if times is None else f" until t = {times[-1]:g}"
    lost = f", {nonfinite} of them diverged" if nonfinite else ""
    took = "" if ns is None or math.isnan(ns) else f", {duration(1e-9 * ns)} per step and path"
    yield f"{samples} paths{until} with h = {step:g}{lost}{took}"


def _solver(record: Stored) -> Iterator[str]:
    """Iterations of a solver of equations and its failures, perhaps over step sizes."""
    names = "solves", "iterations", "failures", "largest_residual"
    solves, iterations, failures, residuals = map(record.get, names)
    if solves is None or np.ndim(solves) > 1:
        return
    mean = iterations.sum() / solves.sum() if solves.any() else 0.0
    residual = short(residuals.max(initial=0))
    yield f"solver: {mean:.1f} iterations a step, {failures.sum():g} failures, largest residual {residual}"


def _accepted(record: Stored) -> Iterator[str]:
    """Shares of flows that a scheme with a test of acceptance accepted, perhaps at each step size."""
    noise, drift = map(record.get, ("noise_accepted", "drift_accepted"))
    if noise is None or np.ndim(noise) > 1:
        return
    places = [f"h = {h:g}: " for h in record.get("h")] if np.ndim(noise) else [""]
    for where, *shares in zip(places, np.atleast_1d(noise), np.atleast_1d(drift), strict=True):
        yield "{}accepted: {:.1%} of the noise flows, {:.1%} of the steps of the drift".format(where, *shares)


# ---------------------------------------------------------------------------------------------------------------------
# Tables of claims and their verdicts.
# ---------------------------------------------------------------------------------------------------------------------


_STYLES = {CONFIRMED: "", CONSISTENT: "", CONTRADICTED: "bold red"}


def show(console: "Console", verdicts: Sequence[Verdict]) -> None:
    """Print the claims of a case, what came out and the verdict; nothing if there are none."""
    if not verdicts:
        return
    for then in (" ", "\n"):  # intervals and swept values stand in lines of their own where there is no room
        table = grid(verdicts, then).as_rich()
        table.columns[1].no_wrap = False
        if narrowed(console, table) <= room(console):
            break
    print_whole(console, table)
    console.print()


def grid(verdicts: Sequence[Verdict], then: str = " ") -> TextTable:
    """Table of claims, with `then` before intervals and further swept values."""
    rows = []
    for one in verdicts:
        result, at = re.sub(r" (?=[\[(])", then, came_out(one)), _at(one).replace(", ", f",{then}")
        verdict = StyledText(one.verdict, _STYLES.get(one.verdict, "yellow"))
        rows.append([*map(StyledText, (one.subject, one.text, result, at)), verdict])
    return TextTable("claims", ["scheme", "claim", "result (95 %)", "at", ""], [rows], left=5)


def _at(one: Verdict) -> str:
    """Step size and the swept value of what came out."""
    quantity = one.found
    h = f"h = {power_of_two(quantity.h)}" if quantity and quantity.h is not None else ""
    swept = quantity.swept_places.items() if quantity else ()
    return ", ".join(filter(None, (h, *(f"{word} = {value:g}" for word, value in swept))))


def came_out(one: Verdict) -> str:
    """Value with its interval, and what of it is not finite, or why there is none."""
    if one.found is None:
        return "not computed"
    if math.isnan(one.found.value):
        return one.found.lost or "not resolved"
    return _number(one.found) + (f" ({one.found.lost})" if one.found.lost else "")


def _number(quantity: Quantity) -> str:
    value, low, high = quantity.value, quantity.low, quantity.high
    form = ".3f" if abs(value) < 100 and abs(value) >= 0.01 else ".2e"
    if low == value == high:
        return short(value, ".3g")
    ends = short(low, form), short(high, form)
    if ends[0] == ends[1]:  # closer than these digits tell
        return with_interval(value, max(value - low, high - value))
    return f"{short(value, form)} [{ends[0]}, {ends[1]}]"


def remarks(name: str, verdicts: Sequence[Verdict]) -> Iterator[str]:
    """Number of claims with each verdict, and :func:`complaints`; nothing if there are no claims."""
    counts = Counter(one.verdict for one in verdicts)
    if counts:
        yield f"{name}: claims: {', '.join(f'{counts[one]} {one}' for one in VERDICTS if counts[one])}"
    yield from (f"{name}: {verdict}: case {details}" for verdict, details in complaints(verdicts))


def complaints(verdicts: Iterable[Verdict]) -> list[tuple[str, str]]:
    """Verdict and the result of each claim that is neither confirmed nor consistent with the results."""
    return [
        (one.verdict, f"{one.claim.case}: {one.subject}: {one.text}; result: {came_out(one)}")
        for one in verdicts
        if one.verdict not in (CONFIRMED, CONSISTENT)
    ]


def columns(record: dict[str, Any], owner: str, verdicts: Sequence[Verdict]) -> dict[str, str]:
    """Columns of a row of CSV and JSON with the verdicts on its case, scheme, eps, estimator and test function.

    That is the worst verdict on each quantity, ``claim[order]``, whatever the step size and the swept value of the
    record; `owner` is the case in the spec.
    """
    worst: dict[str, str] = {}
    for one in verdicts:
        if one.found and one.found.about.owner == owner and _is_about(one.found, record):
            name = f"claim[{one.claim.quantity}]"
            worst[name] = max(worst.get(name, CONFIRMED), one.verdict, key=VERDICTS.index)
    return worst


def _is_about(quantity: Quantity, record: dict[str, Any]) -> bool:
    about, extrapolate = quantity.about, record.get("extrapolate") or 0
    own = {"scheme": about.scheme, "eps": about.eps, "estimator": about.estimator, "function": quantity.function}
    return extrapolate == about.extrapolate and all(
        record.get(name) in (value, None) for name, value in own.items() if value not in (None, "")
    )
