"""Casimir surfaces of systems in YAML that are products of spheres, or of an ellipsoid and constants."""

import numpy as np
from yaml_cases import made

from spi.ensemble.protocol import casimirs
from spi.exact.surfaces import spheres

SPINS = made("{algebra: so(3)^2, hamiltonian: y1*y4 + y2*y5 + y3*y6 + y1^2 - y6, noises: [y3]}").record
SQUEEZED = made("{variables: [a, b, c, d], bracket: {a b: 4*c, b c: a, c a: b}, hamiltonian: a^2 + d, noises: [b]}")


def test_two_spheres():
    assert spheres(SPINS, (1.0, 0.0, 0.0, 0.0, 0.0, 2.0)).lengths == (1.0, 1.0, 1.0, 2.0, 2.0, 2.0)


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
