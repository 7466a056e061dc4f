"""One table for every kind of experiment: what stands in its columns is declared by the record of a result.

    tables = (Table("h", [Column("error", "strong error (95 %)", resolved="resolved"), Column("casimir_drift")]),)

A :class:`Table` has a line for each place along some axes and, for each scheme, the fields of its columns with their
95 % intervals.  It becomes a :class:`Grid` of texts, which is printed, or shown in a report.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import groupby, takewhile
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..storage.stored import Estimate, Stored, last
from .text import angle_note, interval_text, new_table, order_text, power_of_two, print_whole, short

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table as RichTable


class Cell(NamedTuple):
    """A text with its style, as ``rich`` names it."""

    text: str
    style: str = ""


class Grid(NamedTuple):
    """A table of texts."""

    title: str
    headings: Sequence[str]
    sections: Sequence[Sequence[Sequence[Cell]]]  #: the lines of each scheme
    left: int  #: so many columns are left-justified; the first of them, of labels, may wrap

    @property
    def rows(self) -> list[list[str]]:
        """The texts of all lines."""
        return [[cell.text for cell in row] for section in self.sections for row in section]

    def as_rich(self) -> "RichTable":
        """As it is printed."""
        from rich.text import Text

        table = new_table(self.title, self.headings, self.left, labels=0)
        for section in self.sections:
            for row in section:
                table.add_row(*(Text(cell.text, style=cell.style) for cell in row))
            if len(section) > 1:
                table.add_section()
        return table


class Column(NamedTuple):
    """A column of a table, or one for each place along a further axis."""

    #: A field or derived property of the record, by its name in files; or a function of the record that gives texts or
    #: numbers over the first axes of the table, None for none.
    field: str | Callable[[Any], Any]
    heading: str  #: with {} for the place along the further axis
    over: str = ""  #: the further axis
    among: Sequence[str] = ()  #: the places along it that have columns, where any of them are there
    form: str | Callable[[Any], str] = ".1e"  #: of a number without ±, and of ends
    interval: str = "±"  #: "[]" shows it by its ends, as is one that is not symmetric; "" not at all
    resolved: str = ""  #: the field with whether a number is resolved; else it stands in brackets
    red: float = math.inf  #: numbers above this are worrying

    def cells(self, record: Stored, axes: Sequence[str]) -> dict[str, "Cells"]:
        """The cells by heading; along axes that the table lacks the last time or the largest number."""
        if callable(self.field):
            values = self.field(record)
            if values is None:
                return {}
            array = np.asarray(values, object)
            return {self.heading: self._texts(Estimate(tuple(axes[: array.ndim]), array, array, array), None)}
        numbers = record.estimate(self.field)
        if numbers is None:
            return {}
        for axis in [axis for axis in numbers.axes if axis not in (*axes, self.over)]:
            numbers = numbers.without(axis, last if axis in ("t", "n") else _largest)
        cells = self._texts(numbers, getattr(record, self.resolved) if self.resolved else None)
        if not self.over:
            return {self.heading: cells}
        at, names = numbers.axes.index(self.over), places(record, self.over, numbers)
        rest = tuple(axis for axis in numbers.axes if axis != self.over)
        return {
            self.heading.format(name): Cells(
                rest, {(*place[:at], *place[at + 1 :]): cell for place, cell in cells.texts.items() if place[at] == i}
            )
            for i, name in enumerate(names)
            if name in self.among or not {*names} & {*self.among}
        }

    def _texts(self, numbers: Estimate, resolved: Any) -> "Cells":
        texts = {}
        for place, value in np.ndenumerate(numbers.value):
            if isinstance(value, str):
                texts[place] = Cell(value)
                continue
            ends = (numbers.low[place], numbers.high[place]) if self.interval and not numbers.exact else None
            text = interval_text(value, ends, self.form, self.interval == "[]")
            clear = resolved is None or resolved[place]
            style = "bold red" if value > self.red else "" if clear else "dim"
            texts[place] = Cell(text if clear else f"({text})", style)
        return Cells(numbers.axes, texts)


class Cells(NamedTuple):
    """The cells of a column for one scheme."""

    axes: tuple[str, ...]
    texts: dict[tuple[int, ...], Cell]


def _largest(values: np.ndarray, axis: int) -> np.ndarray:
    return values.max(axis) if values.shape[axis] else np.full(np.delete(values.shape, axis), np.nan)


class Table(NamedTuple):
    """A table with a line for each place along some axes."""

    axes: str  #: their names, separated by spaces
    columns: Sequence[Column]
    title: str = ""  #: in place of that of the case
    lines: Callable[[Any], Iterable[tuple[int, ...]]] | None = None  #: the places that have lines, if not all
    of: Callable[[Sequence[Any]], Sequence[Any]] = list  #: the records that it shows, of those of a case

    def items(self, title: str, readings: Sequence[Stored]) -> Iterator[Grid | Cell]:
        """The table of the records of a case, and the meaning of its brackets."""
        if grid := self.grid(title, readings):
            yield grid
            if any(cell.style == "dim" for section in grid.sections for row in section for cell in row):
                yield Cell("( ): not resolved", "dim")

    def grid(self, title: str, readings: Sequence[Stored]) -> Grid | None:
        """The table of the records of a case; None where none of its columns has anything."""
        axes, readings = self.axes.split(), self.of(readings)
        cells: list[dict[str, Cells]] = [{} for _ in readings]
        headings: dict[str, None] = {}
        for column in self.columns:
            for record, own in zip(readings, cells, strict=True):
                own |= (more := column.cells(record, axes))
                headings |= dict.fromkeys(more)
        texts = {
            heading: {cell.text for own in cells if heading in own for cell in own[heading].texts.values()}
            for heading in headings
        }
        headings = {heading: None for heading in headings if texts[heading] - {"", "-"}}
        if not headings:
            return None
        shown = [axis for axis in axes if _is_shown(axis, readings, cells)]
        sections = [
            list(self._section(record, own, axes, shown, headings))
            for record, own in zip(readings, cells, strict=True)
            if own
        ]
        first = [_heading(axis, readings[0]) for axis in shown]
        left = sum(1 for _ in takewhile(_LEFT.__contains__, shown))
        return Grid(self.title or title, ("scheme", *first, *headings), sections, left + 1)

    def _section(
        self,
        record: Stored,
        cells: Mapping[str, Cells],
        axes: Sequence[str],
        shown: Sequence[str],
        headings: Iterable[str],
    ) -> Iterator[list[Cell]]:
        """The lines of one scheme, with labels where they differ from those of the line above."""
        named = {axis: places(record, axis, None) for axis in axes}
        sizes = [len(names) or _size(axis, cells) for axis, names in named.items()]
        lines = list(np.ndindex(*sizes) if self.lines is None else self.lines(record))
        about = record.about
        schemes = [about.label, *[about.estimator] * bool(about.estimator)]
        schemes = schemes if len(lines) > 1 else ["\n".join(schemes)]
        before: list[str] = []
        for number, place in enumerate(lines):
            at = dict(zip(axes, place, strict=True))
            labels = [named[axis][at[axis]] if named[axis] else f"C{at[axis] + 1}" for axis in shown]
            same = next((i for i, label in enumerate(labels) if before[i : i + 1] != [label]), len(labels))
            row = [Cell(schemes[number] if number < len(schemes) else "")]
            row += [Cell("" if i < same else label) for i, label in enumerate(labels)]
            for heading in headings:
                own = cells.get(heading, _NOTHING)
                missing = Cell("-" if own.axes else "")
                row.append(own.texts.get(tuple(at[axis] for axis in own.axes), missing))
            yield row
            before = labels


class Own(NamedTuple):
    """A table of a kind's own."""

    items: Callable[[str, Sequence[Any]], Iterator[Grid | Cell]]  #: as :meth:`Table.items`


