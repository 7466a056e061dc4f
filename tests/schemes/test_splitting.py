"""Steps of the splitting schemes of the rigid body against the printed rotations, with angles of every size."""

import mpmath
import numpy as np
import pytest
import scheme_cases
from helpers import BY_HAND, LANES, RIGID_BODY, SCHEMES, random_states, take_step, turned
from scheme_cases import LOCKED, SPLITTINGS, increments, relative, tosses

from spi.ensemble.protocol import noise_indices
from spi.ensemble.scheme_protocol import substeps
from spi.models import RigidBody
from spi.schemes.splitting import LIE_TROTTER, LIE_TROTTER_EXCHANGED, ORDER_2

# fixtures
generator, model = scheme_cases.generator, scheme_cases.model


@pytest.mark.share
@pytest.mark.parametrize("h", [0.0, 1e-3, 0.2, 1.0])
@pytest.mark.parametrize("name", SPLITTINGS)
def test_splitting_is_the_composition_of_flows(name, model, h, generator):
    """At h = 0.2 and 1 some lanes need range reduction; at h = 1 rounding errors grow within the step."""
    y, dW, coins = random_states(generator), increments(generator, h + 0.01), tosses(generator)
    new, _ = take_step(SCHEMES[name].record, model, h, dW, y, coins)

    def by_hand(name, side):
        """With the coins on that side."""
        states = [BY_HAND[name](model, h, dW[:, lane], side * coins[lane], y[:, lane]) for lane in range(LANES)]
        return np.transpose(states)

    assert relative(new, by_hand(name, 1)) < (1e-12 if h == 1.0 else 1e-14)
    if h > 0.1:  # negative control: another order is another scheme
        others = [(other, 1) for other in SPLITTINGS if other != name]
        if name == "splitting_order2" and len(noise_indices(model)) > 1:
            others.append((name, -1))
        for other in others:
            assert relative(new, by_hand(*other)) > 1e-2


def test_no_noise_and_no_time_changes_nothing(generator):
    y = random_states(generator)
    for row in (row for name, row in SCHEMES.items() if name != "roessler_rs2"):  # which divides by sqrt(h)
        new, _ = take_step(row.record, RIGID_BODY, 0.0, np.zeros((3 * (2 * substeps(row.record) - 1), LANES)), y)
        assert np.array_equal(new, y)


def turned_exactly(k, angle, y):
    """By 60 digits, for an angle that is the float64 `angle` itself."""
    with mpmath.workdps(60):
        exact = turned(k, mpmath.mpf(float(angle)), [mpmath.mpf(float(c)) for c in y], mpmath.sin, mpmath.cos)
        return [float(c) for c in exact]


@pytest.mark.share
@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("which", ["drift", "noise"])
@pytest.mark.parametrize("angle", [0.0312, 0.0313, 0.785, 0.786, -4.0, 1e5, 1.59e6, 1.61e6, -1e8, 1e15])
def test_one_large_angle_in_a_block(angle, which, axis, generator):
    """A sweep chooses its sine by the largest angle of its lanes: right in the lane that has it and in all others.

    Only one flow turns, so that its angles are known to the last bit.
    """
    inertia = tuple(0.8 if k == axis else LOCKED for k in range(3))
    still = (LOCKED, LOCKED, LOCKED)
    y = np.sign(random_states(generator)) * generator.uniform(0.3, 1.0, (3, LANES))
    y[axis] *= 0.1 if abs(angle) > 0.1 else 0.01  # lane 17 alone decides
    if which == "drift":
        model, h, dW = RigidBody(inertia, still), 0.5, np.zeros((3, LANES))
        y[axis, 17] = angle * 0.8 / h
        t = np.full(LANES, h)
    else:
        model, h, dW = RigidBody(still, inertia), 0.0, np.zeros((3, LANES))
        dW[axis] = 0.3 * generator.standard_normal(LANES)
        dW[axis, 17] = angle * 0.8 / y[axis, 17]
        t = dW[axis]
    angles = t * (1.0 / 0.8) * y[axis]
    assert abs(angles[17] / angle - 1) < 1e-14
    expected = np.transpose([turned_exactly(axis, angles[lane], y[:, lane]) for lane in range(LANES)])
    # With order 2 a drift turns in several parts, so only its noise can be told to the last bit, with either coin.
    for scheme in (LIE_TROTTER, LIE_TROTTER_EXCHANGED, *([ORDER_2] if which == "noise" else [])):
        new, _ = take_step(scheme, model, h, dW, y, tosses(generator))
        assert np.array_equal(new[axis], y[axis])
        others = [k for k in range(3) if k != axis]
        assert relative(new[others], expected[others]) < 1e-15
