"""Results of the kinds ``growth`` and ``equilibrium`` made by hand, with the features that views must not hide."""

import numpy as np
from made_up import group_of

from spi.plugins.dynamics.kinds.equilibrium.results import Averages, Equilibrium
from spi.plugins.dynamics.kinds.growth.results import Growth, StationaryLaw
from spi.storage import Order, StoredResults

LABELS = {"euler_maruyama": "Euler-Maruyama", "midpoint": "midpoint", "splitting": "splitting"}
VARIABLES = ("y1", "y2", "y3", "H")
MOMENTS = ("y1", "y1^2", "y2", "y2^2", "y3", "y3^2", "y3^4", "H", "H^2")


def growth_group(scheme, case="free", panels=("growth", "law", "distance"), law=True, **more):
    """Rounding walks of one Casimir function, and the law of the states, which is nearly the exact one."""
    return _group(Growth, scheme, case, more, panels=panels, law=_law() if law else None, snapshots=4096)


def _group(record, scheme, case, more, **own):
    h, n, each = 2.0 ** -np.array([2, 4, 6]), 2 ** np.arange(27), np.ones((3, 1))
    rms = 1e-16 * np.sqrt(n)[:, np.newaxis] * np.ones((3, 1, 1))
    fields = {
        "h": h,
        "n": n,
        "casimir_mean": 0.1 * rms,
        "casimir_rms": rms,
        "casimir_worst": 3.5 * rms,
        "casimir_one": -0.7 * rms,
        "growth": 0.5 * each,
        "growth_low": 0.47 * each,
        "growth_high": 0.53 * each,
        "bias": 1.5e-18 * each,
        "bias_stderr": 1e-18 * each,
        "nonfinite": np.zeros(3, int),
        "samples": 512,
        "steps_each": int(n[-1]),
        **own,
    }
    # the final time depends on the step size, so that this kind has none
    told = {"scheme_label": LABELS[scheme], "case_title": f"case {case}, $5", "final_time": None} | more
    return group_of(record, case, scheme, told, **fields)


def _law():
    exact, each = 1 / (1 + np.arange(len(MOMENTS))), np.ones((3, len(VARIABLES)))
    z = np.random.default_rng(1).standard_normal((3, len(MOMENTS)))
    fraction = 0.05 + 1e-3 * np.random.default_rng(2).standard_normal((3, len(VARIABLES), 20))
    return StationaryLaw(
        variables=VARIABLES,
        moments=MOMENTS,
        fraction=fraction,
        fraction_stderr=np.full(fraction.shape, 6e-4),
        mean=exact + 1e-3 * z,
        mean_stderr=np.full(z.shape, 1e-3),
        mean_exact=exact,
        distance=2e-3 * each,
        distance_stderr=6e-4 * each,
    )


def equilibrium_group(scheme, quantities=None, **more):
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
        quantities=quantities,
    )
    panels = more.pop("panels", ("growth", "means", "histogram", "autocorrelation", "heat"))
    return _group(Equilibrium, scheme, "held", more, panels=panels, averages=averages)


def growth(*groups):
    return StoredResults({"kind": "growth", "title": "Long times"}, groups)


def equilibrium(*groups):
    return StoredResults({"kind": "equilibrium", "title": "Means"}, groups)
