"""Casimir functions along paths: how far they moved from what the exact solution makes of them.

The exact solution preserves C(y).  With damping at the rate gamma it preserves exp(k gamma t) C(y) where C is
homogeneous of degree k, so that this takes the place of C(y) wherever Casimir functions are judged.
"""

import numpy as np

from .protocol import casimirs, decay_rates, large


def growth(model, t):
    """exp(k gamma t) for each Casimir function, shape (..., C) for t of shape (...); 1 without damping."""
    rates = decay_rates(model)
    with np.errstate(over="ignore"):
        return np.exp(np.multiply.outer(t, rates)) if rates else 1.0


def casimirs_of_states(model, states):
    """(C, paths) the Casimir functions of states (d, paths)."""
    if large(model):
        return np.array([casimirs(model, state) for state in np.ascontiguousarray(states.T)]).T
    return np.array(casimirs(model, tuple(states)))
