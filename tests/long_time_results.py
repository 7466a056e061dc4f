"""Results of the kind ``long_time`` made by hand, with the features that views must not hide."""

import numpy as np
from stability_results import attributes_of

from spi.storage.records import Group, Results

VARIABLES = ("y1", "y2", "y3", "H")
MOMENTS = ("y1", "y1^2", "y2", "y2^2", "y3", "y3^2", "y3^4", "H", "H^2")


def long_time_group(
    scheme, case="free", casimirs=1, panels=("growth", "law", "distance", "moments"), law=True, last=26, **more
):
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
    # the final time depends on the step size, so that this kind has none
    about = {"final_time": None, "steps_each": int(n[-1]), "snapshots": 4096, "panels": panels}
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


def long_time(*groups):
    return Results({"kind": "long_time", "title": "Long times"}, groups)
