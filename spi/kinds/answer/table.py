"""Answers as lines of text, and as rows of numbers."""

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from spi.printing.rows import rows_of
from spi.printing.text import human_time, power_of_two, print_lines, readable, short, with_interval

from .results import Answer

if TYPE_CHECKING:
    from rich.console import Console


def rows(readings: Sequence[Answer]) -> Iterator[dict[str, Any]]:
    """A record per test function."""
    for reading in readings:
        yield from rows_of(reading, ["function"])


def show(console: "Console", heading: str, readings: Sequence[Answer]) -> None:
    """Print the answers of a case."""
    if heading:
        console.print(heading, style="bold", markup=False)
    print_lines(console, (line for reading in readings for line in lines(reading)))


def lines(one: Answer) -> Iterator[str]:
    """An answer: values with intervals, how they were found, what that took, and what a person should know."""
    for f, name in enumerate(one.functions):
        formula = readable(one.formulas[f], one.about.variables)
        parts = f"of it bias at most {short(one.bias[f])}, sampling {short(one.sampling[f])}"
        known = parts if one.chosen else "numerical error, nothing is sampled"
        whose = f"E {name} = E {formula}" if formula != name else f"E {name}"
        found = f"{with_interval(one.value[f], one.half[f])} (95 %; {known})"
        if not np.isfinite(one.half[f]):
            found = f"{short(one.value[f])}, not resolved" if np.isfinite(one.value[f]) else "not finite"
        yield f"{whose} at t = {one.about.final_time:g}: {found}"
    yield f"  {how(one)}"
    yield f"  {cost(one)}"
    if one.why:
        yield f"  {one.why}"
    for warning in one.warnings:
        yield f"  warning: {warning}"


def how(one: Answer) -> str:
    """How an answer was found."""
    if not (chosen := one.chosen):
        return "without sampling, by the backward operator"
    times = {0: "", 1: " extrapolated once"}.get(chosen.extrapolated, f" extrapolated {chosen.extrapolated} times")
    steps = f"steps {power_of_two(chosen.largest_step)} to {power_of_two(chosen.smallest_step)}"
    paths = "quasi-random points" if chosen.points else "paths"
    by = f" and by {one.compared.reference}" if one.compared and one.compared.agrees else ""
    check = f"checked at {power_of_two(chosen.smallest_step / 2)}{by}" if chosen.passed else "the check failed"
    return f"{chosen.scheme}{times}, multilevel, {steps}, {chosen.samples:,} {paths} of the largest; {check}"


def cost(one: Answer) -> str:
    """What it took, and what the next digit would."""
    took = f"processor time {human_time(one.cpu_seconds)}"
    if not one.chosen and math.isfinite(one.predicted_seconds):
        took += f" (predicted {human_time(one.predicted_seconds)})"
    if one.chosen:
        took += f" (predicted {human_time(one.predicted_seconds)}, of it the pilot {human_time(one.pilot_seconds)})"
    known = np.isfinite(one.half).all() and np.isfinite(one.next_digit_seconds)
    return took + f"; the next digit would take about {human_time(one.next_digit_seconds)}" * bool(known)