#: How the places along an axis are called in tables, and its heading if that is not the name of the axis.
_PLACES: dict[str, Callable[[Any], str]] = {"h": power_of_two, "level": power_of_two, "t": "{:.5g}".format}
_LEFT = ("function", "h", "level", "casimir")  # whose columns are left-justified
_HEADINGS = {"level": "larger\nstep", "casimir": "Cas-\nimir"}


def places(record: Stored, axis: str, numbers: Estimate | None) -> list[str]:
    """The names of the places along an axis; of one without values their numbers from 1 on, where `numbers` has it."""
    if (values := record.get(axis)) is None:
        count = numbers.value.shape[numbers.axes.index(axis)] if numbers else 0
        return [str(i + 1) if count > 1 else "" for i in range(count)]
    label = record.by_name[axis].meaning.label
    form = label.format if label else _PLACES.get(axis, "{:g}".format)
    return [value if isinstance(value, str) else form(value) for value in values]


_NOTHING = Cells((), {})


def _size(axis: str, cells: Mapping[str, Cells]) -> int:
    """The length of an axis without values: 1 where there is nothing along it, so that the other axes have lines."""
    numbers = (place[own.axes.index(axis)] for own in cells.values() if axis in own.axes for place in own.texts)
    return max(numbers, default=0) + 1


