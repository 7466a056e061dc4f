"""Groups of strong errors made by hand, as complete as those of a run."""

import numpy as np
from made_up import group_of

from spi.kinds.blocks import Solver
from spi.kinds.strong.results import StrongErrors
from spi.storage import Order, StoredResults

H = 2.0 ** -np.arange(5, 14)

LABELS = {"euler_maruyama": "Euler-Maruyama", "midpoint": "midpoint", "splitting": "splitting, noise first (slpI)"}


def strong_group(scheme, case="three", error=None, error_stderr=None, resolved=None, h=H, implicit=False, **attributes):
    """One scheme with errors h^(1/2) and standard errors of 2 %, or those given."""
    error = h**0.5 if error is None else error
    shape = h.size
    solver = Solver(
        solves=np.full(shape, 100),
        iterations=np.full(shape, 320),
        failures=np.zeros(shape, dtype=int),
        largest_residual=np.full(shape, 2.2e-16),
    )
    fields = {
        "error": error,
        "error_stderr": 0.02 * error if error_stderr is None else error_stderr,
        "error_time": np.ones(shape),
        "error_final": 0.9 * error,
        "error_final_stderr": 0.009 * h**0.5,
        "casimir_drift": np.outer(np.arange(shape), [1e-16, -1e-16]),
        "nonfinite": np.where(np.isfinite(error), 0, 37),
        "resolved": np.full(shape, True) if resolved is None else resolved,
        "seconds": 1e-3 / h,
        "ns_per_step": np.full(shape, 6.25),
        "solver": solver if implicit else None,
        "order": Order(0.5, 0.48, 0.52, shape),
        "expected_order": 0.5,
        "samples": 500,
        "reference_step": 2.0**-16,
        "reference_nonfinite": 0,
        "reference_casimir_drift": (0.0, 0.0),
    }
    told = {"scheme_label": LABELS.get(scheme, scheme)} | attributes
    return group_of(StrongErrors, case, scheme, told, h=h, **fields)


def unresolved(group):
    """The group without an order."""
    group.variables.update({name: ((), np.array(np.nan)) for name in ("order", "order_low", "order_high")})
    return group


def strong(*groups, **attributes):
    return StoredResults({"kind": "strong", "title": "Strong errors", **attributes}, groups)
