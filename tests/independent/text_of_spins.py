"""Lattices of spins as docs/spins.md writes them, in loops over bonds and sites."""

import itertools
from functools import partial

import numpy as np
from text_of_systems import gradient

OBLIQUE = [[1, 0], [1 / 2, 3**0.5 / 2]]
CELLS = {  # sites, vectors, and bonds [site, site, cells between them]; no page says which way bonds point
    "chain": ([[0]], [[1]], [[0, 0, [1]]]),
    "ring": ([[0]], [[1]], [[0, 0, [1]]]),
    "square": ([[0, 0]], np.eye(2), [[0, 0, [1, 0]], [0, 0, [0, 1]]]),
    "triangular": ([[0, 0]], OBLIQUE, [[0, 0, [1, 0]], [0, 0, [0, 1]], [0, 0, [1, -1]]]),
    "honeycomb": ([[0, 0], [1 / 3] * 2], OBLIQUE, [[0, 1, [0, 0]], [0, 1, [-1, 0]], [0, 1, [0, -1]]]),
    "cubic": ([[0] * 3], np.eye(3), [[0, 0, [1, 0, 0]], [0, 0, [0, 1, 0]], [0, 0, [0, 0, 1]]]),
    "bcc": ([[0] * 3, [1 / 2] * 3], np.eye(3), [[0, 1, list(d)] for d in itertools.product((0, -1), repeat=3)]),
}


class Spins:
    """H = -sum over bonds (s . J s' + D . (s x s')) - sum over sites (mu B . s + K (a . s)^2 + K4/2 sum_c s_c^4)

    J and D are of all bonds or of each bond of a cell, `along` is the length of D along the bond, mu and B are of all
    sites or of each site of a cell.
    """

    def __init__(self, cell, size, opened=False, *, J=0, D=0, along=0, B=0, K=0, a=(0, 0, 1), K4=0, mu=1):
        places, vectors, bonds = CELLS.get(cell, cell) if isinstance(cell, str) else cell
        self.size, self.opened = np.array(size), opened or cell == "chain"
        cells = list(itertools.product(*map(range, size)))  # the last number changes first, which no page says
        self.sites = {site: n for n, site in enumerate((*cell, s) for cell in cells for s in range(len(places)))}
        self.mu, B = np.resize(mu, len(self.sites)), np.resize(B, (len(self.sites), 3))
        J, D, a = np.broadcast_to(J, (len(bonds), 3, 3)), np.broadcast_to(D, (len(bonds), 3)), a / np.linalg.norm(a)
        self.bonds, self.terms = [], []  # terms: sites, the place in cells (of bonds their middle), energy
        for n, (s, t, way) in enumerate(bonds):
            across = np.add(way, places[t]) - places[s]
            r = np.pad(across @ np.array(vectors), (0, 3 - len(size)))
            d = D[n] + along * r / np.linalg.norm(r)
            for cell in cells:
                to = np.add(cell, way)
                if not self.opened or ((to >= 0).all() and (to < size).all()):
                    i, j = self.sites[*cell, s], self.sites[*(to % size).tolist(), t]
                    self.bonds.append((i, j, J[n], d, across))
                    energy = partial(lambda i, j, J, d, z: -(z[i] @ J @ z[j] + d @ np.cross(z[i], z[j])), i, j, J[n], d)
                    self.terms.append(({i, j}, np.add(cell, places[s]) + across / 2, energy))
        for (*cell, s), i in self.sites.items():
            anisotropy = partial(lambda i, z: -K * (a @ z[i]) ** 2 - K4 / 2 * (z[i] ** 4).sum(), i)
            energy = partial(lambda i, f, z: f(z) - self.mu[i] * B[i] @ z[i], i, anisotropy)
            self.terms.append(({i}, np.add(cell, places[s]), energy))

    def H(self, s):
        return sum(energy(s) for _, _, energy in self.terms)

    def drift(self, s, alpha=0.0):
        """mu s' = b x s + alpha (b - (s . b) s), b = - grad H"""
        b = -sum(gradient(energy, s, sites) for sites, _, energy in self.terms)
        return (np.cross(b, s) + alpha * (b - (s * b).sum(1)[:, None] * s)) / self.mu[:, None]

    def energy_current(self, s):
        """Time derivative of the sum of x e: of two terms that share a site (x - x') {e, e'} / 2"""
        terms, total = [(sites, x, gradient(f, s, sites)) for sites, x, f in self.terms], np.zeros(len(self.size))
        for (here, x, f), (there, y, g) in itertools.product(terms, repeat=2):
            way = x - y - (0 if self.opened else np.round((x - y) / self.size) * self.size)
            total += way / 2 * sum(f[i] @ np.cross(s[i], g[i]) / self.mu[i] for i in here & there)
        return total

    def spin_current(self, s):
        """Time derivative of the sum of x mu s, (3, directions): what each bond gives to mu s, times x - x'"""
        return sum(np.outer(np.cross(J @ s[j] + np.cross(s[j], D), s[i]), -way) for i, j, J, D, way in self.bonds)

    def correlation(self, s, apart):
        """The mean of s . s' over sites that are so many cells apart along the first vector"""
        there = {i: (x + apart, *rest) for (x, *rest), i in self.sites.items()}
        there = there if self.opened else {i: (x % self.size[0], *rest) for i, (x, *rest) in there.items()}
        return np.mean([s[i] @ s[self.sites[site]] for i, site in there.items() if site in self.sites])

    def staggered(self, s):
        """The mean of mu s with the sign of the sublattice, + that of the first site"""
        sign = {0: 1}
        while len(sign) < len(s):
            for i, j, *_ in self.bonds:
                sign |= {j: -sign[i]} if i in sign else {i: -sign[j]} if j in sign else {}
        return sum(sign[i] * self.mu[i] * z for i, z in enumerate(s)) / len(s)
