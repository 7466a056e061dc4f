"""Laws of initial states on spheres: against quadrature, and each path its own."""

import numpy as np
import pytest
from helpers import INITIAL, RIGID_BODY
from scipy import stats
from test_random_states import BODY, check_alone, check_mean, drawn
from yaml_cases import made

from spi.ensemble.protocol import hamiltonian
from spi.ensemble.random_states import Gaussian, Spheres
from spi.exact.surfaces import spheres
from spi.plugins.dynamics.ensemble.laws import Gibbs, Uniform
from spi.plugins.dynamics.exact.energies import least_on, quadratic

TWO = Spheres((0.0, 0.0, 1.0, 0.0, 0.0, 1.0), ((0, 1, 2), (3, 4, 5)), (1.0,) * 6)
SPINS = made("{algebra: so(3)^2, hamiltonian: y1*y4 + y2*y5 + y3*y6 + y1^2 - y6, noises: [y3]}").record


def gibbs(surface, b, matrix):
    terms = [(i, c) for i, c in enumerate(b.tolist())]
    terms += [(i, j, 0.5 * matrix[i, j]) for i, j in np.argwhere(matrix).tolist()]
    return Gibbs(surface, tuple(terms), least_on(surface, b, matrix))


def of_body(temperature):
    _, b, matrix = quadratic(RIGID_BODY)
    return gibbs(BODY, b / temperature, matrix / temperature)


def test_uniform_on_a_sphere():
    """The height and the angle are uniform and independent; around another mean they are not."""
    y = drawn(Uniform(BODY))
    np.testing.assert_allclose((y**2).sum(axis=0), 1.0, rtol=1e-15)
    place = np.stack([(y[2] + 1) / 2, np.arctan2(y[1], y[0]) / (2 * np.pi) + 0.5])
    counts, _, _ = np.histogram2d(*place, bins=8, range=[[0, 1], [0, 1]])
    assert stats.chisquare(counts.ravel()).pvalue > 1e-3
    crooked = Gaussian((0.0, 0.0, 0.2), tuple((i, i, 1.0) for i in range(3)), BODY)
    counts, _ = np.histogram(drawn(crooked)[2], bins=8, range=(-1, 1))
    assert stats.chisquare(counts).pvalue < 1e-9


@pytest.mark.parametrize("temperature", [0.1, -0.1])
def test_gibbs_on_a_sphere_against_quadrature(temperature):
    """Moments of the components, at a negative temperature too, where the axis of most energy is the likeliest."""
    y = drawn(of_body(temperature))
    nodes, weights = np.polynomial.legendre.leggauss(60)
    angle = 2 * np.pi * np.arange(120) / 120
    height, angle = np.meshgrid(nodes, angle, indexing="ij")
    at = np.stack([np.sqrt(1 - height**2) * np.cos(angle), np.sqrt(1 - height**2) * np.sin(angle), height])
    energy = (at**2 / np.reshape(RIGID_BODY.inertia, (3, 1, 1)) / 2).sum(axis=0)
    density = weights[:, np.newaxis] * np.exp(-(energy - energy.min() * (temperature > 0)) / temperature)
    check_mean(y**2, (at**2 * density).sum(axis=(1, 2)) / density.sum())
    check_mean(y, 0.0)


def test_two_spins_of_gibbs():
    """With H = -s1.s2 / T the angle between them has the mean cosine of Langevin, coth(1/T) - T."""
    matrix = np.zeros((6, 6))
    matrix[[0, 1, 2, 3, 4, 5], [3, 4, 5, 0, 1, 2]] = -2.0
    y = drawn(gibbs(TWO, np.zeros(6), matrix))
    check_mean((y[:3] * y[3:]).sum(axis=0), 1 / np.tanh(2.0) - 0.5)


@pytest.mark.parametrize("law", [Uniform(BODY), of_body(0.05)])
def test_the_state_of_a_path_depends_on_nothing_else(law):
    """Nor on other blocks; other seeds and streams give others."""
    check_alone(law)


@pytest.mark.parametrize("seed", range(4))
def test_the_least_energy_is_a_bound(seed):
    """And on one sphere the minimum, with a field and without one."""
    rng = np.random.default_rng(seed)
    x = rng.standard_normal((6, 20000))
    for surface, components in ((spheres(RIGID_BODY, INITIAL), 3), (spheres(SPINS, (1.0,) * 6), 6)):
        half = rng.standard_normal((components, components))
        for b in (rng.standard_normal(components), np.zeros(components)):
            y, matrix = surface.onto(x[:components]), half + half.T
            found = b @ y + 0.5 * (y * (matrix @ y)).sum(axis=0)
            least = least_on(surface, b, matrix)
            assert least <= found.min()
            assert components == 6 or found.min() - least < 0.01 * np.ptp(found)


def test_quadratic_hamiltonians():
    c, b, matrix = quadratic(SPINS)
    y = np.random.default_rng(0).standard_normal(6)
    np.testing.assert_allclose(c + b @ y + 0.5 * y @ matrix @ y, hamiltonian(SPINS, tuple(y)))
    assert quadratic(made("{algebra: so(3), hamiltonian: y1^4, noises: [y3]}").record) is None
