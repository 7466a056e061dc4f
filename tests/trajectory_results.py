"""Groups of trajectories made by hand, as complete as those of a run."""

import numpy as np
from made_up import group_of

from spi.kinds.trajectory.results import Trajectory
from spi.schemes import SCHEMES
from spi.storage import StoredResults

LABELS = {"euler_maruyama": "Euler-Maruyama", "midpoint": "midpoint", "splitting": "splitting, noise first (slpI)"}
THREE = tuple(LABELS)


def trajectory_group(
    scheme, t, y, casimirs, case="main", panels=("casimirs",), hamiltonian=None, eps=None, values=None, **attributes
):
    """A path (t, component) and its Casimirs (t, casimir), by default of a system without a name."""
    lost = np.flatnonzero(~np.isfinite(y).all(axis=1))
    with np.errstate(invalid="ignore"):
        drift = np.abs(casimirs - casimirs[0]).max(axis=0)
    about = {
        "scheme_label": LABELS.get(scheme, scheme),
        "eps": eps,
        "case_title": f"case {case}, $5",
        "model": "nameless",
        "initial": tuple(y[0].tolist()),
        "final_time": float(t[-1]),
        "seed": 7,
    }
    group = group_of(
        Trajectory,
        case,
        scheme,
        about | attributes,
        t=t,
        y=y,
        hamiltonian=1 + y[:, 0] ** 2 if hamiltonian is None else hamiltonian,
        casimirs=casimirs,
        values=values,
        step=float(t[1]),
        path=3,
        panels=panels,
        preserves=SCHEMES[scheme].preserves,
        nonfinite_from=float(t[lost[0]]) if len(lost) else None,
        casimir_drift=tuple(drift.tolist()),
    )
    del group.attributes["model_inertia"]
    return group


def trajectories(*groups, **attributes):
    return StoredResults({"kind": "trajectory", "title": "Paths", **attributes}, groups)
