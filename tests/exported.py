"""Whether the tables of exports hold every array of a results file, with its interval."""

import itertools
import re

#: Errors whose names are not those of the numbers that they are of.
ERRORS_OF = {
    **{"map_stderr": "map_density", "pullback_stderr": "pullback_density", "level_stderr": "level_mean"},
    **{"stderr": "value", "half": "value"},
}
#: The places of first cells, whose names look like lower ends of intervals.
PLACES = ("bin_low", "cell_low", "map_low", "pullback_low")


def missing(results, tables):
    """Names of what is in no table: arrays of the groups, and ``x_low`` and ``x_high`` of those with an error."""
    found = []
    for group in results.groups:
        who = {"case": group.case, "scheme": group.attributes["scheme"], "estimator": group.estimator}
        who |= {name: group.attributes.get(name) for name in ("eps", "extrapolate")}
        who = {name: value for name, value in who.items() if value}
        own = [(table.axes, [row for row in table.rows if who.items() <= row.items()]) for table in tables.values()]
        for name, (axes, values) in group.variables.items():
            if values.size and not any(_holds(rows, over, group, name, axes, values) for over, rows in own if rows):
                found.append(name)
            base, _, end = name.rpartition("_")
            base = ERRORS_OF.get(name, base if name not in PLACES else "")
            if end in ("stderr", "half", "bound", "low", "high") and (base in group.variables or name in ERRORS_OF):
                ends = {f"{base}_low", f"{base}_high"}
                found += sorted(ends - {key for _, rows in own for row in rows[:1] if base in row for key in row})
    return sorted(set(found))


def _holds(rows, over, group, name, axes, values):
    """Whether rows over some axes have the values at their places, or a column for each place along the last axis."""
    if name in rows[0] and {*axes} <= {*over}:
        places = itertools.product(*(group.coordinates[axis].tolist() for axis in axes))
        held = {tuple(row[axis] for axis in axes): row[name] for row in rows}
        return _same([held[place] for place in places], values.ravel().tolist())
    spread = [key for key in rows[0] if re.fullmatch(rf"{name}(_\d+|\[.*\])?", key)]
    spread = spread or [key for key in rows[0] if re.fullmatch(rf"{name.removesuffix('s')}(_\d+)", key)]
    if axes[:-1] == over and len(spread) == values.shape[-1]:
        return _same([row[key] for row in rows for key in spread], values.ravel().tolist())
    return name in rows[0] and {*axes[:-1]} == {*over} and values.shape[-1] == 1


def _same(one, other):
    return len(one) == len(other) and all(a == b or (a != a and b != b) for a, b in zip(one, other, strict=True))
