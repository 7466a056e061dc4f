"""Results as records, JSON, CSV and tables to read."""

import csv
import io
import json
import math
from fractions import Fraction

import numpy as np

#: The columns of a strong study, in this order; those of an implicit solver follow where there are any.
STRONG = (
    *("case", "scheme", "h", "error", "error_stderr", "error_final", "error_final_stderr", "casimir_drift"),
    *("nonfinite", "resolved", "samples", "seconds", "ns_per_step", "order", "order_low", "order_high"),
    *("expected_order", "solves", "iterations", "failures", "largest_residual"),
)

#: Half the width of a 95 % interval in standard errors.
INTERVAL = 1.96

_WIDTH = 100  # of a table that goes into a file or a pipe


def rows(results):
    """One flat record per case, scheme and point of the first axis (for strong errors step sizes, else times)."""
    of_group = {"strong": _strong_rows, "trajectory": _trajectory_rows}.get(results.attributes.get("kind"), _plain_rows)
    return [row for group in results.groups for row in of_group(group)]


def as_json(records):
    """A JSON list of records; as JSON has neither, infinities and nan become null (``nonfinite`` tells why)."""
    plain = [{key: None if _is_odd(value) else value for key, value in record.items()} for record in records]
    return json.dumps(plain, indent=2, ensure_ascii=False, allow_nan=False)


def as_csv(records):
    """CSV with a header; infinities and nan are written ``inf`` and ``nan``, what a record lacks stays empty."""
    columns = list(dict.fromkeys(key for record in records for key in record))
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(records)
    return text.getvalue()


def print_table(results, file=None):
    """Print one table per case to ``file`` (standard output if None), in colour if that is a terminal."""
    console = _console(file)
    title = results.attributes.get("title")
    if title:
        console.print(title, style="bold", markup=False)
    tables = {"strong": _strong_table, "trajectory": _trajectory_table}
    draw = tables.get(results.attributes.get("kind"), _plain_table)
    for case in dict.fromkeys(group.case for group in results.groups):
        groups = [group for group in results.groups if group.case == case]
        heading = groups[0].attributes.get("case_title") or case
        draw(console, "" if heading == title else heading, groups)


def print_catalogue(models, schemes, experiments, file=None):
    """Print what there is: models (name -> record), schemes (name -> row of the table of orders), experiments."""
    console = _console(file)
    table = _table("models", ["name", "parameters", ""], left=3)
    for name, record in models.items():
        table.add_row(name, ", ".join(record._fields), (record.__doc__ or "").splitlines()[0])
    _print(console, table)
    console.print()
    orders = ["strong\norder", "with one\nnoise", "weak\norder"]
    table = _table("schemes", ["name", "", "preserves", *orders], left=3)
    for name, row in schemes.items():
        numbers = (row.strong_order, row.strong_order_commuting, row.weak_order)
        table.add_row(name, row.label, row.preserves, *map(fraction, numbers))
    _print(console, table)
    console.print()
    table = _table("experiments", ["file", "title", "kind", "figure"], left=3)
    for e in experiments:
        table.add_row(str(e.path), e.title, e.kind, str(e.figure or "-"))
    _print(console, table)


def print_cost(experiment, cost, file=None):
    """Print that an experiment is valid and what it would cost (a ``spi.run.Cost``)."""
    cases = [f"{case.name} ({', '.join(case.schemes)})" for case in experiment.cases]
    _console(file).print(
        f"{experiment.path}: valid, profile {experiment.profile}: {'; '.join(cases)}; "
        f"{cost.path_steps:.2g} steps of paths, about {cost.seconds:.2g} s once compiled, {cost.megabytes:.0f} MB",
        markup=False,
        soft_wrap=True,
    )


# ---------------------------------------------------------------------------------------------------------------------
# Records
# ---------------------------------------------------------------------------------------------------------------------


def _strong_rows(group):
    attributes = group.attributes
    low, high = attributes.get("order_ci", (None, None))
    whole = {"case": group.case, "scheme": group.scheme, "order_low": low, "order_high": high}
    whole |= {name: attributes.get(name) for name in ("samples", "order", "expected_order")}
    for i, h in enumerate(group.coordinates["h"].tolist()):
        # Several Casimirs make one column: the largest drift.
        points = {n: v[i].max() for n, (axes, v) in group.variables.items() if axes[:1] == ("h",) and v[i].size}
        record = {**whole, "h": h, **{name: value.item() for name, value in points.items()}}
        yield {key: record[key] for key in STRONG if record.get(key) is not None}


