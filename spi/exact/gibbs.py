"""The Gibbs law of a model on the Casimir surface through a state, density exp(-H/T), by quadrature.

On spheres the quadrature is that of Gauss and Legendre in the height and the trapezoidal rule around; where planes
belong to the surface (see :mod:`.leaves`) H must be quadratic there, so that the law is normal given the rest, and the
quadrature that of Gauss and Hermite around its mean.  Of more than two spheres see :mod:`.chains`.
"""

import math

import numpy as np
from scipy.special import ndtri

from ..compiler.inlining import uncompiled
from ..ensemble.protocol import dimension, hamiltonian
from ..ensemble.special import frozen
from ..models.delegation import undamped
from .chains import Chain
from .leaves import leaf
from .rules import along, hermite, on_sphere
from .surfaces import quadratic

LEVELS = (8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 384, 512)  #: rings on a sphere
MOST = 5_000_000  #: points of a level
_SLICE = 2**17  #: points taken at once
_ROUNDING = 1e-14
_POINTS = 2**20  #: by which the law of a function is found on a surface, twice as many on larger ones


def law_of(model, initial, temperature):
    """The Gibbs law on the surface through `initial`; ValueError, with the reason in a phrase, where none is known.

    `initial` may be a :class:`~..ensemble.random_states.RandomState` of a law on one surface.  T = inf is the uniform
    law; T may be negative where the surface is compact.
    """
    model = undamped(model)
    if hasattr(initial, "law") and getattr(initial.law, "surface", None) is None:
        raise ValueError("paths begin on several surfaces")
    if temperature == 0:
        raise ValueError("the temperature is 0")
    surface = leaf(model, initial)
    energy = _energy(model)
    if surface.flat and not 0 < temperature < math.inf:
        raise ValueError("exp(-H/T) is not integrable on a surface that is not compact")
    if sum(each.shape[1] > 2 for each in surface.spheres) > 2:
        return Chain(surface, energy, 1.0 / temperature, quadratic(model))
    return Quadrature(surface, energy, 1.0 / temperature)


def _energy(model):
    """H of states (d, n); ValueError where it depends on time."""
    y = tuple(np.random.default_rng(8).uniform(0.5, 1.0, dimension(model)).tolist())
    with uncompiled():
        if len({float(hamiltonian(frozen(model, t, 0.0), y)) for t in (0.0, 0.3, 1.1)}) > 1:
            raise ValueError("H depends on time")
    model = frozen(model, 0.0, 0.0)

    def energy(states):
        with uncompiled(), np.errstate(all="ignore"):
            try:
                return np.broadcast_to(hamiltonian(model, tuple(states)), states.shape[1])
            except ValueError:  # a formula with a choice, which is made for one state
                return np.array([hamiltonian(model, tuple(state)) for state in states.T.tolist()])

    return energy


