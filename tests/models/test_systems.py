"""Maxwell-Bloch, sine-Euler and Lotka-Volterra by an independent road: the paper's formulas in plain NumPy."""

import math

import numpy as np
import pytest
import system_formulas
from helpers import LANES, take_step
from model_cases import close
from scipy.linalg import expm
from system_formulas import (
    CELL,
    EULER_MARUYAMA,
    MODES,
    SPLITTING,
    components,
    line_matrix,
    lotka_volterra_fields,
    maxwell_bloch_correction,
    maxwell_bloch_fields,
    maxwell_bloch_rotation,
    maxwell_bloch_shear,
    modes,
    printed_casimirs,
    square,
    sum_formula,
)

from spi.ensemble import fields
from spi.ensemble.protocol import casimirs, drift_flow, hamiltonian, noise_flow, structure
from spi.models import LotkaVolterra, MaxwellBloch, SineEuler
from spi.numerics.angles import ANY_ANGLES

# fixtures
generator = system_formulas.generator


MAXWELL_BLOCH = MaxwellBloch((1.0, 1.0))
SINE_EULER = SineEuler((1.0, 1.0, 1.0, 1.0))
POINTS = 20


def states(generator, d):
    return [tuple(y) for y in generator.standard_normal((POINTS, d)).tolist()]


def maxwell_bloch_matrix(y):
    _, y2, y3 = y
    return np.array([[0, -y3, y2], [y3, 0, 0], [-y2, 0, 0]])


def test_maxwell_bloch_equations_are_the_printed_ones(generator):
    for y in states(generator, 3):
        field, noise = maxwell_bloch_fields(np.array(y))
        assert close(fields.drift_field(MAXWELL_BLOCH, y), field, 1e-15)
        columns = [structure(MAXWELL_BLOCH, y, tuple(e)) for e in np.eye(3).tolist()]
        assert np.array_equal(np.transpose(columns), maxwell_bloch_matrix(y))
        for k in range(2):
            f = fields.noise_field(MAXWELL_BLOCH, k, y)
            assert close(f, noise[k], 1e-15)
            assert close(
                fields.noise_field_derivative(MAXWELL_BLOCH, k, y, f), maxwell_bloch_correction(np.array(y))[k], 1e-14
            )
        y1, y2, y3 = y
        assert hamiltonian(MAXWELL_BLOCH, y) == pytest.approx(y1**2 / 2 + y3, rel=1e-14, abs=1e-15)
        assert casimirs(MAXWELL_BLOCH, y) == pytest.approx(((y2**2 + y3**2) / 2,), rel=1e-15)


@pytest.mark.parametrize("t", [-30.0, -0.4, 0.02, 1.7])
def test_maxwell_bloch_flows_are_the_printed_matrices(t, generator):
    for y in states(generator, 3):
        for k, matrix in enumerate((maxwell_bloch_rotation(y[0] * t), maxwell_bloch_shear(t))):
            for flow in (drift_flow, noise_flow):
                assert close(flow(MAXWELL_BLOCH, k, t, y, ANY_ANGLES), matrix @ y, 1e-14)
                assert not close(flow(MAXWELL_BLOCH, k, -t, y, ANY_ANGLES), matrix @ y, 1e-4)  # negative control


def printed_matrix(y):
    """B(omega) as the paper prints it; a, b, c, d for the indices (1,0), (1,1), (0,1), (-1,1), A = a* and so on."""
    omega = modes(y)
    a, b, c, d = (omega[n] for n in MODES)
    A, B, C, D = (np.conj(w) for w in (a, b, c, d))
    return (
        math.sqrt(3)
        / 2
        * np.array(
            [
                [0, d, b, c, 0, -C, -D, -B],
                [-d, 0, D, -C, c, 0, -a, A],
                [-b, -D, 0, B, d, A, 0, -a],
                [-c, C, -B, 0, b, -a, A, 0],
                [0, -c, -d, -b, 0, D, B, C],
                [C, 0, -A, a, -D, 0, d, -c],
                [D, a, 0, -A, -B, -d, 0, b],
                [B, -A, a, 0, -C, c, -b, 0],
            ]
        )
    )


def complex_gradient(v):
    """(dF/d omega, dF/d omega*) from the derivatives of F by real and imaginary parts."""
    g = 0.5 * (np.array(v[0::2]) - 1j * np.array(v[1::2]))
    return np.concatenate([g, np.conj(g)])


def test_sine_euler_field_is_the_sum_formula(generator):
    for y in states(generator, 8):
        field = fields.drift_field(SINE_EULER, y)
        assert close(field, sum_formula(y), 1e-13)
        assert not close(field, sum_formula(y, factor=2.0), 1e-2)  # negative control: H_k with 2 |k|^2
        for k, n in enumerate(MODES):
            f = fields.noise_field(SINE_EULER, k, y)
            assert close(f, sum_formula(y, among=(n, (-n[0], -n[1]))), 1e-13)
            assert not close(f, sum_formula(y, among=(n, (-n[0], -n[1])), factor=2.0), 1e-2)
            matrix = line_matrix(k, y)
            assert close(f, matrix @ y, 1e-13)
            assert close(fields.noise_field_derivative(SINE_EULER, k, y, f), matrix @ matrix @ y, 1e-13)


