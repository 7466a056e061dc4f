"""Tables of stability: the step sizes up to which a scheme keeps each property, for each value of the parameter."""

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from spi.printing.rows import rows_of
from spi.printing.text import (
    add_rows,
    lines_of,
    new_table,
    power_of_two,
    print_with_remarks,
    short,
)

from .results import CASIMIR_KEPT, REGIMES, Stability, largest_step

if TYPE_CHECKING:
    from rich.console import Console


def rows(readings: Iterable[Stability]) -> Iterator[dict[str, Any]]:
    """A record per value and step size; of several Casimirs the largest error."""
    for reading in readings:
        regime = {"regime": (("value", "h"), np.array(REGIMES)[reading.regimes])}
        yield from rows_of(reading, ["value", "h"], largest=["casimir"], derived=regime)


def show(console: "Console", heading: str, readings: Sequence[Stability]) -> None:
    """Print the table of a case: a line per scheme and value."""
    summaries = [list(_summary(reading)) for reading in readings]
    shown = [name for name in _HEADINGS if any(name in line for lines in summaries for line in lines)]
    headings = ["scheme", readings[0].word, *(_HEADINGS[name] for name in shown)]
    table = new_table(heading, headings, left=1, labels=0)
    for reading, lines in zip(readings, summaries, strict=True):
        values = zip(reading.values.tolist(), lines, strict=True)
        label = lines_of(reading.about)
        add_rows(table, ([label, f"{value:g}", *(line.get(name, "") for name in shown)] for value, line in values))
    print_with_remarks(console, [table], _remarks(readings))


#: The columns of the table, with their headings.
_HEADINGS = {
    "finite": "all paths\nfinite, h",
    "kept": "Casimir\nkept, h",
    "accurate": "accurate,\nh",
    "casimir": "worst\nCasimir",
    "failures": "solver\nfailures",
    "iterations": "iter-\nations",
    "positive": "positive\npaths",
    "angle": "largest\nangle",
}


def _summary(reading: Stability) -> Iterator[dict[str, str]]:
    """The texts of the columns, for each value."""
    for i in range(len(reading.values)):
        line = {
            "finite": _step(reading.h, reading.all_finite[i]),
            "accurate": _step(reading.h, reading.is_accurate[i]),
        }
        if reading.casimirs:
            casimir = reading.casimirs.largest_worst[i]
            line["kept"] = _step(reading.h, casimir < CASIMIR_KEPT)
            line["casimir"] = short(float(casimir.max(initial=0.0)))
        if reading.solver:
            line["failures"] = _percent(float(reading.solver.failing_fraction[i].max(initial=0.0)))
            line["iterations"] = _range(reading.solver.iterations_per_solve[i])
        if reading.positive is not None:
            line["positive"] = _percent(float(reading.positive[i].min(initial=1.0)))
        if reading.largest_angle is not None:
            angle = float(reading.largest_angle[i].max(initial=0.0))
            line["angle"] = f"{angle:.2g}" if angle else "< pi/4"
        yield line


def _step(h: np.ndarray, good: np.ndarray) -> str:
    """The largest step size up to which all is good; with >= if all were, since the true one may be larger."""
    largest, is_all = largest_step(h, good)
    return "none" if math.isnan(largest) else f"{'>= ' * is_all}{power_of_two(largest)}"


def _percent(fraction: float) -> str:
    """A fraction in per cent with two digits; 0 and 100 only if it is that."""
    if fraction in (0.0, 1.0) or not math.isfinite(fraction):
        return f"{100 * fraction:g} %"
    return f"{100 * fraction:.2g} %" if fraction < 0.99 else f"{100 - float(f'{100 - 100 * fraction:.1g}'):.10g} %"


def _range(values: np.ndarray) -> str:
    """From the smallest to the largest number, with one decimal."""
    finite = values[np.isfinite(values)]
    if not len(finite):
        return ""
    low, high = f"{finite.min():.1f}", f"{finite.max():.1f}"
    return low if low == high else f"{low}-{high}"


def _remarks(readings: Sequence[Stability]) -> Iterator[str]:
    """Remarks on the whole table."""
    first = readings[0]
    meaning = (
        f"Casimir kept: relative error < {short(CASIMIR_KEPT, '.0e')} on the worst path; " if first.casimirs else ""
    )
    yield (
        f"h: the largest step size at which this holds, as at all smaller ones; {meaning}"
        f"accurate: root mean square error at T <= {first.accurate:g} |y_0|; all else: worst over h"
    )
    seconds = sum(reading.wall_seconds for reading in readings)
    yield (
        f"{first.samples} paths each; errors against the scheme at {power_of_two(first.reference_step)}; "
        f"{seconds:.3g} s on {first.threads} threads"
    )
