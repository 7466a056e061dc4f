"""Made-up results of work and precision: five schemes, two strong cases with Casimirs and a weak one without."""

import math

import numpy as np
from made_up import group_of

from spi.kinds.work_precision.results import WorkPrecision
from spi.storage import Order, Results

H = 2.0 ** -np.arange(3, 12)

#: scheme -> (label, nanoseconds per step, constant and order of the strong error, the same of the weak error)
MADE_UP = {
    "euler_maruyama": ("Euler-Maruyama", 6.0, 0.9, 0.5, 0.3, 1.0),
    "midpoint": ("midpoint", 61.0, 0.35, 0.5, 0.08, 1.0),
    "splitting": ("splitting", 8.5, 0.55, 0.5, 0.12, 1.0),
    "splitting_drift_first": ("splitting, drift first", 8.6, 0.56, 0.5, 0.15, 1.0),
    "splitting_order2": ("splitting, weak order 2", 14.0, 0.5, 0.5, 0.06, 2.0),
}


def work_group(case, scheme, measure="strong", seed=0, noisy=True, casimirs=True):
    """One scheme; times and errors scatter a little if `noisy`, and Euler-Maruyama loses paths in the case ``lost``."""
    label, ns, *constants = MADE_UP[scheme]
    constant, order = constants[:2] if measure == "strong" else constants[2:]
    rng = np.random.default_rng([seed, *scheme.encode()])
    exact = measure == "weak"
    error = constant * H**order * (1 + (0.0 if exact or not noisy else 0.01) * rng.standard_normal(9))
    stderr = np.full(9, 1e-8) if exact else 0.012 * error
    seconds = ns * 1e-9 / H * (1 + 0.02 * rng.random(9) * noisy)
    lost = np.zeros(9, int)
    if case == "lost" and scheme == "euler_maruyama":
        error[:3], stderr[:3], lost[:2] = (math.inf, math.inf, 3e7), (math.nan, math.nan, 3e7), (512, 31)
    told = {"scheme_label": label, "case_title": {"lost": "strong noise"}.get(case, f"case {case}")}
    told |= {"truncate_noise": True, "model_sigma": (3.0, 3.0, 3.0) if case == "lost" else (1.0, 1.0, 1.0)}
    fields = {
        "h": H,
        "error": error,
        "error_bound" if exact else "error_stderr": stderr,
        "resolved": np.isfinite(error) & (error >= 4 * stderr),
        "casimir_drift": _drifts(scheme, error, rng) if casimirs and not exact else None,
        "nonfinite": lost,
        "ns_per_step": 1e9 * seconds * H,
        "seconds_per_path": seconds,
        "seconds_per_path_low": 0.99 * seconds,
        "seconds_per_path_high": 1.02 * seconds,
        "order": Order(order + 0.01, order - 0.01, order + 0.03, 9),
        "expected_order": order,
        "measure": measure,
        "repeats": 7,
        "reference_step": 2.0**-16,
    }
    if exact:
        fields |= {
            "functions": ("sin(6.283185307179586*y1)",),
            "estimator": "kolmogorov",
            "targets": (1e-2, 1e-4, 1e-6),
        }
    else:
        fields |= {"samples": 500, "targets": (0.1, 0.01, 1e-3)}
    return group_of(WorkPrecision, case, scheme, told, **fields)


def _drifts(scheme, error, rng):
    if scheme == "euler_maruyama":
        with np.errstate(over="ignore"):
            return np.column_stack([error, 0.5 * error**2])
    rounding = 2e-16 / np.sqrt(H)
    drift = np.column_stack([rounding, rounding * (1 + rng.random(9))])
    if scheme == "midpoint":
        drift[:, 1] = 0.1 * H
    if scheme == "splitting":
        drift[0] = 0.0
    return drift


def work_results(cases=("one", "lost", "weak"), schemes=tuple(MADE_UP), **how):
    """Results with these cases; the one called ``weak`` holds weak errors."""
    measures = {case: "weak" if case == "weak" else "strong" for case in cases}
    groups = [work_group(case, scheme, measures[case], **how) for case in cases for scheme in schemes]
    return Results({"kind": "work_precision", "title": "Work and precision, stochastic rigid body"}, tuple(groups))
