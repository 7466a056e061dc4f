"""Functions on the unit sphere as real spherical harmonics of degree <= L, split by the symmetry of the rigid body.

The rotations by pi about the three axes (with the identity, a group of four) commute with every flow of the rigid body,
so functions split into four *classes* that no operator mixes, numbered by the coordinate that behaves like them: class
0 like y1, class 1 like y2, class 2 like y3, and class 3 like y1 y2 y3.  In polar coordinates about the third axis each
degree l of a class has the orders m of one parity with one of cos(m phi), sin(m phi):

    class 0: m odd,  cos for odd l           class 2: m even, cos for odd l
    class 1: m odd,  cos for even l          class 3: m even, cos for even l        (sin for the other l)

The operator behind all flows about the third axis, A f = d/dt f(y turned about axis 3 by the angle t y3), is
A = -y3 d/dphi: it turns cos into m sin and multiplies by y3, that is, in the chain l = m, ..., L of one order m it is
m times a signed Jacobi matrix J_m.  All of it is truncated in one place, J_m to L - m + 1 rows; functions of A
(exp(tA), exp(sA^2), sums) are then exact in the truncated space.  So a splitting scheme in this space is a splitting
scheme for the finite system whose generator is made of the same A, and its error tends to 0 with h for every L.
Functions of J_m taken in its eigenvectors are those that Gauss quadrature with L - m + 1 nodes would give.

The other axes come from the cyclic shift U f(y1, y2, y3) = f(y2, y3, y1): A_{k+1} = U A_k U^-1.
"""

import functools
from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh_tridiagonal
from scipy.sparse import coo_array

from spi.exact.work import counted

from .kinks import FINER, low_pass, waves

CLASSES = (0, 1, 2, 3)
#: Up to this degree :func:`harmonics_up_to` caches its results, 30 MB at most.
KEPT = 128


class OrderStates(NamedTuple):
    """States of one order m > 0 of a class, l = m, ..., L."""

    order: int
    states: np.ndarray  #: their positions among the states of the class
    sign: np.ndarray  #: +1 where the state has cos(m phi), -1 where sin
    nodes: np.ndarray  #: the eigenvalues of J_m ...
    vectors: np.ndarray  #: ... and its eigenvectors


def is_cosine(which, degree):
    """Whether the harmonics of this class and degree have cos(m phi) (else sin)."""
    return (degree % 2 == 1) == (which in (0, 2))


def shifted(which, by=1):
    """Class to which U^by takes the class."""
    return which if which == 3 else (which + by) % 3


