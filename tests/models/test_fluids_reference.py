"""The second road to the model `zeitlin` (tests/fluids.py), checked by itself and against the built-in sine-Euler."""

import itertools
import math

import fluids
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from spi.compiler.inlining import uncompiled
from spi.ensemble.fields import noise_field, noise_field_derivative
from spi.ensemble.protocol import casimirs, drift_flow, hamiltonian, noise_flow, structure
from spi.models import SineEuler
from spi.models.zeitlin import Noise, Zeitlin
from spi.models.zeitlin.tables import lines, modes, nearest, places
from spi.numerics.angles import ANY_ANGLES
from spi.schemes import SCHEMES
from spi.schemes.stages import compositions

SIZES = (3, 5, 7, 9)
SIGMA = (0.5, 0.75, 1.0, 1.25)
SINE_EULER = SineEuler(SIGMA)
#: Its modes are the four noises, one after the other.
ITS_TWIN = Zeitlin(3, tuple(Noise(s, modes=(m,)) for m, s in zip(modes(3), SIGMA, strict=True)))
#: Several noises of both kinds on the line of (1, 0), beside one on another line.
MIXED = (Noise(0.5, modes=((-1, 0), (0, 1)), hamiltonian="linear"), Noise(0.75, modes=((1, 0), (2, 0))))


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


@pytest.mark.parametrize("moved", [fluids.moved_in_modes, fluids.moved_in_matrices])
def test_flows_of_sine_euler(moved):
    assert [own for _, own in lines(3)] == [(m,) for m in modes(3)]
    with uncompiled():
        for y, (k, t) in itertools.product(vectors(3, 5), enumerate((0.6, -0.4, 0.8, 0.2))):
            of_drift = moved(ITS_TWIN, y, t * fluids.drift_gradient(ITS_TWIN, y, own=lines(3)[k][1]))
            of_noise = moved(ITS_TWIN, y, t * fluids.processes(ITS_TWIN)[k].gradient(y))
            assert near(of_drift, drift_flow(SINE_EULER, k, t, tuple(y), ANY_ANGLES))
            assert near(of_noise, noise_flow(SINE_EULER, k, t, tuple(y), ANY_ANGLES))
            assert not near(of_drift, drift_flow(SINE_EULER, k, -t, tuple(y), ANY_ANGLES), 1e-3)


def composed(flows, h, y, dW):
    """A step of the built-in model by the flows of ``schemes.stages.compositions``, with shares of the increments."""
    for part, k, share in flows:
        flow, t = (drift_flow, h) if part == "drift" else (noise_flow, SIGMA[k] * dW[k])
        y = flow(SINE_EULER, k, share * t, y, ANY_ANGLES)
    return y


def test_steps_of_sine_euler():
    (y,), h, dW = vectors(3, 1), 0.5, np.random.default_rng(3).standard_normal(4)
    steps = {
        "splitting": [fluids.lie_trotter(ITS_TWIN, h, dW, y)],
        "splitting_order2": [fluids.order_2(ITS_TWIN, h, dW, coin, y) for coin in (1, -1)],
        "splitting_symmetric": [fluids.symmetric(ITS_TWIN, h, (dW / 2, dW / 2), y)],
    }
    with uncompiled():
        for name, results in steps.items():
            for ours, (_, flows) in zip(results, compositions(SCHEMES[name].record.stages, SINE_EULER), strict=True):
                assert near(ours, composed(flows, h, tuple(y), dW))
    found = [step for results in steps.values() for step in results]
    assert all(not near(a, b, 1e-4) for a, b in itertools.combinations(found, 2))


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


@pytest.mark.parametrize("n", SIZES)
def test_bracket_is_of_lie_poisson_type(n):
    model, (y, a, b, c) = Zeitlin(n), vectors(n, 4)

    def bracket(f, g):  # of the linear functions f.y and g.y, which is linear again
        return fluids.linear_system(model, g).T @ f

    def cyclic(bracket):
        return largest(bracket(a, bracket(b, c)) + bracket(b, bracket(c, a)) + bracket(c, bracket(a, b)))

    assert near(bracket(a, b) @ y, a @ fluids.structure(model, y, b))
    assert near(bracket(a, b), -bracket(b, a))
    assert cyclic(bracket) < 1e-15 < 1e-3 < largest(bracket(a, bracket(b, c)))
    weights = np.linspace(1, 2, n**2 - 1)
    assert cyclic(lambda f, g: weights * bracket(f, g)) > 1e-4  # skew-symmetric, but no bracket


