"""Gibbs law of chains and rings: spheres that a quadratic H couples to at most two others each, transfer matrices.

With nodes u_i of a rule on the unit sphere, the matrix of the bond from sphere a to sphere b is

    D_a^(1/2) exp(-beta u_i.A_ab u_j) D_b^(1/2),

where D has the weights of the rule times the exponentials of the terms of H in one sphere.  The weight of a ring is the
trace of the product around it, the joint law of two spheres has the products of the two ways between them as factors,
and a chain is a ring with a bond of no coupling.  (For Heisenberg's chain see M. E. Fisher, Am. J. Phys. 32, 343
(1964).)
"""

import itertools

import numpy as np

from spi.exact.surfaces import polynomial

from .sphere_law import on_sphere

LEVELS = (6, 8, 12, 16, 24)  #: rings of a rule
_ROUNDING = 1e-13
_STATES = 64  #: at which the form of a function is tested


class ChainLaw:
    """Law with density exp(-beta H) on a product of spheres."""

    def __init__(self, surface, energy, beta):
        if surface.flat or any(each.shape[1] == 2 for each in surface.spheres):
            raise ValueError(f"a surface of {surface.dimension} dimensions is too large for quadrature")
        self.surface, self.energy, self.beta = surface, energy, beta
        self.maps = [each for each in surface.spheres if each.shape[1] == 3]
        x = sum((each for each in surface.spheres if each.shape[1] == 1), np.zeros((len(surface.fibre), 1)))
        self.rest = x + surface.fibre @ surface.planes(x)[0].T  # the constant components
        if (form := polynomial(energy, len(surface.fibre))) is None:
            raise ValueError("H is not quadratic, on more than two spheres")
        self.form = self._on_spheres(*form)
        self.rings = _rings(_neighbours(self.form[2], len(self.maps)))

    def expectation(self, f):
        """(E f(y), an estimate of its error) of a function that takes (d, n) to (n,).

        It is a polynomial of degree 2 in H or in y, or depends on two spheres only; ValueError for others.
        """
        mean, values = self._mean_of(f), []
        for level in LEVELS:
            values.append(mean(level))
            rounding = _ROUNDING * max(abs(values[-1]), 1e-3)
            if len(values) > 1 and abs(values[-1] - values[-2]) <= rounding:
                break
        return float(values[-1]), float(max(abs(values[-1] - values[-2]), rounding))

    def probabilities(self, f, edges):
        """Not implemented: ValueError."""
        raise ValueError("laws of functions are known on at most two spheres")

    def _mean_of(self, f):
        """Function level -> E f(y); ValueError unless f is such a polynomial or depends on two spheres only."""
        u, others = np.random.default_rng(0).standard_normal((2, len(self.maps), 3, _STATES))
        y, energy = self._states(u), self.energy(self._states(u))
        value = np.broadcast_to(f(y), _STATES)
        close = 1e-9 * max(np.abs(value).max(), 1e-300)
        powers = np.array([energy**0, energy, energy**2]).T
        in_energy = np.linalg.lstsq(powers, value)[0]
        if np.abs(powers @ in_energy - value).max() <= close:
            return lambda level: in_energy @ [1.0, *self._energy_moments(level)]
        if (in_y := polynomial(f, len(y))) is not None:
            form = self._on_spheres(*in_y)
            return lambda level: _Transfer(self, level, self.beta).mean(form)
        sites = range(len(self.maps))
        used = [a for a in sites if np.any(f(self._states([others[i] if i == a else u[i] for i in sites])) != value)]
        if len(used) > 2:
            raise ValueError("means on many spheres are known of polynomials of degree 2 in H or in y")
        pair = [*used, *(a for a in sites if a not in used)][:2]
        return lambda level: self._of_two(f, pair, level)

    def _states(self, u):
        """(d, n) from directions (spheres, 3, n)."""
        parts = [m @ (each / np.linalg.norm(each, axis=0)) for m, each in zip(self.maps, u, strict=True)]
        return self.rest + sum(parts)

    def _on_spheres(self, c, b, A):
        """(c, b_a, A_ab) of c + b.y + y.Ay/2 as a function of the unit vectors."""
        y, sites = self.rest[:, 0], range(len(self.maps))
        linear = [m.T @ (b + A @ y) for m in self.maps]
        couplings = {(i, j): self.maps[i].T @ A @ self.maps[j] for i in sites for j in sites}
        return c + b @ y + 0.5 * y @ A @ y, linear, couplings

    def _energy_moments(self, level):
        """E H and E H^2; the variance is -d E H / d beta, by a complex step."""
        step = 1e-12 * max(1.0, abs(self.beta))
        mean = _Transfer(self, level, complex(self.beta, step)).mean(self.form)
        return mean.real, mean.real**2 - mean.imag / step

    def _of_two(self, f, pair, level):
        """E f of a function of two spheres."""
        transfer, total = _Transfer(self, level, self.beta), 0.0
        joint, n = transfer.pair(*pair), len(transfer.weights)
        base = self.rest + sum(m[:, :1] for a, m in enumerate(self.maps) if a not in pair)
        first, second = (self.maps[a] @ transfer.nodes for a in pair)
        for i in range(n):
            total += joint[i] @ np.broadcast_to(f(base + first[:, i : i + 1] + second), n)
        return total


