"""Particles of `zeitlin` against their equation, by plain sums over modes and a Runge-Kutta method."""

import functools
import math

import fluids
import numpy as np
import pytest
from test_expected_orders import expected
from zeitlin_cases import DRIFT_FLOW, ITO_CORRECTION, STEPPERS, apart, coins_of, field, increments, moved, take

from spi.ensemble.protocol import noises_commute
from spi.plugins.fluids.models import ModeNoise, Zeitlin
from spi.plugins.fluids.models.kernels import tables
from spi.plugins.fluids.models.tables import modes

N, PARTICLES, PATHS = 5, 2, 48
ON = (ModeNoise(0.5, modes=((0, 1), (1, -2)), hamiltonian="linear"), ModeNoise(0.6, modes=((2, 1), (-1, 2))))
NOISES = {"off": (), "on": ON, "partly off": (ModeNoise(0.0, modes=((1, 1),)), ModeNoise(0.6, modes=((2, 1),)))}


def fluid(noise=(), n=N, particles=PARTICLES, **options):
    return Zeitlin(n, noise, "zeitlin", particles=particles, **options)


def start(model, paths, size=1.0):
    """States (paths, d): one vorticity, and particles that differ from path to path."""
    x = 2 * math.pi * np.random.default_rng(7).random((paths, 2 * model.particles))
    y = size * fluids.random_state(model.n, 3)
    return np.concatenate([np.tile(y, (paths, 1 + model.tracers)), x], axis=1)


def velocity(model, gradient, x):
    """-u times the speed of the bracket, (..., 2 P), where psi_m = -dH/d omega_{-m} and u = (-d2 psi, d1 psi)."""
    places = np.reshape(x, (*np.shape(x)[:-1], 2, -1))
    psi = -np.conj(fluids.derivatives(model.n, gradient))
    u = np.zeros(places.shape, complex)
    for m in modes(model.n):
        for m1, m2 in (m, (-m[0], -m[1])):
            wave = 1j * psi[..., m1, m2, None] * np.exp(1j * (m1 * places[..., 0, :] + m2 * places[..., 1, :]))
            u += np.stack([-m2 * wave, m1 * wave], axis=-2)
    return -fluids.speed(model) * 2 * math.pi / model.n * u.real.reshape(np.shape(x))


def change(model, y, gradient):
    """B grad H of the vorticity, and the velocity of particles."""
    fields, x = np.split(y, [model.n**2 - 1], axis=-1)
    v = np.broadcast_to(gradient(fields), fields.shape)
    return np.concatenate([fluids.structure(model, fields, v), velocity(model, v, x)], axis=-1)


def moved_by_runge_kutta(model, h, dW, y):
    """States (paths, d) after steps with increments dW (steps, m, paths), between which Wiener paths are straight."""

    def slope(y, rates):
        total = change(model, y, functools.partial(fluids.drift_gradient, model))
        those_on = [process for process in fluids.processes(model) if process.sigma > 0]
        for process, rate in zip(those_on, rates, strict=True):
            total = total + process.sigma * rate[:, None] * change(model, y, process.gradient)
        return total

    for one in dW:
        a = slope(y, one / h)
        b = slope(y + h / 2 * a, one / h)
        c = slope(y + h / 2 * b, one / h)
        y = y + h / 6 * (a + 2 * b + 2 * c + slope(y + h * c, one / h))
    return y


#: Orders without noise.
ORDERS = {"splitting": 1, "splitting_order2": 2, "splitting_symmetric": 2, "euler_maruyama": 1}


@functools.cache
def reference(noise):
    """Ends at T = 1/2 by very small steps, and increments over the halves of steps of 2^-7."""
    model, steps, finer = fluid(NOISES[noise]), 64, 4 if noise != "off" else 1
    count, m = 2 * steps * finer, tables(model).m
    fine = math.sqrt(0.5 / count) * np.random.default_rng(5).standard_normal((count, m, PATHS))
    ends = moved_by_runge_kutta(model, 0.5 / count, fine, start(model, PATHS))
    return ends, fine.reshape(steps, 2, finer, m, PATHS).sum(axis=2)


@pytest.mark.parametrize("noise", NOISES)
@pytest.mark.parametrize("name", ORDERS)
def test_orders(name, noise):
    """Root mean squares of the errors of particles; an order of 1 where the noises that are on are one direction."""
    model, (ends, halves) = fluid(NOISES[noise]), reference(noise)
    places = slice(N * N - 1, None)
    errors = []
    for merged in (16, 4, 1):
        steps = len(halves) // merged
        parts = halves.reshape(steps, 2, merged, *halves.shape[2:]).sum(axis=2)
        found = take(name, model, 0.5 / steps, parts, start(model, PATHS), coins_of(PATHS)).states
        errors.append(np.sqrt(np.square((found - ends)[:, places]).mean()))
    order = math.log(errors[0] / errors[2], 16)
    stated = ORDERS[name] if noise == "off" else expected(name, model, tuple(start(model, 1)[0]))[0]
    assert stated - 0.25 < order
    assert np.sqrt(np.square((start(model, PATHS) - ends)[:, places]).mean()) > 10 * errors[1]


def test_the_sign_and_the_waves_of_the_velocity():
    """Negative control of the comparison: where particles would go with +u."""
    model, h = fluid(), 1e-5
    y = start(model, 8)
    (way,) = take("splitting", model, h, np.zeros((1, 2, 0, 8)), y).states[None] - y
    expected_way = h * velocity(model, fluids.drift_gradient(model, y[:, : N * N - 1]), y[:, N * N - 1 :])
    assert apart(way[:, N * N - 1 :], expected_way) < 1e-4
    assert apart(-way[:, N * N - 1 :], expected_way) > 1


