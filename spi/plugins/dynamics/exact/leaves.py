"""Casimir surfaces of quadratic Casimir functions: products of spheres, and planes over their points.

Where B is affine and has no divergence, sum_i d_i B_ij = 0, all Hamiltonian flows keep Lebesgue measure and the
Casimir functions, hence the measure prod_c delta(C_c(y) - c_c) dy, which on a surface is the Liouville measure up to
a factor.

Semidefinite quadratic Casimir functions bound some coordinates x, which then lie on a product of spheres, and the
measure is uniform there; the others, p, appear in the other Casimir functions to the first degree: A(x) p = c(x), a
plane for each x, with the measure det(A A^T)^(-1/2) dp.
"""

from typing import NamedTuple

import numpy as np

from spi.compiler.inlining import uncompiled
from spi.ensemble import protocol
from spi.ensemble.protocol import dimension
from spi.exact.surfaces import casimir_form, semidefinite, structure_matrix

_CLOSE = 1e-9  # relative distance of numbers that are taken for equal


class Leaf(NamedTuple):
    """States y = x + fibre p, x = sum_a spheres_a u_a, |u_a| = 1, with A(x) p = c(x).

    A(x) = linear + tensor x, c(x) = value - outer.x - x.inner x / 2.  A sphere of dimension 0 stands for one of its
    points.
    """

    spheres: tuple[np.ndarray, ...]  #: (d, n_a), from which the unit sphere in n_a dimensions
    fibre: np.ndarray  #: (d, f), orthonormal columns
    linear: np.ndarray  #: (c, f)
    tensor: np.ndarray  #: (c, f, d)
    outer: np.ndarray  #: (c, d)
    inner: np.ndarray  #: (c, d, d)
    value: np.ndarray  #: (c,)

    @property
    def flat(self):
        """Dimension of the planes."""
        return self.fibre.shape[1] - len(self.value)

    @property
    def dimension(self):
        """Dimension of the surface."""
        return sum(each.shape[1] - 1 for each in self.spheres) + self.flat

    def planes(self, x):
        """(one p (n, f), a basis of the plane (n, f, m), log det(A A^T)^(-1/2) (n,)) for x (d, n)."""
        n, (f, c) = x.shape[1], (self.fibre.shape[1], len(self.value))
        if not c:
            return np.zeros((n, f)), np.broadcast_to(np.eye(f), (n, f, f)), np.zeros(n)
        right = self.value - x.T @ self.outer.T - 0.5 * np.einsum("dn,cde,en->nc", x, self.inner, x)
        rows = self.linear + np.einsum("cfd,dn->ncf", self.tensor, x)
        # Q R = A^T by Householder's reflections
        turned, R = np.broadcast_to(np.eye(f), (n, f, f)), np.empty((n, c, c))
        for k in range(c):
            row = np.einsum("nf,nfg->ng", rows[:, k], turned)
            R[:, k] = row[:, :c]
            away = np.where(np.arange(f) < k, 0.0, row)
            size = np.linalg.norm(away, axis=1)
            R[:, k, k], R[:, k, k + 1 :] = -np.copysign(size, away[:, k]), 0.0
            away[:, k] += np.copysign(size, away[:, k])
            back = np.einsum("nfg,ng->nf", turned, away) * (2.0 / (away * away).sum(axis=1))[:, np.newaxis]
            turned = turned - back[:, :, np.newaxis] * away[:, np.newaxis]
        p = np.einsum("nfc,nc->nf", turned[:, :, :c], np.linalg.solve(R, right[:, :, np.newaxis])[:, :, 0])
        return p, turned[:, :, c:], -np.log(np.abs(np.einsum("ncc->nc", R))).sum(axis=1)


