"""Tangent vectors of the Casimir surface, by differences of paths on the same noise."""

from functools import partial
from typing import Any

import numpy as np

from spi.compiler.inlining import uncompiled
from spi.ensemble.protocol import casimirs, conserved, structure
from spi.exact.surfaces import at_states, structure_matrix
from spi.numerics.arrays import log

#: Near paths are so far away, relative to the state: what is left out is of this size, and roundings are 1e-9 of it.
NEAR = 1e-7
_BY = 1e-6  # relative, by which a state is moved for the gradient of a Casimir function
_RANK = 1e-10  # singular values of B(y_0), relative to the largest, that are 0


def size_of(*states: np.ndarray) -> np.ndarray:
    """(blocks, 1, LANES) the largest component of any of some states (blocks, d, LANES), 1 where all are 0."""
    found = np.maximum.reduce([np.abs(y).max(axis=1, keepdims=True) for y in states])
    return np.where(found > 0.0, found, 1.0)


def tangents(model: Any, y: Any) -> np.ndarray:
    """(m, d) an orthonormal basis of the range of B(y), the tangent space of the Casimir surface at y."""
    with uncompiled():
        matrix = structure_matrix(model, np.array(y))
    left, sizes, _ = np.linalg.svd(matrix)
    return left.T[: int((sizes > _RANK * max(sizes[0], 1e-300)).sum())]


def leaf_dimension(model: Any, y: Any) -> int:
    """The dimension of the Casimir surface through y."""
    return len(tangents(model, y))


def normals_at(model: Any, y: np.ndarray) -> np.ndarray:
    """(C, blocks, d, LANES) orthonormal vectors that span the gradients of the C Casimir functions at states y.

    Gradients are central differences, y (blocks, d, LANES) being moved by 1e-6 of its size.
    """
    count, (blocks, d, lanes) = conserved(model), y.shape
    if not count:
        return np.empty((0, *y.shape))
    by = _BY * size_of(y)[:, 0]
    to = np.array([1.0, -1.0])[:, np.newaxis, np.newaxis] * np.eye(d)  # (2, j, i) by which component i is moved
    states = np.moveaxis(y, 1, 0)[:, np.newaxis, np.newaxis] + np.multiply.outer(to.transpose(2, 0, 1), by)
    found = at_states(partial(casimirs, model), states.reshape(d, -1)).reshape(count, 2, d, blocks, lanes)
    gradients = np.ascontiguousarray(np.moveaxis((found[:, 0] - found[:, 1]) / (2.0 * by), 1, 2))
    orthonormalise(gradients)
    return gradients


def make_tangent(vectors: np.ndarray, normals: np.ndarray) -> None:
    """Take from vectors (m, blocks, d, LANES), in place, what is not tangent to the Casimir surfaces.

    The normal direction neither grows nor shrinks, so that of a vector that shrinks nothing else would be left in the
    end.
    """
    for normal in normals:
        vectors -= (normal * vectors).sum(axis=2, keepdims=True) * normal


def log_density(model: Any, y: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(blocks, LANES) log of the Euclidean area by the area that Hamiltonian flows keep, at states (blocks, d, LANES).

    On the tangent space of the Casimir surface B(y) is, in an orthonormal basis, an antisymmetric matrix b.  There the
    symplectic form is b^-1, and the volume that it makes, the Liouville measure, is the Euclidean one by det(b)^(1/2).
    The Casimir gradients are the kernel of B, so that det(b) = det(B + sum_c n_c n_c^T).  Where B has no divergence,
    sum_i d_i B_ij = 0, this is |grad C_1 ^ grad C_2 ^ ...| up to a constant on the surface.
    """
    blocks, d, lanes = y.shape
    states = np.repeat(np.moveaxis(y, 1, 0)[:, np.newaxis], d, axis=1)
    units = np.repeat(np.eye(d)[..., np.newaxis], blocks * lanes, axis=2)
    columns = at_states(partial(structure, model), states.reshape(d, -1), units.reshape(d, -1))
    columns = np.ascontiguousarray(columns.reshape(d, d, blocks, lanes).transpose(1, 2, 0, 3))
    for normal in normals:
        columns += np.moveaxis(normal, 1, 0)[:, :, np.newaxis] * normal
    found: np.ndarray = 0.5 * orthonormalise(columns).sum(axis=0)
    return found


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
