"""The table of means of functions at equilibrium, and what is to be said of them: warnings, orders, what to run."""

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from spi.printing.text import INTERVAL, add_rows, decimal, lines_of, new_table, power_of_two, short, with_interval

from ..results import APART, LONG_ENOUGH, Averages, Equilibrium, with_averages

if TYPE_CHECKING:
    from rich.table import Table

#: A difference between both halves of the kept time of so many standard errors has this probability by chance.
_SELDOM = 0.01


def table(readings: Sequence[Equilibrium]) -> "Table":
    """Per scheme, function and step size the mean, how far it is from what is known, and its autocorrelation time."""
    first = next(found for _, found in with_averages(readings))
    known = bool(np.isfinite(first.reference).any())
    responses = [first.response(f)[0] for f in range(len(first.functions)) if np.isfinite(first.response(f)[1])]
    headings = ["scheme", "function", "h", "mean (95 %)", *["bias (95 %)", "in std.\nerrors"] * known]
    headings += ["autocor-\nrelation time", *[f"{' or '.join(dict.fromkeys(responses))}\n(95 %)"] * bool(responses)]
    found_table = new_table("means over time", headings, left=3, labels=0)
    for reading, found in with_averages(readings):
        lines = []
        for f, name in enumerate(found.functions):
            for i, h in enumerate(reading.h.tolist()):
                more = _response(found, i, f) if responses else ()
                lines.append([lines_of(reading.about), name, power_of_two(h), *_cells(found, i, f, known), *more])
        add_rows(found_table, lines, labels=2)
    return found_table


def _cell(value: float, half: float) -> str:
    return with_interval(float(value), float(half)) if math.isfinite(value) and math.isfinite(half) else "-"


def _cells(found: Averages, i: int, f: int, known: bool) -> Iterator[str]:
    yield _cell(found.average[i, f], found.average_half[i, f])
    if known:
        factor = found.average_half[i, f] / found.stderr[i, f] if found.stderr[i, f] else INTERVAL
        of_bias = found.bias[i, f], factor * found.bias_stderr[i, f]
        yield _cell(*of_bias) if found.bias_stderr[i, f] else "reference"
        yield decimal(found.deviation[i, f]) if np.isfinite(found.deviation[i, f]) else "-"
    yield _cell(found.tau[i, f], INTERVAL * found.tau_stderr[i, f])


def _response(found: Averages, i: int, f: int) -> Iterator[str]:
    _, factor = found.response(f)
    yield _cell(factor * found.variance[i, f], INTERVAL * abs(factor) * found.variance_stderr[i, f])


def remarks(readings: Sequence[Equilibrium]) -> Iterator[str]:
    """What was kept, warnings, orders of biases, and what to run for a wanted accuracy."""
    for k, (reading, found) in enumerate(with_averages(readings)):
        if not k:
            time = found.kept * found.spacing
            values = f"{found.kept} values of each path {found.spacing:g} apart"
            yield f"means over the last {time:.6g} of the time, {values}"
            yield from (f"{n}: {text}" for n, text in zip(found.functions, found.texts, strict=True) if n != text)
        yield from (f"{reading.about.label}, {line}" for line in _warnings(reading, found))
        for f, name in enumerate(found.functions):
            if math.isfinite((order := found.order[f]).order):
                law = f"{found.constant[f]:.2g} h^{order.order:.2f}"
                yield f"{reading.about.label}: bias of {name} {law}, order in [{order.low:.2f}, {order.high:.2f}]"
        yield from planned(reading, found)


def _warnings(reading: Equilibrium, found: Averages) -> Iterator[str]:
    """One line for each thing that makes the errors of the means doubtful, of the worst step size and function."""
    from scipy.special import stdtrit  # not needed to start the program

    count, paths = found.average.size, reading.samples
    likely = float(stdtrit(max(paths - 1, 15), 1 - 0.5 * (1 - (1 - _SELDOM) ** (1 / count))))
    for text, value, bad in (
        (
            "burn-in: the second half of the kept time differs from the first by {} standard errors of that; "
            "give a longer burn_in and final_time",
            halves := np.abs(found.halves),
            halves > likely,
        ),
        (
            f"a path has {{:.0f}} autocorrelation times, fewer than {LONG_ENOUGH}; run longer",
            lengths := found.kept * found.spacing / np.maximum(found.tau, 1e-300),
            lengths < LONG_ENOUGH,
        ),
        (
            "correlations last longer than they are recorded; take a larger spacing{:.0s}",
            found.tau,
            ~np.isfinite(found.window) & np.isfinite(found.tau) & (lengths >= LONG_ENOUGH),
        ),
        (
            "standard errors of the mean from paths, autocorrelations and batches differ by a factor of {} more "
            "than by chance; run longer",
            apart := found.disagreement(paths),
            apart > APART,
        ),
    ):
        if bad.any():
            worst = np.where(bad, value if value is not lengths else -value, -np.inf).argmax()
            i, f = np.unravel_index(worst, value.shape)
            found_value = decimal(value[i, f]) if "{}" in text else value[i, f]
            told = text.replace("{:.0s}", "") if "{:.0s}" in text else text.format(found_value)
            yield f"{found.functions[f]}, h = {reading.h[i]:g}: {told}"


def told(reading: Equilibrium, found: Averages) -> str:
    """The mean of the first function at the smallest step size."""
    what = f"the mean of {found.functions[0]} at h = {short(float(reading.h[-1]))} is"
    return f"{what} {_cell(found.average[-1, 0], found.average_half[-1, 0])}"


def planned(reading: Equilibrium, found: Averages) -> Iterator[str]:
    """For each function the time for a standard error s, and with an accuracy that is wanted the numbers for it.

    A mean over the time t of all paths has the variance 2 tau Var / t; the bias is C h^p, where that was fitted.
    """
    for f, name in enumerate(found.functions):
        i = len(reading.h) - 1
        rate = 2 * found.tau[i, f] * found.variance[i, f]
        if not math.isfinite(rate) or rate <= 0:
            continue
        wanted = reading.accuracy
        if wanted is None:
            needed = f"{short(float(rate))}/s^2 of time in all paths"
            yield f"{reading.about.label}: a standard error s of {name} takes {needed}"
            continue
        step, why = step_for(reading, found, f, wanted)
        time = rate / wanted**2
        each = max(time / reading.samples, LONG_ENOUGH * found.tau[i, f])
        length = f"{reading.samples} paths of time {short(float(each))} behind the burn-in, {short(each / step)} steps"
        which = f"{reading.about.label}, {name}: h = {short(step)} ({why})"
        yield f"{which} and {length}, for an accuracy of {short(wanted)}"


def step_for(reading: Equilibrium, found: Averages, f: int, wanted: float) -> tuple[float, str]:
    """A step size at which the bias of a function is at most `wanted`, and how that is known.

    By the fitted bias, or else the largest one at which mean and reference are that close; or none is known.
    """
    constant, order = found.constant[f], found.order[f].order
    if np.isfinite(constant) and np.isfinite(order) and order > 0 and constant != 0:
        return float((wanted / abs(constant)) ** (1 / order)), "by the fitted bias"
    near = np.abs(found.bias[:, f]) + INTERVAL * found.bias_stderr[:, f] <= wanted  # false for NaN
    if near.any():
        return float(reading.h[near].max()), "no bias is seen there"
    return float(reading.h[-1]), "the smallest here, its bias is not known"