class _Transfer:
    """Law on the nodes of a level, at one beta, which may be complex."""

    def __init__(self, law, level, beta):
        self.law, self.beta, self.products = law, beta, {}
        self.nodes, self.weights = on_sphere(3, level)
        self.place = {a: (ring, i) for ring in law.rings for i, (a, *_) in enumerate(ring)}

    def mean(self, form):
        """E of c + sum_a b_a.u_a + sum_ab u_a.A_ab u_b / 2."""
        c, linear, couplings = form
        total, u = c, self.nodes
        for a, b in enumerate(linear):
            total = total + self.single(a) @ (b @ u + 0.5 * (u * (couplings[a, a] @ u)).sum(axis=0))
        for a, b in itertools.combinations(range(len(linear)), 2):
            if couplings[a, b].any():
                total = total + (self.pair(a, b) * (u.T @ couplings[a, b] @ u)).sum()
        return total

    def single(self, a):
        """Probabilities (n,) of the nodes for one sphere."""
        ring, i = self.place[a]
        diagonal = np.diag(self.product(ring[i:] + ring[:i]))
        return diagonal / diagonal.sum()

    def pair(self, a, b):
        """Joint probabilities (n, n) of the nodes for two spheres."""
        (ring, i), (other, j) = self.place[a], self.place[b]
        if ring is not other:
            return np.outer(self.single(a), self.single(b))
        if i > j:
            return self.pair(b, a).T
        joint = self.product(ring[i:j]) * self.product(ring[j:] + ring[:i]).T
        return joint / joint.sum()

    def product(self, bonds):
        """Product of the matrices of bonds, up to a factor; for equal bonds it is computed once."""
        key = tuple(map(self._key, bonds))
        if key not in self.products:
            half = 1 << (len(bonds) - 1).bit_length() - 1 if len(bonds) > 1 else 0
            matrix = self.product(bonds[:half]) @ self.product(bonds[half:]) if half else self._matrix(*bonds[0])
            self.products[key] = matrix / np.abs(matrix).max()
        return self.products[key]

    def _key(self, bond):
        """Bytes of all numbers on which the matrix of a bond depends."""
        (a, b, coupled), (_, linear, couplings) = bond, self.law.form
        parts = [linear[a], linear[b], couplings[a, a], couplings[b, b], couplings[a, b] * coupled]
        return b"".join((part + 0.0).tobytes() for part in parts)

    def _matrix(self, a, b, coupled):
        u, (_, linear, couplings) = self.nodes, self.law.form
        ends = [linear[i] @ u + 0.5 * (u * (couplings[i, i] @ u)).sum(axis=0) for i in (a, b)]
        exponent = -self.beta * (0.5 * np.add.outer(*ends) + coupled * (u.T @ couplings[a, b] @ u))
        return np.exp(exponent - exponent.real.max()) * np.sqrt(np.outer(self.weights, self.weights))


def _neighbours(quadratic, count):
    """Spheres to which each of so many is coupled by the matrices of a quadratic H; ValueError if they are many."""
    size, sites = max(np.abs(each).max() for each in quadratic.values()), range(count)
    near = {a: [b for b in sites if b != a and np.abs(quadratic[a, b]).max() > 1e-12 * size] for a in sites}
    if any(len(others) > 2 for others in near.values()):
        raise ValueError("H couples a sphere to more than two others")
    return near


def _rings(near):
    """Bonds (a, b, whether they are coupled) of each ring, from the spheres that each is coupled to."""
    rings, left = [], set(near)
    while left:
        ends = [a for a in sorted(left) if len(near[a]) < 2]
        at, sites = (ends or sorted(left))[0], []
        while at is not None:
            sites.append(at)
            left.discard(at)
            at = next((b for b in near[at] if b in left), None)
        bonds = list(itertools.pairwise([*sites, sites[0]]))
        last = len(sites) - 1
        rings.append(tuple((a, b, b in near[a] and (i < last or last > 1)) for i, (a, b) in enumerate(bonds)))
    return rings
