"""The rigid body against the formulas that the paper prints, and sine-Euler at large angles."""

import itertools

import numpy as np
import pytest
from helpers import turned
from model_cases import MODELS_UNDER_TEST, POINTS, around_the_origin, close

from spi.ensemble import fields
from spi.ensemble.protocol import (
    casimirs,
    drift_flow,
    hamiltonian,
    noise_flow,
    structure,
)
from spi.models import RigidBody, SineEuler
from spi.numerics.angles import ANY_ANGLES, REDUCED_ANGLES

RIGID = [model for _, model, _ in MODELS_UNDER_TEST if isinstance(model, RigidBody)]


@pytest.mark.parametrize("model", RIGID)
def test_rigid_body_flows_are_the_printed_rotations(model):
    generator = np.random.default_rng(5)
    for k, t in itertools.product(range(3), (-30.0, -0.4, 0.02, 1.7)):
        y = tuple(around_the_origin(generator).tolist())
        for flow, inertia in ((drift_flow, model.inertia), (noise_flow, model.noise_inertia)):
            expected = turned(k, t * y[k] / inertia[k], y)
            assert close(flow(model, k, t, y, ANY_ANGLES), expected, 1e-14)
            # Negative control: Ĥ_k = y_k^2 / Î_k, the slip of the paper's section 2, turns twice as far.
            assert not close(flow(model, k, t, y, ANY_ANGLES), turned(k, 2.0 * t * y[k] / inertia[k], y), 1e-4)


@pytest.mark.parametrize("model", RIGID)
def test_rigid_body_equations_are_the_printed_ones(model):
    generator = np.random.default_rng(6)
    for _ in range(POINTS):
        y1, y2, y3 = y = tuple(around_the_origin(generator).tolist())
        i1, i2, i3 = model.inertia
        euler = [(1 / i3 - 1 / i2) * y3 * y2, (1 / i1 - 1 / i3) * y1 * y3, (1 / i2 - 1 / i1) * y2 * y1]
        assert close(fields.drift_field(model, y), euler, 1e-14)
        matrix = np.array([[0, -y3, y2], [y3, 0, -y1], [-y2, y1, 0]])
        assert np.array_equal(np.array([structure(model, y, tuple(e)) for e in np.eye(3).tolist()]).T, matrix)
        n1, n2, n3 = model.noise_inertia
        printed = [[0, y1 * y3 / n1, -y1 * y2 / n1], [-y2 * y3 / n2, 0, y2 * y1 / n2], [y3 * y2 / n3, -y3 * y1 / n3, 0]]
        for k in range(3):
            assert close(fields.noise_field(model, k, y), printed[k], 1e-15)
            assert not close(fields.noise_field(model, k, y), 2 * np.array(printed[k]), 1e-3)  # the slip of section 2
        assert hamiltonian(model, y) == pytest.approx(0.5 * (y1**2 / i1 + y2**2 / i2 + y3**2 / i3), rel=1e-15)
        assert casimirs(model, y) == pytest.approx((y1**2 + y2**2 + y3**2,), rel=1e-15)


@pytest.mark.parametrize("size", [1e2, 1e4, 1e6])
@pytest.mark.parametrize("angles", [REDUCED_ANGLES, ANY_ANGLES])
def test_sine_euler_keeps_both_casimirs_at_large_angles(size, angles):
    """C_2 is kept only if the three angles of a flow add to 0: roundings of their size changed it by 5e-10 at 1e6."""
    model, generator = SineEuler(), np.random.default_rng(5)
    y = tuple(size * x for x in (0.1, 0.3, 0.2, 0.3, 0.3, 0.2, 0.4, 0.1))
    before = np.array(casimirs(model, y))
    for _ in range(50):
        for k in range(4):
            y = drift_flow(model, k, 0.25 * generator.standard_normal(), y, angles)
    np.testing.assert_allclose(np.array(casimirs(model, y)) / before, 1.0, rtol=0, atol=1e-13)
