"""Tables of long times: errors of the Casimirs, how far the law is from the exact one, and means of functions."""

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from statistics import NormalDist
from typing import TYPE_CHECKING, Any

import numpy as np

from spi.kinds.blocks import acceptance_note
from spi.printing.rows import rows_of
from spi.printing.text import (
    INTERVAL,
    add_rows,
    decimal,
    lines_of,
    lost_paths,
    new_table,
    power_of_two,
    print_with_remarks,
    short,
    with_interval,
)

from .results import APART, LONG_ENOUGH, Averages, Equilibrium, Law, with_averages, with_laws

# ---------------------------------------------------------------------------------------------------------------------
# The table of means of functions at equilibrium, and remarks on them: warnings, orders, what to run.
# ---------------------------------------------------------------------------------------------------------------------

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

#: The probability by chance of the difference between both halves of the time from which on there is a warning.
_SELDOM = 0.01


def averages_table(readings: Sequence[Equilibrium]) -> "Table":
    """Per scheme, function and step size the mean, its bias, and its autocorrelation time."""
    first = next(averages for _, averages in with_averages(readings))
    has_reference = bool(np.isfinite(first.reference).any())
    responses = [first.response(f)[0] for f in range(len(first.functions)) if np.isfinite(first.response(f)[1])]
    headings = ["scheme", "function", "h", "mean (95 %)", *["bias (95 %)", "in std.\nerrors"] * has_reference]
    headings += ["autocor-\nrelation time", *[f"{' or '.join(dict.fromkeys(responses))}\n(95 %)"] * bool(responses)]
    table = new_table("means over time", headings, left=3, labels=0)
    for reading, averages in with_averages(readings):
        lines = []
        for f, name in enumerate(averages.functions):
            for i, h in enumerate(reading.h.tolist()):
                more = _response(averages, i, f) if responses else ()
                lines.append(
                    [lines_of(reading.about), name, power_of_two(h), *_cells(averages, i, f, has_reference), *more]
                )
        add_rows(table, lines, labels=2)
    return table


def _cell(value: float, half: float) -> str:
    return with_interval(float(value), float(half)) if math.isfinite(value) and math.isfinite(half) else "-"


def _cells(averages: Averages, i: int, f: int, has_reference: bool) -> Iterator[str]:
    yield _cell(averages.average[i, f], averages.average_half[i, f])
    if has_reference:
        factor = averages.average_half[i, f] / averages.stderr[i, f] if averages.stderr[i, f] else INTERVAL
        of_bias = averages.bias[i, f], factor * averages.bias_stderr[i, f]
        yield _cell(*of_bias) if averages.bias_stderr[i, f] else "reference"
        yield decimal(averages.deviation[i, f]) if np.isfinite(averages.deviation[i, f]) else "-"
    yield _cell(averages.tau[i, f], INTERVAL * averages.tau_stderr[i, f])


def _response(averages: Averages, i: int, f: int) -> Iterator[str]:
    _, factor = averages.response(f)
    yield _cell(factor * averages.variance[i, f], INTERVAL * abs(factor) * averages.variance_stderr[i, f])


def averages_remarks(readings: Sequence[Equilibrium]) -> Iterator[str]:
    """The time of averaging, warnings, orders of biases, and what to run for a wanted accuracy."""
    for k, (reading, averages) in enumerate(with_averages(readings)):
        if not k:
            time = averages.kept * averages.spacing
            values = f"{averages.kept} values of each path {averages.spacing:g} apart"
            yield f"means over the last {time:.6g} of the time, {values}"
            yield from (f"{n}: {text}" for n, text in zip(averages.functions, averages.texts, strict=True) if n != text)
        yield from (f"{reading.about.label}, {line}" for line in _warnings(reading, averages))
        for f, name in enumerate(averages.functions):
            if math.isfinite((order := averages.order[f]).order):
                law = f"{averages.constant[f]:.2g} h^{order.order:.2f}"
                yield f"{reading.about.label}: bias of {name} {law}, order in [{order.low:.2f}, {order.high:.2f}]"
        yield from planned(reading, averages)


