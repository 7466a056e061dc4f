"""Tables of statistics."""

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from spi.kinds.blocks import acceptance_note
from spi.printing.rows import rows_of
from spi.printing.text import (
    add_rows,
    decimal,
    lines_of,
    new_table,
    print_with_remarks,
    short,
    with_interval,
)

from .results import LEAST_GROUPS, DensityMap, Passages, Quantiles, Statistics

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
    yield _mean_cell(reading, f, i)
    if (deviation := reading.deviation) is not None:
        known = (each[f, i] for each in (reading.difference, reading.difference_stderr) if each is not None)
        yield _cell(reading, *known)
        yield decimal(deviation[f, i]) if np.isfinite(deviation[f, i]) else "-"
    for _, values, errors in _further(reading):
        if values is not None:
            yield _cell(reading, values[f, i], errors[f, i])
    if found := reading.quantiles:
        yield from (short(value, ".4g") if np.isfinite(value) else "-" for value in found.quantile[f, i])


def _mean_cell(reading: Statistics, f: int, i: int) -> str:
    """A mean with its interval, of a share from end to end; of values that are not all finite how many are."""
    if reading.finite_share[f, i] < 1.0:
        return f"finite in {_percent(reading.finite_share[f, i])}"
    if _is_share(reading, f) and reading.mean_stderr[f, i] != 0:
        low, high = (short(float(end[f, i]), ".3g") for end in reading.mean_ends)
        return f"{short(float(reading.mean[f, i]), '.4g')} [{low}, {high}]"
    return _cell(reading, reading.mean[f, i], reading.mean_stderr[f, i])


def _is_share(reading: Statistics, f: int) -> bool:
    return reading.passages is not None and bool(np.isfinite(reading.passages.time[f]))


def _percent(share: float) -> str:
    """Three digits, and never 100 % of less than all."""
    told = f"{100 * share:.3g}"
    return f"{told if told != '100' else f'{100 * share:.7f}'} %"


def _cell(reading: Statistics, value: float, stderr: float) -> str:
    if np.isnan(value):
        return "-"
    told = with_interval(float(value), reading.interval * float(stderr) if stderr else 0.0)
    return f"{told} ± ?" if np.isnan(stderr) and np.isfinite(value) else told


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
        yield from _errors_told(one)
        if one.passages:
            yield from _passages_told(one, one.passages)
        if one.reference_step:
            known = f"from paths on the same noise with h = {one.reference_step:g}, or from what is known"
            yield f"    differences are {known}"
        if (found := one.density_map) is not None:
            yield f"    {_map_told(found)}"
        if one.quantiles:
            yield f"    {_quantiles_told(one.quantiles)}"


def _errors_told(one: Statistics) -> Iterator[str]:
    """What is to be said where values are not finite, or errors are not known."""
    if (one.finite_share < 1.0).any():
        told = ", and quantiles are those of these paths" if one.quantiles else ""
        yield f"    finite in so many: the share of the paths whose value is finite; there is no mean of all{told}"
    unknown = np.isnan(one.mean_stderr) & np.isfinite(one.mean)
    if np.isnan(one.interval):
        yield f"    ± ?: fewer than {LEAST_GROUPS} paths tell no errors"
    elif unknown.any():
        yield "    ± ?: all paths have the same value, which tells no error"
    shares = np.array([_is_share(one, f) for f in range(len(one.functions))])
    if shares.any():
        yield "    in brackets: 95 % intervals of shares by Clopper and Pearson"


def _quantiles_told(found: Quantiles) -> str:
    """How wide their intervals are."""
    with np.errstate(invalid="ignore", over="ignore"):
        width = found.quantile_high - found.quantile_low
    finite = width[np.isfinite(width)]
    if not finite.size:
        return "the paths are too few for intervals of quantiles"
    told = f"are at most {short(float(finite.max()))} wide"
    return f"intervals of quantiles, one bin on either side included, {told}"


def _passages_told(one: Statistics, found: Passages) -> Iterator[str]:
    """How late passages are seen, and of each the mean time."""
    if found.between is not None:
        yield f"    passages are seen at looks only, every {found.between:.5g}:"
        yield "        shares are too small, and first times late, of paths with noise by about order 1/2 of that"
    for f in np.flatnonzero(np.isfinite(found.time)):
        mean = _cell(one, found.time[f], found.time_stderr[f])
        yield f"    {one.functions[f]}: mean time, {one.t[-1]:.5g} where it has not come: {mean}"


def _map_told(found: DensityMap) -> str:
    """What a map is of, and how exact."""
    some = found.density > 0
    relative = np.median(found.stderr[some] / found.density[some]) if some.any() else np.nan
    rows, columns = found.density.shape[1:]
    of = "the sphere" if found.is_sphere else " and ".join(found.sides)
    times = ", ".join(f"{t:.5g}" for t in found.t)
    told = f"standard errors of {relative:.0%} in the median" if some.any() else "no path is in any of them"
    return f"maps of {of} at t = {times} in {rows} x {columns} cells; {told}"
