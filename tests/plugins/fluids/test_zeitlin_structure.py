"""What steps of the model `zeitlin` keep, Poisson structure, Casimirs and energy, and to what they converge."""

import fluids
import numpy as np
import pytest
from helpers import COMPILED
from zeitlin_cases import (
    DRIFT_FLOW,
    NOISE_FLOW,
    SIZES,
    STEPPERS,
    apart,
    casimirs_of,
    energy_of,
    increments,
    moved,
    noisy,
    states,
    take,
)

from spi.checks.model_checks import STENCIL
from spi.numerics.rng import LANES
from spi.plugins.fluids.models import ModeNoise, Zeitlin
from spi.plugins.fluids.models.kernels import tables
from spi.plugins.fluids.models.tables import lines
from spi.schemes import SCHEMES, strong_order

SPLITTINGS = [name for name in STEPPERS if name != "euler_maruyama"]


def jacobian(f, y, delta=0.005):
    """D f(y) for a function of LANES states, by central differences of eighth order."""
    d, shifts = len(y), delta * np.array([*STENCIL, *(-j for j in STENCIL)])
    around = (y + shifts[:, np.newaxis, np.newaxis] * np.eye(d)).reshape(-1, d)
    rest = -len(around) % LANES
    around = np.concatenate([around, np.repeat(y[np.newaxis], rest, axis=0)])
    values = np.concatenate([f(around[i : i + LANES]) for i in range(0, len(around), LANES)])
    values = values[: len(values) - rest].reshape(len(shifts), d, d)
    weights = np.array([*STENCIL.values(), *(-c for c in STENCIL.values())]) / delta
    return np.tensordot(weights, values, 1).T


def structure_matrix(model, y):
    """B(y)."""
    return fluids.structure(model, np.broadcast_to(y, (len(y), len(y))), np.eye(len(y))).T


def poisson_defect(name, model, coin):
    """The largest entry of D B(y) D^T - B(Phi(y)), relative to that of B, for a step with noise of the size of y."""
    h, y, dW = 0.5, fluids.random_state(model.n), increments(model, 0.5, 1, 1)

    def step(states):
        return take(name, model, h, np.repeat(dW, len(states), axis=3), states, coin).states

    D, new = jacobian(step, y), step(y[np.newaxis])[0]
    assert apart(new, y) > 0.1
    B = structure_matrix(model, new)
    return np.max(np.abs(D @ structure_matrix(model, y) @ D.T - B)) / np.max(np.abs(B))


@pytest.mark.skipif(not COMPILED, reason="thousands of steps")
@pytest.mark.parametrize("n", SIZES)
def test_poisson_maps(n):
    """All splittings, with coins on both sides; Euler-Maruyama is none."""
    for name in SPLITTINGS if n < 9 else SPLITTINGS[:2]:
        for coin in (1, -1) if name == "splitting_order2" else (1,):
            assert poisson_defect(name, noisy(n), coin) < 1e-9
    assert poisson_defect("euler_maruyama", noisy(n), 1) > 1e-3


@pytest.mark.parametrize("n", SIZES)
def test_flows_are_groups(n):
    """flow(s) flow(t) = flow(s + t), of all lines and groups, and of negative times as well."""
    model, y = noisy(n), states(n, 1)
    times = np.random.default_rng(6).standard_normal((2, tables(model).m))
    flows = [(DRIFT_FLOW, k, 0.9, -0.4) for k in range(len(lines(n)))]
    flows += [(NOISE_FLOW, group, *times) for group in range(len(tables(model).noise.line))]
    for what, k, s, t in flows:
        first, _ = moved(model, what, k, s, y)
        one_by_one, at_once = moved(model, what, k, t, first)[0], moved(model, what, k, s + t, y)[0]
        assert apart(one_by_one, at_once) < 1e-14
        assert apart(moved(model, what, k, -s, first)[0], y) < 1e-14 < 1e-4 < apart(first, y)


@pytest.mark.parametrize("n", (3, *SIZES))
def test_invariants_by_the_kernel(n):
    """C_2, C_3, ... as powers of a matrix, and H as a sum; as many Casimirs as are asked for and there are."""
    y = fluids.random_state(n)
    assert energy_of(Zeitlin(n), y) == pytest.approx(fluids.hamiltonian(Zeitlin(n), y), rel=1e-14)
    for watched in (1, 4, 6):
        found = casimirs_of(Zeitlin(n, casimirs_watched=watched), y)
        degrees = range(2, 2 + min(watched, n - 1))
        theirs = fluids.casimirs(Zeitlin(n), y, degrees)
        assert len(found) == len(degrees)
        assert np.allclose(found, theirs, rtol=0, atol=1e-13 * size_of_casimirs(n, y, degrees))
    scaled = casimirs_of(Zeitlin(n), 1.001 * y)
    assert np.all(np.abs(scaled / casimirs_of(Zeitlin(n), y) - 1) > 1e-3)


def size_of_casimirs(n, y, degrees):
    """tr |W|^k / N: odd Casimirs are sums of terms that nearly cancel."""
    eigenvalues = np.linalg.eigvalsh(fluids.matrix(n, fluids.table(n, y)))
    return np.array([np.mean(np.abs(eigenvalues) ** k) for k in degrees])