@pytest.mark.parametrize("noise", NOISES)
@pytest.mark.parametrize("name", STEPPERS)
def test_areas_are_kept(name, noise):
    """Determinants of the derivative of two large steps with respect to the place of a particle."""
    model, h, delta = fluid(NOISES[noise], particles=1), 0.5, 1e-5
    y = np.repeat(start(model, 6), 4, axis=0)
    y[:, -2:] += np.tile([[delta, 0], [-delta, 0], [0, delta], [0, -delta]], (6, 1))
    dW = np.repeat(increments(model, h, 2, 6), 4, axis=3)
    ends = take(name, model, h, dW, y, np.repeat(coins_of(6), 4)).states[:, -2:].reshape(6, 2, 2, 2)
    areas = np.linalg.det((ends[:, :, 0] - ends[:, :, 1]) / (2 * delta))
    if name == "euler_maruyama":
        assert abs(areas - 1).max() > 1e-2
    else:
        assert abs(areas - 1).max() < 1e-6


@pytest.mark.parametrize("n", [5, 9])
@pytest.mark.parametrize("name", STEPPERS)
def test_a_steady_shear_is_exact(name, n):
    """A vorticity of one mode stands still; the noise of the same direction moves particles along the same lines."""
    model, m, h = fluid((ModeNoise(0.4, modes=((2, -1),), hamiltonian="linear"),), n, 3), np.array([2, -1]), 0.3
    y = start(model, 5)
    y[:, : n * n - 1] = 0
    place = modes(n).index((-2, 1))
    y[:, 2 * place : 2 * place + 2] = 0.7, -0.4
    dW = increments(model, h, 4, 5)
    ends = take(name, model, h, dW, y, coins_of(5)).states
    total = dW.sum(axis=(0, 1))
    drift = velocity(model, fluids.drift_gradient(model, y[:, : n * n - 1]), y[:, n * n - 1 :])
    way = 4 * h * drift
    for process, W in zip(fluids.processes(model), total, strict=True):
        v = np.tile(process.gradient(y[:1, : n * n - 1]), (5, 1))
        way += process.sigma * W[:, None] * velocity(model, v, y[:, n * n - 1 :])
    assert apart((ends - y)[:, n * n - 1 :], way) < 1e-13
    assert abs((ends - y)[:, n * n - 1 :].reshape(5, 2, 3).transpose(0, 2, 1) @ m).max() < 1e-13
    assert abs(way).max() > 0.1


def test_a_path_alone_and_in_company_has_the_same_bits():
    """With more places than go together at once, and one path far away."""
    model = fluid(ON, particles=11)
    y = start(model, 8)
    y[3, -1] = 1e9
    together, _ = moved(model, DRIFT_FLOW, 1, 0.3, y)
    assert np.array_equal(together, [moved(model, DRIFT_FLOW, 1, 0.3, one[np.newaxis])[0][0] for one in y])
    assert (together != y)[:, N * N - 1 :].all()
    h, dW = 0.1, increments(model, 0.1, 2, 11)
    whole = take("splitting_symmetric", model, h, dW, start(model, 11)).states
    part = take("splitting_symmetric", model, h, dW[..., :3], start(model, 11)[:3]).states
    assert np.array_equal(part, whole[:3])


def test_particles_change_nothing_else():
    """Of the vorticity and of a tracer; with noise of several directions on one line up to roundings."""
    for noise, rounding in (((), 0), (ON, 1e-13)):
        model, alone = fluid(noise, tracers=1), Zeitlin(N, noise, "zeitlin", tracers=1)
        y, dW = start(model, 8), increments(model, 0.1, 3, 8)
        found = take("splitting_symmetric", model, 0.1, dW, y).states[:, : -2 * PARTICLES]
        assert apart(found, take("splitting_symmetric", alone, 0.1, dW, y[:, : -2 * PARTICLES]).states) <= rounding
    assert not field(model, ITO_CORRECTION, 0.7, y)[:, -2 * PARTICLES :].any()


def test_which_noises_commute():
    """Modes of one line modulo N do for the vorticity, and not for particles; those of one direction do for both."""
    for pair, with_particles in ((((2, 1), (-1, 2)), False), (((1, 0), (2, 0)), True)):
        noise = (ModeNoise(0.5, modes=pair),)
        assert noises_commute(tables(Zeitlin(N, noise)))
        assert noises_commute(tables(fluid(noise))) == with_particles
        assert expected("splitting", fluid(noise), (1.0,) * 28)[0] == (1.0 if with_particles else 0.5)


def test_tracers_are_nearly_constant_along_particles():
    """The truncation: a tracer in matrices follows particles up to a difference that falls with N^2."""
    away = []
    for n in (15, 31):
        model, many = fluid(n=n, particles=40, tracers=1), n * n - 1
        y = start(model, 1)
        y[0, : 2 * many] = 0
        for m, value in {(1, 0): 0.5, (1, 1): 0.4, (0, 2): 0.25}.items():
            y[0, 2 * modes(n).index(m)] = value
        y[0, many + 2 * modes(n).index((0, 1))] = 0.5  # theta = cos x2
        end = take("splitting_symmetric", model, 0.05, np.zeros((20, 2, 0, 1)), y).states[0]
        theta, x = end[many : 2 * many : 2] + 1j * end[many + 1 : 2 * many : 2], end[2 * many :].reshape(2, -1)
        now = 2 * (theta @ np.exp(1j * np.array(modes(n)) @ x)).real
        away.append(np.sqrt(np.square(now - np.cos(y[0, -40:])).mean()))
        assert np.sqrt(np.square(np.cos(x[1]) - np.cos(y[0, -40:])).mean()) > 0.3
    assert away[1] < 0.02 and 3 < away[0] / away[1] < 6
