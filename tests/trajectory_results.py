"""Groups of trajectories made by hand, as complete as those of a run."""

import numpy as np

from spi.schemes import SCHEMES
from spi.storage.records import Group, Part, Results

LABELS = {"euler_maruyama": "Euler-Maruyama", "midpoint": "midpoint", "splitting": "splitting, noise first (slpI)"}
THREE = tuple(LABELS)


def trajectory_group(
    scheme, t, y, casimirs, case="main", panels=("casimirs",), hamiltonian=None, eps=None, **attributes
):
    """A path (t, component) and its Casimirs (t, casimir), by default of a system without a name."""
    lost = np.flatnonzero(~np.isfinite(y).all(axis=1))
    with np.errstate(invalid="ignore"):
        drift = np.abs(casimirs - casimirs[0]).max(axis=0)
    told = {
        "scheme": scheme,
        "scheme_label": LABELS.get(scheme, scheme),
        "eps": eps,
        "case_title": f"case {case}, $5",
        "model": "nameless",
        "initial": tuple(y[0].tolist()),
        "final_time": float(t[-1]),
        "step": float(t[1]),
        "seed": 7,
        "path": 3,
        "panels": panels,
        "preserves": SCHEMES[scheme].preserves,
        "nonfinite_from": float(t[lost[0]]) if len(lost) else float("nan"),
        "casimir_drift": tuple(drift.tolist()),
        **attributes,
    }
    coordinates = {"t": t, "component": np.arange(y.shape[1]), "casimir": np.arange(casimirs.shape[1])}
    variables = {
        "y": (("t", "component"), y),
        "hamiltonian": (("t",), 1 + y[:, 0] ** 2 if hamiltonian is None else hamiltonian),
        "casimirs": (("t", "casimir"), casimirs),
    }
    return Group(case, Part(scheme, eps=eps).variant, coordinates, variables, told)


def trajectories(*groups, **attributes):
    return Results({"kind": "trajectory", "title": "Paths", **attributes}, groups)
