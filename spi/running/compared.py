"""Whether the groups of a results file are those that follow from something else."""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .. import storage
from ..storage.records import Group, Results

#: What the names of those numbers contain that a clock decides, or the machine at hand.
TIMES = ("seconds", "ns_per_step", "cost_rate")

#: Derived from the same sums numbers differ by rounding at most, as where another version of NumPy derives them.
_ROUNDING = 1e-9

#: By default the title of a case is the name of its file, and threads are those of the process that derives.
_OF_ITS_RUN = ("case_title", "swept_title", "threads")


def differing(derived: Sequence[Group], stored: Sequence[Group], times: bool) -> list[str]:
    """The names of all that is not the same in `stored` as in what was `derived`, times only if they are wanted."""
    mine, theirs = ({group.name: group for group in groups} for groups in (_as_read(derived), stored))
    found = [name for name in (mine | theirs) if name not in mine or name not in theirs]
    for name in mine.keys() & theirs.keys():
        one, other = _plain(mine[name]), _plain(theirs[name])
        keys = [key for key in (one | other) if times or not any(word in key for word in TIMES)]
        found += [f"{name}: {key}" for key in keys if not _same(one.get(key), other.get(key))]
    return sorted(found)


def _as_read(groups: Sequence[Group]) -> tuple[Group, ...]:
    """Groups as a file gives them back."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "derived.h5"
        storage.write(path, Results({}, tuple(groups)))
        return storage.read(path).groups


def _plain(group: Group) -> dict[str, Any]:
    """All that a group has, by name: (axes, array)."""
    facts = {name: ((), value) for name, value in group.attributes.items() if name not in _OF_ITS_RUN}
    return facts | {name: ((name,), values) for name, values in group.coordinates.items()} | group.variables


def _same(one: Any, other: Any) -> bool:
    """Whether two entries are the same, numbers but for rounding."""
    if one is None or other is None or one[0] != other[0]:
        return one is other
    a, b = (np.asarray(entry[1]) for entry in (one, other))
    if a.shape != b.shape or (a.dtype.kind in "if") != (b.dtype.kind in "if"):
        return False
    if a.dtype.kind not in "if":
        return bool(np.array_equal(a, b))
    size = np.abs(a[np.isfinite(a)]).max(initial=0.0)
    return bool(np.allclose(a, b, rtol=_ROUNDING, atol=_ROUNDING**2 * size, equal_nan=True))
