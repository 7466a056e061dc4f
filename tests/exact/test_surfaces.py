"""Casimir surfaces that are products of spheres, and the least energy on them."""

import numpy as np
import pytest
from helpers import INITIAL, RIGID_BODY
from yaml_cases import made

from spi.ensemble.protocol import casimirs, hamiltonian
from spi.exact.surfaces import least_on, quadratic, spheres
from spi.models import MaxwellBloch, SineEuler

SPINS = made("{algebra: so(3)^2, hamiltonian: y1*y4 + y2*y5 + y3*y6 + y1^2 - y6, noises: [y3]}").record
SQUEEZED = made("{variables: [a, b, c, d], bracket: {a b: 4*c, b c: a, c a: b}, hamiltonian: a^2 + d, noises: [b]}")


def test_spheres_of_models():
    assert spheres(RIGID_BODY, INITIAL).triples == ((0, 1, 2),)
    np.testing.assert_allclose(spheres(RIGID_BODY, (0.0, 3.0, 4.0)).lengths, 5.0)
    assert spheres(SPINS, (1.0, 0.0, 0.0, 0.0, 0.0, 2.0)).lengths == (1.0, 1.0, 1.0, 2.0, 2.0, 2.0)
    assert spheres(MaxwellBloch(), (1.0, 0.0, 1.0)) is None
    assert spheres(SineEuler(), tuple(np.ones(8))) is None


def test_an_ellipsoid_with_a_constant_component():
    """The states that are drawn have the Casimir function of the point, and a component that nothing moves."""
    model, point = SQUEEZED.record, (1.0, 2.0, 0.5, 7.0)
    surface = spheres(model, point)
    x = np.random.default_rng(1).standard_normal((4, 100))
    states = surface.onto(x)
    assert surface.triples == ((0, 1, 2),) and np.array_equal(states[3], np.full(100, 7.0))
    of_point = casimirs(model, point)
    for state in states.T:
        np.testing.assert_allclose(casimirs(model, tuple(state)), of_point, rtol=1e-12)


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
