"""Tables of what accuracy costs."""

import math
import re
import textwrap

import numpy as np

from .strong import error_rows
from .text import (
    INTERVAL,
    duration,
    error_and_remark,
    lines_of,
    lost_paths,
    new_table,
    order_found,
    power_of_two,
    print_whole,
    short,
    with_pi,
)

#: The columns of a study of work and precision, in this order; ``error_bound`` instead of ``error_stderr`` where
#: nothing was sampled.
WORK_PRECISION = (
    *("case", "scheme", "measure", "h", "error", "error_stderr", "error_bound", "resolved", "casimir_drift"),
    *("nonfinite", "ns_per_step", "seconds_per_path", "seconds_per_path_low", "seconds_per_path_high"),
    *("samples", "order", "order_low", "order_high", "expected_order"),
)

_HEADING = 10  # characters of the label of a scheme over a column of factors


def rows(groups):
    """A record per step size; the times are the median and the quartiles of the repeats."""
    for group in groups:
        yield from error_rows(group, WORK_PRECISION)


def show(console, heading, groups):
    """Print the tables of a case: errors and times, and which scheme reaches a requested error in the least time."""
    print_whole(console, _points(heading, groups))
    console.print()
    for line in [*_measured(groups[0]), *(line for group in groups for line in _summary(group))]:
        console.print(line, markup=False, soft_wrap=True)
    console.print()
    table, remarks = _requested(groups)
    print_whole(console, table)
    for line in remarks:
        console.print(line, style="dim", markup=False, soft_wrap=True)
    console.print()


def _points(heading, groups):
    from rich.text import Text

    trust = dict.fromkeys("bound" if group.attributes.get("exact") else "95 %" for group in groups)
    error = f"{groups[0].attributes.get('measure', '')} error ({' or '.join(trust)})".strip()
    drifts, losses = (any(name in group.variables for group in groups) for name in ("casimir_drift", "nonfinite"))
    optional = [*["Casimir\ndrift"] * drifts, *["non-\nfinite"] * losses]
    table = new_table(
        heading, ["scheme", "h", error, "time per\npath", "ns per\nstep", *optional, ""], left=3, labels=0
    )
    table.columns[-1].justify = "left"
    for group in groups:
        label = lines_of(group.attributes.get("scheme_label", group.scheme))
        for record in error_rows(group, WORK_PRECISION):
            value, remark = error_and_remark(record, _half(record))
            table.add_row(
                Text(label),
                power_of_two(record["h"]),
                value,
                duration(record["seconds_per_path"]),
                short(record.get("ns_per_step"), ".1f"),
                *[short(record.get("casimir_drift"))] * drifts,
                *[lost_paths(record.get("nonfinite", 0))] * losses,
                remark,
            )
            label = ""
        table.add_section()
    return table


def _half(record):
    """Half the 95 % interval of an error, or the bound on what is wrong with it."""
    return record["error_bound"] if "error_bound" in record else INTERVAL * record["error_stderr"]


def _measured(group):
    """What the errors and the times of a case are."""
    a = group.attributes
    if a.get("functions"):
        yield f"error of the expectation of {', '.join(map(with_pi, a['functions']))}"
    until = f" to T = {a['final_time']:g}" if "final_time" in a else ""
    median = f", the median of {a['repeats']} repeats" if a.get("repeats", 1) > 1 else ""
    yield f"time: of one processor core for one path{until}{median}"


def _summary(group):
    """What is to be said about all step sizes of one scheme."""
    a = group.attributes
    order = a.get("order", math.nan), *a.get("order_ci", (math.nan, math.nan))
    yield f"{a.get('scheme_label', group.scheme)}: {order_found(*order, a.get('expected_order'))}"
    if a.get("note"):
        yield f"    {a['note']}"


def _requested(groups):
    """The table of requested errors, and the lines that explain its marks.

    A column per scheme says how many times as long it takes as the cheapest.
    """
    from rich.text import Text

    labels = {group.scheme: group.attributes.get("scheme_label", group.scheme) for group in groups}
    headings = ["error", "cheapest", "h", "time", *map(_heading, labels.values())]
    table = new_table(
        "cheapest scheme for a requested error, times of the others as multiples", headings, left=3, labels=1
    )
    if len(labels) > 4:
        table.padding = 0  # else it is too wide
    marks = set()
    for target in sorted({t for group in groups for t in group.attributes.get("targets", ())}, reverse=True):
        best, point, cells = _fastest(target, groups)
        marks.update(re.sub(r"[\d. ]", "", cell) for cell in cells.values())
        cells = [Text(cell, style="bold" if scheme == best else "") for scheme, cell in cells.items()]
        table.add_row(_plainly(target), Text(labels.get(best, "none")), *_needs(point), *cells)
        marks.add("≤" * (point is not None and point.at_most))
    remarks = {
        "tie": "tie: the 95 % interval of the factor contains 1",
        "≤": "≤: the largest step that was run does already, or the next larger one lost paths",
        "≥": "≥: so it is for the cheapest scheme",
        "()": "( ): so it is for both, which leaves open which is cheaper",
        "-": "-: not reached at the steps that were run",
    }
    return table, [text for mark, text in remarks.items() if mark in marks]


def _fastest(target, groups):
    """For a requested error the cheapest scheme, its work point, and for each scheme the text of its factor."""
    from ..estimators import cheapest, work_for  # takes a while

    works = {group.scheme: work_for(target, _curve(group)) for group in groups}
    best, factors = cheapest(works)
    cells = dict.fromkeys(works, "-") | ({best: "1"} if best else {})
    cells |= {scheme: _factor(factor) for scheme, factor in factors.items()}
    return best, works.get(best), cells


def _curve(group):
    from ..estimators import WorkCurve, interval_of_median

    v, a = group.arrays, group.attributes
    half = v["error_stderr"] * (1.0 if a.get("exact") else INTERVAL)
    times = [v[f"seconds_per_path{name}"] for name in ("", "_low", "_high")]
    ends = interval_of_median(*times, a.get("repeats", 1))
    return WorkCurve(group.coordinates["h"], np.abs(v["error"]), half, v["resolved"], times[0], *ends)


def _needs(point):
    """Step size and time of a work point."""
    if point is None:
        return "", ""
    exponent = f"{math.log2(point.h):z.1f}".removesuffix(".0")
    return f"2^{exponent}", "≤ " * point.at_most + duration(point.seconds)


def _factor(factor):
    """``2.3``, with what is to be known of its interval."""
    digits = 2 if factor.value < 1.995 else 1 if factor.value < 9.95 else 0
    value = f"{factor.value:.{digits}f}"
    if factor.low == 0.0:
        return f"({value})" if math.isinf(factor.high) else f"≤ {value}"
    return f"tie {value}" if factor.tie else f"≥ {value}" if math.isinf(factor.high) else value


def _plainly(x):
    """``1e-3`` for 0.001, ``2.5e-2`` for 0.025."""
    digits, _, exponent = f"{x:.2e}".partition("e")
    return f"{float(digits):g}e{int(exponent)}" if int(exponent) else f"{float(digits):g}"


def _heading(label):
    """A label in lines of few characters."""
    lines = textwrap.wrap(label.replace("order ", "order\xa0"), _HEADING, break_long_words=False)
    return "\n".join(lines).replace("\xa0", " ")
