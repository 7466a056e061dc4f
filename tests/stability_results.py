"""Results of the kinds ``stability`` and ``long_time`` made by hand, with the features that views must not hide."""

import numpy as np
from helpers import DESCRIBED

from spi.records import Group, Results

LABELS = {"euler_maruyama": "Euler-Maruyama", "midpoint": "midpoint", "splitting": "splitting"}
H = 2.0 ** -np.arange(0, 8)
VALUES = np.array([0.1, 0.3, 1.0, 3.0, 10.0, 30.0])
EACH, EACH_CASIMIR = ("value", "h"), ("value", "h", "casimir")
VARIABLES = ("y1", "y2", "y3", "H")
MOMENTS = ("y1", "y1^2", "y2", "y2^2", "y3", "y3^2", "y3^4", "H", "H^2")


def attributes_of(case, scheme, **more):
    own = {
        "scheme_label": LABELS[scheme],
        "case_title": f"case {case}, $5",
        "truncate_noise": False,
        "eps": None,
        "samples": 512,
        "note": "",
        "threads": 4,
        "wall_seconds": 12.5,
    }
    return DESCRIBED | own | more


def stability_group(scheme, case="free", casimirs=1, panels="regimes", values=VALUES, h=H, law=False, **more):
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
    variables = {
        "finite": (EACH, finite),
        "largest_norm": (EACH, norm),
        "error": (EACH, error),
        "error_stderr": (EACH, 0.03 * error),
        "largest_angle": (EACH, np.where(stiff > 0.5, np.sqrt(stiff), 0.0)),
    }
    if scheme == "midpoint":
        failures = np.where(stiff > 2.0, np.round(1e4 * (1 - np.exp(-(stiff - 2.0) / 50))), 0.0)
        drift = np.maximum(1e-14, 1e-5 * failures / 1e4 * stiff)
        variables |= {
            "solves": (EACH, np.full(stiff.shape, 10_000)),
            "iterations": (EACH, 10_000 * np.minimum(3 + 4 * stiff, 20.0)),
            "failures": (EACH, failures.astype(int)),
            "largest_residual": (EACH, np.where(failures > 0, 0.3, 1e-15)),
        }
    if law:
        known = (values < 20)[:, None]
        distance = 0.1 * stiff / (1 + stiff) + 0.002
        variables["law_distance"] = (EACH, np.where(known, np.where(finite < 1, np.inf, distance), np.nan))
        variables["law_distance_stderr"] = (EACH, np.where(known, 0.003, np.nan) * np.ones(stiff.shape))
    worst = drift[..., None] * np.array([1.0, 3.0])[:casimirs]
    median = np.where(np.isfinite(worst), np.where(worst < 2.2e-15, 0.0, 0.3 * worst), 1.0)
    variables |= {"casimir_worst": (EACH_CASIMIR, worst), "casimir_median": (EACH_CASIMIR, median)}
    about = {"sweep": "sigma", "sweep_label": r"\sigma", "reference_step": 2.0**-14, "accurate": 0.1, "panels": panels}
    coordinates = {"value": values, "h": h, "casimir": np.arange(casimirs)}
    return Group(case, scheme, coordinates, variables, attributes_of(case, scheme, **about, **more))


def predators(scheme, case="predators", **more):
    """The same without a Casimir, some components negative."""
    group = stability_group(scheme, case, 0, **more)
    stiff = group.coordinates["value"][:, None] ** 2 * group.coordinates["h"]
    positive = np.exp(-stiff / 3) if scheme == "euler_maruyama" else np.ones(stiff.shape)
    group.variables["positive"] = (EACH, np.round(positive * 512) / 512)
    group.attributes.update(model="lotka_volterra", initial=(1.5, 0.5))
    del group.attributes["model_inertia"]
    return group


