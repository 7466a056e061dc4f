"""Uniform law on a sphere |y| = r, and that of the Hamiltonian under it.

For a model with ``axis_inertias`` and noises about at least two axes i and j the uniform law is the only stationary one
that gives the axes no weight, whatever the drift:

* All fields are tangent to the sphere and keep its area, so that the uniform law is stationary.  So do all their
  flows, so that it is stationary for splitting schemes as well.
* The fields of the noises are f_k = (y_k / Î_k) y x e_k.  Since (f_i x f_j) . y is a multiple of y_1 y_2 y_3, f_i and
  f_j span the tangent plane off the three great circles y_k = 0.  On the circles f_i, f_j and [f_i, f_j] span it, and
  f_i or f_j crosses them, except at the six points on the axes, where all fields vanish.
* So from each point that is not on an axis every other such point is reached, and transition laws have densities.

With one noise it depends on the drift (about an axis of symmetry y_k is conserved), and nothing is claimed here.
"""

import functools
from typing import NamedTuple

import numpy as np

from spi.compiler.dispatch import answers
from spi.ensemble.protocol import axis_inertias, hamiltonian
from spi.ensemble.random_states import RandomState
from spi.exact.surfaces import strengths_by_place

# ---------------------------------------------------------------------------------------------------------------------
# Rules of quadrature on spheres and for the normal law.
# ---------------------------------------------------------------------------------------------------------------------


@functools.lru_cache(4)
def on_sphere(n, level):
    """(points (n, count), weights (count,)) on the unit sphere in n dimensions, n = 1, 2, 3."""
    if n == 1:
        return np.ones((1, 1)), np.ones(1)
    if n == 2:
        phi = np.pi / (2 * level) * np.arange(4 * level)
        return np.array([np.cos(phi), np.sin(phi)]), np.full(4 * level, 1.0 / (4 * level))
    height, weights = np.polynomial.legendre.leggauss(level)
    phi = np.pi / level * np.arange(2 * level)
    r = np.sqrt(1.0 - height**2)
    points = [np.outer(r, np.cos(phi)), np.outer(r, np.sin(phi)), np.outer(height, np.ones(2 * level))]
    return np.array(points).reshape(3, -1), np.repeat(weights, 2 * level) / (4 * level)


