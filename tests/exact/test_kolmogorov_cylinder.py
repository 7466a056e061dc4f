"""Expectations without sampling for the Maxwell-Bloch system, against roads that share nothing with them."""

from functools import cache
from itertools import product

import numpy as np
import pytest
from helpers import composed
from scipy.integrate import solve_ivp

from spi.exact.kolmogorov import cylinder, grids
from spi.exact.kolmogorov.cylinder import expectations
from spi.models.maxwell_bloch import MaxwellBloch

INITIAL = (0.4, -0.6, 0.7)
DRIFT = (("drift", 0, 1.0), ("drift", 1, 1.0))
NOISE = (("noise", 0, 1.0), ("noise", 1, 1.0))
HALF = (("drift", 0, 0.25), ("drift", 1, 0.5), ("drift", 0, 0.25))
LIE_TROTTER = ((1.0, NOISE + DRIFT),)
EXCHANGED = ((1.0, DRIFT + NOISE),)
ORDER_2 = ((0.5, HALF + NOISE + HALF), (0.5, HALF + NOISE[::-1] + HALF))
SCHEMES = {"lie_trotter": LIE_TROTTER, "exchanged": EXCHANGED, "order_2": ORDER_2}


@pytest.fixture(scope="module", autouse=True)
def _each_grid_once():
    """The tests ask for the same limits with several schemes; a grid knows what was computed on it."""
    with pytest.MonkeyPatch.context() as patch:
        for module in (cylinder, grids):
            patch.setattr(module, "Grid", cache(grids.Grid))
        yield


def waves(y):
    return np.sin(2 * np.pi * y).sum(axis=0)


def slow_wave(y):
    return np.cos(y[0]) + y[1] * y[2]


def by_quadrature(model, compositions, initial, h, steps, phi, nodes):
    """E phi(y_N) by Gauss-Hermite quadrature in all increments."""
    x, weights = np.polynomial.hermite_e.hermegauss(nodes)
    weights = weights / weights.sum()
    one, other = np.array(list(product(range(nodes), repeat=2))).T
    increments, weights = np.sqrt(h) * x[[one, other]], weights[one] * weights[other]
    p, y = np.ones(1), np.array(initial)[:, None]
    for _ in range(steps):
        states, shares = [], []
        for probability, c in compositions:
            y_next = composed(model, c, h, tuple(y[:, :, None]), increments[:, None, :])
            states.append(np.stack(np.broadcast_arrays(*y_next, weights)[:3]).reshape(3, -1))
            shares.append(probability * np.outer(p, weights).ravel())
        p, y = np.concatenate(shares), np.concatenate(states, axis=1)
    return np.dot(p, phi(y))


@cache
def both_noises(name, accuracy=1e-7):
    steps = tuple(2.0**-k for k in (5, 6, 7, 8, 12))
    return expectations(MaxwellBloch(sigma=(1.0, 1.0)), SCHEMES[name], INITIAL, 0.5, steps, (waves,), accuracy)


@pytest.mark.parametrize("name", SCHEMES)
def test_without_noise_it_is_an_ordinary_differential_equation(name):
    model = MaxwellBloch(sigma=(None, None))
    steps = (1.0, 2.0**-3, 1 / 20, 2.0**-5, 2.0**-9)
    found = expectations(model, SCHEMES[name], INITIAL, 1.0, steps, (waves, slow_wave), 1e-8)

    def right_hand_side(_, y):
        return y[1], y[2] * y[0], -y[1] * y[0]

    exact = np.array(solve_ivp(right_hand_side, (0, 1), INITIAL, "DOP853", rtol=1e-13, atol=1e-13).y[:, -1:])
    limit = np.array([phi(exact)[0] for phi in (waves, slow_wave)])
    assert np.all(abs(found.limit - limit) < found.limit_bound + 1e-12) and np.all(found.limit_bound < 1e-7)
    for s, h in enumerate(steps):
        y = INITIAL
        for _ in range(round(1 / h)):
            y = composed(model, SCHEMES[name][0][1], h, y, None)
        value = np.array([phi(np.array(y)[:, None])[0] for phi in (waves, slow_wave)])
        assert np.all(abs(found.value[:, s] - value) < found.value_bound[:, s] + 1e-12), h
        assert np.all(abs(found.weak_error[:, s] - (value - limit)) < found.weak_error_bound[:, s] + 1e-12), h
        assert np.all(found.value_bound[:, s] < 1e-6) and np.all(
            found.weak_error_bound[:, s] < 0.02 * abs(value - limit)
        )