def _warnings(reading: Equilibrium, averages: Averages) -> Iterator[str]:
    """A line for each reason to doubt the errors of the means, about the worst step size and function."""
    from scipy.special import stdtrit  # not needed to start the program

    count, paths = averages.average.size, reading.samples
    likely = float(stdtrit(max(paths - 1, 15), 1 - 0.5 * (1 - (1 - _SELDOM) ** (1 / count))))
    for text, value, bad in (
        (
            "burn-in: the second half of the kept time differs from the first by {} standard errors of that; "
            "give a longer burn_in and final_time",
            halves := np.abs(averages.halves),
            halves > likely,
        ),
        (
            f"a path has {{:.0f}} autocorrelation times, fewer than {LONG_ENOUGH}; run longer",
            lengths := averages.kept * averages.spacing / np.maximum(averages.tau, 1e-300),
            lengths < LONG_ENOUGH,
        ),
        (
            "correlations last longer than they are recorded; take a larger spacing{:.0s}",
            averages.tau,
            ~np.isfinite(averages.window) & np.isfinite(averages.tau) & (lengths >= LONG_ENOUGH),
        ),
        (
            "standard errors of the mean from paths, autocorrelations and batches differ by a factor of {} more "
            "than by chance; run longer",
            apart := averages.disagreement(paths),
            apart > APART,
        ),
    ):
        if bad.any():
            worst = np.where(bad, value if value is not lengths else -value, -np.inf).argmax()
            i, f = np.unravel_index(worst, value.shape)
            worst_value = decimal(value[i, f]) if "{}" in text else value[i, f]
            message = text.replace("{:.0s}", "") if "{:.0s}" in text else text.format(worst_value)
            yield f"{averages.functions[f]}, h = {reading.h[i]:g}: {message}"


def planned(reading: Equilibrium, averages: Averages) -> Iterator[str]:
    """For each function the time that a standard error s takes, or the step size and time for a wanted accuracy.

    A mean over the time t of all paths has the variance 2 tau Var / t; the bias is C h^p, where that was fitted.
    """
    for f, name in enumerate(averages.functions):
        i = len(reading.h) - 1
        rate = 2 * averages.tau[i, f] * averages.variance[i, f]
        if not math.isfinite(rate) or rate <= 0:
            continue
        wanted = reading.accuracy
        if wanted is None:
            needed = f"{short(float(rate))}/s^2 of time in all paths"
            yield f"{reading.about.label}: a standard error s of {name} takes {needed}"
            continue
        step, why = step_for(reading, averages, f, wanted)
        time = rate / wanted**2
        each = max(time / reading.samples, LONG_ENOUGH * averages.tau[i, f])
        length = f"{reading.samples} paths of time {short(float(each))} behind the burn-in, {short(each / step)} steps"
        which = f"{reading.about.label}, {name}: h = {short(step)} ({why})"
        yield f"{which} and {length}, for an accuracy of {short(wanted)}"


def step_for(reading: Equilibrium, averages: Averages, f: int, wanted: float) -> tuple[float, str]:
    """A step size at which the bias of a function is at most `wanted`, and the reason.

    It follows from the fitted bias, or is the largest one at which mean and reference are that close, or the smallest.
    """
    constant, order = averages.constant[f], averages.order[f].order
    if np.isfinite(constant) and np.isfinite(order) and order > 0 and constant != 0:
        return float((wanted / abs(constant)) ** (1 / order)), "by the fitted bias"
    near = np.abs(averages.bias[:, f]) + INTERVAL * averages.bias_stderr[:, f] <= wanted  # false for NaN
    if near.any():
        return float(reading.h[near].max()), "no bias is seen there"
    return float(reading.h[-1]), "the smallest here, its bias is not known"


#: Of several variables the table shows the distances of these.
SHOWN = ("y3", "H")

_PER_CASIMIR = ("growth", "growth_low", "growth_high", "bias", "bias_stderr")


def rows(readings: Iterable[Equilibrium]) -> Iterator[dict[str, Any]]:
    """A record per step size and number of steps; only the last of each step size has fields without number of steps.

    Of several Casimirs each has its columns, ``casimir_rms_1`` and so on.  Fractions in bins are left out.
    """
    spread = ("casimir", "moment", "variable", "function")
    for reading in readings:
        of_steps = next(rows_of(reading, ["h"], spread=spread)).keys() - {"case", "scheme", "h", "samples"}
        for row in rows_of(reading, ["h", "n"], spread=spread):
            left_out = of_steps if row["n"] < reading.n[-1] else ()
            yield {name: value for name, value in row.items() if name not in left_out}


