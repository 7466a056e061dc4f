"""Tables of trajectories."""

import math

import numpy as np

from .text import new_table, power_of_two, print_whole, short


def rows(groups):
    """A record per time."""
    for group in groups:
        yield from _rows(group)


def _rows(group):
    y, energy, casimirs = (group.variables[name][1] for name in ("y", "hamiltonian", "casimirs"))
    columns = {"t": group.coordinates["t"], **{f"y_{i + 1}": v for i, v in enumerate(y.T)}, "hamiltonian": energy}
    columns |= {f"casimir_{c + 1}": v for c, v in enumerate(casimirs.T)}
    for values in zip(*(v.tolist() for v in columns.values()), strict=True):
        yield {"case": group.case, "scheme": group.scheme, **dict(zip(columns, values, strict=True))}


def show(console, heading, groups):
    """Print the table of a case."""
    from rich.text import Text

    count = groups[0].variables["casimirs"][1].shape[1]
    drifts = [f"drift\nof C{c + 1 if count > 1 else ''}" for c in range(count)]
    headings = ["scheme", "step", "steps", "H at the\nend", *drifts, "smallest\ncomponent", "not finite\nfrom t ="]
    implicit = any("solver_failures" in group.attributes for group in groups)
    table = new_table(heading, headings + ["solver\nfailures", "iterations\na step"] * implicit, left=1)
    for group in groups:
        a, y = group.attributes, group.variables["y"][1]
        lost, failures = a["nonfinite_from"], a.get("solver_failures")
        solver = ["" if failures is None else str(failures), short(a.get("solver_iterations_mean"), ".1f")]
        table.add_row(
            Text(a.get("scheme_label", group.scheme)),
            power_of_two(a["step"]),
            str(len(y) - 1),
            short(float(group.variables["hamiltonian"][1][-1]), ".6g"),
            *map(short, a["casimir_drift"]),
            short(float(y[np.isfinite(y)].min(initial=math.inf)), ".3g"),
            Text("" if math.isnan(lost) else f"{lost:g}", style="bold red"),
            *map(Text, solver * implicit),
        )
    print_whole(console, table)
    console.print()
