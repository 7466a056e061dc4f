"""The dimension of the set of states that noises and drift reach on a Casimir surface."""

import numpy as np
import pytest
from helpers import INITIAL, RIGID_BODY
from yaml_cases import made

from spi.ensemble.protocol import hamiltonian
from spi.plugins.dynamics.exact.gibbs import law_of
from spi.plugins.dynamics.exact.reach import reach

POINT = (0.6, 0.48, 0.64)
PAIR = "{{variables: [q, p, x, u], bracket: {{q p: 1, x u: 1}}, hamiltonian: '{}', noises: [q]}}"
SPHERE = "{{algebra: so(3), hamiltonian: '{}', noises: [{}]}}"
SYMMETRIC = "y1^2/4 + y2^2/4 + y3^2/2"
RING = (
    "{algebra: so(3)^n, sizes: {n: 2}, variables: ['x(i), y(i), z(i) for i = 1..n'],"
    " hamiltonian: 'x(1)*x(2) + y(1)*y(2) + z(1)*z(2)', noises: [z(1), z(2)]}"
)


@pytest.mark.parametrize(
    ("text", "point", "found"),
    [
        (SPHERE.format(SYMMETRIC, "y3"), POINT, (1, 2)),
        (SPHERE.format(SYMMETRIC, "y1"), POINT, (2, 2)),
        (SPHERE.format("y1^2/4 + y2^2/2 + y3^2", "y3"), POINT, (2, 2)),
        (SPHERE.format("(y1 + 2*y2)^2", "y1 + 2*y2"), POINT, (1, 2)),
        (SPHERE.format("y1^2/4 + y2^2/2 + y3^2", "y1^2/4 + y2^2/2 + y3^2"), POINT, (1, 2)),
        (RING, (*POINT, 0.0, 0.8, 0.6), (3, 4)),
        *((PAIR.format("p^2/2 + q^2/2 + (q - x)^2/2 + u^2/2"), (s, 0.0, 0.0, 0.0), (4, 4)) for s in (0.0, 1e-12, 1e3)),
        *((PAIR.format("p^2/2 + q^2/2 + x^2/2 + u^2/2"), (s, 0.0, s, 0.0), (2, 4)) for s in (0.0, 1.0)),
    ],
)
def test_dimensions_that_noises_reach(text, point, found):
    """In the fourth and fifth H alone moves, and is conserved; in the ring the sum over the spins.

    Of two oscillators noise moves both where they are coupled, also from rest; otherwise they move the first one only.
    """
    assert reach(made(text).record, point) == found


def test_noises_that_are_off_move_nothing():
    assert reach(RIGID_BODY, INITIAL) == (2, 2)
    assert reach(RIGID_BODY._replace(inertia=(2.0, 2.0, 1.0), sigma=(None, None, 1.0)), INITIAL) == (1, 2)


@pytest.mark.parametrize("text", ["exp(y2)", "cos(y2)", "abs(y2) + y3^2"])
def test_formulas_that_take_numbers_only(text):
    """Elementary functions and choices: noises reach the whole sphere, and the Gibbs law is that of quadrature."""
    model = made(SPHERE.format(text, "y1, y3")).record
    assert reach(model, POINT) == (2, 2)
    states = np.array([[0.6, 0.3], [0.48, -0.2], [0.64, 0.5]])
    energy = law_of(model, POINT, 0.5).energy(states)
    np.testing.assert_allclose(energy, [hamiltonian(model, tuple(y)) for y in states.T.tolist()], rtol=1e-14)