def _trajectory_rows(group):
    y, energy, casimirs = (group.variables[name][1] for name in ("y", "hamiltonian", "casimirs"))
    columns = {"t": group.coordinates["t"], **{f"y_{i + 1}": v for i, v in enumerate(y.T)}, "hamiltonian": energy}
    columns |= {f"casimir_{c + 1}": v for c, v in enumerate(casimirs.T)}
    for values in zip(*(v.tolist() for v in columns.values()), strict=True):
        yield {"case": group.case, "scheme": group.scheme, **dict(zip(columns, values, strict=True))}


def _plain_rows(group):
    """For kinds without a table of their own: variables along the first axis, further axes spread over columns."""
    first = next(iter(group.coordinates), None)
    for i in range(len(group.coordinates[first]) if first else 0):
        record = {"case": group.case, "scheme": group.scheme, first: group.coordinates[first][i].item()}
        for name, (axes, values) in group.variables.items():
            if axes == (first,):
                record[name] = values[i].item()
            elif axes[:1] == (first,):
                record.update({f"{name}[{','.join(map(str, j))}]": v.item() for j, v in np.ndenumerate(values[i])})
        yield record


def _is_odd(value):
    return isinstance(value, float) and not math.isfinite(value)


# ---------------------------------------------------------------------------------------------------------------------
# Tables
# ---------------------------------------------------------------------------------------------------------------------


def _strong_table(console, heading, groups):
    from rich.text import Text

    headings = ["scheme", "h", "strong error (95 %)", "Casimir\ndrift", "non-\nfinite", "ns per\nstep", ""]
    table = _table(heading, headings, left=3)
    table.columns[0].no_wrap, table.columns[0].max_width = False, 32
    table.columns[-1].justify = "left"
    for group in groups:
        label = group.attributes.get("scheme_label", group.scheme)
        for record in _strong_rows(group):
            resolved, lost = record.get("resolved", True), record.get("nonfinite", 0)
            remark = "not finite" if _is_odd(record["error"]) else "" if resolved else "not resolved"
            error = with_interval(record["error"], INTERVAL * record["error_stderr"])
            table.add_row(
                Text(label),
                power_of_two(record["h"]),
                Text(error if resolved else f"({error})", style="" if resolved else "dim"),
                _short(record.get("casimir_drift")),
                Text(str(lost), style="bold red" if lost else ""),
                _short(record.get("ns_per_step"), ".1f"),
                Text(remark, style="dim"),
            )
            label = ""
        table.add_section()
    _print(console, table)
    console.print()
    for group in groups:
        for line in _summary(group):
            console.print(line, markup=False, soft_wrap=True)
    console.print()


def _summary(group):
    """What is to be said about all step sizes of one scheme."""
    a = group.attributes
    low, high = a.get("order_ci", (math.nan, math.nan))
    known = math.isfinite(a.get("order", math.nan))
    order = f"order {a['order']:.3f} [{low:.3f}, {high:.3f}]" if known else "order not resolved"
    expected = f" (expected {fraction(a['expected_order'])})" if "expected_order" in a else ""
    points = group.coordinates["h"].size
    through = (
        f", through the finest {a['points_in_fit']} of {points}" if a.get("points_in_fit", points) < points else ""
    )
    yield f"{a.get('scheme_label', group.scheme)}: {order}{expected}{through if known else ''}"
    if a.get("note"):
        yield f"    {a['note']}"
    if a.get("reference_nonfinite"):
        yield f"    {a['reference_nonfinite']} reference paths left the finite numbers"
    if "failures" in group.variables:
        solves, iterations, failures = (group.variables[n][1].sum() for n in ("solves", "iterations", "failures"))
        residual = group.variables["largest_residual"][1].max(initial=0)
        mean = iterations / solves if solves else 0.0
        yield f"    solver: {mean:.1f} iterations a step, {failures:g} failures, largest residual {_short(residual)}"