class Harmonics:
    """Four classes up to degree L: positions, chains and the shift U.

    Within a class states are sorted by degree, then order.  ``turn[c][l]`` is the orthogonal matrix of U from degree l
    of class c to degree l of ``shifted(c)``.
    """

    def __init__(self, L):
        self.L = L
        self.orders = {c: [self._orders(c, degree) for degree in range(L + 1)] for c in CLASSES}
        self.starts = {c: np.cumsum([0] + [len(m) for m in self.orders[c]]) for c in CLASSES}
        self.size = {c: int(self.starts[c][-1]) for c in CLASSES}
        modes = [_jacobi_modes(m, L) for m in range(1, L + 1)]
        self.chains = {c: [self._chain(c, m, *modes[m - 1]) for m in range(2 - (c < 2), L + 1, 2)] for c in CLASSES}
        self.turn = self._turns()
        self._generators = {}

    @staticmethod
    def _orders(which, degree):
        first = 1 if which < 2 else (0 if is_cosine(which, degree) else 2)
        return np.arange(first, degree + 1, 2)

    def _chain(self, which, m, nodes, vectors):
        _, states, cosine = self._states(which, m)
        return OrderStates(m, states, np.where(cosine, 1.0, -1.0), nodes, vectors)

    def _states(self, which, m):
        """(degrees, positions, whether they have cos(m phi)) of the states of order m in a class."""
        degrees = np.arange(m, self.L + 1)
        if m == 0:
            degrees = degrees[is_cosine(which, degrees)]
        states = [self.starts[which][i] + (m - self.orders[which][i][0]) // 2 for i in degrees]
        return degrees, np.array(states), is_cosine(which, degrees)

    def _turns(self):
        """With M_k multiplication by y_k from degree l - 1 to l: U_l = (2l+1)/l sum_k M_{k+1} U_{l-1} M_k^T.

        This is U M_k = M_{k+1} U and sum_k M_k M_k^T = l / (2l+1); no rounding error grows in it, since the rows of
        (M_0, M_1, M_2) are orthogonal.
        """
        turn = {c: [] for c in CLASSES}
        full = np.ones((1, 1))
        for degree in range(self.L + 1):
            if degree:
                M = _coordinates(degree)
                full = (2 + 1 / degree) * sum((M[k] @ (M[k - 1] @ full.T).T) for k in range(3))
            for c in CLASSES:
                rows, columns = (self._in_full(b, degree) for b in (shifted(c), c))
                turn[c].append(full[np.ix_(rows, columns)].copy())
            counted(_making(self.L, degree) / 2)
        return turn

    def _in_full(self, which, degree):
        """Positions among cos 0, ..., cos l, sin 1, ..., sin l."""
        return self.orders[which][degree] + (0 if is_cosine(which, degree) else degree)

    def generator(self, which, k):
        """A_k in a class, a sparse antisymmetric matrix, made once."""
        if (which, k) not in self._generators:
            self._generators[which, k] = self._generator(which, k)
        return self._generators[which, k]

    def _generator(self, which, k):
        inner = shifted(which, 2 - k)  # U^(2-k) takes axis k to the third
        chains = self.chains[inner]
        couples = [chain.order * _jacobi(chain.order, self.L) * chain.sign[:-1] for chain in chains]
        lower = [chain.states[1:] for chain in chains], [chain.states[:-1] for chain in chains]
        A = _antisymmetric(*lower, couples, self.size[inner])
        if k == 2:
            return A
        # A_0 = U A_2 U^-1, from class which - 1
        turn = self.turn[shifted(which, -1)] if k == 0 else [matrix.T for matrix in self.turn[which]]
        first, starts = self.starts[inner], self.starts[which]
        rows, columns, values = [], [], []
        for degree in range(1, self.L + 1):
            low, middle, high = first[degree - 1 : degree + 2]
            block = turn[degree] @ A[middle:high, low:middle].toarray() @ turn[degree - 1].T
            block[abs(block) < 1e-13 * self.L] = 0.0
            i, j = np.nonzero(block)
            rows.append(i + starts[degree])
            columns.append(j + starts[degree - 1])
            values.append(block[i, j])
            counted(_making(self.L, degree) / 2 / 8)  # there are two such axes in each of four classes
        return _antisymmetric(rows, columns, values, self.size[which])

    def project(self, functions, radius, rough=()):
        """Coefficients of phi(radius n) for each class: arrays (size, number of functions).

        `rough` (F,) says which functions have kinks.
        """
        rings, around = self.L + 1 + self.L // 2, 3 * self.L + 4
        z, weights = np.polynomial.legendre.leggauss(rings)
        phi = 2 * np.pi / around * np.arange(around)
        s = np.sqrt((1 - z) * (1 + z))
        points = np.array([np.outer(s, np.cos(phi)), np.outer(s, np.sin(phi)), np.outer(z, np.ones(around))])
        points = radius * points.reshape(3, -1)
        values = np.array([np.broadcast_to(f(points), points.shape[1]).reshape(rings, around) for f in functions])
        modes = np.fft.rfft(values, axis=-1)[..., : self.L + 1] * (weights * 2 * np.pi / around)[:, None]
        by_class = self._coefficients(modes, z)
        for f in np.flatnonzero(rough):
            for c, coefficients in self._projected(functions[f], radius).items():
                by_class[c][:, f] = coefficients
        return by_class

    def _projected(self, f, radius):
        """Coefficients of a function with kinks for each class, from a finer grid and through a low-pass filter.

        With y = (sin t cos phi, sin t sin phi, cos t) the product of f and |sin t| is periodic in t and phi, and the
        associated Legendre functions are waves in t, up to L.
        """
        rings, half = FINER * (self.L + 1 + self.L // 2), self.L + 1
        t, phi = (2 * np.pi / n * np.arange(n) for n in (2 * rings, FINER * (3 * self.L + 4)))

        def point(t, phi):
            return radius * np.array([np.sin(t) * np.cos(phi), np.sin(t) * np.sin(phi), np.cos(t)])

        def weighted(y):
            return f(y) * np.hypot(y[0], y[1]) / radius

        weighted.singular = (*f.singular, lambda y: np.hypot(y[0], y[1]))
        k = np.fft.fftfreq(2 * half, 1 / (2 * half))[:, None]
        middles = np.pi / half * (np.arange(half) + 0.5)
        modes = waves(weighted, point, t, phi, half, half) * np.exp(0.5j * np.pi / half * k)
        modes[half] = 0.0  # the wave -L - 1
        modes = 2 * half * np.fft.ifft(modes, axis=0)[:half] * (2 * np.pi**2 / half)
        by_class = self._coefficients(modes[None], np.cos(middles))
        degree = {c: np.repeat(np.arange(self.L + 1), [len(m) for m in self.orders[c]]) for c in CLASSES}
        return {c: by_class[c][:, 0] * low_pass(degree[c], self.L) for c in CLASSES}

    def _coefficients(self, modes, z):
        """From weighted modes (functions, rings, orders)."""
        return self._sort(lambda P, m: ((P @ modes[:, :, m].real.T), (P @ -modes[:, :, m].imag.T)), z, len(modes))

    def evaluation(self, point):
        """Vectors e_c with f(point) = sum_c e_c . f_c, for a point of the unit sphere."""
        phi = np.arctan2(point[1], point[0])
        vectors = self._sort(lambda P, m: (P * np.cos(m * phi), P * np.sin(m * phi)), np.array([point[2]]), 1)
        return {c: v[:, 0] for c, v in vectors.items()}

    def _sort(self, parts, z, count):
        """Coefficients from parts(P, m) = those of cos(m phi) and sin(m phi), l = m, ..., L."""
        by_class = {c: np.zeros((self.size[c], count)) for c in CLASSES}
        for m, P in enumerate(legendre(self.L, z)):
            cosine, sine = parts(P if m == 0 else np.sqrt(2) * P, m)
            for c in CLASSES[:2] if m % 2 else CLASSES[2:]:
                degrees, states, cosines = self._states(c, m)
                by_class[c][states] = np.where(cosines[:, None], cosine[degrees - m], sine[degrees - m])
        return by_class


def harmonics_up_to(L):
    """:class:`Harmonics` of a degree; those of low degrees, of which many fit into memory, are cached."""
    return _cached(L) if L <= KEPT else Harmonics(L)


_cached = functools.cache(Harmonics)


def seconds_to_make(L):
    """The seconds to make all of the :class:`Harmonics` of a degree, roughly, on one core."""
    return 0.018 + (1.3e-5 if L <= KEPT else 7e-5) * L**2


def _making(L, degree):
    """Part of :func:`seconds_to_make` for one degree."""
    return seconds_to_make(L) * 3 * degree**2 / L**3


def _antisymmetric(rows, columns, values, size):
    """Sparse antisymmetric matrix with these entries below the diagonal, lists of arrays."""
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    lower = coo_array(entries, (size, size)).tocsr()
    return lower - lower.T.tocsr()


def _jacobi(m, L):
    """Off-diagonal of J_m, multiplication by y3 on the degrees m, ..., L of order m."""
    degree = np.arange(m + 1, L + 1)
    return np.sqrt((degree - m) * (degree + m) / (4.0 * degree**2 - 1))


def _jacobi_modes(m, L):
    if m == L:
        return np.zeros(1), np.ones((1, 1))
    return eigh_tridiagonal(np.zeros(L - m + 1), _jacobi(m, L))


def legendre(L, z):
    """Normalised associated Legendre functions, for each m an array (L - m + 1, len(z)); integral 1 with m = 0."""
    z = np.asarray(z, dtype=float)
    s = np.sqrt((1 - z) * (1 + z))
    top = np.full(z.shape, np.sqrt(0.25 / np.pi))
    for m in range(L + 1):
        P = np.zeros((L - m + 1, len(z)))
        P[0] = top
        couple = _jacobi(m, L)
        for i in range(L - m):
            P[i + 1] = (z * P[i] - (couple[i - 1] * P[i - 1] if i else 0.0)) / couple[i]
        yield P
        top = top * s * np.sqrt((2 * m + 3) / (2 * m + 2))


def _coordinates(degree):
    """Multiplication by y1, y2, y3 from degree - 1 to degree, among cos 0, ..., cos l, sin 1, ..., sin l."""
    lower = degree - 1
    m = np.arange(degree)
    up = np.sqrt((degree + m) * (degree + m + 1) / (4.0 * degree**2 - 1)) / 2  # to order m + 1 ...
    down = -np.sqrt((degree - m) * (degree - m + 1) / (4.0 * degree**2 - 1)) / 2  # ... and to m - 1
    up[0] *= np.sqrt(2)  # cos 0 carries no factor sqrt(2)
    if degree > 1:
        down[1] *= np.sqrt(2)
    same = np.sqrt((degree - m) * (degree + m) / (4.0 * degree**2 - 1))
    c, s = (lambda m: m), (lambda m: degree + m)
    c0, s0 = (lambda m: m), (lambda m: lower + m)
    p, q = m[1:], m[2:]
    entries = (
        ((c(m + 1), c0(m), up), (c(p - 1), c0(p), down[1:]), (s(p + 1), s0(p), up[1:]), (s(q - 1), s0(q), down[2:])),
        ((s(m + 1), c0(m), up), (s(q - 1), c0(q), -down[2:]), (c(p + 1), s0(p), -up[1:]), (c(p - 1), s0(p), down[1:])),
        ((c(m), c0(m), same), (s(p), s0(p), same[1:])),
    )
    matrices = []
    for parts in entries:
        rows, columns, values = (np.concatenate([part[i] for part in parts]) for i in range(3))
        matrices.append(coo_array((values, (rows, columns)), (2 * degree + 1, 2 * degree - 1)).tocsr())
    return matrices