@pytest.mark.share
@pytest.mark.parametrize("sigma", [(0.8, 0.6), (0.5, None), (None, 0.7)])
@pytest.mark.parametrize("name", SCHEMES)
def test_one_step(name, sigma):
    """h = T, against quadrature; the reversed composition is another scheme."""
    model, initial, h = MaxwellBloch(sigma=sigma), (-0.3, 0.8, -0.5), 0.25
    found = expectations(model, SCHEMES[name], initial, h, (h,), (waves, slow_wave), 1e-9)
    for f, phi in enumerate((waves, slow_wave)):
        value = by_quadrature(model, SCHEMES[name], initial, h, 1, phi, 60)
        assert abs(found.value[f, 0] - value) < found.value_bound[f, 0] + 1e-13
        assert found.value_bound[f, 0] < 1e-7
        if name != "order_2":
            reverse = tuple((p, c[::-1]) for p, c in SCHEMES[name])
            assert abs(by_quadrature(model, reverse, initial, h, 1, phi, 60) - value) > 1e3 * found.value_bound[f, 0]


@pytest.mark.parametrize("name", SCHEMES)
def test_two_steps(name):
    model, initial, T = MaxwellBloch(sigma=(0.5, 0.4)), (0.4, -0.6, 0.7), 0.5
    found = expectations(model, SCHEMES[name], initial, T, (T / 2,), (slow_wave,), 1e-9)
    value = by_quadrature(model, SCHEMES[name], initial, T / 2, 2, slow_wave, 16)
    assert abs(found.value[0, 0] - value) < found.value_bound[0, 0] + 1e-11
    assert found.value_bound[0, 0] < 1e-7


def test_moments():
    """y_2^2 + y_3^2 is conserved; with drift alone in H_3's direction and noise in H_1's, E(y_2 + i y_3) decays."""
    functions = (lambda y: y[1] ** 2 + y[2] ** 2, lambda y: y[1], lambda y: y[2], lambda y: y[0])
    found = expectations(MaxwellBloch((0.3, 0.2)), LIE_TROTTER, (0.5, 1.0, 0.5), 0.5, (0.5, 1 / 16), functions, 1e-8)
    assert np.all(abs(found.value[0] - 1.25) < found.value_bound[0] + 1e-12)
    assert abs(found.limit[0] - 1.25) < found.limit_bound[0] + 1e-12

    only_noise = ((1.0, (("noise", 0, 1.0), ("noise", 1, 1.0))),)
    y1, z, sigma, h = 0.5, 1.0 + 0.5j, 0.9, 0.5
    found = expectations(MaxwellBloch((sigma, 0.4)), only_noise, (y1, 1.0, 0.5), h, (h,), functions, 1e-8)
    mean = z * np.exp(-0.5 * sigma**2 * y1**2 * h)
    for f, value in ((0, 1.25), (1, mean.real), (2, mean.imag), (3, y1)):
        assert abs(found.value[f, 0] - value) < found.value_bound[f, 0] + 1e-10
        assert found.value_bound[f, 0] < 1e-6


def test_a_point_at_rest():
    found = expectations(MaxwellBloch((1.0, 1.0)), ORDER_2, (0.7, 0.0, 0.0), 1.0, (1.0, 1 / 32), (waves,), 1e-8)
    assert np.allclose(found.value, np.sin(1.4 * np.pi), atol=1e-12)
    assert np.allclose(found.limit, np.sin(1.4 * np.pi), atol=1e-12)


def test_orders():
    """Lie-Trotter errors fall as h, those of the order 2 scheme as h^2, and both have one limit."""
    orders = {"lie_trotter": 1, "order_2": 2}
    found = {name: both_noises(name) for name in orders}
    for name, order in orders.items():
        weak = found[name].weak_error[0]
        assert found[name].notes["order"] == order
        assert abs(np.log2(weak[2] / weak[3]) - order) < 0.05
        assert abs(np.log2(weak[3] / weak[4]) / 4 - order) < 0.05
        assert np.all(found[name].weak_error_bound[0, :4] < 0.02 * abs(weak[:4]))
        assert found[name].limit == pytest.approx(found["order_2"].limit, rel=0, abs=1e-12 + found[name].limit_bound[0])


@pytest.mark.share(1)
@pytest.mark.parametrize("name", ["lie_trotter", "order_2"])
def test_errors_are_honest(name):
    """A finer computation stays within the errors stated by a coarser one."""
    coarse, fine = both_noises(name, 1e-6), both_noises(name)
    assert np.prod(fine.notes["grid"]) > np.prod(coarse.notes["grid"])
    assert np.all(abs(coarse.value - fine.value) < coarse.value_bound)
    assert np.all(abs(coarse.limit - fine.limit) < coarse.limit_bound)
    assert np.all(abs(coarse.weak_error - fine.weak_error) < coarse.weak_error_bound)


def test_small_noise_is_a_small_change():
    """E phi is even in each sigma, and its change with sigma^2 is linear."""
    limits = [
        expectations(MaxwellBloch((s, s)), ORDER_2, INITIAL, 0.5, (2.0**-6,), (waves,), 1e-9).limit[0]
        for s in (None, 1e-3, 2e-3)
    ]
    change = [limit - limits[0] for limit in limits[1:]]
    assert change[1] / change[0] == pytest.approx(4.0, rel=1e-2)


def test_a_step_that_does_not_divide_the_time():
    with pytest.raises(ValueError, match="does not divide"):
        expectations(MaxwellBloch(), LIE_TROTTER, INITIAL, 1.0, (0.3,), (waves,))
