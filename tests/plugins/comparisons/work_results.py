"""Made-up results of work and precision: five schemes, two strong cases with Casimirs and a weak one without."""

import numpy as np
from made_up import group_of

from spi.plugins.comparisons.kinds.work_precision.results import WorkPrecision
from spi.storage import Order, StoredResults

H = 2.0 ** -np.arange(3, 12)

#: scheme -> (label, nanoseconds per step, constant and order of the strong error, the same of the weak error)
MADE_UP = {
    "euler_maruyama": ("Euler-Maruyama", 6.0, 0.9, 0.5, 0.3, 1.0),
    "midpoint": ("midpoint", 61.0, 0.35, 0.5, 0.08, 1.0),
    "splitting": ("splitting", 8.5, 0.55, 0.5, 0.12, 1.0),
    "splitting_drift_first": ("splitting, drift first", 8.6, 0.56, 0.5, 0.15, 1.0),
    "splitting_order2": ("splitting, weak order 2", 14.0, 0.5, 0.5, 0.06, 2.0),
}


def work_group(case, scheme, measure="strong", noisy=True, casimirs=True):
    """One scheme; times and errors scatter a little if `noisy`."""
    label, ns, *constants = MADE_UP[scheme]
    constant, order = constants[:2] if measure == "strong" else constants[2:]
    rng = np.random.default_rng([0, *scheme.encode()])
    exact = measure == "weak"
    error = constant * H**order * (1 + (0.0 if exact or not noisy else 0.01) * rng.standard_normal(9))
    stderr = np.full(9, 1e-8) if exact else 0.012 * error
    seconds = ns * 1e-9 / H * (1 + 0.02 * rng.random(9) * noisy)
    told = {"scheme_label": label, "case_title": f"case {case}", "truncate_noise": True}
    told |= {"model_sigma": (3.0, 3.0, 3.0) if case == "two" else (1.0, 1.0, 1.0)}
    fields = {
        "h": H,
        "error": error,
        "error_bound" if exact else "error_stderr": stderr,
        "resolved": np.isfinite(error) & (error >= 4 * stderr),
        "casimir_drift": np.full((9, 2), 1e-15) if casimirs and not exact else None,
        "nonfinite": np.zeros(9, int),
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


def work_results(cases=("one", "two", "weak"), schemes=tuple(MADE_UP), **how):
    """Results with these cases; the one called ``weak`` holds weak errors."""
    measures = {case: "weak" if case == "weak" else "strong" for case in cases}
    groups = [work_group(case, scheme, measures[case], **how) for case in cases for scheme in schemes]
    return StoredResults(
        {"kind": "work_precision", "title": "Work and precision, stochastic rigid body"}, tuple(groups)
    )
