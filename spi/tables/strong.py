"""Tables of strong errors."""

import math

from .text import (
    INTERVAL,
    angle_note,
    error_and_remark,
    lines_of,
    lost_paths,
    new_table,
    order_found,
    power_of_two,
    print_whole,
    short,
)

#: The columns of a strong study, in this order; those of an implicit solver follow where there are any.
STRONG = (
    *("case", "scheme", "h", "error", "error_stderr", "error_final", "error_final_stderr", "casimir_drift"),
    *("nonfinite", "resolved", "samples", "seconds", "ns_per_step", "order", "order_low", "order_high"),
    *("expected_order", "solves", "iterations", "failures", "largest_residual"),
)


def rows(groups):
    """A record per step size."""
    for group in groups:
        yield from error_rows(group, STRONG)


def error_rows(group, columns):
    """A record per step size of a group with the axis h, of those of the columns that it has, in their order."""
    attributes = group.attributes
    low, high = attributes.get("order_ci", (None, None))
    whole = {"case": group.case, "scheme": group.scheme, "order_low": low, "order_high": high}
    whole |= {name: attributes.get(name) for name in ("measure", "samples", "order", "expected_order")}
    for i, h in enumerate(group.coordinates["h"].tolist()):
        # Several Casimirs make one column: the largest drift.
        points = {n: v[i].max() for n, (axes, v) in group.variables.items() if axes[:1] == ("h",) and v[i].size}
        record = {**whole, "h": h, **{name: value.item() for name, value in points.items()}}
        if attributes.get("exact"):
            record["error_bound"] = record.pop("error_stderr")
        yield {key: record[key] for key in columns if record.get(key) is not None}


def show(console, heading, groups):
    """Print the table of a case."""
    from rich.text import Text

    headings = ["scheme", "h", "strong error (95 %)", "Casimir\ndrift", "non-\nfinite", "ns per\nstep", ""]
    table = new_table(heading, headings, left=3, labels=0)
    table.columns[-1].justify = "left"
    for group in groups:
        label = lines_of(group.attributes.get("scheme_label", group.scheme))
        for record in error_rows(group, STRONG):
            error, remark = error_and_remark(record, INTERVAL * record["error_stderr"])
            table.add_row(
                Text(label),
                power_of_two(record["h"]),
                error,
                short(record.get("casimir_drift")),
                lost_paths(record.get("nonfinite", 0)),
                short(record.get("ns_per_step"), ".1f"),
                remark,
            )
            label = ""
        table.add_section()
    print_whole(console, table)
    console.print()
    for group in groups:
        for line in _summary(group):
            console.print(line, markup=False, soft_wrap=True)
    console.print()


def _summary(group):
    """What is to be said about all step sizes of one scheme."""
    a = group.attributes
    order = a.get("order", math.nan), *a.get("order_ci", (math.nan, math.nan))
    points = group.coordinates["h"].size
    few = math.isfinite(order[0]) and a.get("points_in_fit", points) < points
    through = f", through the finest {a['points_in_fit']} of {points}" if few else ""
    yield f"{a.get('scheme_label', group.scheme)}: {order_found(*order, a.get('expected_order'))}{through}"
    if a.get("note"):
        yield f"    {a['note']}"
    if a.get("reference_nonfinite"):
        yield f"    {a['reference_nonfinite']} reference paths left the finite numbers"
    if "largest_angle" in group.variables and (note := angle_note(group.variables["largest_angle"][1].max())):
        yield f"    {note}"
    if "failures" in group.variables:
        solves, iterations, failures = (group.variables[n][1].sum() for n in ("solves", "iterations", "failures"))
        residual = group.variables["largest_residual"][1].max(initial=0)
        mean = iterations / solves if solves else 0.0
        yield f"    solver: {mean:.1f} iterations a step, {failures:g} failures, largest residual {short(residual)}"
