"""Tables of statistics."""

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from spi.kinds.solver import acceptance_note
from spi.printing.rows import rows_of
from spi.printing.sentences import joined, sentence, whose
from spi.printing.text import INTERVAL, add_rows, decimal, lines_of, new_table, print_with_remarks, short, with_interval

from .results import DensityMap, Passages, Statistics

if TYPE_CHECKING:
    from rich.console import Console

_MOST_TIMES = 6  # that a table shows


def rows(readings: Iterable[Statistics]) -> Iterator[dict[str, Any]]:
    """A record per function and time; of several quantiles each has its column.  Histograms are left out."""
    for reading in readings:
        yield from rows_of(reading, ["function", "t"], spread=["level", "other"])


def show(console: "Console", heading: str, readings: Sequence[Statistics]) -> None:
    """Print the table of a case, of some of its times."""
    first = readings[0]
    levels = [f"{level:g}-quantile" for level in first.quantiles.level] if first.quantiles else []
    further = [f"{name} (95 %)" for name, values, _ in _further(first) if values is not None]
    known = ["difference\n(95 %)", "in std.\nerrors"] if first.difference is not None else []
    table = new_table(heading, ["scheme", "function", "t", "mean (95 %)", *known, *further, *levels], left=2, labels=0)
    for reading in readings:
        lines = [
            [lines_of(reading.about), name, f"{reading.t[i]:.5g}", *_cells(reading, f, i)]
            for f, name in enumerate(reading.functions)
            for i in shown(reading, f)
        ]
        add_rows(table, lines, labels=2)
    print_with_remarks(console, [table], _remarks(readings))


def shown(reading: Statistics, f: int) -> list[int]:
    """Which times a table shows of a function: of those at which a reference is known, if there are any."""
    times = np.arange(len(reading.t))
    if reading.difference is not None and (there := np.isfinite(reading.difference[f])).any():
        times = times[there]
    return times[np.unique(np.linspace(len(times) - 1, 0, min(len(times), _MOST_TIMES)).round().astype(int))].tolist()


def _further(reading: Statistics) -> list[tuple[str, Any, Any]]:
    """What may stand in columns behind the mean: name, values and standard errors (F, T), or None."""
    return [
        ("variance", reading.variance, reading.variance_stderr),
        ("autocorrelation", reading.autocorrelation, reading.autocorrelation_stderr),
    ]


def _cells(reading: Statistics, f: int, i: int) -> Iterator[str]:
    yield _cell(reading.mean[f, i], reading.mean_stderr[f, i])
    if (deviation := reading.deviation) is not None:
        yield _cell(*(each[f, i] for each in (reading.difference, reading.difference_stderr) if each is not None))
        yield decimal(deviation[f, i]) if np.isfinite(deviation[f, i]) else "-"
    for _, values, errors in _further(reading):
        if values is not None:
            yield _cell(values[f, i], errors[f, i])
    if found := reading.quantiles:
        yield from (short(value, ".4g") if np.isfinite(value) else "-" for value in found.quantile[f, i])


def _cell(value: float, stderr: float) -> str:
    return "-" if np.isnan(value) else with_interval(float(value), INTERVAL * float(stderr))


def _remarks(readings: Sequence[Statistics]) -> Iterator[str]:
    first = readings[0]
    for name, text in zip(first.functions, first.texts, strict=True):
        if name != text:
            yield f"{name}: {text}"
    for one in readings:
        lost = f", {one.nonfinite} of them diverged" * bool(one.nonfinite)
        speed = f"{one.ns_per_step:.1f} ns per step and path"
        yield f"{one.about.label}: {one.samples} paths with h = {one.step:g}{lost}, {speed}"
        if note := acceptance_note(one.acceptance):
            yield f"    {note}"
        if one.passages:
            yield from _passages_told(one, one.passages)
        if one.reference_step:
            known = f"from paths on the same noise with h = {one.reference_step:g}, or from what is known"
            yield f"    differences are {known}"
        if (found := one.density_map) is not None:
            yield f"    {_map_told(found)}"
        if one.quantiles:
            width = np.nanmax(one.quantiles.quantile_high - one.quantiles.quantile_low, initial=0.0)
            yield f"    intervals of quantiles, one bin on either side included, are at most {short(float(width))} wide"


def _passages_told(one: Statistics, found: Passages) -> Iterator[str]:
    """Of each passage the share of the paths until the last time, with its bias, and the mean time."""
    for f in np.flatnonzero(np.isfinite(found.share).any(axis=1)):
        last = np.flatnonzero(np.isfinite(found.share[f]))[-1]
        share, error = found.share[f, last], found.share_stderr[f, last]
        end, order = f"{one.t[last]:.5g}", f"order {_cell(found.order[f], found.order_stderr[f])}"
        yield f"    {one.functions[f]}: {_cell(share, error)} of the paths until t = {end}, the others never by then,"
        yield f"        corrected for looking at given times only (observed {order} in the time between two looks);"
        yield f"        mean time, {end} where it has not come: {_cell(found.time[f], found.time_stderr[f])}"


def _map_told(found: DensityMap) -> str:
    """What a map is of, and how exact."""
    with np.errstate(all="ignore"):
        relative = np.nanmedian(np.where(found.density > 0, found.stderr / found.density, np.nan))
    rows, columns = found.density.shape[1:]
    of = "the sphere" if found.is_sphere else " and ".join(found.sides)
    times = ", ".join(f"{t:.5g}" for t in found.t)
    return f"maps of {of} at t = {times} in {rows} x {columns} cells; standard errors of {relative:.0%} in the median"


def told(readings: Sequence[Statistics]) -> str:
    """What came out of a case, in one sentence: the means at the end."""
    names = readings[0].functions[:3]
    found = []
    for f, name in enumerate(names):
        values = [
            f"{with_interval(float(one.mean[f, -1]), INTERVAL * float(one.mean_stderr[f, -1]))} with {whose(one.about)}"
            for one in readings
        ]
        found.append(f"the mean of {name} at t = {readings[0].t[-1]:g} is {joined(values)}")
    return sentence(found)
