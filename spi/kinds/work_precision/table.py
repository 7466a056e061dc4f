"""Tables of what accuracy costs."""

import math
import re
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from spi.printing.rows import rows_of
from spi.printing.text import (
    duration,
    error_and_remark,
    error_table,
    lines_of,
    lost_paths,
    new_table,
    order_found,
    power_of_two,
    print_lines,
    print_whole,
    readable,
    short,
)

from ..weak.results import cannot_do
from .results import WorkPrecision, requested
from .work_points import Factor, WorkPoint, cheapest, work_for

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

_HEADING = 10  # characters of the label of a scheme over a column of factors


def rows(readings: Iterable[WorkPrecision]) -> Iterator[dict[str, Any]]:
    """A record per step size; of several Casimirs the largest drift, the times are the median and the quartiles."""
    for reading in readings:
        yield from rows_of(reading, ["h"], largest=["casimir"])


def show(console: "Console", heading: str, readings: Sequence[WorkPrecision]) -> None:
    """Print the tables of a case: errors and times, and which scheme reaches a requested error in the least time."""
    print_whole(console, _points(heading, readings))
    console.print()
    first, summaries = readings[0], (line for reading in readings for line in _summary(reading))
    none = [cannot_do("the estimators", first.left_out)] if first.left_out else []
    print_lines(console, [*_measured(first), *summaries, *none])
    console.print()
    table, remarks = _requested(readings)
    print_whole(console, table)
    print_lines(console, remarks, style="dim")
    console.print()


def _points(heading: str, readings: Sequence[WorkPrecision]) -> "Table":
    """The table of errors and times."""
    trust = dict.fromkeys("bound" if reading.exact else "95 %" for reading in readings)
    error = f"{readings[0].measure} error ({' or '.join(trust)})"
    drifts = any(reading.largest_drift is not None for reading in readings)
    losses = any(reading.nonfinite is not None for reading in readings)
    optional = [*["Casimir\ndrift"] * drifts, *["di-\nverged"] * losses]
    headings = ["scheme", "h", error, "time per\npath", "ns per\nstep", *optional, ""]
    parts = (([lines_of(reading.about)], _lines(reading, drifts, losses)) for reading in readings)
    return error_table(heading, headings, 3, parts)


def _lines(reading: WorkPrecision, drifts: bool, losses: bool) -> Iterator[tuple["str | Text", ...]]:
    """The cells of each step size, with errors of Casimirs or without, and with diverged paths or without."""
    for record, half in zip(rows([reading]), reading.half.tolist(), strict=True):
        value, remark = error_and_remark(record, half)
        yield (
            power_of_two(record["h"]),
            value,
            duration(record["seconds_per_path"]),
            short(record["ns_per_step"], ".1f"),
            *[short(record.get("casimir_drift"))] * drifts,
            *[lost_paths(record.get("nonfinite", 0))] * losses,
            remark,
        )


def _measured(reading: WorkPrecision) -> Iterator[str]:
    """What the errors and the times of a case are."""
    if reading.functions:
        functions = ", ".join(readable(function, reading.about.variables) for function in reading.functions)
        yield f"error of the expectation of {functions}"
    repeats = f"the median of {reading.repeats} repeats"
    yield f"time: of one processor core for one path to T = {reading.about.final_time:g}, {repeats}"


def _summary(reading: WorkPrecision) -> Iterator[str]:
    """What is to be said about all step sizes of one scheme."""
    yield f"{reading.about.label}: {order_found(*reading.order[:3], reading.expected_order)}"
    if reading.note:
        yield f"    {reading.note}"


def _requested(readings: Sequence[WorkPrecision]) -> tuple["Table", list[str]]:
    """The table of requested errors, and the lines that explain its marks.

    A column per scheme says how many times as long it takes as the cheapest.
    """
    from rich.text import Text

    labels = {reading.about.variant: reading.about.label for reading in readings}
    headings = ["error", "cheapest", "h", "time", *map(_heading, labels.values())]
    table = new_table(
        "cheapest scheme for a requested error, times of the others as multiples", headings, left=3, labels=1
    )
    if len(labels) > 4:
        table.padding = 0  # else it is too wide
    marks: set[str] = set()
    for target in reversed(requested(readings)):
        best, point, cells = _fastest(target, readings)
        marks.update(re.sub(r"[\d. ]", "", cell) for cell in cells.values())
        factors = [Text(cell, style="bold" if variant == best else "") for variant, cell in cells.items()]
        table.add_row(_plainly(target), Text(labels[best] if best else "none"), *_needs(point), *factors)
        marks.add("≤" * (point is not None and point.at_most))
    remarks = {
        "tie": "tie: the 95 % interval of the factor contains 1",
        "≤": "≤: the largest step that was run does already, or paths diverged at the next larger one",
        "≥": "≥: so it is for the cheapest scheme",
        "()": "( ): so it is for both, which leaves open which is cheaper",
        "-": "-: not reached at the steps that were run",
    }
    return table, [text for mark, text in remarks.items() if mark in marks]


def _fastest(target: float, readings: Sequence[WorkPrecision]) -> tuple[str | None, WorkPoint | None, dict[str, str]]:
    """For a requested error the cheapest scheme, its work point, and for each scheme the text of its factor."""
    works = {reading.about.variant: work_for(target, reading.curve) for reading in readings}
    best, factors = cheapest(works)
    cells = dict.fromkeys(works, "-") | ({best: "1"} if best else {})
    cells |= {variant: _factor(factor) for variant, factor in factors.items()}
    return best, works[best] if best else None, cells


def _needs(point: WorkPoint | None) -> tuple[str, str]:
    """Step size and time of a work point."""
    if point is None:
        return "", ""
    exponent = f"{math.log2(point.h):z.1f}".removesuffix(".0")
    return f"2^{exponent}", "≤ " * point.at_most + duration(point.seconds)


def _factor(factor: Factor) -> str:
    """``2.3``, with what is to be known of its interval."""
    digits = 2 if factor.value < 1.995 else 1 if factor.value < 9.95 else 0
    value = f"{factor.value:.{digits}f}"
    if factor.low == 0.0:
        return f"({value})" if math.isinf(factor.high) else f"≤ {value}"
    return f"tie {value}" if factor.tie else f"≥ {value}" if math.isinf(factor.high) else value


def _plainly(x: float) -> str:
    """``1e-3`` for 0.001, ``2.5e-2`` for 0.025."""
    digits, _, exponent = f"{x:.2e}".partition("e")
    return f"{float(digits):g}e{int(exponent)}" if int(exponent) else f"{float(digits):g}"


def _heading(label: str) -> str:
    """A label in lines of few characters."""
    lines = textwrap.wrap(label.replace("order ", "order\xa0"), _HEADING, break_long_words=False)
    return "\n".join(lines).replace("\xa0", " ")
