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


def _cells(one: Exponents) -> Iterator[str]:
    yield lines_of(one.about)
    yield from map(_value, one.exponent[:, -1], one.exponent_half[:, -1])
    yield _value(one.total[-1], one.total_half[-1])
    yield _dimension(one)


def _dimension(one: Exponents) -> str:
    half = one.dimension_half
    if half is None and math.isfinite(one.dimension):
        return f"{one.dimension:g} or more"
    return _value(one.dimension, half) if half else f"{one.dimension:g}"


def _value(value: float, half: float) -> str:
    return with_interval(float(value), float(half))


def _remarks(readings: Sequence[Exponents]) -> Iterator[str]:
    yield "per unit of time; the dimension is that of Kaplan and Yorke"
    for one in readings:
        lost = f", {one.nonfinite} of them diverged" * bool(one.nonfinite)
        speed = f"{one.ns_per_step:.1f} ns per step and path with its near ones"
        yield f"{one.about.label}: {one.samples} paths until t = {one.t[-1]:g} with h = {one.step:g}{lost}, {speed}"
        if one.change > _LARGE:
            yield f"    vectors changed by factors of {one.change:.0e} between two stops: take a smaller `every`"
        if not one.is_stationary:
            yield f"    {_drift(one)}"
        if (found := one.pictures) is not None:
            yield f"    {found.points} states on one path of noise, which began a time t ago:"
            for i, t in enumerate(found.t):
                mean = _value(found.distance[i], found.distance_half[i])
                told = f"mean distance {mean}, typical one {short(float(found.typical[i]))}"
                yield f"    t = {t:g}: {told}, in {found.occupied[i]:.1%} of the cells"


def _drift(one: Exponents) -> str:
    """That the energy still changes."""
    assert one.energy is not None and one.energy_stderr is not None
    ends = (_value(one.energy[i], float(student(one.samples - 1)) * one.energy_stderr[i]) for i in (0, -1))
    began, ended = (f"{end} at t = {t:g}" for end, t in zip(ends, one.t[[0, -1]], strict=True))
    return f"no stationary law was found, so that exponents are no limit: the mean of H goes from {began} to {ended}"