def long_time_group(scheme, case="free", casimirs=1, panels="growth law distance moments", law=True, last=26, **more):
    """Rounding walks of the splitting, errors of the midpoint rule's solver that add up, Euler-Maruyama that grows."""
    rng = np.random.default_rng(1)
    h, n = 2.0 ** -np.array([2, 4, 6]), 2.0 ** np.arange(last + 1)
    power, size = {"splitting": (0.5, 1e-16), "midpoint": (0.95, 2e-16), "euler_maruyama": (1.0, 1e-2)}[scheme]
    growth = size * n**power * (1 + 0.1 * rng.standard_normal((3, n.size)))
    rms = growth[..., None] * np.array([1.0, 2.0])[:casimirs]
    lost = np.zeros(3, int)
    if scheme == "euler_maruyama":
        rms[0, 9:], rms[1, 14:], lost[:2] = np.inf, np.inf, (512, 40)
    if scheme == "splitting":
        rms[:, :2] = 0.0
    with np.errstate(invalid="ignore"):
        signed = np.where(np.isfinite(rms), 0.7 * rms * rng.choice([-1, 1], rms.shape), np.nan)
    axes, ends = ("h", "n", "casimir"), ("h", "casimir")
    fitted = np.where(lost > 0, np.nan, power)[:, None] * np.ones((3, casimirs))
    variables = {
        "casimir_mean": (axes, 0.1 * signed),
        "casimir_rms": (axes, rms),
        "casimir_worst": (axes, 3.5 * rms),
        "casimir_one": (axes, signed),
        "growth": (ends, fitted),
        "growth_low": (ends, fitted - 0.03),
        "growth_high": (ends, fitted + 0.03),
        "bias": (ends, np.full((3, casimirs), 1.5e-18 if scheme == "splitting" else 2e-17)),
        "bias_stderr": (ends, np.full((3, casimirs), 1e-18)),
        "nonfinite": (("h",), lost),
    }
    coordinates = {"h": h, "n": n.astype(np.int64), "casimir": np.arange(casimirs)}
    if law:
        variables |= _law(scheme, h, lost, rng)
        coordinates |= {"variable": np.array(VARIABLES), "bin": np.arange(20), "moment": np.array(MOMENTS)}
    about = {"steps_each": int(n[-1]), "snapshots": 4096, "panels": panels}
    return Group(case, scheme, coordinates, variables, attributes_of(case, scheme, **about, **more))


def _law(scheme, h, lost, rng):
    """Fractions, means and distances; the midpoint rule is off by a term of order h, the splitting by noise alone."""
    bins, stderr = (np.arange(20) + 0.5) / 20, 0.0006
    off = {"splitting": 0.0, "midpoint": 0.02, "euler_maruyama": 0.6}[scheme] * h
    fraction = (1 + off[:, None, None] * (2 * bins - 1) * 4 + 20 * stderr * rng.standard_normal((3, 4, 20))) / 20
    distance = np.abs(off)[:, None] * np.array([0.2, 0.3, 0.5, 1.0]) + 0.0008
    z = rng.standard_normal((3, len(MOMENTS))) + (off / 0.002)[:, None]
    gone = lost == lost.max() if lost.any() else np.zeros(3, bool)
    fraction[gone], distance[gone], z[gone] = 0.0, 1.0, np.nan
    exact = 1 / (1 + np.arange(len(MOMENTS)))
    return {
        "fraction": (("h", "variable", "bin"), fraction),
        "fraction_stderr": (("h", "variable", "bin"), np.full(fraction.shape, stderr)),
        "mean": (("h", "moment"), exact + 1e-3 * z),
        "mean_stderr": (("h", "moment"), np.full(z.shape, 1e-3)),
        "mean_exact": (("moment",), exact),
        "law_distance": (("h", "variable"), distance),
        "law_distance_stderr": (("h", "variable"), np.full(distance.shape, 6e-4)),
    }


def stability(*groups):
    return Results({"kind": "stability", "title": "Stability under strong noise"}, groups)


def long_time(*groups):
    return Results({"kind": "long_time", "title": "Long times"}, groups)