def _is_shown(axis: str, readings: Sequence[Stored], cells: Sequence[Mapping[str, Any]]) -> bool:
    """Whether an axis has a column: not that of a single Casimir, or of a single function without a name."""
    if axis == "function":
        return any(places(record, axis, None) != ["phi"] for record in readings)
    return axis in readings[0].by_name or max(_size(axis, own) for own in cells) > 1


def _heading(axis: str, record: Stored) -> str:
    return str(getattr(record, "word", axis)) if axis == "value" else _HEADINGS.get(axis, axis)


# ---------------------------------------------------------------------------------------------------------------------
# A case: its tables and the lines under them
# ---------------------------------------------------------------------------------------------------------------------


def printed(title: str, readings: Sequence[Stored]) -> Iterator[Grid | Cell]:
    """The tables of the records of a case, the lines on each record, and those on the case."""
    for table in readings[0].tables:
        yield from table.items(title, readings)
    for record in readings:
        yield from map(Cell, _lines(record))
    yield from map(Cell, readings[0].remarks_of_case(readings))


def show_items(console: "Console", items: Iterable[Grid | Cell]) -> None:
    """Print tables and lines, however long, with an empty line behind each table and block of lines."""
    for is_table, members in groupby(items, lambda item: isinstance(item, Grid)):
        for item in members:
            if isinstance(item, Grid):
                print_whole(console, item.as_rich())
                console.print()
            else:
                console.print(item.text, style=item.style or None, markup=False, soft_wrap=True)
        if not is_table:
            console.print()


def _lines(record: Stored) -> Iterator[str]:
    """What is to be said of a record, after its label, and what it says itself."""
    for number, line in enumerate(_common(record)):
        yield f"    {line}" if number else f"{record.about.label}: {line}"
    yield from record.remarks()


def _common(record: Any) -> Iterator[str]:
    """Order, paths, angles of flows and solvers of equations, of records that have such fields."""
    if (order := getattr(record, "order", None)) is not None:
        few = math.isfinite(order.order) and order.points < len(record.h)
        through = f", through the finest {order.points} of {len(record.h)}" * few
        yield order_text(order.order, order.low, order.high, record.expected_order) + through
    if note := getattr(record, "note", ""):
        yield note
    if hasattr(record, "step") and hasattr(record, "samples"):
        lost = f", {record.nonfinite} of them diverged" * bool(record.nonfinite)
        paths = f"{record.samples} paths until t = {record.t[-1]:g} with h = {record.step:g}{lost}"
        yield f"{paths}, {record.ns_per_step:.1f} ns per step and path"
    if count := getattr(record, "reference_nonfinite", 0):
        yield f"{count} reference paths diverged (NaN or infinity)"
    angle: Any = getattr(record, "largest_angle", None)
    if angle is not None and np.ndim(angle) < 2 and (note := angle_note(float(np.max(angle)))):
        yield note
    yield from _accepted(record)
    solver: Any = getattr(record, "solver", None)
    if hasattr(solver, "solves") and np.ndim(solver.solves) < 2:
        solves, iterations, failures = (each.sum() for each in (solver.solves, solver.iterations, solver.failures))
        mean, residual = iterations / solves if solves else 0.0, short(solver.largest_residual.max(initial=0))
        yield f"solver: {mean:.1f} iterations a step, {failures:g} failures, largest residual {residual}"


def _accepted(record: Any) -> Iterator[str]:
    """The shares of flows that a scheme with a test of acceptance accepted, perhaps at each step size."""
    acceptance = getattr(record, "acceptance", None)
    if acceptance is None or np.ndim(acceptance.noise_accepted) > 1:
        return
    shares = np.atleast_1d(acceptance.noise_accepted), np.atleast_1d(acceptance.drift_accepted)
    for i, (noise, drift) in enumerate(zip(*shares, strict=True)):
        where = f"h = {record.h[i]:g}: " if np.ndim(acceptance.noise_accepted) else ""
        yield f"{where}accepted: {noise:.1%} of the noise flows, {drift:.1%} of the steps of the drift"