def test_sine_euler_structure_is_the_printed_matrix(generator):
    for y, v in zip(states(generator, 8), states(generator, 8), strict=True):
        matrix = printed_matrix(y)
        expected = matrix @ complex_gradient(v)
        assert close(expected[4:], np.conj(expected[:4]), 1e-14)
        assert close(structure(SINE_EULER, y, v), components(expected[:4]), 1e-13)
        assert not close(structure(SINE_EULER, y, v), components((matrix.T @ complex_gradient(v))[:4]), 1e-2)
        omega = modes(y)
        gradient = [np.conj(omega[n]) / square(n) for n in MODES]  # of H, by omega; by omega* its conjugates
        field = matrix @ np.concatenate([gradient, np.conj(gradient)])
        assert close(fields.drift_field(SINE_EULER, y), components(field[:4]), 1e-13)


def test_sine_euler_conserved_quantities_are_the_printed_sums(generator):
    for y in states(generator, 8):
        omega = modes(y)
        assert np.allclose(casimirs(SINE_EULER, y), printed_casimirs(y), rtol=1e-13, atol=1e-13)
        energy = sum(abs(omega[n]) ** 2 / square(n) for n in MODES)
        assert hamiltonian(SINE_EULER, y) == pytest.approx(energy, rel=1e-14)
        whole = 0.5 * sum(np.real(omega[n] * omega[-n[0], -n[1]]) / square(n) for n in CELL)
        assert energy == pytest.approx(whole, rel=1e-14)
        assert hamiltonian(SINE_EULER, y) != pytest.approx(energy / 2, rel=1e-2)  # negative control: 2 |k|^2


@pytest.mark.parametrize("t", [-1.4, -0.6, 0.01, 1.3])  # expm itself errs by 5e-13 for t = 7
def test_sine_euler_flows_are_matrix_exponentials(t, generator):
    for y in states(generator, 8):
        for k in range(4):
            expected = expm(t * line_matrix(k, y)) @ y
            for flow in (drift_flow, noise_flow):
                assert close(flow(SINE_EULER, k, t, y, ANY_ANGLES), expected, 1e-13)
                assert not close(flow(SINE_EULER, k, 0.5 * t, y, ANY_ANGLES), expected, 1e-4)  # with 2 |k|^2


def test_lotka_volterra_equations_are_the_printed_ones(generator):
    model = LotkaVolterra((0.7,))
    for y in np.exp(generator.standard_normal((POINTS, 2))).tolist():
        y1, y2 = y = tuple(y)
        field, noise = lotka_volterra_fields(np.array(y))
        assert close(fields.drift_field(model, y), field, 1e-14)
        f = fields.noise_field(model, 0, y)
        assert close(f, noise[0], 1e-15)
        assert close(fields.noise_field_derivative(model, 0, y, f), y, 1e-14)  # f is linear, and twice f is y again
        matrix = [structure(model, y, e) for e in ((1.0, 0.0), (0.0, 1.0))]
        assert np.array_equal(np.transpose(matrix), [[0, y1 * y2], [-y1 * y2, 0]])
        assert hamiltonian(model, y) == pytest.approx(y1 - math.log(y1) + y2 - 2 * math.log(y2), rel=1e-14)
        assert casimirs(model, y) == ()


@pytest.mark.parametrize("t", [-2.5, -0.3, 0.04, 1.9])
def test_lotka_volterra_flows_are_exponentials(t, generator):
    model = LotkaVolterra((0.7,))
    for y in np.exp(generator.standard_normal((POINTS, 2))).tolist():
        y1, y2 = y = tuple(y)
        expected = (y1, y2 * math.exp(t * (1 - y1))), (y1 * math.exp(t * (y2 - 2)), y2)
        for k in range(2):
            assert np.allclose(drift_flow(model, k, t, y, ANY_ANGLES), expected[k], rtol=1e-14, atol=0)
        assert np.allclose(noise_flow(model, 0, t, y, ANY_ANGLES), np.array(y) * math.exp(t), rtol=1e-14, atol=0)


@pytest.mark.parametrize("h", [0.05, 1.0, 30.0])
def test_splitting_keeps_populations_positive(h):
    """One step from anywhere is positive, whatever h and dW, as long as its exponents stay within the floats."""
    generator = np.random.default_rng(3)
    y, dW = np.exp(generator.standard_normal((2, LANES))), math.sqrt(h) * generator.standard_normal((1, LANES))
    model = LotkaVolterra((2.0,))
    with np.errstate(over="ignore", under="ignore"):
        new, _ = take_step(SPLITTING, model, h, dW, y)
        after_noise = y * np.exp(2.0 * dW)
        prey_exponent = h * (1 - after_noise[0])
        exponents = np.abs([prey_exponent, h * (after_noise[1] * np.exp(prey_exponent) - 2)])
    assert not np.any(new < 0.0) and not np.any(np.isnan(new))
    within = (exponents < 600.0).all(axis=0)
    assert np.count_nonzero(within) >= 5
    assert np.all((new[:, within] > 0.0) & np.isfinite(new[:, within]))
    explicit, _ = take_step(EULER_MARUYAMA, model, h, dW, y)  # negative control
    assert np.any(explicit < 0.0)
