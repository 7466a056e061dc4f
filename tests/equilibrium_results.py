"""Results of the kind ``equilibrium`` made by hand, with the features that views must not hide."""

import numpy as np
from made_up import group_of
from stability_results import LABELS

from spi.kinds.equilibrium.results import Averages, Equilibrium, Law
from spi.storage import Order, Results

VARIABLES = ("y1", "y2", "y3", "H")
MOMENTS = ("y1", "y1^2", "y2", "y2^2", "y3", "y3^2", "y3^4", "H", "H^2")


def equilibrium_group(
    scheme,
    case="free",
    casimirs=1,
    panels=("growth", "law", "distance"),
    law=True,
    last=26,
    averages=None,
    **more,
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
    fitted = np.where(lost > 0, np.nan, power)[:, None] * np.ones((3, casimirs))
    fields = {
        "h": h,
        "n": n.astype(np.int64),
        "casimir_mean": 0.1 * signed,
        "casimir_rms": rms,
        "casimir_worst": 3.5 * rms,
        "casimir_one": signed,
        "growth": fitted,
        "growth_low": fitted - 0.03,
        "growth_high": fitted + 0.03,
        "bias": np.full((3, casimirs), 1.5e-18 if scheme == "splitting" else 2e-17),
        "bias_stderr": np.full((3, casimirs), 1e-18),
        "nonfinite": lost,
        "law": _law(scheme, h, lost, rng) if law else None,
        "samples": 512,
        "steps_each": int(n[-1]),
        "snapshots": 4096,
        "panels": panels,
        "averages": averages,
    }
    # the final time depends on the step size, so that this kind has none
    told = {"scheme_label": LABELS[scheme], "case_title": f"case {case}, $5", "final_time": None} | more
    return group_of(Equilibrium, case, scheme, told, **fields)


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
    return Law(
        variables=VARIABLES,
        moments=MOMENTS,
        fraction=fraction,
        fraction_stderr=np.full(fraction.shape, stderr),
        mean=exact + 1e-3 * z,
        mean_stderr=np.full(z.shape, 1e-3),
        mean_exact=exact,
        distance=distance,
        distance_stderr=np.full(distance.shape, 6e-4),
    )


def averages_group(scheme, case="held", **more):
    """Means of H and of y3^2 at T = 1/4: a bias of order 2 and one that is not resolved."""
    h, lag = 2.0 ** -np.array([2, 4, 6]), 0.25 * np.arange(8.0)
    each, cells = np.ones((3, 2)), np.linspace(1.0, 0.2, 10) * np.ones((3, 2, 10))
    bias = np.stack([0.1 * h**2, 1e-5 * np.ones(3)], axis=1)
    rho = np.exp(-lag) * np.ones((3, 2, 8))
    averages = Averages(
        functions=("H", "square"),
        texts=("H", "y3^2"),
        temperature=0.25,
        spacing=0.25,
        kept=1600,
        average=0.5 + bias,
        average_half=2e-5 * each,
        **{name: 1e-5 * each for name in ("stderr_paths", "stderr_tau", "stderr_batches")},
        tau=0.9 * each,
        tau_stderr=0.02 * each,
        window=4.5 * each,
        halves=0.7 * each,
        variance=0.1 * each,
        variance_stderr=1e-3 * each,
        reference=np.array([0.5, 0.5]),
        reference_stderr=np.zeros(2),
        reference_variance=np.array([0.1, 0.1]),
        order=(Order(2.0, 1.9, 2.1, 3), Order(np.nan, np.nan, np.nan, 1)),
        constant=np.array([0.1, np.nan]),
        lag=lag,
        correlation=rho,
        correlation_stderr=0.01 * rho,
        cell_low=0 * each,
        cell_width=0.1 * each,
        density=cells,
        density_stderr=0.01 * cells,
        density_exact=cells,
    )
    panels = ("growth", "means", "histogram", "autocorrelation", "heat")
    return equilibrium_group(scheme, case, panels=panels, law=False, averages=averages, **more)


def equilibrium(*groups):
    return Results({"kind": "equilibrium", "title": "Long times"}, groups)
