"""Groups of strong errors made by hand, as complete as those of a run."""

import numpy as np
from helpers import DESCRIBED

from spi.storage.records import Group, Results

H = 2.0 ** -np.arange(5, 14)

LABELS = {"euler_maruyama": "Euler-Maruyama", "midpoint": "midpoint", "splitting": "splitting, noise first (slpI)"}


def strong_group(scheme, case="three", error=None, error_stderr=None, resolved=None, h=H, implicit=False, **attributes):
    """One scheme with errors h^(1/2) and standard errors of 2 %, or those given."""
    error = h**0.5 if error is None else error
    nonfinite = np.where(np.isfinite(error), 0, 37)
    of_h = {
        "error": error,
        "error_stderr": 0.02 * error if error_stderr is None else error_stderr,
        "error_time": np.ones(h.size),
        "error_final": 0.9 * error,
        "error_final_stderr": 0.009 * h**0.5,
        "nonfinite": nonfinite,
        "resolved": np.full(h.size, True) if resolved is None else resolved,
        "seconds": 1e-3 / h,
        "ns_per_step": np.full(h.size, 6.25),
    }
    if implicit:
        of_h |= {
            "solves": np.full(h.size, 100),
            "iterations": np.full(h.size, 320),
            "failures": np.zeros(h.size, dtype=int),
            "largest_residual": np.full(h.size, 2.2e-16),
        }
    drift = np.outer(np.arange(h.size), [1e-16, -1e-16])
    told = {
        **DESCRIBED,
        "scheme": scheme,
        "scheme_label": LABELS.get(scheme, scheme),
        "case_title": case,
        "order": 0.5,
        "order_ci": (0.48, 0.52),
        "points_in_fit": h.size,
        "expected_order": 0.5,
        "samples": 500,
        "reference_step": 2.0**-16,
        "reference_nonfinite": 0,
        "note": "",
        **attributes,
    }
    variables = {name: (("h",), values) for name, values in of_h.items()}
    return Group(
        case, scheme, {"h": h, "casimir": np.arange(2)}, variables | {"casimir_drift": (("h", "casimir"), drift)}, told
    )


def strong(*groups, **attributes):
    return Results({"kind": "strong", "title": "Strong errors", **attributes}, groups)
