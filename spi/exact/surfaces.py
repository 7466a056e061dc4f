"""Casimir surfaces that are products of spheres, and quadratic Hamiltonians on them.

On the dual of so(3), {y_i, y_j} = c_k y_k and so on with c_1, c_2, c_3 of one sign, C = |c_1| y_i^2 + |c_2| y_j^2 +
|c_3| y_k^2 is a Casimir function.  In x = |c|^(1/2) y the bracket is a multiple of that of so(3), so that the Liouville
measure of its surfaces, the only one that all Hamiltonian flows keep, is the area of the sphere |x| = r.
"""

import itertools
import struct
from functools import partial
from typing import NamedTuple

import numpy as np

from ..compiler.inlining import uncompiled
from ..ensemble import protocol
from ..ensemble.protocol import dimension
from ..ensemble.random_states import Spheres

# ---------------------------------------------------------------------------------------------------------------------
# The places of pieces and noises: the axis about which they turn, or whether they turn or shear.
#
# See ``flow_places`` in ``ensemble/protocol.py``.
# ---------------------------------------------------------------------------------------------------------------------


def by_place(model, compositions):
    """Compositions as ``schemes.stages.compositions`` gives them, with places instead of numbers of flows."""
    if not (places := protocol.flow_places(model)):
        return compositions
    of = dict(zip(("drift", "noise"), places, strict=True))
    return tuple((p, tuple((part, of[part][k], share) for part, k, share in flows)) for p, flows in compositions)


def strengths_by_place(model, count):
    """(sigma_1, ..., sigma_count) of the noises at these places, 0 where there is none."""
    if not (places := protocol.flow_places(model)):
        return protocol.strengths(model)
    sigma = dict(zip(places[1], protocol.strengths(model), strict=True))
    return tuple(sigma.get(place, 0.0) for place in range(count))


_TRIALS = 3  # states at which a formula is compared with the model
_CLOSE = 1e-9  # relative distance of numbers that are taken for equal


def spheres(model, point):
    """The Casimir surface through `point`, if it is a product of spheres or ellipsoids with other components constant.

    None if it is not, or if states are arrays.
    """
    if protocol.large(model):
        return None
    d = dimension(model)
    states = np.random.default_rng(0).standard_normal((_TRIALS, d))
    with uncompiled():  # compiling would take longer
        matrices = [structure_matrix(model, y) for y in states]
    lengths, triples, predicted = np.zeros(d), [], np.zeros((_TRIALS, d, d))
    for triple in _triples(matrices[0]):
        weights = np.array([matrices[0][j, k] / states[0, i] for i, j, k in _turned(triple)])
        if not (weights > 0).all() and not (weights < 0).all():
            return None
        for (i, j, k), weight in zip(_turned(triple), weights, strict=True):
            predicted[:, j, k], predicted[:, k, j] = weight * states[:, i], -weight * states[:, i]
        at = list(triple)
        scale = np.sqrt(np.abs(weights))
        lengths[at] = np.linalg.norm(scale * np.array(point)[at]) / scale
        triples.append(triple)
    if not triples or not np.allclose(predicted, matrices, rtol=_CLOSE, atol=_CLOSE):
        return None
    return Spheres(tuple(map(float, point)), tuple(triples), tuple(lengths.tolist()))


def at_states(method, *arrays):
    """(..., n): an uncompiled function of states, each a tuple, at the columns of arrays (d, n).

    The function is called once for all columns, or column by column where it has branches or elementary functions of
    models, which take numbers only.
    """
    count = arrays[0].shape[1]
    with uncompiled(), np.errstate(all="ignore"):
        if count > 1:
            try:
                value = method(*map(tuple, arrays))
                if isinstance(value, tuple):
                    return np.array([np.broadcast_to(v, count) for v in value], float)
                return np.array(np.broadcast_to(value, count), float)
            except (TypeError, ValueError, struct.error):
                pass
        columns = zip(*(array.T.tolist() for array in arrays), strict=True)
        return np.array([method(*map(tuple, column)) for column in columns], float).T


def structure_matrix(model, y):
    """B(y), of a state as an array."""
    unit = np.eye(len(y))
    return np.array([protocol.structure(model, tuple(y.tolist()), tuple(column)) for column in unit.tolist()], float).T


