"""Systems that depend on time: against a quadrature and closed forms, orders, what the program refuses."""

import math

import numpy as np
import pytest
from ensemble_cases import increments_of
from helpers import SCHEMES, loop_in_python, simulate, take_step
from scipy.integrate import quad, solve_ivp
from yaml_cases import definition

from spi.checks.model_checks import check_model
from spi.compiler.inlining import uncompiled
from spi.ensemble.loop import PAIRS_REVERSED
from spi.ensemble.observer import invariants_of
from spi.ensemble.protocol import drift_gradient, frozen, hamiltonian, noise_gradient
from spi.models.delegation import damped
from spi.numerics.rng import LANES
from spi.plugins.systems import generated as systems
from spi.specs.models import strengths_of

INITIAL = (0.5, -0.3, 0.7)


def record(text, name="Driven", **keys):
    """The record of a definition, with other values of some keys."""
    keys = {**definition(text), **keys}
    sigma = systems.strengths(keys, keys.get("sigma"))
    return systems.record(systems.made(keys, name), strengths_of(sigma))


#: H = H_0 + eps cos(w t) H_1, H_1 a product that becomes two squares, and a travelling wave.
PLAIN = """
algebra: so(3)
parameters: {eps: 1/2, w: 3}
hamiltonian: y1^2/4 + y2^2/2 + 3*y3^2/4 + eps*cos(w*t)*y1*y2 + sin(y3 - w*t)/2
"""


def gradient(t, y):
    c = 0.5 * math.cos(3 * t)
    return [y[0] / 2 + c * y[1], y[1] + c * y[0], 1.5 * y[2] + math.cos(y[2] - 3 * t) / 2]


def reference(time, start=0.0):
    """By an adaptive quadrature that knows none of our code."""
    solved = solve_ivp(
        lambda t, y: np.cross(y, gradient(t, y)), (start, start + time), INITIAL, "DOP853", rtol=1e-12, atol=1e-13
    )
    return solved.y[:, -1]


def steps_by_hand(scheme, model, time, steps):
    """The last state of one path without noise: each step is that of a model that does not change."""
    y, h = np.repeat(np.array(INITIAL)[:, None], LANES, axis=1), time / steps
    with uncompiled():
        for n in range(steps):
            y, _ = take_step(scheme, frozen(model, n * h, h), h, np.zeros((0, LANES)), y)
    return y[:, 0]


ORDERS = {
    "splitting": 1,
    "splitting_order2": 2,
    "splitting_symmetric": 2,
    "euler_maruyama": 1,
    "midpoint": 2,
    "munthe_kaas_euler": 1,
    "munthe_kaas_midpoint": 2,
}


@pytest.mark.share(3)
@pytest.mark.parametrize("name", ORDERS)
def test_without_noise_schemes_converge_to_a_quadrature(name):
    model, y = record(PLAIN), reference(1.0)
    errors = [np.linalg.norm(steps_by_hand(SCHEMES[name].record, model, 1.0, n) - y) for n in (8, 16, 32)]
    assert errors[-1] < 0.05
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx(ORDERS[name], abs=0.35)


def test_a_model_that_is_frozen_at_the_beginning_of_steps_has_order_1_only():
    """The negative control of order 2."""
    model, y = record(PLAIN), reference(1.0)

    def last(steps):
        z, h = np.repeat(np.array(INITIAL)[:, None], LANES, axis=1), 1.0 / steps
        with uncompiled():
            for n in range(steps):
                z, _ = take_step(
                    SCHEMES["splitting_symmetric"].record, frozen(model, n * h, 0.0), h, np.zeros((0, LANES)), z
                )
        return np.linalg.norm(z[:, 0] - y)

    assert 0.7 < math.log2(last(16) / last(32)) < 1.3


def test_the_beginning_can_be_at_another_time():
    model = record(PLAIN, initial_time="pi/7")
    y = steps_by_hand(SCHEMES["splitting_symmetric"].record, model, 1.0, 32)
    assert np.linalg.norm(y - reference(1.0, math.pi / 7)) < 4e-3 < 0.02 < np.linalg.norm(y - reference(1.0))
    assert type(model) is type(record(PLAIN))


# --- what is frozen --------------------------------------------------------------------------------------------------

#: All that moves is about one axis.
ONE_AXIS = """
algebra: so(3)
parameters: {eps: 1/2, w: 3}
hamiltonian: (1 + eps*cos(w*t))*y3 + exp(-t)*y3^2/2
noises: [y3, (t - 0.3)*y3]
sigma: [0.6*cos(w*t), 0.5]
"""


