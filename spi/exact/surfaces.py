"""Casimir surfaces that are products of spheres, and quadratic Casimir functions.

On the dual of so(3), {y_i, y_j} = c_k y_k and so on with c_1, c_2, c_3 of one sign, C = |c_1| y_i^2 + |c_2| y_j^2 +
|c_3| y_k^2 is a Casimir function.  In x = |c|^(1/2) y the bracket is a multiple of that of so(3), so that the Liouville
measure of its surfaces, the only one that all Hamiltonian flows keep, is the area of the sphere |x| = r.
"""

import struct
from functools import partial

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
    """Casimir surface through `point`, if it is a product of spheres or ellipsoids with other components constant.

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
    """Triples of components of which each depends on the other two only; empty if there are other groups."""
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
    """Three cyclic permutations."""
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
    """Values (n,) of c + b.y + y.Ay/2 at states (d, n)."""
    return c + b @ y + 0.5 * (y * (A @ y)).sum(axis=0)


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
