"""What the flows and derived fields of every model must satisfy beside the generic checks (tests/checks)."""

import model_cases
import numpy as np
import pytest
from model_cases import MODELS_UNDER_TEST, close

from spi.checks.model_checks import along, derivative
from spi.ensemble import fields
from spi.ensemble.protocol import (
    dimension,
    drift_angle,
    drift_flow,
    exact_flows,
    large,
    noise_angle,
    noise_flow,
    noise_gradient,
    noise_hessian,
    noise_indices,
    noise_structure,
    noise_structure_derivative,
    noises,
    pieces,
    strengths,
    structure,
    structure_derivative,
)
from spi.models import MODELS, LotkaVolterra, RigidBody, RigidBodySharedNoise, SineEuler
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


def vectors(model, count, seed=11):
    return [tuple(v) for v in np.random.default_rng(seed).standard_normal((count, dimension(model))).tolist()]


def test_ito_correction(case):
    """h/2 sum_k sigma_k^2 f_k' f_k, with f_k' f_k the derivative of f_k along itself, by differences."""
    model, y = case
    h = 0.37
    correction = 0.0
    for k in noise_indices(model):
        direction = fields.noise_field(model, k, y)
        changed = derivative(lambda s, k=k, v=direction: fields.noise_field(model, k, along(y, v)(s)))
        assert close(fields.noise_field_derivative(model, k, y, direction), changed, 1e-11)
        correction = correction + strengths(model)[k] ** 2 * changed
    got = np.array(fields.add_ito_correction(model, y, h, y)) - y
    assert close(got, 0.5 * h * correction, 1e-11)
    # Negative controls: without the 1/2, with the other sign, without the correction; the noise of sigma_3 of
    # Maxwell-Bloch has none.
    for wrong in (1.0, -0.5, 0.0) if np.linalg.norm(correction) > 1e-6 else ():
        assert not close(got, wrong * h * correction, 1e-3)


def test_field_of_a_step_and_its_derivative(case):
    """F = B grad(h H + sum_k sigma_k dW_k Ĥ_k) and F', of which the implicit midpoint rule is made."""
    model, y = case
    h, lane = 0.21, 5
    dW = np.random.default_rng(3).standard_normal(noises(model) * fields.LANES)
    (v,) = vectors(model, 1)
    expected = h * np.array(fields.drift_field(model, y))
    for k in noise_indices(model):
        dWk = dW[k * fields.LANES + lane]
        expected += strengths(model)[k] * dWk * np.array(fields.noise_field(model, k, y))
    assert close(fields.step_field(model, h, dW, lane, y), expected, 1e-14)
    explicit = np.array(fields.add_noise_fields(model, y, dW, lane, y)) - y
    assert close(explicit + h * np.array(fields.drift_field(model, y)), expected, 1e-14)
    gradient = fields.step_gradient(model, h, dW, lane, y)
    changed = derivative(lambda s: fields.step_field(model, h, dW, lane, along(y, v)(s)))
    assert close(fields.step_field_derivative(model, h, dW, lane, y, gradient, v), changed, 1e-11)


def test_structure_for_gradients_of_noise(case):
    """B(y) v may leave out only what vanishes for every v that is 0 where grad Ĥ_k is 0 wherever it is taken."""
    model, y = case
    generator, somewhere = np.random.default_rng(13), [tuple(np.abs(v)) for v in vectors(model, 5, seed=12)]
    (u,) = vectors(model, 1)
    for k in range(noises(model)):
        gradients = np.array([noise_gradient(model, k, z) for z in somewhere])
        assert gradients.any()
        v = tuple((generator.standard_normal(dimension(model)) * gradients.any(axis=0)).tolist())
        assert close(noise_structure(model, k, y, v), structure(model, y, v), 1e-15)
        assert close(noise_structure_derivative(model, k, y, u, v), structure_derivative(model, y, u, v), 1e-15)
        for z in somewhere:  # and grad Ĥ_k is among these v, as is its derivative
            assert np.array_equal(np.array(noise_hessian(model, k, z, u)) * ~gradients.any(axis=0), np.zeros(len(y)))
    if isinstance(model, SineEuler):  # negative control: for other v it is something else
        assert not close(noise_structure(model, 0, y, u), structure(model, y, u), 1e-2)
