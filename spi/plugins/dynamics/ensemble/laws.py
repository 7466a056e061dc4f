"""Laws of initial states on Casimir surfaces that are products of spheres."""

from typing import NamedTuple

import numpy as np

from spi.ensemble.random_states import Spheres


class Uniform(NamedTuple):
    """Uniform law on a product of spheres."""

    surface: Spheres

    @property
    def numbers(self):
        """Number of normal numbers for a state."""
        return len(self.surface.point)

    def states(self, z):
        """States (d, paths) of numbers (numbers, paths)."""
        return self.surface.onto(z)


class Gibbs(NamedTuple):
    """Law on a product of spheres whose density is proportional to exp(-E), by rejection from the uniform law.

    E, which is quadratic, is the sum of c y_i y_j over (i, j, c) and of c y_i over (i, c) in `terms`, and at least
    `least`.  A state is taken where an exponential number, (z1^2 + z2^2) / 2, is at least E - least.
    """

    surface: Spheres
    terms: tuple[tuple, ...]
    least: float

    @property
    def numbers(self):
        """Number of normal numbers for an attempt."""
        return len(self.surface.point) + 2

    def energy(self, y):
        """E of states (d, paths)."""
        total = np.zeros(y.shape[1])
        for *which, c in self.terms:
            term = c * y[which[0]]
            total += term * y[which[1]] if which[1:] else term
        return total

    def attempts(self, z):
        """States (d, paths) of numbers (numbers, paths), and which are taken."""
        y = self.surface.onto(z)
        return y, 0.5 * (z[-1] * z[-1] + z[-2] * z[-2]) >= self.energy(y) - self.least
