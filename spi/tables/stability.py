"""Tables of stability: up to which step size a scheme keeps what, for each value of the swept parameter."""

import math

import numpy as np

from ..regimes import (
    CASIMIR_KEPT,
    REGIMES,
    failing_fraction,
    iterations_per_solve,
    largest_casimir,
    largest_step,
    regimes,
)
from .text import lines_of, new_table, power_of_two, print_whole, short

#: The columns of a stability study, in this order; of what a group lacks there is none.
STABILITY = (
    *("case", "scheme", "sweep", "value", "h", "regime", "finite", "largest_norm", "error", "error_stderr"),
    *("casimir_worst", "casimir_median", "law_distance", "law_distance_stderr", "positive", "largest_angle"),
    *("solves", "iterations", "failures", "largest_residual", "samples", "reference_step"),
)


def rows(groups):
    """A record per value and step size; of several Casimirs the largest error."""
    for group in groups:
        yield from _rows(group)


def _rows(group):
    v, found = group.arrays, regimes(group)
    for name in ("casimir_worst", "casimir_median"):
        v[name] = largest_casimir(v[name])
    points = [name for name in STABILITY if v.get(name) is not None]
    whole = {"case": group.case, "scheme": group.scheme}
    whole |= {name: group.attributes.get(name) for name in ("sweep", "samples", "reference_step")}
    for i, value in enumerate(group.coordinates["value"].tolist()):
        for j, h in enumerate(group.coordinates["h"].tolist()):
            record = {**whole, "value": value, "h": h, "regime": REGIMES[found[i, j]]}
            record |= {name: v[name][i, j].item() for name in points}
            yield {key: record[key] for key in STABILITY if record.get(key) is not None}


def show(console, heading, groups):
    """Print the table of a case: a line per scheme and value."""
    from rich.text import Text

    told = [list(_summary(group)) for group in groups]
    shown = [name for name in _HEADINGS if any(name in line for lines in told for line in lines)]
    headings = ["scheme", groups[0].attributes.get("sweep", "value"), *(_HEADINGS[name] for name in shown)]
    table = new_table(heading, headings, left=1, labels=0)
    for group, lines in zip(groups, told, strict=True):
        label = lines_of(group.attributes.get("scheme_label", group.scheme))
        for value, line in zip(group.coordinates["value"].tolist(), lines, strict=True):
            table.add_row(Text(label), f"{value:g}", *(Text(line.get(name, "")) for name in shown))
            label = ""
        table.add_section()
    print_whole(console, table)
    console.print()
    for line in _remarks(groups):
        console.print(line, markup=False, soft_wrap=True)
    console.print()


#: What a line of the table may say, and the heading of its column.
_HEADINGS = {
    "finite": "all paths\nfinite, h",
    "kept": "Casimir\nkept, h",
    "accurate": "accurate,\nh",
    "casimir": "worst\nCasimir",
    "failures": "solver\nfailures",
    "iterations": "iter-\nations",
    "positive": "positive\npaths",
    "angle": "largest\nangle",
}


def _summary(group):
    """What the table says of each value: the text of each of its columns."""
    v, h = group.arrays, group.coordinates["h"]
    casimir = largest_casimir(v["casimir_worst"])
    for i in range(len(group.coordinates["value"])):
        line = {
            "finite": _step(h, v["finite"][i] >= 1.0),
            "accurate": _step(h, v["error"][i] <= group.attributes["accurate"]),
        }
        if casimir is not None:
            line["kept"] = _step(h, casimir[i] < CASIMIR_KEPT)
            line["casimir"] = short(float(casimir[i].max(initial=0.0)))
        if "failures" in v:
            line["failures"] = _percent(float(failing_fraction(v)[i].max(initial=0.0)))
            line["iterations"] = _range(iterations_per_solve(v)[i])
        if "positive" in v:
            line["positive"] = _percent(float(v["positive"][i].min(initial=1.0)))
        if "largest_angle" in v:
            angle = float(v["largest_angle"][i].max(initial=0.0))
            line["angle"] = f"{angle:.2g}" if angle else "< pi/4"
        yield line


def _step(h, good):
    """The largest step size up to which all is good; with >= if all were, since the true one may be larger."""
    largest, is_all = largest_step(h, good)
    return "none" if math.isnan(largest) else f"{'>= ' * is_all}{power_of_two(largest)}"


def _percent(fraction):
    """A fraction in per cent with two digits; 0 and 100 only if it is that."""
    if fraction in (0.0, 1.0) or not math.isfinite(fraction):
        return f"{100 * fraction:g} %"
    return f"{100 * fraction:.2g} %" if fraction < 0.99 else f"{100 - float(f'{100 - 100 * fraction:.1g}'):.10g} %"


def _range(values):
    """From the smallest to the largest number, with one decimal."""
    known = values[np.isfinite(values)]
    if not len(known):
        return ""
    low, high = f"{known.min():.1f}", f"{known.max():.1f}"
    return low if low == high else f"{low}-{high}"


def _remarks(groups):
    """What holds for the whole table, and the notes of the groups."""
    a = groups[0].attributes
    kept = f"Casimir kept: relative error < {short(CASIMIR_KEPT, '.0e')} on the worst path; "
    kept *= bool(groups[0].variables["casimir_worst"][1].size)
    yield (
        f"h: the largest step size at which this holds, as at all smaller ones; {kept}"
        f"accurate: root mean square error at T <= {a['accurate']:g} |y_0|; all else: worst over h"
    )
    told = [f"{a['samples']} paths each"] * ("samples" in a)
    told += [f"errors against the scheme at {power_of_two(a['reference_step'])}"] * ("reference_step" in a)
    seconds = sum(group.attributes.get("wall_seconds", 0.0) for group in groups)
    told += [f"{seconds:.3g} s on {a.get('threads', '?')} threads"] * (seconds > 0)
    if told:
        yield "; ".join(told)
    for group in groups:
        if group.attributes.get("note"):
            yield f"{group.attributes.get('scheme_label', group.scheme)}: {group.attributes['note']}"
