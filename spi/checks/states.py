"""The states at which a model is checked."""

import numpy as np

from ..compiler.inlining import uncompiled
from ..ensemble.protocol import (
    drift_gradient,
    hamiltonian,
    noise_gradient,
    noises,
    populations,
    structure,
    structure_derivative,
)
from ..numerics.arrays import runge_kutta

_MOVED = 0.4  # by such a part of its size a state is moved on its surface, or by a half, a quarter, ... of that
_HALVINGS = 6
_LEAST = 0.25  # of its component such a part remains
_DIRECTIONS, _STEPS = 3, 6


def states_around(y, model, count=2):
    """States near y, none of whose components is 0; positive ones if they are populations."""
    generator, y = np.random.default_rng(1), np.array(y, float)
    size = np.sqrt(np.mean(y * y)) or 1.0
    for _ in range(count):
        z = generator.choice([-1.0, 1.0], y.size) * generator.uniform(0.2, 0.6, y.size)
        yield tuple((y * np.exp(z) if populations(model) else y + size * z).tolist())


def states_on_surface(y, model, count=2):
    """States near y on the surface on which solutions from y stay, where H and the noises are finite.

    They are moved along the fields of linear functions drawn at random.  Where y cannot be moved, as 0 in many
    systems, they are those of :func:`states_around`.  Components that never change their sign stay away from 0, near
    which the derivatives of a logarithm could not be told by differences.
    """
    generator = np.random.default_rng(1)
    with uncompiled(), np.errstate(all="ignore"):
        least = np.where(_keep_their_sign(y, model), _LEAST * np.abs(y), -np.inf)
        for _ in range(count):
            gradients = generator.standard_normal((_DIRECTIONS, len(y)))
            yield next(_moved(y, model, gradients, least), None) or next(iter(states_around(y, model, 1)))


def _keep_their_sign(y, model):
    """For each component whether it is other than 0 for ever: where it is 0, nothing moves it."""
    found = []
    for e in np.eye(len(y)):
        without = tuple(np.where(e, 0.0, y).tolist())
        found.append(np.dot(e, y) != 0.0 and not np.any(structure(model, without, tuple(e.tolist()))))
    return found


def _moved(y, model, gradients, least):
    """A state on the surface, the first of several that are nearer and nearer to y where all is finite.

    Components are at least so large, with the sign of those of y.
    """
    start = np.array(y, float)
    if not any(np.any(structure(model, y, tuple(g.tolist()))) for g in gradients):
        return
    for halvings in range(_HALVINGS):
        z = start
        for gradient in gradients:
            z = _along(z, model, gradient, _MOVED / 2**halvings)
        moved = tuple(z.tolist())
        if np.all(np.isfinite(z)) and np.all(z * np.sign(y) >= least) and _is_finite(model, moved):
            yield moved
    yield tuple(y)


def _along(y, model, gradient, part):
    """The state moved by such a part of its size along the field of a linear function, by steps of Runge and Kutta."""

    def field(z):
        return np.array(structure(model, tuple(z.tolist()), tuple(gradient.tolist())))

    slopes = [
        structure_derivative(model, tuple(y.tolist()), tuple(e), tuple(gradient.tolist())) for e in np.eye(len(y))
    ]
    size = np.linalg.norm(y)
    speed = max(
        np.linalg.norm(field(y)), np.linalg.norm(slopes) * size / _STEPS
    )  # near a rest point the steps stay stable
    h = part * size / speed / _STEPS if speed else 0.0
    return runge_kutta(field, y, h, _STEPS)


def _is_finite(model, y):
    values = [hamiltonian(model, y), *drift_gradient(model, y)]
    for k in range(noises(model)):
        values += noise_gradient(model, k, y)
    return bool(np.all(np.isfinite(values)))