def show(console: "Console", heading: str, readings: Sequence[Equilibrium]) -> None:
    """Print the tables of a case: errors of the Casimirs, and the stationary law where it is known."""
    tables = [_casimirs(heading, readings)]
    if law := readings[0].law:
        tables.append(_laws(readings, law.variables))
    if readings[0].averages:
        tables.append(averages_table(readings))
    print_with_remarks(console, tables, (*_remarks(readings), *averages_remarks(readings)))


def _casimirs(heading: str, readings: Sequence[Equilibrium]) -> "Table":
    """Per scheme, step size and Casimir its errors after all steps and their growth."""
    count = readings[0].casimir_count
    several = count > 1
    names = ["scheme", "h", "di-\nverged", *["Cas-\nimir"] * several]
    columns = ["rms error\nat the end", "worst", "growth of rms,\nexponent (95 %)", "bias/step", "in std.\nerrors"]
    table = new_table(heading, [*names, *columns], left=2, labels=0)
    for reading in readings:
        places = itertools.product(range(len(reading.h)), range(max(count, 1)))
        add_rows(table, (_casimir_cells(reading, i, c) for i, c in places), labels=3)
    return table


def _casimir_cells(reading: Equilibrium, i: int, c: int) -> Iterator["str | Text"]:
    yield lines_of(reading.about)
    yield power_of_two(float(reading.h[i]))
    yield lost_paths(int(reading.nonfinite[i]))
    if not reading.casimir_count:
        yield from ["-"] * 5
        return
    if reading.casimir_count > 1:
        yield f"C{c + 1}"
    rms, worst = (float(values[i, -1, c]) for values in (reading.casimir_rms, reading.casimir_worst))
    p, low, high, bias, stderr = (float(getattr(reading, name)[i, c]) for name in _PER_CASIMIR)
    growth = f"{p:.2f} [{low:.2f}, {high:.2f}]" if math.isfinite(p) else "not fitted"
    ratio = decimal(bias / stderr) if stderr > 0 and math.isfinite(bias / stderr) else "-"
    yield from (short(rms), short(worst), growth, short(bias), ratio)


def _laws(readings: Sequence[Equilibrium], variables: tuple[str, ...]) -> "Table":
    """Per scheme and step size the distances of distribution functions and means from the exact ones."""
    chosen = [name for name in variables if name in SHOWN] or variables
    distances = [f"distance of the\nlaw of {name} (95 %)" for name in chosen]
    headings = ["scheme", "h", *distances, "largest |z|\nof the means", "of"]
    table = new_table("stationary law", headings, left=2, labels=0)
    for reading, law in with_laws(readings):
        lines = []
        for i, h in enumerate(reading.h.tolist()):
            pairs = ((law.distance[i, m], law.distance_stderr[i, m]) for m in map(variables.index, chosen))
            cells = [with_interval(float(value), INTERVAL * float(stderr)) for value, stderr in pairs]
            lines.append([lines_of(reading.about), power_of_two(h), *cells, *_largest_z(law, i)])
        add_rows(table, lines)
    return table


def _largest_z(law: Law, i: int) -> tuple[str, str]:
    """The largest |mean - exact| in standard errors, and its moment."""
    z = np.abs(law.z[i])
    if np.isnan(z).any():
        return "not finite", ""
    return f"{z.max():.1f}", law.moments[z.argmax()]


def chance(count: int) -> float:
    """The bound of the largest |z| of `count` independent standard normals in 95 % of cases."""
    return NormalDist().inv_cdf(0.5 + 0.5 * 0.95 ** (1 / count))


def _remarks(readings: Sequence[Equilibrium]) -> Iterator[str]:
    first = readings[0]
    snapshots = f", {first.snapshots} snapshots of each path" if first.snapshots else ""
    which = f" at h = {first.h[0]:g}" if first.averages else ""
    yield f"{first.samples} paths of {_count(first.steps_each)} steps each{which}{snapshots}"
    yield f"{sum(reading.wall_seconds for reading in readings):.3g} s on {first.threads} threads"
    for reading in readings:
        for i, h in enumerate(reading.h.tolist() if reading.acceptance else ()):
            yield f"{reading.about.label}, h = {h:g}: {acceptance_note(reading.acceptance, i)}"
    if first.law:
        count = len(first.law.moments)
        yield f"by chance the largest |z| of {count} independent means is below {chance(count):.1f} in 95 % of cases"


def _count(steps: int) -> str:
    """A number of steps, powers of two also as such."""
    return f"{power_of_two(steps)} = {steps:.2g}" if steps > 1 and math.frexp(steps)[0] == 0.5 else f"{steps:,}"
