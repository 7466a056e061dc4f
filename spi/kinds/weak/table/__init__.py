"""Tables of weak errors."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from spi.printing.rows import rows_of
from spi.printing.sentences import joined, orders, sentence, whose
from spi.printing.text import (
    error_and_remark,
    error_table,
    lines_of,
    lost_paths,
    power_of_two,
    print_lines,
    print_whole,
    with_interval,
)
from spi.storage.records import Order

from ..comparisons import agreement
from ..results import Prefixes, WeakErrors
from .levels import difference_table, level_table
from .summary import agreement_line, name_of, summaries

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

_AXES = ("function", "h")
#: What the rows of fewer paths have in common with those of all.
_OF_ALL = ("case", "scheme", "eps", "extrapolate", "estimator", *_AXES, "expected_order")


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
    errors = replace(reading, levels=None, differences=None)  # which have a table of their own
    yield from rows_of(errors, _AXES, derived={"agreement": (_AXES, found.deviation)} if found else {})


def _prefix_rows(reading: WeakErrors, prefixes: Prefixes, all_samples: int) -> Iterator[dict[str, Any]]:
    """Of fewer paths than all; expectations and orders are known of all only."""
    resolved = prefixes.resolved
    for n, samples in enumerate(prefixes.samples.tolist()):
        if samples == all_samples:
            continue
        fewer = {"samples": samples, "cpu_seconds": prefixes.cpu_seconds[n].item()}
        values = {"error": prefixes.error[n], "error_stderr": prefixes.error_stderr[n], "resolved": resolved[n]}
        for place, row in zip(np.ndindex(reading.error.shape), _point_rows(reading), strict=True):
            same = {name: row[name] for name in _OF_ALL if name in row}
            yield same | {name: of_all[place].item() for name, of_all in values.items()} | fewer


def show(console: "Console", heading: str, readings: Sequence[WeakErrors]) -> None:
    """Print the tables of a case: errors, what is to be said about them, and the levels of multilevel estimates."""
    print_whole(console, _errors(heading, readings))
    console.print()
    print_lines(console, summaries(readings))
    each = [(reading, f) for reading in readings for f in range(len(reading.functions))]
    for reading, f in each:
        for line, bad in agreement_line(reading, readings, f):
            print_lines(console, [f"{name_of(reading, f)}: {line}"], style="bold red" if bad else None)
    console.print()
    known = set()  # as those of one scheme serve all levels of extrapolation
    for reading, f in each:
        name = name_of(reading, f)
        if reading.differences:
            print_whole(console, difference_table(reading.differences, reading.h, f, name))
            console.print()
        if not (levels := reading.levels):
            continue
        of_all = reading.about.scheme, reading.about.eps, f, levels.samples.tobytes(), levels.mean[f].tobytes()
        if of_all not in known:
            known.add(of_all)
            of = f" of {reading.differences.scheme}" if reading.differences else ""
            print_whole(console, level_table(levels, f, f"{name}{of}"))
            console.print()


def told(readings: Sequence[WeakErrors]) -> str:
    """What came out of a case, in one sentence: orders, and whether sampled and deterministic errors agree.

    Of several estimators the one with the narrowest interval tells the order.
    """
    best: dict[tuple[str, str], tuple[str, Order, float | None]] = {}
    for reading in readings:
        for function, order in zip(reading.functions, reading.orders, strict=True):
            key = reading.about.variant, function
            if key not in best or _width(order) < _width(best[key][1]):
                best[key] = whose(reading.about), order, reading.expected_order
    return sentence([orders("weak", best.values()), *_agreement(readings)])


def _width(order: Order) -> float:
    return np.inf if np.isnan(order.order) else order.high - order.low


def _agreement(readings: Sequence[WeakErrors]) -> Iterator[str]:
    far: dict[str, float] = {}
    for reading in readings:
        found = agreement(reading, readings)
        known = np.abs(found.deviation[np.isfinite(found.deviation)]) if found else np.empty(0)
        if known.size:
            label = whose(reading.about)
            far[label] = max(far.get(label, 0.0), float(known.max()))
    if far:
        each = [f"{most:.1f} for {label}" for label, most in far.items()]
        yield f"sampled and deterministic errors differ by at most so many standard errors: {joined(each)}"


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
    return error_table(heading, headings, len(names), (_labelled(reading, several, lost) for reading in readings))


def _labelled(reading: WeakErrors, several: bool, lost: bool) -> tuple[list[str], list[tuple["str | Text", ...]]]:
    """The labels of one scheme and estimator, and the cells of each line."""
    lines, labels = list(_lines(reading, several, lost)), [lines_of(reading.about), reading.about.estimator]
    return ["\n".join(labels)] if len(lines) == 1 else labels, lines


def _lines(reading: WeakErrors, several: bool, lost: bool) -> Iterator[tuple["str | Text", ...]]:
    """The cells of each line of one scheme and estimator, which name the test function and count lost paths or not."""
    from rich.text import Text

    halves = zip(reading.half.flat, reading.expectation_half.flat, strict=True)
    before = None
    for record, (half, expectation_half) in zip(_point_rows(reading), halves, strict=True):
        error, remark = error_and_remark(record, half)
        yield (
            *[Text(record["function"] if record["function"] != before else "")] * several,
            power_of_two(record["h"]),
            error,
            with_interval(record["expectation"], expectation_half),
            *[lost_paths(record.get("nonfinite"))] * lost,
            remark,
        )
        before = record["function"]
