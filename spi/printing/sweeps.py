"""What came out in one line, and tables of what came out over a swept parameter: a line for each value."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..statistics.claims import Quantity
from ..statistics.curves import Curve
from .text import add_rows, lines_of, new_table, power_of_two, print_whole, short, with_interval

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

_UNEVEN = ("order", "growth", "quantile")  # the ends of whose intervals lie at different distances


def show(console: "Console", heading: str, curves: Sequence[Curve]) -> None:
    """Print the tables of a case that is swept: for each scheme, estimator and test function a line per value.

    Quantities of other test functions, as quantiles are, have a table of their own.
    """
    if curves and curves[0].second_word:
        _show_map(console, heading, curves)
        return
    by_functions: dict[tuple[str, ...], list[Curve]] = {}
    for name in dict.fromkeys(curve.name for curve in curves):
        members = [curve for curve in curves if curve.name == name]
        by_functions.setdefault(tuple(dict.fromkeys(curve.function for curve in members)), []).extend(members)
    for members in by_functions.values():
        print_whole(console, _table(heading, members))
        console.print()


def _table(heading: str, curves: Sequence[Curve]) -> "Table":
    names = {curve.name: curve.label for curve in curves}
    of = {(*_whose(curve), curve.name): curve for curve in curves}
    headings = [f"{label}{_at(curves, name)}\n(95 %)" for name, label in names.items()]
    several = any(curve.about.estimator for curve in curves), any(curve.function for curve in curves)
    labels = ["scheme", *["estimator"] * several[0], *["function"] * several[1]]
    table = new_table(heading, [*labels, curves[0].word, *headings], left=len(labels), labels=0)
    for key in dict.fromkeys(map(_whose, curves)):
        members = [of[*key, name] for name in names if (*key, name) in of]
        about, function = members[0].about, members[0].function
        cells, lines = [lines_of(about), *[about.estimator] * several[0], *[function] * several[1]], []
        for value in dict.fromkeys(value for curve in members for value in curve.values.tolist()):
            here = {curve.name: one for curve in members for one in curve.points if one.at == (curve.word, value)}
            lines.append([*cells, f"{value:g}", *(_told(here[name]) if name in here else "" for name in names)])
        add_rows(table, lines, len(cells))
    return table


def _show_map(console: "Console", heading: str, curves: Sequence[Curve]) -> None:
    """Of two parameters a line for each value of the first: both ends of what came out, and where it is zero."""
    from rich.text import Text

    for curve in curves:
        grid = curve.grid()
        words, values, zeros = grid.words, grid.of("value"), grid.zeros()
        name = f"{curve.label}, {curve.about.label}{f', {curve.function}' * bool(curve.function)}"
        columns = [words[0], "least", f"at {words[1]}", "largest", f"at {words[1]}", f"zero at {words[1]} (95 %)"]
        table = new_table(": ".join(filter(None, (heading, name))), columns[: 6 if zeros else 5], left=0, labels=0)
        for i, value in enumerate(grid.axes[0].tolist()):
            known = np.flatnonzero(np.isfinite(values[i]))
            ends = [known[pick(values[i, known])] for pick in (np.argmin, np.argmax)] if known.size else []
            told = [f(x) for j in ends for f, x in ((short, float(values[i, j])), ("{:g}".format, grid.axes[1][j]))]
            told += [""] * (4 - len(told))
            told += [", ".join(with_interval(where, half) for at, where, half in zeros if at == value)] * bool(zeros)
            table.add_row(*map(Text, (f"{value:g}", *told)))
        print_whole(console, table)
        if (known_too := curve.chi_squared) is not None:
            told_of = f"chi squared {known_too[0]:.1f} of {known_too[1]} differences from what is known"
            console.print(told_of, markup=False, highlight=False)
        console.print()


def _whose(curve: Curve) -> tuple[str, str, str]:
    return curve.about.variant, curve.about.estimator, curve.function


def _at(curves: Sequence[Curve], name: str) -> str:
    """At which step size a quantity is."""
    steps = {point.h for curve in curves if curve.name == name for point in curve.points}
    if steps == {None}:
        return ""
    return f" at\nh = {power_of_two(h)}" if len(steps) == 1 and (h := steps.pop()) else " at the\nsmallest h"


def _told(point: Quantity) -> str:
    """A quantity with its interval, as its ends where these lie at different distances."""
    if math.isnan(point.value):
        return "not resolved"
    if point.low == point.high:
        return short(point.value, ".3g")
    if point.name in _UNEVEN:
        form = ".4g" if point.name == "quantile" else ".3f"
        return f"{short(point.value, form)} [{short(point.low, form)}, {short(point.high, form)}]"
    return with_interval(point.value, (point.high - point.low) / 2)


def headline(curves: Sequence[Curve]) -> str:
    """``Order: 0.504 [0.489, 0.520] with splitting; ... Error at h = 2^-9: ...``, of the first test function."""
    parts = []
    for name in dict.fromkeys(curve.name for curve in curves):
        first, *_ = of_name = [curve for curve in curves if curve.name == name]
        of = f" of {first.function}" * bool(first.function)
        members = "; ".join(_ends(curve) for curve in of_name if curve.function == first.function)
        parts.append(f"{first.label[0].upper()}{first.label[1:]}{of}{_at(curves, name)}: {members}.".replace("\n", " "))
    return " ".join(parts)


def _ends(curve: Curve) -> str:
    """The first and the last value of a curve, with those of the parameter, or the only one."""
    ends = [curve.points[0], *curve.points[1:][-1:]]
    places = [", ".join(f"{word} = {x:g}" for word, x in one.swept_places.items()) for one in ends]
    values = [f"{_told(one)} at {place}" if place else _told(one) for one, place in zip(ends, places, strict=True)]
    return f"{' to '.join(values)} with {', '.join(filter(None, (curve.about.label, curve.about.estimator)))}"
