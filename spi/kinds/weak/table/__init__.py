"""Tables of weak errors."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from spi.printing.text import (
    error_and_remark,
    in_order,
    lines_of,
    lost_paths,
    new_table,
    power_of_two,
    print_whole,
    with_interval,
)

from ..reading import Stages, WeakErrors
from ..reading.comparisons import agreement
from .levels import difference_table, level_table
from .summary import agreement_line, name_of, summaries
from .told import told as told

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

#: The columns of the records, in this order.
COLUMNS = (
    *("case", "scheme", "eps", "extrapolate", "estimator", "function", "h", "error", "error_stderr", "error_bound"),
    *("expectation", "expectation_stderr", "expectation_bound", "reference", "limit", "limit_bound", "resolved"),
    *("agreement", "order", "order_low", "order_high", "expected_order"),
    *("samples", "cpu_seconds", "ns_per_step", "nonfinite"),
)


def rows(readings: Sequence[WeakErrors]) -> Iterator[dict[str, Any]]:
    """A record per test function and step size; after them those of the first so many paths, where they are kept.

    ``agreement`` is the error less the deterministic one, in standard errors.
    """
    for reading in readings:
        yield from _point_rows(reading, readings)
        if reading.prefixes and reading.sampled:
            yield from _prefix_rows(reading, reading.prefixes, reading.sampled.samples)


def _point_rows(reading: WeakErrors, readings: Sequence[WeakErrors] = ()) -> Iterator[dict[str, Any]]:
    """The records of all step sizes; their ``agreement`` with one of `readings`, if it is not sampled."""
    found = agreement(reading, readings)
    whole = _whole(reading) | {"cpu_seconds": reading.cpu_seconds}
    per_point = {name: getattr(reading, name) for name in ("error", "expectation", "resolved")}
    per_function = {}
    if reading.sampled:
        whole |= {name: getattr(reading.sampled, name) for name in ("samples", "ns_per_step")}
        per_point |= {name: getattr(reading.sampled, name) for name in ("error_stderr", "expectation_stderr")}
        per_function["reference"] = reading.sampled.reference
    if reading.unsampled:
        per_point |= {name: getattr(reading.unsampled, name) for name in ("error_bound", "expectation_bound")}
        per_function |= {name: getattr(reading.unsampled, name) for name in ("limit", "limit_bound")}
    if found:
        per_point["agreement"] = found.deviation
    for f, function in enumerate(reading.functions):
        order = dict(zip(("order", "order_low", "order_high"), reading.orders[f], strict=False))
        for i, h in enumerate(reading.h.tolist()):
            record = whole | order | {name: values[f].item() for name, values in per_function.items()}
            record |= {"function": function, "h": h}
            record |= {name: values[f, i].item() for name, values in per_point.items()}
            record["nonfinite"] = None if reading.nonfinite is None else reading.nonfinite[i].item()
            yield in_order(record, COLUMNS)


def _prefix_rows(reading: WeakErrors, stages: Stages, all_samples: int) -> Iterator[dict[str, Any]]:
    """Of fewer paths than all; expectations and orders are known of all only."""
    resolved = stages.resolved
    for n, samples in enumerate(stages.samples.tolist()):
        if samples == all_samples:
            continue
        run = _whole(reading) | {"samples": samples, "cpu_seconds": stages.cpu_seconds[n].item()}
        for f, function in enumerate(reading.functions):
            for i, h in enumerate(reading.h.tolist()):
                values = {name: getattr(stages, name)[n, f, i].item() for name in ("error", "error_stderr")}
                where = {"function": function, "h": h, "resolved": resolved[n, f, i].item()}
                yield in_order(run | where | values, COLUMNS)


def _whole(reading: WeakErrors) -> dict[str, Any]:
    one = {name: getattr(reading.about, name) for name in ("case", "scheme", "eps", "estimator")}
    return one | {"extrapolate": reading.about.extrapolate or None, "expected_order": reading.expected_order}


def show(console: "Console", heading: str, readings: Sequence[WeakErrors]) -> None:
    """Print the tables of a case: errors, what is to be said about them, and the levels of multilevel estimates."""
    print_whole(console, _errors(heading, readings))
    console.print()
    for line in summaries(readings):
        console.print(line, markup=False, soft_wrap=True)
    each = [(reading, f) for reading in readings for f in range(len(reading.functions))]
    for reading, f in each:
        for line, bad in agreement_line(reading, readings, f):
            style = "bold red" if bad else None
            console.print(f"{name_of(reading, f)}: {line}", style=style, markup=False, soft_wrap=True)
    console.print()
    for reading, f in each:
        name = name_of(reading, f)
        if reading.differences:
            print_whole(console, difference_table(reading.differences, reading.h, f, name))
            console.print()
        if reading.levels:
            of = f" of {reading.differences.scheme}" if reading.differences else ""
            print_whole(console, level_table(reading.levels, f, f"{name}{of}"))
            console.print()


def _errors(heading: str, readings: Sequence[WeakErrors]) -> "Table":
    """The table of errors and expectations, a line per test function and step size."""
    trust = " or ".join(
        ["95 %"] * any(reading.sampled for reading in readings)
        + ["bound"] * any(reading.unsampled for reading in readings)
    )
    several = any(len(reading.functions) > 1 for reading in readings)
    lost = any(reading.nonfinite is not None and reading.nonfinite.any() for reading in readings)
    names = ["scheme,\nestimator", *["function"] * several, "h"]
    headings = [*names, f"weak error ({trust})", f"expectation ({trust})", *["di-\nverged"] * lost, ""]
    table = new_table(heading, headings, left=len(names), labels=0)
    table.columns[-1].justify = "left"
    for reading in readings:
        for cells in _lines(reading, several, lost):
            table.add_row(*cells)
        table.add_section()
    return table


def _lines(reading: WeakErrors, several: bool, lost: bool) -> Iterator[tuple["str | Text", ...]]:
    """The cells of each line of one scheme and estimator, which name the test function and count lost paths or not."""
    from rich.text import Text

    records = list(_point_rows(reading))
    both = [lines_of(reading.about), reading.about.estimator]
    labels = iter(["\n".join(both)] if len(records) == 1 else both)
    halves = zip(reading.half.flat, reading.expectation_half.flat, strict=True)
    before = None
    for record, (half, expectation_half) in zip(records, halves, strict=True):
        error, remark = error_and_remark(record, half)
        yield (
            Text(next(labels, "")),
            *[Text(record["function"] if record["function"] != before else "")] * several,
            power_of_two(record["h"]),
            error,
            with_interval(record["expectation"], expectation_half),
            *[lost_paths(record.get("nonfinite"))] * lost,
            remark,
        )
        before = record["function"]
