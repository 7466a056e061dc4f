"""Tables of Lyapunov exponents."""

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from spi.printing.rows import rows_of
from spi.printing.text import (
    add_rows,
    lines_of,
    new_table,
    print_with_remarks,
    short,
    with_interval,
)
from spi.statistics.estimators import student

from .results import Exponents

if TYPE_CHECKING:
    from rich.console import Console

_LARGE = 1e3  # factors of vectors between two stops from which on differences lose too many digits


def rows(readings: Iterable[Exponents]) -> Iterator[dict[str, Any]]:
    """A record per exponent and time, with the sum of all."""
    for reading in readings:
        yield from rows_of(reading, ["number", "t"])


def show(console: "Console", heading: str, readings: Sequence[Exponents]) -> None:
    """Print the table of a case: the exponents at the last time."""
    columns = ["scheme", *(f"exponent {k} (95 %)" for k in range(1, len(readings[0].number) + 1)), "sum (95 %)"]
    table = new_table(heading, [*columns, "dimension (95 %)"], left=1, labels=0)
    add_rows(table, map(_cells, readings))
    print_with_remarks(console, [table], _remarks(readings))


def _cells(reading: Exponents) -> Iterator[str]:
    yield lines_of(reading.about)
    yield from map(_value, reading.exponent[:, -1], reading.exponent_half[:, -1])
    yield _value(reading.total[-1], reading.total_half[-1])
    yield _dimension(reading)


def _dimension(reading: Exponents) -> str:
    half = reading.dimension_half
    if half is None and math.isfinite(reading.dimension):
        return f"{reading.dimension:g} or more"
    return _value(reading.dimension, half) if half else f"{reading.dimension:g}"


def _value(value: float, half: float) -> str:
    return with_interval(float(value), float(half))


def _remarks(readings: Sequence[Exponents]) -> Iterator[str]:
    yield "per unit of time; the dimension is that of Kaplan and Yorke"
    for reading in readings:
        lost = f", {reading.nonfinite} of them diverged" * bool(reading.nonfinite)
        speed = f"{reading.ns_per_step:.1f} ns per step and path with its near ones"
        paths = f"{reading.samples} paths until t = {reading.t[-1]:g} with h = {reading.step:g}{lost}"
        yield f"{reading.about.label}: {paths}, {speed}"
        if reading.change > _LARGE:
            yield f"    vectors changed by factors of {reading.change:.0e} between two stops: take a smaller `every`"
        if not reading.is_stationary:
            yield f"    {_drift(reading)}"
        if (pictures := reading.pictures) is not None:
            yield f"    {pictures.points} states on one path of noise, which began a time t ago:"
            for i, t in enumerate(pictures.t):
                mean = _value(pictures.distance[i], pictures.distance_half[i])
                distances = f"mean distance {mean}, typical one {short(float(pictures.typical[i]))}"
                yield f"    t = {t:g}: {distances}, in {pictures.occupied[i]:.1%} of the cells"


def _drift(reading: Exponents) -> str:
    """A remark that the energy still changes."""
    assert reading.energy is not None and reading.energy_stderr is not None
    ends = (_value(reading.energy[i], float(student(reading.samples - 1)) * reading.energy_stderr[i]) for i in (0, -1))
    began, ended = (f"{end} at t = {t:g}" for end, t in zip(ends, reading.t[[0, -1]], strict=True))
    return f"no stationary law was found, so that exponents are no limit: the mean of H goes from {began} to {ended}"