def casimir_changes(name, steps, paths=16):
    """(C - C(y_0)) / tr |W|^k for C_2 to C_5 of paths at N = 15, [path, k]."""
    model, y, degrees = noisy(15), fluids.random_state(15), (2, 3, 4, 5)
    dW = increments(model, 0.01, steps, paths)
    new = take(name, model, 0.01, dW, np.repeat(y[np.newaxis], paths, axis=0)).states
    assert np.all(np.linalg.norm(new - y, axis=1) > 0.1 if steps > 1000 else True)
    change = fluids.casimirs(model, new, degrees) - fluids.casimirs(model, y, degrees)
    return change / size_of_casimirs(15, y, degrees)


@pytest.mark.skipif(not COMPILED, reason="millions of flows")
def test_casimirs_walk_without_bias():
    """Ten times as far a bias of 1e-17 a step would show; Euler-Maruyama loses them at once."""
    changes = casimir_changes("splitting", 2000)
    assert np.max(np.abs(changes)) < 5e-14
    standard_error = changes.std(axis=0, ddof=1) / np.sqrt(len(changes))
    assert np.all(np.abs(changes.mean(axis=0)) < 4 * standard_error)
    assert np.all(np.abs(casimir_changes("euler_maruyama", 20)).mean(axis=0) > 1e-3)


def energy_error(name, h, time, every=25.0):
    """The largest |H / H(y_0) - 1| at multiples of `every`, without noise at N = 15, in both halves of the time."""
    model, y = Zeitlin(15), states(15, 1)
    steps, first, errors = round(every / h), energy_of(model, y[0]), []
    for _ in range(round(time / every)):
        y = take(name, model, h, np.zeros((steps, 2, 0, 1)), y).states
        errors.append(abs(energy_of(model, y[0]) / first - 1))
    half = len(errors) // 2
    return max(errors[:half]), max(errors[half:])


@pytest.mark.share(1)
@pytest.mark.skipif(not COMPILED, reason="thousands of steps")
@pytest.mark.parametrize(("name", "order"), [("splitting", 1), ("splitting_symmetric", 2)])
def test_energy_without_noise(name, order):
    """The error is of order h^p and does not grow with time, over 10^4 steps of the largest h."""
    coarse, fine = energy_error(name, 0.25, 2500.0), energy_error(name, 0.0625, 625.0)
    assert np.log2(max(coarse) / max(fine)) / 2 == pytest.approx(order, abs=0.3)
    early, late = coarse
    assert late < 1.5 * early < 0.1  # an error that grows like time would be twice as large


def ends(name, model, fine, count):
    """The states at time 1 after `count` steps, from increments over `len(fine)` intervals."""
    m, paths = fine.shape[1:]
    halves = fine.reshape(count, 2, -1, m, paths).sum(axis=2)
    y = np.repeat(fluids.random_state(model.n)[np.newaxis], paths, axis=0)
    return take(name, model, 1 / count, halves, y).states


def fine_increments(model, count, paths=LANES):
    return increments(model, 1 / count, count, paths).reshape(2 * count, -1, paths)


def slope(distances):
    """The fitted order from distances at steps that are halved each time."""
    return -np.polyfit(np.arange(len(distances)), np.log2(distances), 1)[0]


def rms(difference):
    return np.sqrt(np.mean(np.sum(difference**2, axis=1)))


#: (noise, strong order): one; the two of a linear noise and two of a line, all of which commute; and several lines.
ORDERS = [
    ((ModeNoise(1.0, modes=((1, 0),)),), 1.0),
    ((ModeNoise(0.5, modes=((1, 0),), hamiltonian="linear"), ModeNoise(1.0, modes=((2, 0),))), 1.0),
    ((ModeNoise(1.0, modes=((1, 0), (0, 1), (1, 1))),), 0.5),
]


@pytest.mark.skipif(not COMPILED, reason="thousands of steps")
@pytest.mark.parametrize(("noise", "order"), ORDERS)
def test_strong_order(noise, order):
    model = Zeitlin(5, noise)
    assert strong_order(SCHEMES["splitting"], model, states(5, 1)[0]) == order
    fine = fine_increments(model, 2**10)
    exact = ends("splitting", model, fine, 2**10)
    found = slope([rms(ends("splitting", model, fine, 2**p) - exact) for p in (4, 5, 6, 7)])
    assert found == pytest.approx(order, abs=0.15)


@pytest.mark.skipif(not COMPILED, reason="thousands of steps")
def test_the_limit_is_that_of_euler_maruyama():
    """On the same Brownian paths both tend to the same, with order 1/2, for noises that do not commute."""
    model = Zeitlin(5, ORDERS[2][0])
    fine = fine_increments(model, 2**12)
    distances = [
        rms(ends("splitting", model, fine, 2**p) - ends("euler_maruyama", model, fine, 2**p)) for p in (6, 8, 10, 12)
    ]
    assert slope(distances) / 2 == pytest.approx(0.5, abs=0.1)
    assert distances[-1] < 0.05 * rms(ends("splitting", model, -fine, 2**6) - ends("splitting", model, fine, 2**6))
