"""What gradients, structure and derived fields of every model must satisfy."""

import model_cases
import numpy as np
import pytest
from model_cases import close

from spi.checks.flow_checks import along, derivative
from spi.ensemble import fields
from spi.ensemble.protocol import (
    casimirs,
    dimension,
    drift_gradient,
    drift_hessian,
    hamiltonian,
    noise_gradient,
    noise_hessian,
    noise_indices,
    noise_structure,
    noise_structure_derivative,
    noises,
    strengths,
    structure,
    structure_derivative,
)
from spi.models import SineEuler

# fixtures
point, case = model_cases.point, model_cases.case


def vectors(model, count, seed=11):
    return [tuple(v) for v in np.random.default_rng(seed).standard_normal((count, dimension(model))).tolist()]


def gradient_of(f, y):
    """The gradient at y of a scalar function, by differences."""
    return np.array([derivative(lambda s, e=e: f(along(y, e)(s))) for e in np.eye(len(y))])


def test_gradient_of_the_hamiltonian(case):
    model, y = case
    assert close(drift_gradient(model, y), gradient_of(lambda y: hamiltonian(model, y), y), 1e-11)


def test_hessian_products(case):
    model, y = case
    u, v = vectors(model, 2)
    gradients = [(lambda y: drift_gradient(model, y), lambda y, v: drift_hessian(model, y, v))]
    for k in range(noises(model)):
        gradients.append((lambda y, k=k: noise_gradient(model, k, y), lambda y, v, k=k: noise_hessian(model, k, y, v)))
    for gradient, hessian in gradients:
        assert close(hessian(y, v), derivative(lambda s, g=gradient: g(along(y, v)(s))), 1e-11)
        # A field is a gradient only if its derivative is symmetric.
        assert np.dot(u, hessian(y, v)) == pytest.approx(np.dot(v, hessian(y, u)), rel=1e-14, abs=1e-14)


def test_structure_is_skew_and_satisfies_jacobi(case):
    model, y = case
    u, v, w = vectors(model, 3)
    size = np.linalg.norm(structure(model, y, v)) * np.linalg.norm(w)
    assert abs(np.dot(v, structure(model, y, w)) + np.dot(w, structure(model, y, v))) <= 1e-14 * size
    changed = derivative(lambda s: structure(model, along(y, u)(s), v))
    assert close(structure_derivative(model, y, u, v), changed, 1e-11)
    terms = [
        np.dot(a, structure_derivative(model, y, structure(model, y, c), b))
        for a, b, c in ((u, v, w), (v, w, u), (w, u, v))
    ]
    assert abs(sum(terms)) <= 1e-14 * sum(np.abs(terms))


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


def test_casimirs_are_in_the_kernel_of_the_structure(case):
    model, y = case
    for c in range(len(casimirs(model, y))):
        gradient = gradient_of(lambda y, c=c: casimirs(model, y)[c], y)
        assert np.linalg.norm(gradient) > 0.1
        assert np.linalg.norm(structure(model, y, tuple(gradient))) <= 1e-11 * np.linalg.norm(gradient)


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
