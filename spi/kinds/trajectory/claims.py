"""What a spec may expect of trajectories."""

from collections.abc import Iterable, Iterator

import numpy as np

from spi.statistics.claims import Quantity, lost_among, lost_is_infinite, quantity

from .results import Trajectory


def quantities(readings: Iterable[Trajectory]) -> Iterator[Quantity]:
    """Of the whole path: max |C(y_n) - C(y_0)|, max |H(y_n) - H(y_0)|, the smallest component, and 1 if it was lost."""
    for one in readings:
        with np.errstate(invalid="ignore"):
            change = np.abs(one.hamiltonian - one.hamiltonian[0])
        told = {
            "hamiltonian_drift": lost_is_infinite(change).max(),
            "lowest": one.lowest.min() if np.isfinite(one.lowest).any() else np.nan,
            "nonfinite": one.nonfinite_from is not None,
        }
        if one.casimir_drift:
            told["casimir_drift"] = lost_is_infinite(np.array(one.casimir_drift)).max()
        for name, value in told.items():
            lost = lost_among(np.abs(one.y).max(axis=1), "times") if name == "lowest" else ""
            yield quantity(name, one.about, value, lost=lost)
