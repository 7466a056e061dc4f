"""Results of the kind ``stability`` made by hand, with the features that views must not hide."""

import numpy as np
from made_up import group_of

from spi.kinds.blocks import Solver
from spi.kinds.stability.results import CasimirErrors, Law, Stability
from spi.storage import Results

LABELS = {"euler_maruyama": "Euler-Maruyama", "midpoint": "midpoint", "splitting": "splitting"}
H = 2.0 ** -np.arange(0, 8)
VALUES = np.array([0.1, 0.3, 1.0, 3.0, 10.0, 30.0])
EACH = ("value", "h")


def stability_group(scheme, case="free", casimirs=1, panels=("regimes",), values=VALUES, h=H, law=False, **more):
    """Paths of Euler-Maruyama explode, the midpoint rule's solver fails, the splitting keeps its Casimir."""
    stiff = values[:, None] ** 2 * h
    error = {"euler_maruyama": 2.0, "midpoint": 0.3, "splitting": 0.2}[scheme] * np.sqrt(stiff) * np.sqrt(h[0])
    finite = np.ones(stiff.shape)
    norm = 1 + 1e-13 * stiff
    drift = 1e-15 * (1 + np.sqrt(1 / h)) * np.ones(stiff.shape)
    if scheme == "euler_maruyama":
        finite = np.where(stiff > 8.0, np.round(np.exp(8.0 - stiff) * 512) / 512, 1.0)
        drift = np.where(finite < 1, np.inf, 0.02 * stiff + 0.5 * stiff**4)
        norm = np.where(finite < 1, np.inf, np.sqrt(1 + drift))
        error = np.where(finite < 1, np.inf, error)
    failures = np.zeros(stiff.shape, int)
    if scheme == "midpoint":
        failures = np.where(stiff > 2.0, np.round(1e4 * (1 - np.exp(-(stiff - 2.0) / 50))), 0.0).astype(int)
        drift = np.maximum(1e-14, 1e-5 * failures / 1e4 * stiff)
    solver = Solver(
        solves=np.full(stiff.shape, 10_000),
        iterations=10_000 * np.minimum(3 + 4 * stiff, 20.0),
        failures=failures,
        largest_residual=np.where(failures > 0, 0.3, 1e-15),
    )
    worst = drift[..., None] * np.array([1.0, 3.0])[:casimirs]
    median = np.where(np.isfinite(worst), np.where(worst < 2.2e-15, 0.0, 0.3 * worst), 1.0)
    fields = {
        "values": values,
        "h": h,
        "finite": finite,
        "largest_norm": norm,
        "error": error,
        "error_stderr": 0.03 * error,
        "casimirs": CasimirErrors(worst=worst, median=median) if casimirs else None,
        "largest_angle": np.where(stiff > 0.5, np.sqrt(stiff), 0.0),
        "solver": solver if scheme == "midpoint" else None,
        "law": _law(values, np.where(finite < 1, np.inf, 0.1 * stiff / (1 + stiff) + 0.002)) if law else None,
        "word": "sigma",
        "functions": ("y1", "y2^2") if law else (),
        "accurate": 0.1,
        "samples": 512,
        "reference_step": 2.0**-14,
        "panels": panels,
    }
    told = {"scheme_label": LABELS[scheme], "case_title": f"case {case}, $5"} | more
    return group_of(Stability, case, scheme, told, **fields)


def _law(values, distance):
    """Two test functions, the first of them off by `distance` (V, S); of values above 20 the truth is not known."""
    known = (values < 20)[:, None]
    truth = np.where(known, (0.25, 0.5), np.nan)
    return Law(
        names=("a", "b"),
        expectation=np.stack([0.25 + distance, 0.5 * np.ones(distance.shape)], axis=2),
        expectation_stderr=np.full((*distance.shape, 2), 0.003),
        truth=truth,
        truth_bound=1e-6 * truth,
        distance=np.where(known, distance, np.nan),
        distance_stderr=np.where(known, 0.003, np.nan) * np.ones(distance.shape),
    )


def predators(scheme, case="predators", **more):
    """The same without a Casimir, some components negative."""
    group = stability_group(scheme, case, 0, **more)
    stiff = group.coordinates["value"][:, None] ** 2 * group.coordinates["h"]
    positive = np.exp(-stiff / 3) if scheme == "euler_maruyama" else np.ones(stiff.shape)
    group.variables["positive"] = (EACH, np.round(positive * 512) / 512)
    group.attributes.update(model="lotka_volterra", initial=(1.5, 0.5))
    del group.attributes["model_inertia"]
    return group


def stability(*groups):
    return Results({"kind": "stability", "title": "Stability under strong noise"}, groups)