@functools.cache
def hermite(count):
    """(nodes, weights) for the normal law."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(count)
    return nodes, weights / weights.sum()


#: Bins of equal probability.
BINS = 20
_NODES = 20_000  # of the quadrature over one axis; the distribution function of H is then good to 1e-6
_RINGS = 256  # of points on the sphere: polynomials of up to this degree are integrated exactly


def obstacle(model, initial):
    """The reason why the law of paths from `initial` need not tend to the uniform one; None if it does."""
    name = type(model).__qualname__
    if not answers(axis_inertias, model):
        return f"no stationary law is known for {name}, which does not answer axis_inertias"
    noise_inertias = axis_inertias(model)[1]
    turning = [s for s, i in zip(strengths_by_place(model, 3), noise_inertias, strict=True) if s and np.isfinite(i)]
    if len(turning) < 2:
        return f"the stationary law of {name} is known with noises about at least two axes, not with {len(turning)}"
    if isinstance(initial, RandomState) and initial.law.surface is None:
        return "paths begin on several spheres"
    if np.count_nonzero(initial) < 2:
        return "on an axis nothing moves"
    return None


class SphereLaw(NamedTuple):
    """y_1, y_2, y_3, each uniform on [-r, r] (Archimedes), and H = sum_k y_k^2 / (2 I_k) unless that is constant."""

    model: NamedTuple
    radius: float
    variables: tuple[str, ...]
    edges: np.ndarray  #: (variables, BINS + 1) of y_k / r and of H
    moments: dict[str, float]  #: name -> exact value, of y_k / r and of H

    @classmethod
    def of(cls, model, initial):
        """Law on the sphere through the initial state; ValueError where it is not known to be stationary."""
        if reason := obstacle(model, initial):
            raise ValueError(reason)
        r = float(np.linalg.norm(initial))
        # H is quadratic and diagonal: a_k = H(r e_k), so that H = sum_k a_k (y_k / r)^2
        a = np.array([hamiltonian(model, tuple(r * (i == k) for i in range(3))) for k in range(3)])
        variables, edges = ["y1", "y2", "y3"], [np.linspace(-1.0, 1.0, BINS + 1)] * 3
        moments = {
            f"y{k}{power}": value for power, value in (("", 0.0), ("^2", 1 / 3), ("^4", 1 / 5)) for k in (1, 2, 3)
        }
        moments |= {"H": a.sum() / 3, "H^2": ((a**2).sum() * 2 + a.sum() ** 2) / 15}
        if np.ptp(a) > 1e-6 * a.max():
            variables.append("H")
            edges.append(_quantiles(a))
        return cls(model, r, tuple(variables), np.array(edges), moments)

    def _values(self, states):
        """y_k / r and H, (4, paths)."""
        return np.array([*(states / self.radius), hamiltonian(self.model, tuple(states))])

    def moments_of(self, states):
        """(moments, paths) the quantities whose exact means are `moments`, for states (3, paths)."""
        *y, energy = self._values(states)
        y = np.array(y)
        return np.concatenate([y, y**2, y**4, [energy, energy**2]])

    def count(self, states, counts):
        """Add one to the bin of each variable and path in `counts` (variables, BINS, paths), to none if outside."""
        for v, values in enumerate(self._values(states)[: len(self.variables)]):
            # roundings can carry a state over the ends, the scheme can as well
            end = 1e-9 * np.abs(self.edges[v]).max()
            inside = (values >= self.edges[v, 0] - end) & (values <= self.edges[v, -1] + end)
            bins = np.clip(np.searchsorted(self.edges[v], values, side="right") - 1, 0, BINS - 1)
            paths = np.flatnonzero(inside)
            counts[v, bins[paths], paths] += 1.0


def _quantiles(a):
    """Quantiles 0, 1/BINS, ..., 1 of sum_k a_k u_k^2, u uniform on the unit sphere.

    Given u_3 = z, the sum is a_3 z^2 + (1 - z^2) (a_2 + (a_1 - a_2) cos^2 phi) with phi uniform, and cos^2 phi <= q has
    the probability 2/pi arcsin(q^(1/2)); z is uniform.
    """
    a1, a2, a3 = np.sort(a)[[0, 2, 1]]  # a_1 and a_2 differ
    z2 = ((np.arange(_NODES) + 0.5) / _NODES) ** 2

    def probability(x):
        q = (a2 - (x - a3 * z2) / (1.0 - z2)) / (a2 - a1)  # the sum is at most x where cos^2 phi is at least q
        return 1.0 - np.mean(2.0 / np.pi * np.arcsin(np.sqrt(np.clip(q, 0.0, 1.0))))

    low, high = np.full(BINS - 1, a.min()), np.full(BINS - 1, a.max())
    wanted = np.arange(1, BINS) / BINS
    for _ in range(50):
        middle = 0.5 * (low + high)
        less = np.array([probability(x) for x in middle]) < wanted
        low, high = np.where(less, middle, low), np.where(less, high, middle)
    return np.concatenate([[a.min()], 0.5 * (low + high), [a.max()]])


def stationary_means(model, initial, functions):
    """E phi under the uniform law on the sphere through the initial state, of functions of y (3, n); (F,).

    By Gauss-Legendre quadrature in y_3 and the trapezoidal rule around it.  ValueError where the law is not known to
    be stationary.
    """
    if reason := obstacle(model, initial):
        raise ValueError(reason)
    _, weights = np.polynomial.legendre.leggauss(_RINGS)
    y = float(np.linalg.norm(initial)) * on_sphere(3, _RINGS)[0]
    return np.array(
        [np.broadcast_to(f(y), y.shape[1]).reshape(_RINGS, -1).mean(axis=1) @ weights / 2 for f in functions]
    )
