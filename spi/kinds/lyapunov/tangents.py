"""Tangent vectors of the Casimir surface, by differences of paths on the same noise."""

from typing import Any

import numpy as np

from spi.compiler.inlining import uncompiled
from spi.ensemble.protocol import casimirs, conserved
from spi.exact.surfaces import structure_matrix
from spi.numerics.arrays import log

#: Near paths are so far away, relative to |y_0|: what is left out is of this size, and roundings are 1e-9 of it.
NEAR = 1e-7
_RANK = 1e-10  # singular values of B(y_0), relative to the largest, that are 0


def tangents(model: Any, y: Any) -> np.ndarray:
    """(m, d) an orthonormal basis of the range of B(y), the tangent space of the Casimir surface at y."""
    with uncompiled():
        matrix = structure_matrix(model, np.array(y))
    left, sizes, _ = np.linalg.svd(matrix)
    return left.T[: int((sizes > _RANK * max(sizes[0], 1e-300)).sum())]


def leaf_dimension(model: Any, y: Any) -> int:
    """The dimension of the Casimir surface through y."""
    return len(tangents(model, y))


def make_tangent(model: Any, y: np.ndarray, vectors: np.ndarray) -> None:
    """Take from vectors (m, blocks, d, LANES), in place, what is not tangent to the Casimir surfaces of states y.

    The normal direction neither grows nor shrinks, so that of a vector that shrinks nothing else would be left in the
    end.  Gradients of Casimir functions are central differences, y (blocks, d, LANES) being moved by 1e-6 of its size.
    """
    states = np.moveaxis(y, 1, 0)
    by = 1e-6 * np.sqrt((states * states).sum(axis=0))
    gradients = np.empty((conserved(model), *y.shape))
    for j in range(len(states)):
        ahead, behind = ([each + (sign * by if i == j else 0.0) for i, each in enumerate(states)] for sign in (1, -1))
        changes = zip(casimirs(model, tuple(ahead)), casimirs(model, tuple(behind)), strict=True)
        for c, (after, before) in enumerate(changes):
            gradients[c, :, j] = (after - before) / by
    orthonormalise(gradients)
    for normal in gradients:
        vectors -= (normal * vectors).sum(axis=2, keepdims=True) * normal


def orthonormalise(vectors: np.ndarray) -> np.ndarray:
    """Make vectors (m, blocks, d, LANES) orthonormal in place, one after the other; the logarithms of what is left.

    By Gram and Schmidt, one vector after the other; the result is (m, blocks, LANES), the logarithms of the diagonal
    of R in vectors = Q R.
    """
    sizes = np.empty((len(vectors), vectors.shape[1], vectors.shape[3]))
    with np.errstate(all="ignore"):
        for i, vector in enumerate(vectors):
            for before in vectors[:i]:
                vector -= (before * vector).sum(axis=1, keepdims=True) * before
            sizes[i] = np.sqrt((vector * vector).sum(axis=1))
            vector /= sizes[i][:, np.newaxis]
    return log(sizes)
