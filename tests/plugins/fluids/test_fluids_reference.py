"""The second road to the model `zeitlin` (tests/fluids.py), checked by itself and against the built-in sine-Euler."""

import itertools
import math

import fluids
import numpy as np
import pytest

from spi.compiler.inlining import uncompiled
from spi.ensemble.fields import noise_field, noise_field_derivative
from spi.ensemble.protocol import casimirs, hamiltonian, structure
from spi.models import SineEuler
from spi.plugins.fluids.models import ModeNoise, Zeitlin
from spi.plugins.fluids.models.tables import modes, nearest, places

SIZES = (3, 5, 7, 9)
SIGMA = (0.5, 0.75, 1.0, 1.25)
SINE_EULER = SineEuler(SIGMA)
#: Its modes are the four noises, one after the other.
ITS_TWIN = Zeitlin(3, tuple(ModeNoise(s, modes=(m,)) for m, s in zip(modes(3), SIGMA, strict=True)))
#: Several noises of both kinds on the line of (1, 0), beside one on another line.
MIXED = (ModeNoise(0.5, modes=((-1, 0), (0, 1)), hamiltonian="linear"), ModeNoise(0.75, modes=((1, 0), (2, 0))))


def largest(difference):
    return np.max(np.abs(difference))


def near(a, b, tolerance=1e-14):
    return largest(np.asarray(a) - b) <= tolerance


def vectors(n, count, seed=1):
    """Random vectors of length 1."""
    found = np.random.default_rng(seed).standard_normal((count, n**2 - 1))
    return found / np.linalg.norm(found, axis=1, keepdims=True)


# --- N = 3: the built-in model ---------------------------------------------------------------------------------------


def test_equations_of_sine_euler():
    with uncompiled():
        for y, v in zip(vectors(3, 20), vectors(3, 20, seed=2), strict=True):
            assert near(fluids.structure(ITS_TWIN, y, v), structure(SINE_EULER, tuple(y), tuple(v)))
            assert near(fluids.hamiltonian(ITS_TWIN, y), hamiltonian(SINE_EULER, tuple(y)))
            # its C_1 has each pair of modes once
            assert near(fluids.casimirs(ITS_TWIN, y, (2, 3)) / (2, 1), casimirs(SINE_EULER, tuple(y)))


def test_noise_of_sine_euler():
    with uncompiled():
        for y in vectors(3, 20):
            fields = [noise_field(SINE_EULER, k, tuple(y)) for k in range(4)]
            assert near(fluids.noise_fields(ITS_TWIN, y), fields)
            derivatives = [noise_field_derivative(SINE_EULER, k, tuple(y), f) for k, f in enumerate(fields)]
            correction = np.square(SIGMA) / 2 @ derivatives
            assert near(fluids.ito_correction(ITS_TWIN, y), correction)
            assert np.linalg.norm(correction) > 1e-3


# --- the bracket -----------------------------------------------------------------------------------------------------


def test_printed_equations():
    """omega_m' = sum_n sin(2 pi (m x n) / N) / |n|^2 omega_{m+n} omega_{-n}, in loops, for N = 5."""
    n, (y,), omega = 5, vectors(5, 1), {(0, 0): 0.0}
    for i, (a, b) in enumerate(modes(n)):
        omega[a, b] = complex(*y[2 * i : 2 * i + 2])
        omega[-a, -b] = omega[a, b].conjugate()
    for i, m in enumerate(modes(n)):
        total = 0.0
        for k in itertools.product(range(-2, 3), repeat=2):
            if k != (0, 0):
                factor = math.sin(2 * math.pi / n * (m[0] * k[1] - m[1] * k[0])) / (k[0] ** 2 + k[1] ** 2)
                total += factor * omega[nearest(n, (m[0] + k[0], m[1] + k[1]))] * omega[-k[0], -k[1]]
        assert near(complex(*fluids.drift_field(Zeitlin(n), y)[2 * i : 2 * i + 2]), total)