def _triples(matrix):
    """The triples of components of which each depends on the other two only; empty if there are other groups."""
    acting = np.abs(matrix) > 0.0
    triples = []
    for i in np.flatnonzero(acting.any(axis=1)):
        group = tuple(sorted({int(i), *np.flatnonzero(acting[i]).tolist()}))
        if len(group) != 3:
            return []
        if group not in triples:
            triples.append(group)
    return triples if len({i for group in triples for i in group}) == 3 * len(triples) else []


def _turned(triple):
    """The three cyclic permutations."""
    a, b, c = triple
    return (a, b, c), (b, c, a), (c, a, b)


def polynomial(f, d):
    """(c, b, A) of the function c + b.y + y.Ay/2 of states (d, n) that f is; None where it is none."""
    unit, y = np.eye(d), np.random.default_rng(6).standard_normal((d, _TRIALS))
    try:
        with np.errstate(all="ignore"):
            zero = float(np.broadcast_to(f(np.zeros((d, 1))), 1)[0])
            up, down = (np.broadcast_to(f(sign * unit), d) for sign in (1.0, -1.0))
            both = np.array([np.broadcast_to(f(unit + unit[:, i : i + 1]), d) for i in range(d)])
            form = zero, 0.5 * (up - down), both - up - up[:, np.newaxis] + zero
            size = value_of(*map(np.abs, (*form, y)))
            return form if (np.abs(f(y) - value_of(*form, y)) <= _CLOSE * (1.0 + size)).all() else None
    except (ArithmeticError, ValueError):  # f need not be defined at 0
        return None


def value_of(c, b, A, y):
    """The values (n,) of c + b.y + y.Ay/2 at states (d, n)."""
    return c + b @ y + 0.5 * (y * (A @ y)).sum(axis=0)


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
    """The minimum of b.x + x.Ax/2 for |x| = 1, from below: the largest mu/2 - b.(A - mu)^-1 b/2, mu < eigenvalues."""
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


# ---------------------------------------------------------------------------------------------------------------------
# Casimir surfaces of quadratic Casimir functions: products of spheres, and planes over their points.
#
# Where B is affine and has no divergence, sum_i d_i B_ij = 0, all Hamiltonian flows keep Lebesgue measure and the
# Casimir functions, hence the measure prod_c delta(C_c(y) - c_c) dy, which on a surface is the Liouville measure up to
# a factor.
#
# Semidefinite quadratic Casimir functions bound some coordinates x, which then lie on a product of spheres, and the
# measure is uniform there; the others, p, appear in the other Casimir functions to the first degree: A(x) p = c(x), a
# plane for each x, with the measure det(A A^T)^(-1/2) dp.
# ---------------------------------------------------------------------------------------------------------------------


class Leaf(NamedTuple):
    """The states y = x + fibre p, x = sum_a spheres_a u_a, |u_a| = 1, with A(x) p = c(x).

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
        """The dimension of the planes."""
        return self.fibre.shape[1] - len(self.value)

    @property
    def dimension(self):
        """The dimension of the surface."""
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
    """The :class:`Leaf` through a state; ValueError with the reason in a phrase where there is none."""
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
    surface = _with_planes(
        tuple(spheres), N, [form for form, bounds in zip(forms, bounding, strict=True) if not bounds], point
    )
    matrix = B @ np.append(point, 1.0)
    rank = np.linalg.matrix_rank(matrix, tol=_CLOSE * max(np.abs(matrix).max(), 1e-300))
    if rank == 0:
        raise ValueError("its surface is one state")
    if rank != surface.dimension:
        raise ValueError(f"its Casimir functions do not tell the surface, which has {rank} dimensions")
    return surface


def _with_planes(spheres, N, forms, point):
    """The leaf whose planes are given by the Casimir functions that are of the first degree in p."""
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


def casimir_form(model, c):
    """(b, Q) of Casimir function number c, b.y + y.Qy/2 and a constant; ValueError if it is not quadratic."""
    form = polynomial(partial(at_states, lambda y: protocol.casimirs(model, y)[c]), dimension(model))
    if form is None:
        raise ValueError(f"Casimir function number {c + 1} is not quadratic")
    _, b, Q = (np.where(np.abs(part) > 1e-12, part, 0.0) for part in form)
    return b, Q


def semidefinite(Q):
    """Q or -Q where that is positive semidefinite, 0 otherwise."""
    values = np.linalg.eigvalsh(Q)
    small = _CLOSE * np.abs(values).max(initial=0)
    return Q if values[0] >= -small else -Q if values[-1] <= small else np.zeros_like(Q)


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
