"""Tables of long times: errors of the Casimirs, how far the law is from the exact one, and means of functions."""

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from statistics import NormalDist
from typing import TYPE_CHECKING, Any

import numpy as np

from spi.kinds.solver import acceptance_note
from spi.printing.rows import rows_of
from spi.printing.sentences import joined, sentence, whose
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

from ..results import Equilibrium, Law, with_averages, with_laws
from . import averages

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

#: Of several variables the table shows the distances of these.
SHOWN = ("y3", "H")

_PER_CASIMIR = ("growth", "growth_low", "growth_high", "bias", "bias_stderr")


def rows(readings: Iterable[Equilibrium]) -> Iterator[dict[str, Any]]:
    """A record per step size and number of steps; the last ones of each step size tell all that has no number of steps.

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
        tables.append(averages.table(readings))
    print_with_remarks(console, tables, (*_remarks(readings), *averages.remarks(readings)))


def _casimirs(heading: str, readings: Sequence[Equilibrium]) -> "Table":
    """Per scheme, step size and Casimir its errors after all steps and how they grew."""
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
    """Per scheme and step size how far distribution functions and means are from the exact ones."""
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
    """The largest |mean - exact| in standard errors, and of which moment it is."""
    z = np.abs(law.z[i])
    if np.isnan(z).any():
        return "not finite", ""
    return f"{z.max():.1f}", law.moments[z.argmax()]


def told(readings: Sequence[Equilibrium]) -> str:
    """What came out of a case, in one sentence: errors of the Casimirs after all steps, and the law of the states."""
    errors, means = [], []
    for reading in readings:
        if reading.casimir_count:
            rms = float(reading.casimir_rms[:, -1].max())
            errors.append(
                f"{short(rms) if math.isfinite(rms) else 'diverged'} with {whose(reading.about)}{_grown(reading)}"
            )
        if reading.law and np.isfinite(reading.law.z).all():
            means.append(f"{np.abs(reading.law.z).max():.1f} with {whose(reading.about)}")
    after = f"after {_count(readings[0].steps_each)} steps the root mean square error of the Casimir functions is"
    law = "the means of the stationary law are off by at most so many standard errors:"
    found = [f"{averages.told(one, known)} with {whose(one.about)}" for one, known in with_averages(readings)]
    return sentence(
        [f"{after} {joined(errors)}" if errors else "", f"{law} {joined(means)}" if means else "", joined(found)]
    )


def _grown(reading: Equilibrium) -> str:
    """The power of the number of steps by which the errors grow, from the smallest to the largest that is known."""
    known = reading.growth[np.isfinite(reading.growth)]
    if not known.size:
        return ""
    low, high = (f"{end(known):.2f}" for end in (np.min, np.max))
    return f" (growing as n^{low}{'' if low == high else f' to n^{high}'})"


def chance(count: int) -> float:
    """What the largest |z| of `count` independent standard normals stays below in 95 % of cases."""
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