class Quadrature:
    """The law with density exp(-beta H), with respect to the Liouville measure of a :class:`~.leaves.Leaf`."""

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
        found, change = [], []
        for level in self.levels:
            total, size, mass = 0.0, 0.0, 0.0
            for part in self._parts(level):
                y, logarithm = self._weighted(*part)
                weight, value = np.exp(logarithm - self._shift), np.broadcast_to(f(y), y.shape[1])
                total, size, mass = total + weight @ value, size + weight @ np.abs(value), mass + weight.sum()
            found.append(total / mass)
            rounding = _ROUNDING * size / mass
            if len(found) > 1:
                change.append(abs(found[-1] - found[-2]))
            if len(found) > 2 and max(change[-2:]) <= 10 * rounding:
                break
        return float(found[-1]), float(max(change[-1], rounding))

    def probabilities(self, f, edges):
        """(bins,) the probabilities that f(y) is in each bin, of which the last contains its upper edge.

        By points on a line, between which f is taken for linear.
        """
        edges = np.asarray(edges, float)
        below, mass = np.zeros(len(edges)), 0.0
        for y, weight, joined in self._line():
            value = np.broadcast_to(f(y), y.shape[1])
            one, other = value[:-1], np.where(joined, value[1:], value[:-1])
            weight = np.where(joined, 0.5 * (weight[1:] + weight[:-1]), weight[:-1])
            low, size = np.minimum(one, other), np.abs(other - one)
            mass += weight.sum()
            with np.errstate(invalid="ignore", divide="ignore"):
                for i, edge in enumerate(edges):
                    at = low <= edge if i == len(edges) - 1 else low < edge
                    below[i] += (weight * np.where(size > 0, np.clip((edge - low) / size, 0.0, 1.0), at)).sum()
        return np.diff(below) / mass

    # --- nodes ---------------------------------------------------------------------------------------------------------

    def _axes(self, level):
        """[(points (n_a, n), weights (n,)) of each sphere], and the same of one direction of the planes."""
        spheres = [on_sphere(each.shape[1], level) for each in self.surface.spheres]
        return spheres, hermite(min(level // 2 + 4, 40))

    def _count(self, level):
        """How many points a level has."""
        sizes = [{1: 1, 2: 4 * level, 3: 2 * level**2}.get(each.shape[1], np.inf) for each in self.surface.spheres]
        return math.prod(sizes) * min(level // 2 + 4, 40) ** self.surface.flat

    def _parts(self, level):
        """(x (d, n), log weights (n,), z (m, k) of the planes, log weights (k,)) in parts."""
        spheres, (z, of_z) = self._axes(level)
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
        q = mean.T[:, :, np.newaxis] + np.einsum("nij,jnk->ink", root, np.broadcast_to(z, (len(z), *x.shape[1:], z.shape[2])))
        y = (y[:, :, np.newaxis] + np.einsum("mdn,mnk->dnk", directions, q)).reshape(len(y), -1)
        # nodes and weights of z have its normal density in them
        logarithm = (logarithm + determinant)[:, np.newaxis] + of_z + 0.5 * (z * z).sum(axis=0)
        return y, logarithm.ravel() - self.beta * self.energy(y)

    def _normal(self, start, directions):
        """Of the law on each plane, start + sum_m q_m directions_m: mean of q (n, m), root of covariance, its log det.

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

    def _line(self):
        """(states (d, n + 1), weights times density (n + 1,), whether neighbours are joined (n,)) in parts.

        They lie on a line through the unit cube, the first of whose coordinates it passes once, the others many times
        at irrational rates, and the first angle at the fastest.  From the cube there is a map to the surface.
        """
        surface = self.surface
        turning = [each.shape[1] for each in surface.spheres if each.shape[1] > 1]
        free = surface.dimension - bool(turning)
        around = 2**10 if free == 1 else 2**7  # points to a turn
        points = _POINTS if surface.dimension < 3 else 2 * _POINTS
        for first in range(0, points, _SLICE):
            s = np.arange(first, first + _SLICE + 1) / around
            cube = along(s, s * around / points, free)
            joined = (np.abs(np.diff(cube)) < 0.5).all(axis=0)
            coordinates, angles = iter(cube), iter([s])
            x = np.zeros((len(surface.fibre), len(s)))
            for map_ in surface.spheres:
                x += map_ @ _unit(map_.shape[1], coordinates, angles)
            z = np.array([ndtri(each) for each in coordinates]).reshape(surface.flat, len(s), 1)
            y, logarithm = self._weighted(x, np.zeros(len(s)), z, np.zeros(1))
            yield y, np.exp(logarithm - self._shift), joined


def _unit(n, coordinates, angles):
    """Points of the unit sphere in n dimensions from coordinates in [0, 1]; an angle is of `angles` while there are."""
    if n == 1:
        return np.ones((1, 1))
    height = 2.0 * next(coordinates) - 1.0 if n == 3 else 0.0
    turns = next(angles, None)
    phi = 2 * np.pi * (next(coordinates) if turns is None else turns)
    r = np.sqrt(1.0 - height**2)
    return np.array([r * np.cos(phi), r * np.sin(phi), *([height] if n == 3 else [])])
