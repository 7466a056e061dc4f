"""Tables of weak errors."""

import json
import math

import numpy as np

from .agreement import agreement, agreement_line
from .eps import limits_shown, over_eps
from .levels import level_table, level_warnings
from .text import (
    INTERVAL,
    fraction,
    is_odd,
    lines_of,
    new_table,
    order_found,
    power_of_two,
    print_whole,
    short,
    with_interval,
    with_pi,
)

#: The columns of a weak study, in this order.
WEAK = (
    *("case", "scheme", "estimator", "function", "h", "error", "error_stderr", "error_bound"),
    *("expectation", "expectation_stderr", "expectation_bound", "reference", "limit", "limit_bound", "resolved"),
    *("agreement", "order", "order_low", "order_high", "expected_order"),
    *("samples", "cpu_seconds", "ns_per_step", "nonfinite"),
)

PAPER = 1e9  #: samples of the paper's weak errors

_PER_POINT = ("error", "expectation")  # each with its _stderr or _bound
_PER_FUNCTION = ("reference", "limit", "limit_bound", "order", "order_low", "order_high")


def rows(groups):
    """A record per test function and step size; after them those of the first so many paths, where they are kept.

    ``agreement`` is the error less the deterministic one, in standard errors.
    """
    for group in groups:
        yield from _point_rows(group, groups)
        if "prefix_error" in group.variables:
            yield from _prefix_rows(group)


def _point_rows(group, groups=()):
    found = agreement(group, groups)
    v, a = group.arrays, group.attributes
    whole = _whole(group) | {name: a.get(name) for name in ("samples", "cpu_seconds", "ns_per_step")}
    points = [f"{name}{what}" for name in _PER_POINT for what in ("", "_stderr", "_bound")] + ["resolved"]
    for f, function in enumerate(group.coordinates["function"].tolist()):
        per_function = {name: v[name][f].item() for name in _PER_FUNCTION if name in v}
        for i, h in enumerate(group.coordinates["h"].tolist()):
            record = {**whole, **per_function, "function": function, "h": h}
            record |= {name: v[name][f, i].item() for name in points if name in v}
            record["nonfinite"] = v["nonfinite"][i].item() if "nonfinite" in v else None
            record["agreement"] = None if found is None else found[0][f, i].item()
            yield _in_order(record)


def _prefix_rows(group):
    """Of fewer paths than all; expectations and orders are known of all only."""
    from ..estimators import is_resolved  # takes a while

    v = group.arrays
    resolved = is_resolved(np.abs(v["prefix_error"]), v["prefix_error_stderr"])
    for n, samples in enumerate(group.coordinates["samples"].tolist()):
        if samples == group.attributes.get("samples"):
            continue
        for f, function in enumerate(group.coordinates["function"].tolist()):
            for i, h in enumerate(group.coordinates["h"].tolist()):
                values = {name: v[f"prefix_{name}"][n, f, i].item() for name in ("error", "error_stderr")}
                run = {"samples": samples, "cpu_seconds": v["prefix_cpu_seconds"][n].item()}
                where = {"function": function, "h": h, "resolved": resolved[n, f, i].item()}
                yield _in_order({**_whole(group), **where, **values, **run})


def _whole(group):
    one = {"case": group.case, "scheme": group.scheme, "estimator": group.estimator}
    return one | {"expected_order": group.attributes.get("expected_order")}


def _in_order(record):
    return {key: record[key] for key in WEAK if record.get(key) is not None}


def show(console, heading, groups):
    """Print the tables of a case: errors, what is to be said about them, and the levels of multilevel estimates."""
    table = _errors(heading, groups)
    print_whole(console, table)
    console.print()
    lines = [*_functions(groups), *(line for group in groups for line in _summary(group)), *over_eps(groups)]
    lines += [*_references(groups), *limits_shown(groups)]
    for line in lines:
        console.print(line, markup=False, soft_wrap=True)
    for group in groups:
        for f in range(len(group.coordinates["function"])):
            for line, bad in agreement_line(group, groups, f):
                style = "bold red" if bad else None
                console.print(f"{_name(group, f)}: {line}", style=style, markup=False, soft_wrap=True)
    console.print()
    for group in groups:
        for f in range(len(group.coordinates["function"])) if "level_mean" in group.variables else ():
            print_whole(console, level_table(group, f, _name(group, f)))
            console.print()


