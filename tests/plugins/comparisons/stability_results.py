"""Results of the kind ``stability`` made by hand: the error grows with the noise, and all else is as it should be."""

import numpy as np
from made_up import group_of

from spi.kinds.blocks import Solver
from spi.plugins.comparisons.kinds.stability.results import CasimirErrors, Stability
from spi.storage import StoredResults

LABELS = {"euler_maruyama": "Euler-Maruyama", "midpoint": "midpoint", "splitting": "splitting"}
H = 2.0 ** -np.arange(0, 8)
VALUES = np.array([0.1, 0.3, 1.0, 3.0, 10.0, 30.0])


def stability_group(scheme, case="free", casimirs=1, panels=("regimes",), values=VALUES, word="sigma", **more):
    """One scheme; the midpoint rule has a solver, whose equations have solutions."""
    one, none = np.ones((len(values), len(H))), np.zeros((len(values), len(H)), int)
    solver = Solver(solves=none + 10_000, iterations=none + 30_000, failures=none, largest_residual=1e-15 * one)
    drift = np.repeat(1e-15 * one[..., np.newaxis], casimirs, axis=2)
    fields = {
        "values": values,
        "h": H,
        "finite": one,
        "largest_norm": one,
        "error": 0.2 * values[:, np.newaxis] * np.sqrt(H),
        "error_stderr": 1e-3 * one,
        "casimirs": CasimirErrors(worst=drift, median=0.5 * drift) if casimirs else None,
        "largest_angle": 0.0 * one,
        "solver": solver if scheme == "midpoint" else None,
        "law": None,
        "word": word,
        "functions": (),
        "accurate": 0.1,
        "samples": 512,
        "reference_step": 2.0**-14,
        "panels": panels,
    }
    told = {"scheme_label": LABELS[scheme], "case_title": f"case {case}, $5"} | more
    return group_of(Stability, case, scheme, told, **fields)


def predators(scheme):
    """The same without a Casimir, and with shares of paths that stay positive."""
    group = stability_group(scheme, "predators", casimirs=0)
    group.variables["positive"] = ("value", "h"), np.ones((len(VALUES), len(H)))
    return group


def stability(*groups):
    return StoredResults({"kind": "stability", "title": "Stability under strong noise"}, groups)