def test_a_step_has_the_means_of_its_coefficients():
    model = record(ONE_AXIS)
    with uncompiled():
        for s, h in ((0.0, 0.25), (0.7, 0.5), (0.4, 1e-3)):
            step = frozen(model, s, h)
            mean = [
                quad(f, s, s + h, epsabs=1e-14)[0] / h
                for f in (lambda t: 1 + math.cos(3 * t) / 2, lambda t: math.exp(-t))
            ]
            assert drift_gradient(step, INITIAL)[2] == pytest.approx(mean[0] + mean[1] * INITIAL[2], abs=1e-10)
            assert noise_gradient(step, 1, INITIAL)[2] == pytest.approx(s + h / 2 - 0.3, abs=1e-14)
            square = quad(lambda t: (0.6 * math.cos(3 * t)) ** 2, s, s + h, epsabs=1e-14)[0] / h
            assert step.sigma[0] ** 2 == pytest.approx(square, abs=1e-8) and step.sigma[1] == 0.5
            now = frozen(model, s, 0.0)
            assert now.sigma[0] == pytest.approx(0.6 * math.cos(3 * s), abs=1e-15)
            exact = (1 + math.cos(3 * s) / 2) * INITIAL[2] + math.exp(-s) * INITIAL[2] ** 2 / 2
            assert hamiltonian(now, INITIAL) == pytest.approx(exact, abs=1e-15)


def test_flows_that_commute_at_all_times_are_exact_whatever_the_step():
    """y1 + i y2 turns by the angle of an integral, and with noise its mean decays by another; closed forms."""
    model, scheme, time = record(ONE_AXIS), SCHEMES["splitting"].record, 2.0
    angle = time + math.sin(3 * time) / 6 + (1 - math.exp(-time)) * INITIAL[2]
    spread = 0.36 * (time / 2 + math.sin(6 * time) / 12)
    for steps in (4, 16):
        y, h, variance = np.repeat(np.array(INITIAL)[:, None], LANES, axis=1), time / steps, 0.0
        with uncompiled():
            for n in range(steps):
                step = frozen(model, n * h, h)
                variance += step.sigma[0] ** 2 * h
                y, _ = take_step(scheme, step, h, np.zeros((2, LANES)), y)
        turned = complex(y[0, 0], y[1, 0]) / complex(*INITIAL[:2])
        assert abs(turned - complex(math.cos(angle), -math.sin(angle))) < 1e-8
        assert variance == pytest.approx(spread, abs=1e-8)


def test_the_energy_of_a_path_is_that_of_its_time():
    model, times = record(ONE_AXIS), np.array([0.0, 0.25, 1.5])
    energy, _ = invariants_of(model, np.tile(INITIAL, (3, 1)), times)
    exact = (1 + np.cos(3 * times) / 2) * INITIAL[2] + np.exp(-times) * INITIAL[2] ** 2 / 2
    assert np.allclose(energy, exact, rtol=0, atol=1e-14)


def test_the_generic_checks_pass_and_the_compiler_takes_the_module():
    from spi.checks.model_checks import obstacle

    for text in (PLAIN, ONE_AXIS):
        model = record(text)
        assert obstacle(model) is None
        with uncompiled():
            assert check_model(frozen(model, 0.4, 0.1), [INITIAL], written=False) == []


# --- the loop over time ----------------------------------------------------------------------------------------------

NOISY = """
algebra: so(3)
parameters: {w: 3}
hamiltonian: y1^2/4 + sin(w*t)*y3
noises: [y2]
sigma: [0.5 + t]
"""


def by_hand(model, h, increments, sides=None):
    """Paths by the flows, step after step, given increments (step, noise, path)."""
    y = np.repeat(np.array(INITIAL)[:, None], LANES, axis=1)
    with uncompiled():
        for n, dW in enumerate(increments):
            y, _ = take_step(SCHEMES["splitting"].record, frozen(model, n * h, h), h, dW, y)
    return y


def test_the_loop_gives_each_step_its_time():
    """At three step sizes at once, and where pairs of steps act in reversed order."""
    model, h, steps = record(NOISY), 2.0**-4, 8
    with loop_in_python():
        found, _ = simulate(
            SCHEMES["splitting"].record,
            model,
            h=h,
            steps=steps,
            doublings=(0, 0, 1, 2),
            initial=INITIAL,
            reversals=[0, PAIRS_REVERSED, 0, 0],
        )
    dW = increments_of(h=h, steps=steps)[0][:, :1]
    expected = [dW, dW.reshape(-1, 2, *dW.shape[1:])[:, ::-1].reshape(dW.shape)]
    expected += [dW.reshape(-1, 2**s, *dW.shape[1:]).sum(axis=1) for s in (1, 2)]
    for level, (increments, step) in enumerate(zip(expected, (h, h, 2 * h, 4 * h), strict=True)):
        y = by_hand(model, step, increments)
        assert np.allclose(found[level, -1], y, rtol=0, atol=1e-12)
        shifted = by_hand(record(NOISY, initial_time="0.01"), step, increments)
        assert not np.allclose(found[level, -1], shifted, rtol=0, atol=1e-5)


def test_damping_keeps_what_depends_on_time():
    model = damped(record(NOISY), 0.1)
    with uncompiled():
        step = frozen(model, 0.5, 0.25)
        assert type(step) is type(model) and step.damping == 0.1
        assert step.sigma == step.model.sigma == frozen(model.model, 0.5, 0.25).sigma != model.sigma


# --- definitions -----------------------------------------------------------------------------------------------------