@pytest.mark.parametrize("n", SIZES)
def test_modes_on_a_line_commute(n):
    place = {m: i for m, (i, _) in places(n).items()}
    (y,), d = vectors(n, 1), n**2 - 1
    B = fluids.structure(Zeitlin(n), np.broadcast_to(y, (d, d)), np.eye(d)).T.reshape(d // 2, 2, d // 2, 2)
    assert near(B, -B.transpose(2, 3, 0, 1))
    for g, own in lines(n):
        on_line = [place[nearest(n, (k * g[0], k * g[1]))] for k in range(1, n)]
        assert not B[np.ix_(on_line, range(2), on_line, range(2))].any()
        assert {place[m] for m in own} <= set(on_line)
    assert largest(B[place[1, 0], :, place[0, 1]]) > 1e-2


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
def test_clock_and_shift_matrices(n):
    T = {m: fluids.clock_and_shift(n, m) for m in places(n)} | {(0, 0): np.eye(n)}
    for (a, b), (c, d) in itertools.islice(itertools.product(places(n), repeat=2), 0, None, 1 if n < 9 else 7):
        product = np.exp(2j * math.pi / n * (a * d - b * c)) * T[nearest(n, (a + c, b + d))]
        assert near(T[a, b] @ T[c, d], product)
    assert all(near(T[a, b].conj().T, T[-a, -b]) and near(np.trace(T[a, b]), 0) for a, b in places(n))


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


@pytest.mark.parametrize("n", SIZES)
def test_casimirs_along_flows(n):
    model, y, degrees = Zeitlin(n, MIXED if n > 3 else ()), fluids.random_state(n), range(2, n + 1)
    before, energy = fluids.casimirs(model, y, degrees), fluids.hamiltonian(model, y)
    assert before[0] == pytest.approx(1.0) and before[0] == pytest.approx(2 * y @ y)  # the mean square
    changes = []
    for k, (g, own) in enumerate(lines(n)):
        moved = fluids.moved_in_modes(model, y, 10 * fluids.drift_gradient(model, y, own))
        assert near(moved, fluids.drift_flow(model, k, 10.0, y), 1e-13)
        assert near(fluids.casimirs(model, moved, degrees), before, 1e-12)
        multiples = {nearest(n, (a * g[0], a * g[1])) for a in range(1, n)}
        on_line = np.repeat([m in multiples for m in modes(n)], 2)
        assert near(moved[on_line], y[on_line], 1e-13) and not near(moved, y, 1e-3)
        changes.append(fluids.hamiltonian(model, moved) - energy)
    assert largest(changes) > 1e-2  # the flow of a part of H does not keep H
    for numbers in fluids.noise_lines(model):
        moved = fluids.noise_flow(model, numbers, np.linspace(0.5, 1, 6), y)
        assert near(fluids.casimirs(model, moved, degrees), before, 1e-12) and not near(moved, y, 1e-2)
    scaled = fluids.casimirs(model, 1.001 * y, degrees)
    assert np.all(np.abs(scaled - before) > 1e-6 * np.abs(before))


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


@pytest.mark.parametrize("n", [5, 7])
def test_noises_of_a_line_commute(n):
    model, y, dW = Zeitlin(n, MIXED), fluids.random_state(n), np.random.default_rng(4).standard_normal(6)
    numbers, other = fluids.noise_lines(model)
    at_once = fluids.noise_flow(model, numbers, dW, y)
    for order in (numbers, numbers[::-1]):
        one_by_one = y
        for k in order:
            one_by_one = fluids.noise_flow(model, [k], dW, one_by_one)
        assert near(at_once, one_by_one, 1e-13)
    assert not near(*(fluids.noise(model, dW, y, order) for order in ([numbers, other], [other, numbers])), 1e-2)


@pytest.mark.parametrize("noise", [MIXED, ITS_TWIN.noise])
def test_ito_correction_from_flows(noise):
    """(flow(d) - 2 y + flow(-d)) / d^2 tends to sigma^2 f' f."""
    model, d = Zeitlin(5 if noise is MIXED else 3, noise), 1e-3
    y, count = fluids.random_state(model.n), len(fluids.processes(model))
    flows = (fluids.noise_flow(model, [k], np.full(count, s), y) - y for k in range(count) for s in (d, -d))
    found = sum(flows) / (2 * d**2)
    assert near(found, fluids.ito_correction(model, y), 1e-6) and largest(found) > 0.01


def test_euler_maruyama_and_splitting_agree_in_the_mean():
    y = fluids.random_state(3)

    def difference(h):
        signs = math.sqrt(h) * np.array(list(itertools.product((1, -1), repeat=4)))
        steps = (fluids.euler_maruyama, fluids.lie_trotter)
        return largest(np.subtract(*(np.mean([step(ITS_TWIN, h, dW, y) for dW in signs], axis=0) for step in steps)))

    assert difference(0.02) / difference(0.01) == pytest.approx(4, rel=0.1)
    assert near(fluids.euler_maruyama(Zeitlin(3), 0.1, np.zeros(0), y), y + 0.1 * fluids.drift_field(ITS_TWIN, y))


@pytest.mark.parametrize(
    "order, step",
    [
        (1, lambda model, h, y: fluids.lie_trotter(model, h, (), y)),
        (2, lambda model, h, y: fluids.strang(model, h, ((), ()), y)),
        (2, lambda model, h, y: fluids.symmetric(model, h, ((), ()), y)),
        (2, lambda model, h, y: fluids.order_2(model, h, (), 1, y)),
    ],
)
def test_orders_without_noise(order, step):
    model, y = Zeitlin(5), fluids.random_state(5)
    exact = solve_ivp(lambda t, y: fluids.drift_field(model, y), (0, 1), y, rtol=1e-11, atol=1e-11).y[:, -1]
    errors = []
    for count in (16, 32):
        z = y
        for _ in range(count):
            z = step(model, 1 / count, z)
        errors.append(np.linalg.norm(z - exact))
    assert math.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.1)


def test_symmetric_steps_are_their_own_reverse():
    model, y, halves = Zeitlin(5, MIXED), fluids.random_state(5), np.random.default_rng(5).standard_normal((2, 6))
    for step in (fluids.strang, fluids.symmetric):
        back = step(model, -0.3, -halves[::-1], step(model, 0.3, halves, y))
        assert near(back, y, 1e-13)
    assert not near(step(model, -0.3, -halves, step(model, 0.3, halves, y)), y, 1e-3)
