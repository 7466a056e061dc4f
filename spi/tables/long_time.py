"""Tables of long times: how errors of the Casimirs grow, and how far the law of long paths is from the exact one."""

import math
from statistics import NormalDist

import numpy as np

from .text import INTERVAL, lines_of, lost_paths, new_table, power_of_two, print_whole, short, with_interval

#: Of several variables the table shows the distances of these.
SHOWN = ("y3", "H")

_SERIES = ("casimir_mean", "casimir_rms", "casimir_worst", "casimir_one")
_PER_CASIMIR = ("growth", "growth_low", "growth_high", "bias", "bias_stderr")


def rows(groups):
    """A record per step size and number of steps; the last ones of each step size tell all that has no number of steps.

    Of several Casimirs each has its columns, ``casimir_rms_1`` and so on.  Fractions in bins are left out.
    """
    for group in groups:
        yield from _rows(group)


def _rows(group):
    v, n = group.arrays, group.coordinates["n"].tolist()
    numbers = _numbers(group)
    whole = {"case": group.case, "scheme": group.scheme, "samples": group.attributes.get("samples")}
    for i, h in enumerate(group.coordinates["h"].tolist()):
        for k, steps in enumerate(n):
            record = {**whole, "h": h, "n": steps}
            for name in _SERIES:
                record |= {name + number: v[name][i, k, c].item() for c, number in enumerate(numbers)}
            yield record | (_ends(group, v, i) if k == len(n) - 1 else {})


def _numbers(group):
    """What is put behind the names of what each Casimir has: nothing if it is the only one."""
    count = len(group.coordinates["casimir"])
    return [""] if count == 1 else [f"_{c + 1}" for c in range(count)]


def _ends(group, v, i):
    """What a step size has besides errors at each number of steps."""
    record = {"nonfinite": v["nonfinite"][i].item()}
    for name in _PER_CASIMIR:
        record |= {name + number: v[name][i, c].item() for c, number in enumerate(_numbers(group))}
    if "mean" in v:
        for m, name in enumerate(group.coordinates["moment"].tolist()):
            pair = {f"{what}[{name}]": v[what][i, m].item() for what in ("mean", "mean_stderr")}
            record |= {**pair, f"mean_exact[{name}]": v["mean_exact"][m].item()}
    if "law_distance" in v:
        for m, name in enumerate(group.coordinates["variable"].tolist()):
            record |= {f"{what}[{name}]": v[what][i, m].item() for what in ("law_distance", "law_distance_stderr")}
    return record


def show(console, heading, groups):
    """Print the tables of a case: errors of the Casimirs, and the stationary law where it is known."""
    print_whole(console, _casimirs(heading, groups))
    console.print()
    known = [group for group in groups if "law_distance" in group.variables]
    if known:
        print_whole(console, _laws(known))
        console.print()
    for line in _remarks(groups):
        console.print(line, markup=False, soft_wrap=True)
    console.print()


def _casimirs(heading, groups):
    """Per scheme, step size and Casimir its errors after all steps and how they grew."""
    from rich.text import Text

    several = any(len(group.coordinates["casimir"]) > 1 for group in groups)
    names = ["scheme", "h", "non-\nfinite", *["Cas-\nimir"] * several]
    columns = ["rms error\nat the end", "worst", "growth of rms,\nexponent (95 %)", "bias/step", "in std.\nerrors"]
    table = new_table(heading, [*names, *columns], left=2, labels=0)
    for group in groups:
        v, label = group.arrays, _label(group)
        for i, h in enumerate(group.coordinates["h"].tolist()):
            lost = int(v["nonfinite"][i])
            start = [Text(label), power_of_two(h), lost_paths(lost)]
            for c in range(max(len(group.coordinates["casimir"]), 1)):
                cells = _casimir_cells(v, i, c) if v["casimir_rms"].shape[-1] else ["-"] * 5
                table.add_row(*start, *[f"C{c + 1}"] * several, *cells)
                start = ["", "", ""]
            label = ""
        table.add_section()
    return table


