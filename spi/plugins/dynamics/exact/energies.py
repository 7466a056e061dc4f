"""Quadratic Hamiltonians, and the least energy on a product of spheres."""

import itertools
from functools import partial

import numpy as np

from spi.compiler.inlining import uncompiled
from spi.ensemble import protocol
from spi.ensemble.protocol import dimension
from spi.exact.surfaces import at_states, value_of

_TRIALS = 3  # states at which a formula is compared with the model
_CLOSE = 1e-9  # relative distance of numbers that are taken for equal


def quadratic(model):
    """(c, b, A) of H = c + b.y + y.Ay/2 at the initial time; None if H is no such function."""
    d, model = dimension(model), protocol.frozen(model, getattr(model, "time", 0.0), 0.0)
    zero = (0.0,) * d
    try:
        with np.errstate(all="ignore"), uncompiled():
            b = np.array(protocol.drift_gradient(model, zero), float)
            columns = [np.array(protocol.drift_gradient(model, tuple(e)), float) - b for e in np.eye(d).tolist()]
            c, matrix = float(protocol.hamiltonian(model, zero)), np.array(columns)
            y = np.random.default_rng(1).standard_normal((d, _TRIALS))
            values = at_states(partial(protocol.hamiltonian, model), y)
            size = value_of(abs(c), np.abs(b), np.abs(matrix), np.abs(y))
            if not (np.abs(values - value_of(c, b, matrix, y)) <= _CLOSE * size).all():
                return None
    except (ArithmeticError, ValueError):  # H need not be defined at 0
        return None
    return c, b, 0.5 * (matrix + matrix.T)


def least_on(surface, b, matrix):
    """A lower bound of b.y + y.Ay/2 on a product of spheres; on one sphere its minimum.

    Each sphere adds its own minimum, each pair of them the norm of their coupling.
    """
    point, lengths = np.array(surface.point), np.array(surface.lengths)
    turning = np.zeros(len(point), bool)
    turning[list(itertools.chain(*surface.triples))] = True
    rest = np.where(turning, 0.0, point)  # components that are constant
    linear, least = lengths * (b + matrix @ rest), float(b @ rest + 0.5 * rest @ matrix @ rest)
    scaled = lengths[:, np.newaxis] * matrix * lengths
    triples = [list(triple) for triple in surface.triples]
    for at in triples:
        least += _least_on_sphere(linear[at], scaled[np.ix_(at, at)])
    for first, second in itertools.combinations(triples, 2):
        least -= float(np.linalg.norm(scaled[np.ix_(first, second)], 2))
    size = np.abs(linear).sum() + np.abs(scaled).sum() + abs(least)
    return least - 1e-12 * size


def _least_on_sphere(b, matrix):
    """Minimum of b.x + x.Ax/2 for |x| = 1, from below: the largest mu/2 - b.(A - mu)^-1 b/2, mu < eigenvalues."""
    values, vectors = np.linalg.eigh(matrix)
    squares = (vectors.T @ b) ** 2
    size = np.sqrt(squares.sum())
    low, high = values[0] - size, values[0]
    for _ in range(100):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        inside = (squares / (values - middle) ** 2).sum() < 1.0
        low, high = (middle, high) if inside else (low, middle)
    if size == 0.0:
        return 0.5 * float(values[0])
    used = squares > 0.0
    return 0.5 * float(low - (squares[used] / (values[used] - low)).sum())