def leaf(model, point):
    """:class:`Leaf` through a state; ValueError with the reason in a phrase where there is none."""
    if protocol.large(model):
        raise ValueError("its states are arrays")
    point = np.array(point, float)
    with uncompiled():
        B = _bracket(model)
        forms = [casimir_form(model, c) for c in range(protocol.conserved(model))]
    d = len(point)
    # constant combinations of components, which a model need not state
    u, s, _ = np.linalg.svd(B.reshape(d, -1))
    forms += [(v, np.zeros((d, d))) for v in u[:, s <= _CLOSE * s[0]].T]
    size, vectors = np.linalg.eigh(sum((semidefinite(Q) for b, Q in forms if not b.any()), np.zeros((d, d))))
    bounded = size > _CLOSE * max(size[-1], 1e-300)
    N, V = vectors[:, ~bounded], vectors[:, bounded] / np.sqrt(size[bounded])
    x = (vectors[:, bounded] * np.sqrt(size[bounded])).T @ point
    bounding = [
        not (np.abs(N.T @ Q).max(initial=0) > _CLOSE or np.abs(N.T @ b).max(initial=0) > _CLOSE) for b, Q in forms
    ]
    parts = _joint_spaces([V.T @ Q @ V for (_, Q), bounds in zip(forms, bounding, strict=True) if bounds], len(x))
    spheres = []
    for P in parts:
        at = P.T @ x
        if np.linalg.norm(at) > _CLOSE * np.linalg.norm(x):
            spheres.append(V @ P * np.linalg.norm(at) if len(at) > 1 else V @ P * at)
    planes = [form for form, bounds in zip(forms, bounding, strict=True) if not bounds]
    return _of_full_rank(_with_planes(tuple(spheres), N, planes, point), B @ np.append(point, 1.0))


def _of_full_rank(surface, matrix):
    """A surface, if it has as many dimensions as the rank of the structure matrix says."""
    rank = np.linalg.matrix_rank(matrix, tol=_CLOSE * max(np.abs(matrix).max(), 1e-300))
    if rank == 0:
        raise ValueError("its surface is one state")
    if rank != surface.dimension:
        raise ValueError(f"its Casimir functions do not tell the surface, which has {rank} dimensions")
    return surface


def _with_planes(spheres, N, forms, point):
    """Leaf whose planes are given by the Casimir functions that are of the first degree in p."""
    if any(np.abs(N.T @ Q @ N).max(initial=0) > _CLOSE for _, Q in forms):
        raise ValueError("its Casimir functions leave surfaces that are no planes over spheres")
    x = point - N @ (N.T @ point)
    rows = np.array([N.T @ b + N.T @ Q @ x for b, Q in forms]).reshape(len(forms), N.shape[1])
    independent = []
    for c in range(len(forms)):
        if np.linalg.matrix_rank(rows[[*independent, c]], tol=_CLOSE) > len(independent):
            independent.append(c)
    forms, d = [forms[c] for c in independent], len(point)
    b, Q = (np.array([form[i] for form in forms]).reshape(len(forms), *(d,) * (i + 1)) for i in (0, 1))
    value = b @ point + 0.5 * np.einsum("d,cde,e->c", point, Q, point)
    return Leaf(spheres, N, b @ N, np.einsum("df,cde->cfe", N, Q), b, Q, value)


def _bracket(model):
    """(d, d, d + 1): B_ij = sum_k b_ijk y_k + b_ijd; ValueError if B is not affine, or has a divergence."""
    d = dimension(model)
    zero = np.zeros(d)
    constant = structure_matrix(model, zero)
    B = np.stack([*(structure_matrix(model, e) - constant for e in np.eye(d)), constant], axis=2)
    y = np.random.default_rng(5).standard_normal(d) + 2.0
    if not np.allclose(structure_matrix(model, y), B @ np.append(y, 1.0), rtol=_CLOSE, atol=_CLOSE):
        raise ValueError("its bracket is not linear")
    if np.abs(np.einsum("iji->j", B[:, :, :d])).max() > _CLOSE:
        raise ValueError("its bracket does not keep Lebesgue measure")
    return B


def _joint_spaces(matrices, r):
    """Orthonormal bases (r, n_a) of the joint eigenspaces of the matrices, on each of which they determine |x_a|."""
    if not r:
        return []
    weights = np.random.default_rng(7).standard_normal(len(matrices))
    values, vectors = np.linalg.eigh(sum(w * M for w, M in zip(weights, matrices, strict=True)))
    cuts = np.flatnonzero(np.diff(values) > 1e-7 * np.abs(values).max()) + 1
    parts = np.split(vectors, cuts, axis=1)
    table = np.array([[(P.T @ M @ P)[0, 0] for P in parts] for M in matrices])
    sums = [sum(t * P @ P.T for t, P in zip(row, parts, strict=True)) for row in table]
    if not np.allclose(sums, matrices, atol=1e-8) or np.linalg.matrix_rank(table, tol=1e-8) < len(parts):
        raise ValueError("its Casimir functions do not bound a product of spheres")
    return parts