def _casimir_cells(v, i, c):
    rms, worst = (float(v[name][i, -1, c]) for name in ("casimir_rms", "casimir_worst"))
    p, low, high = (float(v[name][i, c]) for name in ("growth", "growth_low", "growth_high"))
    bias, stderr = (float(v[name][i, c]) for name in ("bias", "bias_stderr"))
    growth = f"{p:.2f} [{low:.2f}, {high:.2f}]" if math.isfinite(p) else "not fitted"
    ratio = f"{bias / stderr:.1f}" if stderr > 0 and math.isfinite(bias / stderr) else "-"
    return [short(rms), short(worst), growth, short(bias), ratio]


def _laws(groups):
    """Per scheme and step size how far distribution functions and means are from the exact ones."""
    from rich.text import Text

    variables = list(dict.fromkeys(name for group in groups for name in group.coordinates["variable"].tolist()))
    chosen = [name for name in variables if name in SHOWN] or variables
    distances = [f"distance of the\nlaw of {name} (95 %)" for name in chosen]
    table = new_table(
        "stationary law", ["scheme", "h", *distances, "largest |z|\nof the means", "of"], left=2, labels=0
    )
    for group in groups:
        v, label = group.arrays, _label(group)
        names = group.coordinates["variable"].tolist()
        for i, h in enumerate(group.coordinates["h"].tolist()):
            pairs = ((v["law_distance"][i, m], v["law_distance_stderr"][i, m]) for m in map(names.index, chosen))
            cells = [with_interval(float(value), INTERVAL * float(stderr)) for value, stderr in pairs]
            table.add_row(Text(label), power_of_two(h), *cells, *map(Text, _largest_z(group, v, i)))
            label = ""
        table.add_section()
    return table


def _largest_z(group, v, i):
    """The largest |mean - exact| in standard errors, and of which moment it is."""
    if "mean" not in v or not v["mean"].shape[-1]:
        return "", ""
    with np.errstate(divide="ignore", invalid="ignore"):
        z = np.abs(v["mean"][i] - v["mean_exact"]) / v["mean_stderr"][i]
    if np.isnan(z).any():
        return "not finite", ""
    return f"{z.max():.1f}", str(group.coordinates["moment"][z.argmax()])


def chance(count):
    """What the largest |z| of `count` independent standard normals stays below in 95 % of cases."""
    return NormalDist().inv_cdf(0.5 + 0.5 * 0.95 ** (1 / count))


def _label(group):
    return lines_of(group.attributes.get("scheme_label", group.scheme))


def _remarks(groups):
    runs = {}
    for group in groups:
        a = group.attributes
        run = f"{a.get('samples', '?')} paths of {_count(a.get('steps_each'))} steps each"
        run += f", {a['snapshots']} snapshots of each path" if a.get("snapshots") else ""
        runs.setdefault(run, []).append(a.get("scheme_label", group.scheme))
    for run, labels in runs.items():
        yield run if len(runs) == 1 else f"{', '.join(labels)}: {run}"
    seconds = sum(group.attributes.get("wall_seconds", 0.0) for group in groups)
    if seconds > 0:
        yield f"{seconds:.3g} s on {groups[0].attributes.get('threads', '?')} threads"
    counts = {len(g.coordinates["moment"]) for g in groups if "mean" in g.variables} - {0}
    for count in sorted(counts):
        yield f"by chance the largest |z| of {count} independent means is below {chance(count):.1f} in 95 % of cases"
    for group in groups:
        if group.attributes.get("note"):
            yield f"{group.attributes.get('scheme_label', group.scheme)}: {group.attributes['note']}"


def _count(steps):
    """A number of steps, powers of two also as such."""
    if steps is None:
        return "?"
    return f"{power_of_two(steps)} = {steps:.2g}" if steps > 1 and math.frexp(steps)[0] == 0.5 else f"{steps:,}"
