"""Gibbs law of a model on the Casimir surface through a state, density exp(-H/T), by quadrature.

On spheres the quadrature is that of Gauss and Legendre in the height and the trapezoidal rule around; where planes
belong to the surface (see :class:`.leaves.Leaf`) H must be quadratic there, so that the law is normal given the rest,
and the quadrature that of Gauss and Hermite around its mean.  For more than two spheres see :mod:`.chains`.
"""

import math
from functools import partial

import numpy as np

from spi.compiler.inlining import uncompiled
from spi.ensemble import protocol
from spi.exact.surfaces import at_states, spheres

from .chains import ChainLaw
from .leaves import leaf
from .sphere_law import hermite, on_sphere

LEVELS = (8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 384, 512)  #: rings on a sphere
MOST = 5_000_000  #: points of a level
_SLICE = 2**17  #: points taken at once
_ROUNDING = 1e-14
_RESOLVED = 0.01  #: the largest relative change of the integral of exp(-H/T) between the finest levels
_SIDE = 2**10  #: points on a side of a grid
_FAR = 7.0  #: half-width of the interval of a normal coordinate, in standard deviations


def law_of(model, initial, temperature):
    """Gibbs law on the surface through `initial`; ValueError, with the reason in a phrase, where there is none.

    `initial` may be a :class:`~spi.ensemble.random_states.RandomState` of a law on one surface.  T = inf is the uniform
    law; T may be negative where the surface is compact.
    """
    if hasattr(initial, "law") and getattr(initial.law, "surface", None) is None:
        raise ValueError("paths begin on several surfaces")
    if protocol.decay_rates(model):
        raise ValueError("its Casimir functions decay")
    if temperature == 0:
        raise ValueError("the temperature is 0")
    surface = leaf(model, initial)
    energy = _energy(model)
    if surface.flat and not 0 < temperature < math.inf:
        raise ValueError("exp(-H/T) is not integrable on a surface that is not compact")
    if sum(each.shape[1] > 2 for each in surface.spheres) > 2:
        return ChainLaw(surface, energy, 1.0 / temperature)
    return Quadrature(surface, energy, 1.0 / temperature)


def _energy(model):
    """H of states (d, n); ValueError where it depends on time."""
    y = tuple(np.random.default_rng(8).uniform(0.5, 1.0, protocol.dimension(model)).tolist())
    with uncompiled():
        if len({float(protocol.hamiltonian(protocol.frozen(model, t, 0.0), y)) for t in (0.0, 0.3, 1.1)}) > 1:
            raise ValueError("H depends on time")
    model = protocol.frozen(model, 0.0, 0.0)

    return partial(at_states, partial(protocol.hamiltonian, model))


