"""States that noises and drift can reach: whether a law on the Casimir surface can be the only stationary one.

The fields of the noises, X_k, and their brackets with one another and with the drift span at a point y
the same space as the vectors (D Phi)^-1 X_k(Phi(y)), Phi being flows of random combinations of all these fields
(fields are analytic).  Friction along the noises changes nothing in this.
"""

from functools import partial

import numpy as np

from spi.compiler.inlining import uncompiled
from spi.ensemble import protocol
from spi.exact.surfaces import at_states, structure_matrix
from spi.numerics.arrays import runge_kutta

_STEPS = 32  #: of a flow by Runge and Kutta
_NUDGE, _FLAT, _CLOSE = 1e-5, 1e-4, 1e-6


@np.errstate(all="ignore")
def reach(model, initial):
    """(dimension of the set of states that noises and drift reach from a state, that of its Casimir surface)."""
    start, rng = np.array(initial, float), np.random.default_rng(3)
    with uncompiled():
        surface = int(np.linalg.matrix_rank(structure_matrix(model, start), tol=_CLOSE * np.abs(start).max()))
        count = 1 + len(protocol.noise_indices(model))
        y = _flow(model, start[:, np.newaxis], rng.standard_normal(count))
        vectors = _noise_fields(model, y)
        around = y + _NUDGE * np.hstack([np.zeros((len(y), 1)), np.eye(len(y)), -np.eye(len(y))])
        for _ in range(2 * surface):
            if _rank(vectors) >= surface:
                break
            moved = _flow(model, _flow(model, around, rng.standard_normal(count)), rng.standard_normal(count))
            derivative = (moved[:, 1 : len(y) + 1] - moved[:, len(y) + 1 :]) / (2 * _NUDGE)
            if np.isfinite(moved).all():
                vectors += list(np.linalg.lstsq(derivative, np.array(_noise_fields(model, moved[:, :1])).T)[0].T)
    return min(_rank(vectors), surface), surface


def _gradients(model, y):
    """(m + 1, d, n): grad H and all grad Ĥ_k at states (d, n)."""
    methods = [
        partial(protocol.drift_gradient, model),
        *(partial(protocol.noise_gradient, model, k) for k in protocol.noise_indices(model)),
    ]
    return np.array([at_states(gradient, y) for gradient in methods])


def _field(model, y, gradient):
    """B times a gradient, (d, n)."""
    return at_states(partial(protocol.structure, model), y, gradient)


def _noise_fields(model, y):
    """Fields of the noises at one state (d, 1)."""
    return [_field(model, y, gradient)[:, 0] for gradient in _gradients(model, y)[1:]]


def _rank(vectors):
    sizes = np.linalg.norm(vectors, axis=1, keepdims=True)
    return int(np.linalg.matrix_rank(vectors / np.where(sizes > 0, sizes, 1.0), tol=_FLAT))


def _flow(model, y, weights):
    """States moved along a combination of the fields for the time 1 over the size of its derivative at the first one.

    A state may be 0, as that of an oscillator at rest.
    """

    def field(y):
        return _field(model, y, np.tensordot(weights, _gradients(model, y), 1))

    beside = _NUDGE * max(np.abs(y[:, 0]).max(), 1.0) * np.eye(len(y))
    derivative = (field(y[:, :1] + beside) - field(y[:, :1] - beside)) / (2.0 * beside.max())
    h = 1.0 / (_STEPS * max(np.abs(derivative).sum(axis=1).max(), 1.0))
    return runge_kutta(field, y, h, _STEPS)