def _errors(heading, groups):
    from rich.text import Text

    exact = any("error_bound" in group.variables for group in groups)
    sampled = any("error_stderr" in group.variables for group in groups)
    trust = " or ".join(["95 %"] * sampled + ["bound"] * exact)
    several = any(len(group.coordinates["function"]) > 1 for group in groups)
    lost = any("nonfinite" in group.variables and bool(group.variables["nonfinite"][1].any()) for group in groups)
    names = ["scheme,\nestimator", *["function"] * several, "h"]
    headings = [*names, f"weak error ({trust})", f"expectation ({trust})", *["non-\nfinite"] * lost, ""]
    table = new_table(heading, headings, left=len(names), labels=0)
    table.columns[-1].justify = "left"
    for group in groups:
        records = list(_point_rows(group))
        labels = iter([lines_of(group.attributes.get("scheme_label", group.scheme)), group.estimator])
        before = None
        for record in records:
            resolved, name = record.get("resolved", True), record["function"]
            error = _with_trust(record, "error")
            remark = "not finite" if is_odd(record["error"]) else "" if resolved else "not resolved"
            table.add_row(
                Text("\n".join(labels) if len(records) == 1 else next(labels, "")),
                *[Text(name if name != before else "")] * several,
                power_of_two(record["h"]),
                Text(error if resolved else f"({error})", style="" if resolved else "dim"),
                _with_trust(record, "expectation"),
                *[Text(str(record.get("nonfinite", "")), style="bold red" if record.get("nonfinite") else "")] * lost,
                Text(remark, style="dim"),
            )
            before = name
        table.add_section()
    return table


def _with_trust(record, name):
    """A value with its 95 % interval, or the bound on its error."""
    bound = record.get(f"{name}_bound")
    return with_interval(record[name], INTERVAL * record[f"{name}_stderr"] if bound is None else bound)


def _name(group, f):
    """What one row of summaries is about."""
    names = group.coordinates["function"].tolist()
    label = group.attributes.get("scheme_label", group.scheme)
    return ", ".join([label, group.estimator, *[names[f]] * (len(names) > 1)])


def _functions(groups):
    """The test functions, in which 6.283185307179586 is 2*pi again."""
    group = groups[0]
    for name, text in zip(group.coordinates["function"].tolist(), group.attributes.get("functions", ()), strict=False):
        yield f"{name} = {with_pi(text)}"


def _summary(group):
    """What is to be said about all step sizes of one scheme with one estimator."""
    a = group.attributes
    v = group.arrays
    points = group.coordinates["h"].size
    for f in range(len(group.coordinates["function"])):
        order = [v[name][f] if name in v else math.nan for name in ("order", "order_low", "order_high")]
        used = v["order_points"][f] if "order_points" in v else points
        through = f", through {used} of {points} step sizes" if math.isfinite(order[0]) and used < points else ""
        yield f"{_name(group, f)}: {order_found(*order, a.get('expected_order'))}{through}"
        yield from (f"    {line}" for line in _accuracy(group, v, f))
        if "limit" in v:
            name = group.coordinates["function"][f]
            yield f"    E {name}(y(T)) = {with_interval(v['limit'][f].item(), v['limit_bound'][f].item())} (bound)"
        if "level_mean" in v:
            yield from (f"    {line}" for line in level_warnings(group, f))
    resolution = _resolution(a.get("notes"))
    if resolution:
        yield f"    {resolution}"
    if a.get("reference_nonfinite"):
        yield f"    {a['reference_nonfinite']} reference paths left the finite numbers"


def _accuracy(group, v, f):
    """The standard error at the largest step beside that of so many independent samples as the paper has."""
    if "error_stderr" not in v or not group.coordinates["h"].size:
        return
    a, largest = group.attributes, int(np.argmax(group.coordinates["h"]))
    stderr = float(v["error_stderr"][f, largest])
    seconds = a.get("cpu_seconds", math.nan)
    told = f"standard error {short(stderr)} at {power_of_two(group.coordinates['h'][largest])}"
    told += f" in {seconds:.3g} s of processor time" if math.isfinite(seconds) else ""
    paper = float(v["sd"][f]) / math.sqrt(PAPER) if "sd" in v else math.nan
    if math.isfinite(paper):
        told += f"; 10^9 independent samples would give {short(paper)}"
        if stderr > paper > 0 and math.isfinite(seconds * stderr):
            told += f", which would take about {_two_digits(seconds * (stderr / paper) ** 2)} s here"
    yield told


def _two_digits(x):
    return short(float(f"{x:.2g}"), "g")


def _resolution(notes):
    """The short ones of the notes of a solver without sampling (JSON)."""
    try:
        told = json.loads(notes or "{}")
    except ValueError:
        return ""
    short_ones = {key: json.dumps(value) for key, value in told.items() if not key.startswith("seconds")}
    return ", ".join(f"{key.replace('_', ' ')} {text}" for key, text in short_ones.items() if len(text) <= 12)


def _references(groups):
    """How much of the errors the references of a case lack."""
    told = {}
    for group in groups:
        a = group.attributes
        if "error_stderr" in group.variables and "reference_step" in a and group.coordinates["h"].size:
            finest = float(group.coordinates["h"].min())
            told[a["reference_step"], finest, a.get("expected_order"), a.get("reference_scheme")] = None
    for reference, finest, order, scheme in told:
        where = f"the reference at h_ref = {power_of_two(reference)}"
        if scheme:
            yield f"{where} is {scheme}: errors are not corrected for what it lacks"
        elif order:
            share = 100 * (reference / finest) ** order
            ratio = "h_ref/h" if order == 1 else f"(h_ref/h)^{fraction(order)}"
            yield f"{where} lacks {ratio} = {share:.2g} % of the finest error (order {fraction(order)}); corrected"
        else:
            yield f"{where}: errors are corrected for what it lacks as if the scheme had its usual order"
