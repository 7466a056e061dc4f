"""The states that noises and drift can reach: whether a law on the Casimir surface can be the only stationary one.

The fields of the noises, X_k, and their brackets with one another and with the drift span at a point y
the same space as the vectors (D Phi)^-1 X_k(Phi(y)), Phi being flows of random combinations of all these fields
(fields are analytic).  Friction along the noises changes nothing in this.
"""

from collections.abc import Sequence
from functools import partial
from itertools import combinations_with_replacement
from typing import NamedTuple

import numpy as np

from ..compiler.inlining import uncompiled
from ..ensemble.protocol import dimension, drift_gradient, noise_gradient, noise_indices, strengths, structure
from ..numerics.arrays import runge_kutta
from .surfaces import at_states, structure_matrix

_STEPS = 32  #: of a flow by Runge and Kutta
_NUDGE, _FLAT, _CLOSE = 1e-5, 1e-4, 1e-6


class Reach(NamedTuple):
    """The dimension of the set of states that the noises reach."""

    rank: int  #: of the fields and their brackets
    surface: int  #: dimension of the Casimir surface
    invariants: tuple[str, ...]  #: further independent linear and quadratic functions that are conserved


def reach(model, initial, names: Sequence[str]):
    """The :class:`Reach` from a state, with invariants in the names of the components."""
    start = np.array(initial, float)
    with uncompiled(), np.errstate(all="ignore"):
        surface = int(np.linalg.matrix_rank(structure_matrix(model, start), tol=_CLOSE * np.abs(start).max()))
        rng = np.random.default_rng(3)
        rank = _rank(model, start, surface, rng)
        if rank >= surface:
            return Reach(surface, surface, ())
        return Reach(rank, surface, tuple(_invariants(model, start, names, rng)))


def _acting(model):
    return [k for k in noise_indices(model) if strengths(model)[k]]


def _gradients(model, y):
    """(m + 1, d, n): grad H and all grad Ĥ_k at states (d, n)."""
    methods = [partial(drift_gradient, model), *(partial(noise_gradient, model, k) for k in _acting(model))]
    return np.array([at_states(gradient, y) for gradient in methods])


def _field(model, y, gradient):
    """B times a gradient, (d, n)."""
    return at_states(partial(structure, model), y, gradient)


def _rank(model, start, most, rng):
    """The rank of the fields at a state to which a random flow takes `start`, at most `most`."""
    count = 1 + len(_acting(model))
    y = _flow(model, start[:, np.newaxis], rng.standard_normal(count))
    vectors = [_field(model, y, g)[:, 0] for g in _gradients(model, y)[1:]]
    around = y + _NUDGE * np.hstack([np.zeros((len(y), 1)), np.eye(len(y)), -np.eye(len(y))])
    for _ in range(2 * most):
        if _rank_of(vectors) >= most:
            break
        moved = _flow(model, _flow(model, around, rng.standard_normal(count)), rng.standard_normal(count))
        derivative = (moved[:, 1 : len(y) + 1] - moved[:, len(y) + 1 :]) / (2 * _NUDGE)
        if np.isfinite(moved).all():
            there = [_field(model, moved[:, :1], g)[:, 0] for g in _gradients(model, moved[:, :1])[1:]]
            vectors += list(np.linalg.lstsq(derivative, np.array(there).T)[0].T)
    return _rank_of(vectors)


def _rank_of(vectors):
    sizes = np.linalg.norm(vectors, axis=1, keepdims=True)
    return int(np.linalg.matrix_rank(vectors / np.where(sizes > 0, sizes, 1.0), tol=_FLAT))


def _flow(model, y, weights):
    """States moved along a combination of the fields for the time 1 over their size."""

    def field(y):
        return _field(model, y, np.tensordot(weights, _gradients(model, y), 1))

    size = np.abs(field(y[:, :1])).max() / max(np.abs(y).max(), 1e-300)
    h = 1.0 / (_STEPS * max(size, 1.0))
    return runge_kutta(field, y, h, _STEPS)


def _invariants(model, start, names, rng):
    """Formulas of polynomials of degree 2 that no field changes, but for Casimir functions and functions of others."""
    d = dimension(model)
    pairs = list(combinations_with_replacement(range(d), 2))
    points = start * rng.uniform(0.5, 1.5, (2 * (d + len(pairs)), d)) + 0.1 * np.abs(start).max() * rng.random(d)
    gradients = np.zeros((len(points), d + len(pairs), d))  # of y_i y_j, then of y_i
    for n, (i, j) in enumerate(pairs):
        gradients[:, n, i] += points[:, j]
        gradients[:, n, j] += points[:, i]
    gradients[:, len(pairs) :] = np.eye(d)
    fields = np.array([_field(model, points.T, g) for g in _gradients(model, points.T)])
    slopes = np.einsum("pnd,fdp->fpn", gradients, fields).reshape(-1, d + len(pairs))
    turned = np.einsum("pnd,ped->npe", gradients, np.array([structure_matrix(model, y) for y in points]))
    independent: list[np.ndarray] = []
    rows = _reduced(slopes)
    for row in sorted(rows, key=lambda row: (row[: len(pairs)].any(), np.count_nonzero(row))):
        field = np.einsum("n,npe->pe", row, turned)
        at = np.array([np.einsum("n,ne->e", each, turned[:, 0]) for each in (*independent, row)])
        if np.abs(field).max() > _CLOSE * np.abs(turned).max() and np.linalg.matrix_rank(at, tol=_CLOSE) > len(
            independent
        ):
            independent.append(row)
            terms = [f"{names[i]}*{names[j]}" if i != j else f"{names[i]}^2" for i, j in pairs] + list(names)
            yield _sum(row, terms)


def _reduced(matrix):
    """The rows of the reduced echelon form of a basis of the null space of a matrix, pivots in first columns first."""
    _, sizes, v = np.linalg.svd(matrix)
    basis = v[np.concatenate([sizes, np.zeros(len(v) - len(sizes))]) <= _CLOSE * max(sizes[0], 1e-300)]
    rows = []
    for column in range(matrix.shape[1]):
        if not len(basis) or np.abs(basis[:, column]).max() < _CLOSE:
            continue
        at = np.argmax(np.abs(basis[:, column]))
        pivot = basis[at] / basis[at, column]
        basis = np.delete(basis, at, axis=0)
        basis = basis - np.outer(basis[:, column], pivot)
        rows = [row - row[column] * pivot for row in rows] + [pivot]
    return [np.where(np.abs(row) > _CLOSE, row, 0.0) for row in rows]


def _sum(row, terms):
    text = ""
    for c, term in zip(row, terms, strict=True):
        if c:
            sign = "-" if c < 0 else "+" if text else ""
            text += (f" {sign} " if text else sign) + ("" if abs(abs(c) - 1) < _CLOSE else f"{abs(c):.6g}*") + term
    return text