def _trajectory_table(console, heading, groups):
    from rich.text import Text

    count = groups[0].variables["casimirs"][1].shape[1]
    drifts = [f"drift\nof C{c + 1 if count > 1 else ''}" for c in range(count)]
    headings = ["scheme", "step", "steps", "H at the\nend", *drifts, "smallest\ncomponent", "not finite\nfrom t ="]
    implicit = any("solver_failures" in group.attributes for group in groups)
    table = _table(heading, headings + ["solver\nfailures", "iterations\na step"] * implicit, left=1)
    for group in groups:
        a, y = group.attributes, group.variables["y"][1]
        lost, failures = a["nonfinite_from"], a.get("solver_failures")
        solver = ["" if failures is None else str(failures), _short(a.get("solver_iterations_mean"), ".1f")]
        table.add_row(
            Text(a.get("scheme_label", group.scheme)),
            power_of_two(a["step"]),
            str(len(y) - 1),
            _short(float(group.variables["hamiltonian"][1][-1]), ".6g"),
            *map(_short, a["casimir_drift"]),
            _short(float(y[np.isfinite(y)].min(initial=math.inf)), ".3g"),
            Text("" if math.isnan(lost) else f"{lost:g}", style="bold red"),
            *map(Text, solver * implicit),
        )
    _print(console, table)
    console.print()


def _plain_table(console, heading, groups):
    for group in groups:
        records = list(_plain_rows(group))
        title = f"{heading}: {group.attributes.get('scheme_label', group.scheme)}"
        columns = [key for key in (records[0] if records else ()) if key not in ("case", "scheme")]
        table = _table(title, columns)
        for record in records:
            table.add_row(*(_short(v, ".6g") if isinstance(v, float) else str(v) for v in map(record.get, columns)))
        _print(console, table)
        scalars = {name: values.item() for name, (axes, values) in group.variables.items() if not axes}
        for name, value in {**scalars, **group.attributes}.items():
            console.print(f"{name}: {value}", markup=False, soft_wrap=True)
        console.print()


def _console(file):
    from rich.console import Console

    console = Console(file=file, highlight=False)
    return console if console.is_terminal else Console(file=file, highlight=False, width=_WIDTH)


def _table(title, headings, left=0):
    from rich import box
    from rich.table import Table
    from rich.text import Text

    style = {"box": box.SIMPLE_HEAD, "padding": (0, 1, 0, 0), "pad_edge": False, "show_edge": False}
    table = Table(title=Text(title) if title else None, title_justify="left", **style)
    for i, heading in enumerate(headings):
        table.add_column(Text(heading), justify="left" if i < left else "right", no_wrap=True)
    return table


def _print(console, table):
    """Print a table at the width its numbers need: one cut short would be another number."""
    from rich.measure import Measurement

    needed = Measurement.get(console, console.options.update(max_width=10_000), table).maximum
    console.width = max(console.width, needed)
    console.print(table)


# ---------------------------------------------------------------------------------------------------------------------
# Numbers
# ---------------------------------------------------------------------------------------------------------------------


def with_interval(value, half):
    """``3.42e-3 ± 0.07e-3``: the half width with one digit, or two after a leading 1, the value to the same place."""
    if not math.isfinite(value):
        return str(value)
    if not (math.isfinite(half) and half > 0):
        return _short(value, ".3e")
    scale = math.floor(math.log10(max(abs(value), half)))
    place = math.floor(math.log10(half))
    place -= half < 1.95 * 10.0**place
    digits = min(max(scale - place, 0), 9)
    exponent = f"e{scale}" if scale else ""
    return f"{value / 10.0**scale:.{digits}f}{exponent} ± {half / 10.0**scale:.{digits}f}{exponent}"


def power_of_two(h):
    """``2^-5`` for 0.03125, and other numbers as they are."""
    mantissa, exponent = math.frexp(h)
    return f"2^{exponent - 1}" if mantissa == 0.5 else f"{h:g}"


def fraction(x):
    """``1/2`` for 0.5, and numbers that are no simple fraction as they are."""
    nearest = Fraction(x).limit_denominator(12)
    return str(nearest) if abs(nearest - x) < 1e-12 else f"{x:g}"


def _short(x, form=".1e"):
    """A number without the leading zeros of its exponent; nothing for None."""
    if x is None:
        return ""
    text = f"{x:{form}}"
    digits, e, exponent = text.partition("e")
    return f"{digits}e{int(exponent)}" if e and exponent else text
