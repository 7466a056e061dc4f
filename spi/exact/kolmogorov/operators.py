"""Backward operators on the sphere, class by class (see :mod:`.harmonics`): one step, its powers, and the semigroup.

A step is stored as E = P - I throughout, and a flow about axis k adds U^j (exp(turn A + spread A^2) - 1) U^-j f to f:
the rounding errors of the fixed matrices are then proportional to h, and do not pile up over many small steps.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import ive

from ..work import counted
from .backward import acting_on_functions, joined, split
from .harmonics import shifted

#: Matrices of at most so many rows are squared at once, within a second.
_AT_ONCE = 2500


class Factor(NamedTuple):
    """The operator exp(turn A_k + spread A_k^2) of one or more flows about axis k."""

    axis: int
    turn: float
    spread: float


def factors(turn, spread, composition, h):
    """The factors of one composition in the order in which they act on f, the last flow first.

    `turn` and `spread` are the coefficients of A_k and A_k^2 in the generator.
    """
    coefficients = {"drift": turn, "noise": spread}
    word = acting_on_functions(composition, lambda part, k: coefficients[part][k] != 0)
    return tuple(Factor(k, drift * h * turn[k], noise * h * spread[k]) for k, drift, noise in joined(word))


class Step:
    """The backward operator of a step in one class of functions.

    `words` are (probability, factors); the common beginning and end of all words are applied once.
    """

    def __init__(self, harmonics, which, words):
        self.harmonics, self.which, self.cache = harmonics, which, {}
        self.before, branches, self.after = split(words)
        self.nothing = sum(p for p, word in branches if not word)
        self.branches = [(p, word) for p, word in branches if word]

    @property
    def length(self):
        """The number of factors that are applied."""
        return len(self.before) + len(self.after) + sum(len(word) for _, word in self.branches)

    def increment(self, V):
        """E V, for the columns of V."""
        D = self._along(self.before, V, np.zeros_like(V))
        if self.branches:
            D = sum((p * self._along(word, V, D.copy()) for p, word in self.branches), self.nothing * D)
        return self._along(self.after, V, D)

    def _along(self, word, V, D):
        for factor in word:
            D += self._factor(factor, V + D)
        return D

    def _factor(self, factor, V):
        by = (2 - factor.axis) % 3  # U^by takes the axis to the third
        inner = shifted(self.which, by)
        if (inner, factor) not in self.cache:
            chains = self.harmonics.chains[inner]
            self.cache[inner, factor] = [(c.states, _on_chain(c, factor)) for c in chains]
        V = self._shift(V, self.which, by)
        W = np.zeros_like(V)
        for states, matrix in self.cache[inner, factor]:
            W[states] = matrix @ V[states]
        return self._shift(W, inner, -by % 3)

    def _shift(self, V, which, by):
        """U^by V."""
        if by == 0:
            return V
        goal = shifted(which, by)
        turns = self.harmonics.turn[which] if by == 1 else [m.T for m in self.harmonics.turn[goal]]
        a, b = self.harmonics.starts[which].tolist(), self.harmonics.starts[goal].tolist()
        W = np.empty_like(V)
        for i, matrix in enumerate(turns):
            np.matmul(matrix, V[a[i] : a[i + 1]], out=W[b[i] : b[i + 1]])
        return W

    def matrix(self):
        """E, made in strips so narrow that they stay in cache and BLAS starts no threads for products this small."""
        size = self.harmonics.size[self.which]
        width = min(max(2**18 // self.harmonics.L**2, 24), 128)
        E = np.empty((size, size))
        for a in range(0, size, width):
            E[:, a : a + width] = self.increment(np.eye(size, min(width, size - a), -a))
            counted(_building(self.harmonics.L, self.length) * min(width, size - a) / size)
        return E

    def power(self, V, n):
        """P^n V: step by step, or with E as a matrix, squared as often as is cheapest."""
        L = self.harmonics.L
        doublings = cheapest(L, n, self.length)[1]
        if doublings is None:
            for _ in range(n):
                V = V + self.increment(V)
                counted(_stepping(L, self.length))
            return V
        E = self.matrix()
        for _ in range(doublings):
            if n % 2:
                V = V + E @ V
            E = _squared(E) + 2 * E
            n //= 2
        for _ in range(n):
            V = V + E @ V
            counted(_multiplying(L))
        return V


def cheapest(L, n, length):
    """(seconds on one core, roughly, doublings or None for no matrix) of the cheapest way to P^n."""
    ways = [(n * _stepping(L, length), None)]
    if L <= 160:  # else the matrices get large
        build = _building(L, length)
        for k in range(int(n).bit_length()):
            ways.append((build + k * _squaring(L**2 / 4) + (n / 2**k) * _multiplying(L), k))
    return min(ways, key=lambda way: way[0])


def _stepping(L, length):
    """Seconds of one core for a step of `length` factors, roughly."""
    return length * (5e-6 * L + L**3 / 4e9)


def _building(L, length):
    """Seconds of one core to build the matrix of such a step, roughly."""
    return length * L**3 * (L**2 / 4) / 1e10


def _multiplying(L):
    """Seconds of one core for a step with the matrix, roughly."""
    return (L**2 / 4) ** 2 * 1e-9 + 5e-5


def _squaring(size):
    """Seconds of one core for the square of a matrix, roughly."""
    return 2 * size**3 / 4e10 + size**2 * 3e-9


def _squared(E):
    """E E, for large matrices some columns at a time, so that progress is counted and work can be interrupted."""
    size, square = len(E), np.empty_like(E)
    width = size if size <= _AT_ONCE else 512
    for a in range(0, size, width):
        np.matmul(E, E[:, a : a + width], out=square[:, a : a + width])
        counted(_squaring(size) * min(width, size - a) / size)
    return square


def _on_chain(chain, factor):
    """exp(turn A + spread A^2) - 1 on one chain, A being m J_m with signs; its even and odd part."""
    x = chain.order * chain.nodes
    s = factor.spread * x**2
    Q = chain.vectors
    even = (Q * (np.expm1(-s) * np.cos(factor.turn * x) - 2 * np.sin(factor.turn * x / 2) ** 2)) @ Q.T
    odd = (Q * (np.exp(-s) * np.sin(factor.turn * x))) @ Q.T
    return even + odd * chain.sign


def bounds(L, turn, spread):
    """Bounds of the skew and of the symmetric part of the generator: |A_k| <= max m J_m < (L+1) / 2."""
    top = (L + 1) / 2
    return top * sum(abs(t) for t in turn), top**2 * sum(spread)


def semigroup(harmonics, which, turn, spread, time, V):
    """exp(time G) V with G = sum_k turn_k A_k + spread_k A_k^2.

    Chebyshev expansion in pieces so short that the imaginary part of the numerical range, which is [-rho, 0] + i[-beta,
    beta], does no harm: within it |T_j| stays far below the reciprocal of the coefficients.
    """
    A = [harmonics.generator(which, k) for k in range(3)]
    G = sum(t * a + s * (a @ a) if s else t * a for t, s, a in zip(turn, spread, A, strict=True))
    pieces, half, coefficients = chebyshev(*bounds(harmonics.L, turn, spread), time)
    B = (G * (time / pieces / half)).tocsr()
    for _ in range(pieces):
        # with U_j = T_j(1 + B) - 1, since the c_j add up to 1 only up to rounding
        a, b = np.zeros_like(V), B @ V
        W = coefficients[1] * b
        for c in coefficients[2:]:
            a, b = b, 2 * (b + B @ (b + V)) - a
            W += c * b
            counted(term(harmonics.L, 1, V.shape[1]))
        V = V + W
    return V


def term(L, classes, columns):
    """Seconds of one core for a term of the expansion of :func:`semigroup`, of all columns of classes, roughly."""
    return 1.2e-5 * classes + 4e-9 * L**2 * columns


def chebyshev(beta, rho, time):
    """(pieces, half, c): exp(z) = sum_j c_j T_j(1 + z / half) for z = time / pieces * an element of the range."""
    pieces = max(1, int(np.ceil(time * beta / 2)))
    half = max(rho * time / pieces / 2, 1.0)
    coefficients = 2 * ive(np.arange(40 + int(14 * np.sqrt(half))), half)
    coefficients[0] /= 2
    return pieces, half, coefficients[: np.nonzero(coefficients > 1e-20)[0][-1] + 1]
