"""What the flows of every model must satisfy."""

import model_cases
import numpy as np
import pytest
from model_cases import MODELS_UNDER_TEST, close
from scipy.integrate import solve_ivp

from spi.checks.flow_checks import along, derivative
from spi.ensemble import fields
from spi.ensemble.protocol import (
    casimirs,
    dimension,
    drift_angle,
    drift_flow,
    drift_gradient,
    exact_flows,
    large,
    noise_angle,
    noise_flow,
    noise_gradient,
    noises,
    pieces,
    structure,
)
from spi.models import MODELS, LotkaVolterra, RigidBody, RigidBodySharedNoise
from spi.numerics.angles import ANY_ANGLES, REDUCED_ANGLES, SMALL_ANGLES, TINY_ANGLES

# fixtures
point, case = model_cases.point, model_cases.case


def flows(model):
    """(angle, flow) of every piece of H and every noise, as functions of (t, y) and (t, y, angles)."""
    for k in range(pieces(model)):
        yield (
            lambda t, y, k=k: drift_angle(model, k, t, y),
            lambda t, y, angles=ANY_ANGLES, k=k: drift_flow(model, k, t, y, angles),
        )
    for k in range(noises(model)):
        yield (
            lambda t, y, k=k: noise_angle(model, k, t, y),
            lambda t, y, angles=ANY_ANGLES, k=k: noise_flow(model, k, t, y, angles),
        )


def test_every_model_is_under_test():
    exact = {cls for cls in MODELS.values() if exact_flows(cls) and not large(cls)}
    assert {type(model) for _, model, _ in MODELS_UNDER_TEST} == exact


def test_shared_noise_has_no_exact_flow():
    """The composition of three rotations with one increment starts like the flow of Ĥ, but is none."""
    model, y = RigidBodySharedNoise((2.0, 1.0, 2 / 3), (1.0, 2.0, 3.0)), (0.5, -0.7, 0.9)
    field = fields.noise_field(model, 0, y)
    assert close(derivative(lambda s: noise_flow(model, 0, s, y, ANY_ANGLES)), field, 1e-11)
    separate = RigidBody((2.0, 1.0, 2 / 3), (1.0, 2.0, 3.0))
    assert close(field, np.sum([fields.noise_field(separate, k, y) for k in range(3)], axis=0), 1e-14)
    there_and_back = noise_flow(model, 0, -0.6, noise_flow(model, 0, 0.6, y, ANY_ANGLES), ANY_ANGLES)
    assert not close(there_and_back, y, 1e-2)


def flow_by_solver(field, t, y):
    solution = solve_ivp(lambda _, y: field(tuple(y.tolist())), (0.0, t), y, method="DOP853", rtol=1e-12, atol=1e-13)
    return solution.y[:, -1]


@pytest.mark.parametrize("t", [-0.7, 1.3])
def test_noise_flows_solve_their_equations(case, t):
    model, y = case
    for k in range(noises(model)):
        expected = flow_by_solver(lambda y, k=k: structure(model, y, noise_gradient(model, k, y)), t, y)
        assert close(noise_flow(model, k, t, y, ANY_ANGLES), expected, 1e-10)
        # Negative control: the Hamiltonian with a factor 2 too many, or time backwards, is seen.
        assert not close(noise_flow(model, k, 2.0 * t, y, ANY_ANGLES), expected, 1e-3)
        assert not close(noise_flow(model, k, -t, y, ANY_ANGLES), expected, 1e-3)


@pytest.mark.parametrize("t", [-0.7, 1.3])
def test_drift_flows_solve_their_equations(case, t):
    """The words give the gradient of the whole H only; the field of one piece is the derivative of its flow at 0."""
    model, y = case
    for k in range(pieces(model)):
        field = lambda y, k=k: derivative(lambda s: drift_flow(model, k, s, y, ANY_ANGLES))  # noqa: E731
        assert close(drift_flow(model, k, t, y, ANY_ANGLES), flow_by_solver(field, t, y), 1e-10)


def test_derivatives_of_flows_are_the_fields(case):
    model, y = case
    total = sum(derivative(lambda s, k=k: drift_flow(model, k, s, y, ANY_ANGLES)) for k in range(pieces(model)))
    field = structure(model, y, drift_gradient(model, y))
    assert close(total, field, 1e-11)
    assert close(fields.drift_field(model, y), field, 1e-15)
    for k in range(noises(model)):
        field = structure(model, y, noise_gradient(model, k, y))
        assert close(derivative(lambda s, k=k: noise_flow(model, k, s, y, ANY_ANGLES)), field, 1e-11)
        assert close(fields.noise_field(model, k, y), field, 1e-15)


@pytest.mark.parametrize(("s", "t"), [(0.3, 0.9), (-2.5, 1.0), (40.0, -17.0), (1e3, 1e3)])
def test_flows_are_groups(case, s, t):
    model, y = case
    if isinstance(model, LotkaVolterra) and abs(t) > 100.0:
        pytest.skip("its exponentials leave the range of floating numbers")
    for angle, flow in flows(model):
        # An angle a is known to a rounding of a only, hence the second part of the bound; on the way back, as many
        # digits are lost as the way there adds to the state.
        bound = 1e-14 + 4e-16 * (angle(s, y) + angle(t, y))
        there = flow(t, y)
        assert close(flow(s, there), flow(s + t, y), bound)
        assert close(flow(-t, there), y, bound * max(1.0, np.linalg.norm(there)))
        assert flow(0.0, y) == y


@pytest.mark.parametrize("target", [1e-9, 0.031, -0.031, 0.1, 0.78, -0.78, 3.0, -100.0, 12345.6, 1.5e6])
def test_angle_ranges_agree(case, target):
    """The same angle by the tiny, the small, the reduced and the library's sine."""
    model, y = case
    for angle, flow in flows(model):
        per_time = angle(1.0, y)
        if per_time == 0.0:
            continue
        t = target / per_time
        expected = flow(t, y, ANY_ANGLES)
        assert close(flow(t, y, REDUCED_ANGLES), expected, 1e-15)
        for angles, limit in ((SMALL_ANGLES, np.pi / 4), (TINY_ANGLES, 2.0**-5)):
            if abs(target) <= limit:
                assert close(flow(t, y, angles), expected, 1e-15)
            elif abs(target) > 10.0:  # negative control: beyond its range a polynomial is wrong
                assert not close(flow(t, y, angles), expected, 1e-6)


def test_flows_keep_casimirs_and_structure(case):
    """A flow is a Poisson map: D B(y) D^T = B(flow(y)), D its derivative; so every piece must be some B grad H_k."""
    model, y = case
    unit = np.eye(dimension(model))
    for _, flow in flows(model):
        after = flow(0.6, y)
        assert close(casimirs(model, after), casimirs(model, y), 1e-14)
        jacobian = np.array([derivative(lambda s, e=e, flow=flow: flow(0.6, along(y, e)(s))) for e in unit]).T
        before = np.array([structure(model, y, tuple(e)) for e in unit.tolist()]).T
        expected = np.array([structure(model, after, tuple(e)) for e in unit.tolist()]).T
        assert close(jacobian @ before @ jacobian.T, expected, 1e-9)