def test_limit_of_many_modes():
    """omega' = u.grad omega, u = (d_2, -d_1) psi, -Laplace psi = omega: Euler's equations for the vorticity -omega.

    The sum over a + b = m of (a x b) omega_a omega_b / |a|^2, which sin(x) ~ x leaves, with an error O(N^-2).
    """
    given = {(1, 0): 0.3 + 0.1j, (1, 1): -0.2j, (0, 1): 0.5, (-1, 1): 0.1 - 0.4j}
    errors = []
    for n in (15, 31):
        omega, frequency = np.zeros((n, n), complex), np.fft.fftfreq(n, 1 / n)
        for (a, b), value in given.items():
            omega[a, b], omega[-a, -b] = value, np.conj(value)
        k1, k2 = np.meshgrid(frequency, frequency, indexing="ij")
        psi = omega / np.where(k1**2 + k2**2 == 0, 1, k1**2 + k2**2)
        u1, u2, w1, w2 = (np.fft.ifft2(1j * part) for part in (k2 * psi, -k1 * psi, k1 * omega, k2 * omega))
        expected = n**2 * fluids.state(n, np.fft.fft2(u1 * w1 + u2 * w2))
        found = fluids.drift_field(Zeitlin(n, normalisation="zeitlin"), fluids.state(n, omega))
        errors.append(largest(found - expected))
    assert near(found, 31 / (2 * math.pi) * fluids.drift_field(Zeitlin(31), fluids.state(31, omega)))
    assert errors[1] < 0.05 * largest(expected)
    assert errors[0] / errors[1] == pytest.approx((31 / 15) ** 2, rel=0.05)


# --- matrices --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("n", SIZES)
def test_matrices_and_modes(n):
    model, (y, v) = Zeitlin(n, normalisation="zeitlin"), vectors(n, 2)
    omega = fluids.table(n, y)
    W = fluids.matrix(n, omega)
    assert near(W, sum(omega[m] * fluids.clock_and_shift(n, m) for m in places(n)), 1e-13)
    assert near(W, W.conj().T) and near(np.trace(W), 0)
    assert near(fluids.table_of(n, W), omega) and near(fluids.state(n, omega), y)
    A = fluids.generator(model, v)
    assert near(A, -A.conj().T)
    assert near(fluids.state(n, fluids.table_of(n, A @ W - W @ A)), fluids.structure(model, y, v))
    # whatever the gradient: it need not be that of one line
    assert near(fluids.moved_in_matrices(model, y, 3 * v), fluids.moved_in_modes(model, y, 3 * v))
    assert not near(fluids.moved_in_matrices(model, y, 3 * v), y, 1e-2)


# --- noises and steps ------------------------------------------------------------------------------------------------


def test_processes_of_a_noise():
    """Real before imaginary parts, mode after mode; (-1,0) is another name of (1,0), which stands for both."""
    model, y = Zeitlin(5, MIXED), fluids.random_state(5)
    assert [p.mode for p in fluids.processes(model)] == [(1, 0), (1, 0), (0, 1), (0, 1), (1, 0), (2, 0)]
    assert [p.sigma for p in fluids.processes(model)] == [0.5] * 4 + [0.75] * 2
    assert fluids.noise_lines(model) == [[0, 1, 4, 5], [2, 3]]
    gradients = [p.gradient(y) for p in fluids.processes(model)]
    first, two = modes(5).index((1, 0)), math.sqrt(2)
    assert gradients[0][2 * first] == two and gradients[1][2 * first + 1] == two and gradients[3].max() == two
    assert all(np.count_nonzero(v) == count for v, count in zip(gradients, (1, 1, 1, 1, 2, 2), strict=True))
    square = modes(5).index((2, 0))
    assert near(gradients[5][2 * square :][:2], 2 * y[2 * square :][:2] / 4)


@pytest.mark.parametrize("noise", [MIXED, ITS_TWIN.noise])
def test_ito_correction_from_flows(noise):
    """(flow(d) - 2 y + flow(-d)) / d^2 tends to sigma^2 f' f."""
    model, d = Zeitlin(5 if noise is MIXED else 3, noise), 1e-3
    y, count = fluids.random_state(model.n), len(fluids.processes(model))
    flows = (fluids.noise_flow(model, [k], np.full(count, s), y) - y for k in range(count) for s in (d, -d))
    found = sum(flows) / (2 * d**2)
    assert near(found, fluids.ito_correction(model, y), 1e-6) and largest(found) > 0.01
