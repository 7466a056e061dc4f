"""Tables of strong errors."""

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from spi.kinds.blocks import acceptance_note
from spi.printing.rows import rows_of
from spi.printing.text import (
    INTERVAL,
    angle_note,
    error_and_remark,
    error_table,
    lines_of,
    lost_paths,
    order_found,
    power_of_two,
    print_lines,
    print_whole,
    short,
)

from .results import StrongErrors

if TYPE_CHECKING:
    from rich.console import Console
    from rich.text import Text


def rows(readings: Iterable[StrongErrors]) -> Iterator[dict[str, Any]]:
    """A record per step size; of several Casimirs the largest drift."""
    for reading in readings:
        yield from rows_of(reading, ["h"], largest=["casimir"])


def show(console: "Console", heading: str, readings: Sequence[StrongErrors]) -> None:
    """Print the table of a case."""
    headings = ["scheme", "h", "strong error (95 %)", "Casimir\ndrift", "di-\nverged", "ns per\nstep", ""]
    parts = (([lines_of(reading.about)], _lines(reading)) for reading in readings)
    print_whole(console, error_table(heading, headings, 3, parts))
    console.print()
    print_lines(console, (line for reading in readings for line in _summary(reading)))
    console.print()


def _lines(reading: StrongErrors) -> Iterator[tuple["str | Text", ...]]:
    """The cells of each step size."""
    for record in rows([reading]):
        error, remark = error_and_remark(record, INTERVAL * record["error_stderr"])
        drift, ns = short(record.get("casimir_drift")), short(record.get("ns_per_step"), ".1f")
        yield power_of_two(record["h"]), error, drift, lost_paths(record.get("nonfinite", 0)), ns, remark


def _summary(reading: StrongErrors) -> Iterator[str]:
    """What is to be said about all step sizes of one scheme."""
    order, points = reading.order, len(reading.h)
    few = order.points < points and order.order == order.order
    through = f", through the finest {order.points} of {points}" if few else ""
    yield f"{reading.about.label}: {order_found(*order[:3], reading.expected_order)}{through}"
    if reading.note:
        yield f"    {reading.note}"
    if reading.reference_nonfinite:
        yield f"    {reading.reference_nonfinite} reference paths diverged (NaN or infinity)"
    if reading.largest_angle is not None and (note := angle_note(float(reading.largest_angle.max()))):
        yield f"    {note}"
    for i, h in enumerate(reading.h.tolist() if reading.acceptance else ()):
        yield f"    h = {h:g}: {acceptance_note(reading.acceptance, i)}"
    if reading.solver:
        solver = reading.solver
        solves, iterations, failures = (each.sum() for each in (solver.solves, solver.iterations, solver.failures))
        residual = solver.largest_residual.max(initial=0)
        mean = iterations / solves if solves else 0.0
        yield f"    solver: {mean:.1f} iterations a step, {failures:g} failures, largest residual {short(residual)}"