class Quadrature:
    """Law with density exp(-beta H), with respect to the Liouville measure of a :class:`~.leaves.Leaf`."""

    def __init__(self, surface, energy, beta):
        self.surface, self.energy, self.beta = surface, energy, beta
        self.levels = [level for level in LEVELS if self._count(level) <= MOST]
        if len(self.levels) < 3:
            raise ValueError(f"a surface of {surface.dimension} dimensions is too large for quadrature")
        self._shift = 0.0
        _, logarithm = self._weighted(*next(self._parts(self.levels[2])))
        if not np.isfinite(logarithm).all():
            raise ValueError("H is not finite on the surface")
        self._shift = float(logarithm.max())

    def expectation(self, f):
        """(E f(y), an estimate of its error) of a function that takes (d, n) to (n,)."""
        means, change, masses, resolved = [], [], [], False
        for level in self.levels:
            with np.errstate(all="ignore"):
                total, size, mass = self._sums(f, level)
                means.append(total / mass)
                masses.append(mass)
                rounding = _ROUNDING * size / mass
                if len(means) > 1:
                    change.append(abs(means[-1] - means[-2]))
                    resolved = abs(mass - masses[-2]) <= _RESOLVED * mass
            if len(means) > 2 and resolved and max(change[-2:]) <= 10 * rounding:
                break
        if not resolved:
            raise ValueError("quadrature does not resolve exp(-H/T), which is not integrable or too narrow")
        return float(means[-1]), float(max(change[-1], rounding))

    def _sums(self, f, level):
        """Sums of f, of |f| and of 1 with the weights of the law."""
        total, size, mass = 0.0, 0.0, 0.0
        for part in self._parts(level):
            y, logarithm = self._weighted(*part)
            weight, value = np.exp(logarithm - self._shift), np.broadcast_to(f(y), y.shape[1])
            total, size, mass = total + weight @ value, size + weight @ np.abs(value), mass + weight.sum()
        return total, size, mass

    @np.errstate(all="ignore")  # f may have no value, as log(y1) where y1 < 0
    def probabilities(self, f, edges):
        """(bins,) the probabilities that f(y) is in each bin, of which the last contains its upper edge.

        On a surface of two dimensions, by points on a grid between which f is taken to be linear: the error is about
        1e-5.  ValueError on larger ones.
        """
        if self.surface.dimension != 2:
            raise ValueError("laws of functions are known on surfaces of two dimensions")
        edges = np.asarray(edges, float)
        below, mass = np.zeros(len(edges)), 0.0
        for low, size, weight in self._on_grid(f):
            mass += weight.sum()
            for i, edge in enumerate(edges):
                at = low <= edge if i == len(edges) - 1 else low < edge
                below[i] += (weight * np.where(size > 0, np.clip((edge - low) / size, 0.0, 1.0), at)).sum()
        return np.diff(below) / mass

    # --- nodes -------------------------------------------------------------------------------------------------------

    def _count(self, level):
        """Number of points of a level."""
        sizes = [{1: 1, 2: 4 * level, 3: 2 * level**2}.get(each.shape[1], np.inf) for each in self.surface.spheres]
        return math.prod(sizes) * min(level // 2 + 4, 40) ** self.surface.flat

    def _parts(self, level):
        """(x (d, n), log weights (n,), z (m, k) of the planes, log weights (k,)) in parts."""
        spheres = [on_sphere(each.shape[1], level) for each in self.surface.spheres]
        z, of_z = hermite(min(level // 2 + 4, 40))
        grid = [each.ravel() for each in np.meshgrid(*[np.arange(len(z))] * self.surface.flat)]
        of_z = sum((np.log(of_z[i]) for i in grid), np.zeros(1))
        z = np.array([z[i] for i in grid]).reshape(len(grid), len(of_z))
        shape = tuple(len(weights) for _, weights in spheres)
        count, most = math.prod(shape), max(_SLICE // len(of_z), 1)
        for first in range(0, count, most):
            numbers = np.arange(first, min(first + most, count))
            x, logarithm = np.zeros((len(self.surface.fibre), len(numbers))), np.zeros(len(numbers))
            at = np.unravel_index(numbers, shape) if shape else ()
            for map_, (points, weights), i in zip(self.surface.spheres, spheres, at, strict=True):
                x, logarithm = x + map_ @ points[:, i], logarithm + np.log(weights[i])
            yield x, logarithm, z, of_z

    def _weighted(self, x, logarithm, z, of_z):
        """(states (d, n k), log of weight times density (n k,)) of a part of a rule; z may be (m, n, 1) as well."""
        surface = self.surface
        if not surface.fibre.shape[1]:
            return x, logarithm - self.beta * self.energy(x)
        p, basis, measure = surface.planes(x)
        y, logarithm = x + surface.fibre @ p.T, logarithm + measure
        if not surface.flat:
            return y, logarithm - self.beta * self.energy(y)
        directions = np.einsum("df,nfm->mdn", surface.fibre, basis)
        mean, root, determinant = self._normal(y, directions)
        if z.ndim == 2:
            z = z[:, np.newaxis]
        q = mean.T[:, :, np.newaxis] + np.einsum(
            "nij,jnk->ink", root, np.broadcast_to(z, (len(z), *x.shape[1:], z.shape[2]))
        )
        y = (y[:, :, np.newaxis] + np.einsum("mdn,mnk->dnk", directions, q)).reshape(len(y), -1)
        # nodes and weights of z have its normal density in them
        logarithm = (logarithm + determinant)[:, np.newaxis] + of_z + 0.5 * (z * z).sum(axis=0)
        return y, logarithm.ravel() - self.beta * self.energy(y)

    def _normal(self, start, directions):
        """(mean (n, m), root of covariance (n, m, m), its log det (n,)) of q in planes start + sum_m q_m directions_m.

        From values of H, which is checked to be quadratic there.
        """
        H, m = self.energy, len(directions)
        zero = H(start)
        up, down = np.array([[H(start + s * e) for e in directions] for s in (1.0, -1.0)])
        slope, second = 0.5 * (up - down), np.empty((start.shape[1], m, m))
        for i in range(m):
            second[:, i, i] = up[i] + down[i] - 2.0 * zero
            for j in range(i):
                both = H(start + directions[i] + directions[j])
                second[:, i, j] = second[:, j, i] = both - up[i] - up[j] + zero
        q = np.random.default_rng(9).standard_normal(m) + 2.0
        expected = zero + q @ slope + 0.5 * np.einsum("i,nij,j->n", q, second, q)
        difference = H(start + np.einsum("m,mdn->dn", q, directions)) - expected
        size = np.abs(second).max() + np.abs(slope).max() + np.abs(zero).max()
        if not np.abs(difference).max() <= 1e-9 * size * (1.0 + q @ q):
            raise ValueError("H is not quadratic where the surface is not compact")
        try:
            lower = np.linalg.cholesky(self.beta * second)
        except np.linalg.LinAlgError:
            raise ValueError("exp(-H/T) is not integrable on the surface") from None
        root = np.linalg.inv(lower).transpose(0, 2, 1)
        mean = -self.beta * np.einsum("nij,nkj,kn->ni", root, root, slope)
        return mean, root, -np.log(np.einsum("nii->ni", lower)).sum(axis=1)

    def _on_grid(self, f):
        """Yield (least values of f in cells, ranges of f there, weights of the cells) on a surface of two dimensions.

        The range is that along the direction in which f changes more.
        """
        rows = max(_SLICE // _SIDE, 1)
        for first in range(0, _SIDE, rows):
            u, v = np.meshgrid(np.arange(first, first + rows + 1) / _SIDE, np.arange(_SIDE + 1) / _SIDE, indexing="ij")
            value, weight = (each.reshape(u.shape) for each in self._of_square(f, u.ravel(), v.ravel()))
            corners = [value[:-1, :-1], value[1:, :-1], value[:-1, 1:], value[1:, 1:]]
            down, right = (abs(corners[3] - corners[0] + s * (corners[1] - corners[2])) for s in (1, -1))
            size = 0.5 * np.maximum(down, right)
            weight = weight[:-1, :-1] + weight[1:, :-1] + weight[:-1, 1:] + weight[1:, 1:]
            yield sum(corners) / 4 - 0.5 * size, size, weight

    def _of_square(self, f, *square):
        """Values and weights of points of the unit square, which is mapped to the surface."""
        coordinates, x, logarithm = iter(square), np.zeros((len(self.surface.fibre), 1)), np.zeros(len(square[0]))

        def on_interval():
            theta = np.pi * next(coordinates)
            return np.cos(theta), np.sin(theta)

        with np.errstate(divide="ignore"):
            for map_ in self.surface.spheres:
                if (n := map_.shape[1]) == 1:
                    x = x + map_
                    continue
                height, r = on_interval() if n == 3 else (np.zeros(1), np.ones(1))
                phi = 2 * np.pi * next(coordinates)
                x = x + map_ @ np.array([r * np.cos(phi), r * np.sin(phi), height + 0.0 * phi])[:n]
                logarithm += np.log(np.abs(r))
            far = [on_interval() for _ in range(self.surface.flat)]
            logarithm += sum(np.log(np.abs(r)) for _, r in far)
        z = np.array([_FAR * height for height, _ in far]).reshape(len(far), len(logarithm), 1)
        x = np.broadcast_to(x, (len(x), len(logarithm)))
        y, logarithm = self._weighted(x, logarithm, z, -0.5 * (z * z).sum(axis=0))
        return np.broadcast_to(f(y), len(logarithm)), np.exp(logarithm - self._shift)


def mean_divergence(model, temperature, point):
    """-(1/(2 T^2)) sum_k sigma_k^2 E (X_k H)^2 under the Gibbs law exp(-H/T) on the Casimir surface through a state.

    It is the sum of the Lyapunov exponents.  X_k = B grad Ĥ_k; `model` is that without friction.  None where the
    surface is no single sphere, the model depends on time, or the law is not available, as that of H = log(y3).
    """
    surface = spheres(model, point)
    if surface is None or len(surface.triples) > 1 or hasattr(model, "time"):
        return None

    def rate(y):
        gradient = protocol.drift_gradient(model, y)
        fields = [
            protocol.structure(model, y, protocol.noise_gradient(model, k, y)) for k in protocol.noise_indices(model)
        ]
        slopes = [sum(a * b for a, b in zip(gradient, field, strict=True)) for field in fields]
        return sum((sigma * slope) ** 2 for sigma, slope in zip(protocol.strengths(model), slopes, strict=True))

    try:
        return -law_of(model, point, temperature).expectation(partial(at_states, rate))[0] / (2 * temperature**2)
    except ValueError:
        return None
