"""Tables of statistics."""

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from spi.printing.rows import rows_of
from spi.printing.sentences import joined, sentence, whose
from spi.printing.text import INTERVAL, lines_of, new_table, print_whole, short, with_interval

from .results import DensityMap, Statistics

if TYPE_CHECKING:
    from rich.console import Console

_MOST_TIMES = 6  # that a table shows


def rows(readings: Iterable[Statistics]) -> Iterator[dict[str, Any]]:
    """A record per function and time; of several quantiles each has its column.  Histograms are left out."""
    for reading in readings:
        yield from rows_of(reading, ["function", "t"], spread=["level", "other"])


def show(console: "Console", heading: str, readings: Sequence[Statistics]) -> None:
    """Print the table of a case, of some of its times."""
    from rich.text import Text

    first = readings[0]
    levels = [f"{level:g}-quantile" for level in first.quantiles.level] if first.quantiles else []
    further = [f"{name} (95 %)" for name, values, _ in _further(first) if values is not None]
    known = ["difference\n(95 %)", "in std.\nerrors"] if first.difference is not None else []
    table = new_table(heading, ["scheme", "function", "t", "mean (95 %)", *known, *further, *levels], left=2, labels=0)
    for reading in readings:
        label = lines_of(reading.about)
        for f, name in enumerate(reading.functions):
            for i in shown(len(reading.t)):
                cells = list(map(Text, _cells(reading, f, i)))
                table.add_row(Text(label), Text(name), f"{reading.t[i]:.5g}", *cells)
                label = name = ""
        table.add_section()
    print_whole(console, table)
    console.print()
    for line in _remarks(readings):
        console.print(line, markup=False, highlight=False, soft_wrap=True)
    console.print()


def shown(times: int) -> list[int]:
    """The numbers of the times that a table shows, among them the last."""
    return np.unique(np.linspace(times - 1, 0, min(times, _MOST_TIMES)).round().astype(int)).tolist()


def _further(reading: Statistics) -> list[tuple[str, Any, Any]]:
    """What may stand in columns behind the mean: name, values and standard errors (F, T), or None."""
    return [
        ("variance", reading.variance, reading.variance_stderr),
        ("autocorrelation", reading.autocorrelation, reading.autocorrelation_stderr),
    ]


def _cells(reading: Statistics, f: int, i: int) -> Iterator[str]:
    yield _cell(reading.mean[f, i], reading.mean_stderr[f, i])
    if (deviation := reading.deviation) is not None and reading.difference is not None:
        yield _cell(reading.difference[f, i], reading.difference_stderr[f, i])
        yield f"{deviation[f, i]:.1f}" if np.isfinite(deviation[f, i]) else "-"
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
        if one.corrected:
            for f in np.flatnonzero(np.isfinite(one.corrected.share).any(axis=1)):
                last = np.flatnonzero(np.isfinite(one.corrected.share[f]))[-1]
                value, error = (float(each[f, last]) for each in (one.corrected.share, one.corrected.share_stderr))
                told = f"{with_interval(value, INTERVAL * error)} at t = {one.t[last]:.5g}"
                yield f"    {one.functions[f]}: {told}, corrected for looking at given times only (extrapolated)"
        if one.reference_step:
            yield f"    differences are from paths on the same noise with h = {one.reference_step:g}, or from what is known"
        if (found := one.density_map) is not None:
            yield f"    {_map_told(found)}"
        if one.quantiles:
            width = np.nanmax(one.quantiles.quantile_high - one.quantiles.quantile_low, initial=0.0)
            yield f"    intervals of quantiles, one bin on either side included, are at most {short(float(width))} wide"


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
