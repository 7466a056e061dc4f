"""Casimir functions along paths: how far they moved from what the exact solution makes of them.

The exact solution preserves C(y).  With damping at the rate gamma it preserves exp(k gamma t) C(y) where C is
homogeneous of degree k, so that this takes the place of C(y) wherever Casimir functions are judged.
"""

import numpy as np

from ..compiler.dispatch import kernel, number, unrolled
from ..numerics.rng import LANES
from .lanes import load_lane
from .protocol import casimir_indices, casimirs, conserved, decay_rates, dimension, hamiltonian, large
from .special import frozen


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


def empty_invariants(model, states):
    """Room for so many states (n, d) and times (n,), and for H (n,) and the Casimir functions (n, C) of them."""
    room = np.zeros((states, dimension(model))), np.zeros(states)
    return *room, np.empty(states), np.empty((states, conserved(model)))


def invariants_of(model, states, times):
    """H (n,) and the Casimir functions (n, C) of states (n, d) at times (n,), as kernels round them."""
    _, _, energy, values = empty_invariants(model, len(states))
    invariants(model, states, times, energy, values)
    return energy, values


@unrolled(casimir_indices)
def _keep_casimir(index, model, values, row, found):
    c = number(index)
    values[row, c] = found[c]
    return values


@kernel
def invariants(model, states, times, energy, values):
    """H and the Casimirs of each row of `states` (n, d) at its time, in `energy` (n,) and `values` (n, C)."""
    block = np.zeros(states.shape[1] * LANES)  # of which the first lane is used: words take states from blocks
    for row in range(len(states)):
        for i in range(states.shape[1]):  # an assignment of slices would take a second to compile
            block[i * LANES] = states[row, i]
        y = load_lane(model, block, 0)
        energy[row] = hamiltonian(frozen(model, times[row], 0.0), y)
        _keep_casimir(model, values, row, casimirs(model, y))
