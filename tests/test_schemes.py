"""One step, and many steps, of every scheme: against formulas written out by hand, and the structure that it keeps.

The ensemble is not involved: increments are drawn here, with fixed seeds.
"""

from typing import NamedTuple

import mpmath
import numpy as np
import pytest
from helpers import (
    BY_HAND,
    COMPILED,
    INITIAL,
    LANES,
    ONE_NOISE,
    RIGID_BODY,
    SCHEMES,
    random_states,
    simulate,
    take_step,
    take_steps,
    turned,
)
from matplotlib.colors import is_color_like
from matplotlib.markers import MarkerStyle

from spi import protocol
from spi.angles import ANY_ANGLES, REDUCED_ANGLES, SMALL_ANGLES, TINY_ANGLES
from spi.dispatch import kernel
from spi.elementary import REDUCIBLE, SMALL
from spi.models import LotkaVolterra, MaxwellBloch, RigidBody, RigidBodySharedNoise, SineEuler
from spi.protocol import (
    REPORT,
    casimirs,
    dimension,
    drift_angle,
    drift_flow,
    noise_angle,
    noise_flow,
    noise_indices,
    noises,
    pieces,
    strengths,
)
from spi.schemes import SCHEMES as ALL_SCHEMES
from spi.schemes import has_theory, typical_ns
from spi.schemes.midpoint import Midpoint, eliminate
from spi.schemes.rows import compositions
from spi.schemes.splitting import LIE_TROTTER, LIE_TROTTER_EXCHANGED, ORDER_2

MODELS = {
    "three_noises": RIGID_BODY,
    "one_noise": ONE_NOISE,
    "other_parameters": RigidBody((1.3, 0.4, 2.2), (0.7, 2.0, 0.5), (0.5, 2.0, 0.3)),
}
SPLITTINGS = tuple(BY_HAND)
IMPLICIT = "midpoint"
RENORMALISED = SCHEMES["euler_maruyama_renormalised"].record
SOLVES, ITERATIONS, FAILURES, RESIDUAL, ANGLE = range(len(REPORT))


@pytest.fixture
def generator():
    return np.random.default_rng(2024)


@pytest.fixture(params=MODELS.values(), ids=MODELS.keys())
def model(request):
    return request.param


def on_the_sphere(generator):
    """States of length 1, for which the implicit equations are solvable at every h and truncated dW used here."""
    y = random_states(generator)
    return y / np.linalg.norm(y, axis=0)


def increments(generator, h, steps=None):
    shape = (3, LANES) if steps is None else (steps, 3, LANES)
    return np.sqrt(h) * np.clip(generator.standard_normal(shape), -3.0, 3.0)


def tosses(generator, steps=None):
    """Fair coins."""
    return generator.choice([-1.0, 1.0], LANES if steps is None else (steps, LANES))


def relative(a, b):
    """The largest distance of two arrays of states [component, lane], relative to the length of the second."""
    return np.max(np.linalg.norm(np.asarray(a) - b, axis=0) / np.linalg.norm(b, axis=0))


# --- the equation, by hand -------------------------------------------------------------------------------------------


def field(model, h, dW, y):
    """h B grad H + sum_k sigma_k dW_k B grad Ĥ_k as the paper prints them (y x grad, component by component)."""
    y1, y2, y3 = y
    g1, g2, g3 = (
        h * y[k] / model.inertia[k] + strengths(model)[k] * dW[k] * y[k] / model.noise_inertia[k] for k in range(3)
    )
    return np.array([y2 * g3 - y3 * g2, y3 * g1 - y1 * g3, y1 * g2 - y2 * g1])


def ito_correction(model, y):
    """For k = 1: f_1 = (0, y1 y3, -y1 y2) / Î_1, so f_1' f_1 = -(y1 / Î_1)^2 (0, y2, y3); the others alike."""
    s = [(strength * y[k] / model.noise_inertia[k]) ** 2 for k, strength in enumerate(strengths(model))]
    return -0.5 * np.array([(s[1] + s[2]) * y[0], (s[0] + s[2]) * y[1], (s[0] + s[1]) * y[2]])


# --- the table -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SCHEMES)
def test_rows_are_complete(name):
    row = SCHEMES[name]
    assert isinstance(row.record, tuple) and row.label and row.preserves
    for order in (row.strong_order, row.strong_order_commuting, row.weak_order):
        assert order in (0.5, 1.0, 1.5, 2.0)
    assert row.strong_order <= row.strong_order_commuting
    assert len({row.label for row in SCHEMES.values()}) == len(SCHEMES)


def test_rows_say_where_schemes_come_from_and_how_they_look():
    """Also those of the multiscale system; no two schemes look alike."""
    for row in ALL_SCHEMES.values():
        assert row.formula and "\n" not in row.formula and row.reference
        marker, colour = row.look
        assert is_color_like(colour) and marker in MarkerStyle.markers
    for what in ("look", "formula", "label"):
        assert len({getattr(row, what) for row in ALL_SCHEMES.values()}) == len(ALL_SCHEMES)


def test_questions_to_rows_follow_from_their_records():
    compositions_of_flows = {name for name, row in ALL_SCHEMES.items() if row.composition is not None}
    assert compositions_of_flows == {*SPLITTINGS, "ap_splitting", "ap_splitting_midpoint"}
    assert {name for name, row in ALL_SCHEMES.items() if row.solvable_without_sampling} == set(SPLITTINGS)
    shared = RigidBodySharedNoise((2.0, 1.0, 2 / 3), (1.0, 2.0, 3.0))
    assert {name for name, row in ALL_SCHEMES.items() if not has_theory(row, shared)} == compositions_of_flows
    assert all(has_theory(row, RIGID_BODY) for row in ALL_SCHEMES.values())


# --- Euler-Maruyama --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("h", [0.0, 1e-3, 0.3])
def test_euler_maruyama_is_the_ito_formula(model, h, generator):
    y, dW = random_states(generator), increments(generator, h + 0.1)
    new, _ = take_step(SCHEMES["euler_maruyama"].record, model, h, dW, y)
    assert relative(new, y + field(model, h, dW, y) + h * ito_correction(model, y)) < 1e-14
    if h == 0.3:  # negative control
        assert relative(new, y + field(model, h, dW, y)) > 1e-2


@pytest.mark.parametrize("h", [0.0, 1e-3, 0.3])
def test_renormalised_euler_maruyama_is_a_step_put_back_on_the_sphere(model, h, generator):
    y, dW = random_states(generator), increments(generator, h + 0.1)
    explicit, _ = take_step(SCHEMES["euler_maruyama"].record, model, h, dW, y)
    new, _ = take_step(RENORMALISED, model, h, dW, y)
    length = np.linalg.norm(y, axis=0)
    assert relative(new, explicit * (length / np.linalg.norm(explicit, axis=0))) < 1e-15
    assert np.max(np.abs(np.linalg.norm(new, axis=0) / length - 1)) < 1e-15
    assert relative(new, explicit) > 1e-2  # negative control: there was something to be put right


# --- splitting -------------------------------------------------------------------------------------------------------


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


@pytest.mark.parametrize("name", SPLITTINGS)
def test_splitting_without_time_is_the_noise_flows(name, model, generator):
    y, dW, coins = random_states(generator), increments(generator, 0.1), tosses(generator)
    new, _ = take_step(SCHEMES[name].record, model, 0.0, dW, y, coins)
    expected = []
    for lane in range(LANES):
        state = tuple(y[:, lane])
        for k in (2, 1, 0) if name == "splitting_order2" and coins[lane] < 0 else (0, 1, 2):
            state = turned(k, strengths(model)[k] * dW[k, lane] * state[k] / model.noise_inertia[k], state)
        expected.append(state)
    assert relative(new, np.transpose(expected)) < 3e-15


def test_no_noise_and_no_time_changes_nothing(generator):
    y = random_states(generator)
    for row in SCHEMES.values():
        new, _ = take_step(row.record, RIGID_BODY, 0.0, np.zeros((3, LANES)), y)
        assert np.array_equal(new, y)


LOCKED = 1e40  # a moment of inertia so large that nothing turns about its axis


def turned_exactly(k, angle, y):
    """By 60 digits, for an angle that is the float64 `angle` itself."""
    with mpmath.workdps(60):
        exact = turned(k, mpmath.mpf(float(angle)), [mpmath.mpf(float(c)) for c in y], mpmath.sin, mpmath.cos)
        return [float(c) for c in exact]


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


ROADS = {
    "tiny": (TINY_ANGLES, [1e-9, 0.02, 2.0**-5]),
    "small": (SMALL_ANGLES, [2.0**-5, 0.3, SMALL]),
    "reduced": (REDUCED_ANGLES, [SMALL, 1.0, 22.0, 1e3, 355.0 / 113.0 * 1e5, 1e6, REDUCIBLE]),
    "any": (ANY_ANGLES, [1e-9, 1.0, 1e6, REDUCIBLE, 1e8, 1e12, 1e15]),
}


@pytest.mark.parametrize("road", ROADS)
def test_flows_are_accurate_to_the_ends_of_each_road(road, generator):
    """No accuracy is lost, up to the very ends of the ranges and beyond: 2 units in the last place of the length."""
    angles, sizes = ROADS[road]
    for size in sizes:
        for angle in (np.nextafter(size, 0.0), size, -size):
            axis = int(generator.integers(3))
            unlocked = tuple(1.0 if k == axis else LOCKED for k in range(3))
            model = RigidBody(unlocked, unlocked)
            y = generator.uniform(0.3, 1.0, 3)
            y[axis] = 1.0  # so that the angle is the time, to the last bit
            expected = np.array(turned_exactly(axis, angle, y))
            turning = np.delete(y, axis)
            for flow in (drift_flow, noise_flow):
                new = np.array(flow(model, axis, float(angle), tuple(y.tolist()), angles))
                assert new[axis] == 1.0
                assert np.linalg.norm(new - expected) <= 2 * np.spacing(np.linalg.norm(turning))


# --- splitting, for every model --------------------------------------------------------------------------------------

SYSTEMS = {
    "rigid_body": RIGID_BODY,
    "rigid_body_two_noises": RIGID_BODY._replace(sigma=(0.7, None, 1.2)),
    "rigid_body_one_noise": ONE_NOISE,
    "rigid_body_no_noise": RIGID_BODY._replace(sigma=(None, None, None)),
    "maxwell_bloch": MaxwellBloch((0.5, 1.5)),
    "lotka_volterra": LotkaVolterra((0.3,)),
    "sine_euler": SineEuler((0.5, 0.2, None, 0.4)),
}


def order_2_printed(model, h, dW, coin, y):
    """The remark rem:order2 for one path, with the model's own flows, which other tests check."""
    last, on = pieces(model) - 1, [k for k, sigma in enumerate(model.sigma) if sigma is not None]

    def half(y):
        for k in range(last):
            y = drift_flow(model, k, h / 4, y, ANY_ANGLES)
        y = drift_flow(model, last, h / 2, y, ANY_ANGLES)
        for k in range(last - 1, -1, -1):
            y = drift_flow(model, k, h / 4, y, ANY_ANGLES)
        return y

    y = half(y)
    for k in on if coin == 1 else on[::-1]:
        y = noise_flow(model, k, model.sigma[k] * dW[k], y, ANY_ANGLES)
    return half(y)


def acted(flows, model, h, dW, y):
    """What a composition, given as data, makes of a state."""
    for kind, k, fraction in flows:
        if kind == "drift":
            y = drift_flow(model, k, fraction * h, y, ANY_ANGLES)
        else:
            y = noise_flow(model, k, fraction * model.sigma[k] * dW[k], y, ANY_ANGLES)
    return y


@pytest.fixture(params=SYSTEMS)
def system(request, generator):
    """A model, states [component, lane] and increments [noise, lane]."""
    model = SYSTEMS[request.param]
    y = random_states(generator, dimension(model))
    if isinstance(model, LotkaVolterra):
        y = np.exp(0.5 * y)
    return model, y, 0.5 * generator.standard_normal((noises(model), LANES))


def largest_angle(scheme, model, h, dW, y, coins):
    """The largest |angle| of all flows of one step of a block, by one lane and one flow after the other."""
    found, as_data = [0.0], compositions(scheme.rows, model)
    for lane in range(LANES):
        state = tuple(y[:, lane].tolist())
        _, flows = as_data[0 if coins[lane] > 0 else -1]
        for kind, k, fraction in flows:
            angle, flow, t = (
                (drift_angle, drift_flow, fraction * h)
                if kind == "drift"
                else (noise_angle, noise_flow, fraction * model.sigma[k] * dW[k, lane])
            )
            found.append(angle(model, k, t, state))
            state = flow(model, k, t, state, ANY_ANGLES)
    return max(found)


def test_largest_angle_is_reported(system, generator):
    """The largest of a step, if it is above pi/4; the largest of all steps."""
    model, y, dW = system
    coins, largest = tosses(generator), []
    for h, strength in ((0.3, 1.0), (2.0, 1.0), (1e-3, 1e-3), (0.3, 0.1)):
        _, report = take_step(ORDER_2, model, h, strength * dW, y, coins)
        expected = largest_angle(ORDER_2, model, h, strength * dW, y, coins)
        largest.append(expected if expected > SMALL else 0.0)
        assert report[ANGLE] == pytest.approx(largest[-1], rel=1e-12, abs=0.0)
        assert not report[:ANGLE].any()
    assert largest[2] == 0.0
    assert (largest[1] > 1.0) == (not isinstance(model, LotkaVolterra))  # which has no angles


@pytest.mark.parametrize("scheme", [LIE_TROTTER, LIE_TROTTER_EXCHANGED], ids=["noise first", "drift first"])
def test_largest_angle_of_many_steps(scheme, model, generator):
    y, h, coins = random_states(generator), 0.5, np.ones(LANES)
    dW = increments(generator, h, steps=3)
    _, report = take_steps(scheme, model, h, dW, y)
    largest = []
    for step in dW:
        largest.append(largest_angle(scheme, model, h, step, y, coins))
        y, _ = take_step(scheme, model, h, step, y)
    assert report[ANGLE] == pytest.approx(max(largest), rel=1e-12)
    assert len(set(largest)) == 3 and min(largest) > SMALL


@pytest.mark.parametrize("angle", [0.1, np.nextafter(SMALL, 0.0), SMALL, np.nextafter(SMALL, 1.0), 1e7, np.inf, np.nan])
def test_one_angle_is_reported_from_a_quarter_of_pi_on(angle):
    """To the last bit; what is not finite counts as infinite, so that it is not forgotten."""
    model = RigidBody((1.0, LOCKED, LOCKED), (LOCKED, LOCKED, LOCKED))
    y = np.zeros((3, LANES))
    y[0, 40] = -1.0 if np.isfinite(angle) else angle
    with np.errstate(invalid="ignore"):
        _, report = take_steps(LIE_TROTTER, model, angle if np.isfinite(angle) else 1.0, np.zeros((2, 3, LANES)), y)
    assert report[ANGLE] == (0.0 if angle <= SMALL else angle if np.isfinite(angle) else np.inf)
    _, report = take_step(SCHEMES["euler_maruyama"].record, model, 1.0, np.zeros((3, LANES)), y)
    assert report[ANGLE] == 0.0  # it turns nothing


def by_lanes(step, y, dW, coins):
    """The states after step(y, dW, coin) in every lane."""
    return np.transpose([step(tuple(y[:, n].tolist()), dW[:, n].tolist(), coins[n]) for n in range(LANES)])


def test_order_2_is_the_printed_composition_and_so_are_the_compositions_as_data(system, generator):
    model, y, dW = system
    h, coins = 0.3, tosses(generator)
    new, _ = take_step(ORDER_2, model, h, dW, y, coins)
    printed = by_lanes(lambda y, dW, coin: order_2_printed(model, h, dW, coin, y), y, dW, coins)
    assert relative(new, printed) < 1e-13
    as_data = compositions(ORDER_2.rows, model)
    assert [probability for probability, _ in as_data] == [0.5, 0.5]
    of_coin = {1.0: as_data[0][1], -1.0: as_data[1][1]}
    assert relative(by_lanes(lambda y, dW, coin: acted(of_coin[coin], model, h, dW, y), y, dW, coins), printed) < 1e-14
    if len(noise_indices(model)) > 1:  # negative control: the coins on the other side
        other, _ = take_step(ORDER_2, model, h, dW, y, -coins)
        assert relative(other, printed) > 1e-2
    lie_trotter = compositions(LIE_TROTTER.rows, model)[0][1]
    assert relative(by_lanes(lambda y, dW, coin: acted(lie_trotter, model, h, dW, y), y, dW, coins), printed) > 1e-2


@pytest.mark.parametrize("scheme", [LIE_TROTTER, LIE_TROTTER_EXCHANGED], ids=["noise first", "drift first"])
def test_compositions_of_lie_trotter_are_its_step(system, scheme):
    model, *_ = system
    ((probability, flows),) = compositions(scheme.rows, model)
    drift, noise = [("drift", k, 1.0) for k in range(pieces(model))], [("noise", k, 1.0) for k in noise_indices(model)]
    assert probability == 1.0
    assert list(flows) == (noise + drift if scheme is LIE_TROTTER else drift + noise)


def test_compositions_as_data_for_two_pieces_and_two_noises():
    halves = [("drift", 0, 0.25), ("drift", 1, 0.5), ("drift", 0, 0.25)]
    noise = [("noise", 0, 1.0), ("noise", 1, 1.0)]
    expected = ((0.5, (*halves, *noise, *halves)), (0.5, (*halves, *noise[::-1], *halves)))
    assert compositions(ORDER_2.rows, MaxwellBloch((1.0, 1.0))) == expected


def test_order_2_with_the_coin_turned_is_its_own_inverse(system, generator):
    """Phi_{-h,-coin}(-dW) o Phi_{h,coin}(dW) is the identity: turning the coin reverses the order of all flows."""
    model, y, dW = system
    h, coins = 0.3, tosses(generator)
    new, _ = take_step(ORDER_2, model, h, dW, y, coins)
    back, _ = take_step(ORDER_2, model, -h, -dW, new, -coins)
    assert relative(back, y) < 1e-12
    assert relative(new, y) > 0.1
    if len(noise_indices(model)) > 1:  # negative control
        assert relative(take_step(ORDER_2, model, -h, -dW, new, coins)[0], y) > 1e-2


def test_only_order_2_tosses_coins():
    assert [name for name, row in SCHEMES.items() if protocol.tosses(row.record)] == ["splitting_order2"]


def test_order_2_keeps_all_casimirs(system, generator):
    model, y, _ = system
    steps = 200 if COMPILED else 10
    dW = 0.1 * np.clip(generator.standard_normal((steps, noises(model), LANES)), -3.0, 3.0)
    new, _ = take_steps(ORDER_2, model, 0.01, dW, y, tosses(generator, steps))
    for lane in range(LANES):
        before, after = (np.array(casimirs(model, tuple(x[:, lane].tolist()))) for x in (y, new))
        assert np.all(np.abs(after - before) <= 1e-13 * np.linalg.norm(y[:, lane]) ** 3 + 1e-13)
    assert relative(new, y) > 0.1


def test_flows_of_a_step_for_estimates_of_run_time():
    """13 flows and, because lanes differ in their coins, two of the noises twice."""
    assert typical_ns("splitting_order2", RIGID_BODY) > typical_ns("splitting", RIGID_BODY)
    flow = typical_ns("splitting", RIGID_BODY._replace(sigma=(None, None, None))) / 3
    assert typical_ns("splitting_order2", RIGID_BODY._replace(sigma=(None, None, None))) == pytest.approx(10 * flow)
    draws = typical_ns("splitting", RIGID_BODY) - 6 * flow
    assert typical_ns("splitting_order2", RIGID_BODY) == pytest.approx(15 * flow + draws)


# --- lanes are independent -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SCHEMES)
def test_lanes_that_are_not_finite_do_not_disturb_others(name, generator):
    y, dW, h = random_states(generator), increments(generator, 0.1, steps=5), 0.05
    scheme, coins = SCHEMES[name].record, tosses(generator, steps=5)
    clean, clean_report = take_steps(scheme, RIGID_BODY, h, dW, y, coins)
    spoilt = np.array([3, 4, 30, 31, 63])
    y[:, 3] = np.nan
    y[1, 4] = np.nan
    y[2, 30] = np.inf
    y[0, 31] = -np.inf
    dW[2, 0, 63] = np.nan
    with np.errstate(all="ignore"):
        new, report = take_steps(scheme, RIGID_BODY, h, dW, y, coins)
    others = np.delete(np.arange(LANES), spoilt)
    assert np.all(np.isnan(new[:, spoilt]).any(axis=0))
    # A sweep may take another road to the same sine, an iteration may end a turn later: the last digits may differ.
    assert relative(new[:, others], clean[:, others]) < 1e-14
    if name == IMPLICIT:
        assert report[ITERATIONS] <= 2 * clean_report[ITERATIONS]  # no looping for what is lost
        assert report[FAILURES] == 5 * 4 + 3


@pytest.mark.parametrize("name", SCHEMES)
def test_a_lane_does_not_depend_on_its_place(name, generator):
    """Lanes in another order give the same bits in another order."""
    y, dW, order = random_states(generator), increments(generator, 0.1, steps=3), generator.permutation(LANES)
    coins = tosses(generator, steps=3)
    new, _ = take_steps(SCHEMES[name].record, RIGID_BODY, 0.1, dW, y, coins)
    permuted, _ = take_steps(SCHEMES[name].record, RIGID_BODY, 0.1, dW[:, :, order], y[:, order], coins[:, order])
    assert np.array_equal(permuted, new[:, order])


@pytest.mark.parametrize("name", SCHEMES)
def test_a_noise_that_is_off_has_no_effect(name, generator):
    """None and 0 mean the same; and increments of a noise that is off are not read."""
    y, dW, h, coins = random_states(generator), increments(generator, 0.1), 0.1, tosses(generator)
    zero, _ = take_step(SCHEMES[name].record, RIGID_BODY._replace(sigma=(1.0, 0.0, 0.0)), h, dW, y, coins)
    dW[1:] = np.nan
    off, _ = take_step(SCHEMES[name].record, ONE_NOISE, h, dW, y, coins)
    if name in SPLITTINGS:
        assert np.array_equal(off, zero)  # a flow through the angle 0 is left out
    else:
        assert relative(off, zero) < 1e-15  # one rounding more or less where 0 is not added
    on, _ = take_step(SCHEMES[name].record, RIGID_BODY, h, increments(generator, 0.1), y)
    assert relative(on, zero) > 1e-2


# --- Poisson maps ----------------------------------------------------------------------------------------------------

DELTA = 2e-4
POINTS = 4  # a block holds 4 points with 1 + 2 * 6 states each


def structure_matrix(y):
    y1, y2, y3 = y
    return np.array([[0, -y3, y2], [y3, 0, -y1], [-y2, y1, 0]])


def poisson_defect(scheme, model, h, generator):
    """The largest entry of D B(y) D^T - B(Phi(y)) over random y and dW; D by central differences of fourth order.

    All states that belong to one point are lanes of one block with the same increments and coin.
    """
    worst = 0.0
    y, dW, coins = np.ones((3, LANES)), np.zeros((3, LANES)), np.ones(LANES)
    offsets = [np.zeros(3)] + [j * DELTA * e for e in np.eye(3) for j in (-2, -1, 1, 2)]
    for point in range(POINTS):
        lanes = slice(point * len(offsets), (point + 1) * len(offsets))
        y[:, lanes] = (generator.standard_normal(3) + np.array(offsets)).T
        dW[:, lanes] = increments(generator, h)[:, :1]
        coins[lanes] = (-1) ** point
    new, _ = take_step(scheme, model, h, dW, y, coins)
    for point in range(POINTS):
        base = point * len(offsets)
        columns = []
        for i in range(3):
            a, b, c, d = (new[:, base + 1 + 4 * i + j] for j in range(4))
            columns.append((8.0 * (c - b) - (d - a)) / (12.0 * DELTA))
        jacobian = np.transpose(columns)
        defect = jacobian @ structure_matrix(y[:, base]) @ jacobian.T - structure_matrix(new[:, base])
        worst = max(worst, np.abs(defect).max())
    return worst


@pytest.mark.parametrize("h", [0.01, 0.1, 0.5])
@pytest.mark.parametrize("name", [name for name, row in SCHEMES.items() if "Poisson structure" in row.preserves])
def test_poisson_maps(name, model, h, generator):
    for _ in range(5 if COMPILED else 1):
        assert poisson_defect(SCHEMES[name].record, model, h, generator) < 1e-8


def test_all_splittings_claim_to_be_poisson_maps_and_no_others():
    assert {name for name, row in SCHEMES.items() if "Poisson structure" in row.preserves} == set(SPLITTINGS)


@pytest.mark.parametrize("name", ["euler_maruyama", "midpoint"])
def test_comparators_are_no_poisson_maps(name, model, generator):
    """Negative control.  The midpoint rule keeps quadratic Casimirs but, for a B that is not constant, not B."""
    assert poisson_defect(SCHEMES[name].record, model, 0.5, generator) > 1e-3


# --- Casimirs --------------------------------------------------------------------------------------------------------


def casimir_errors(scheme, h, steps, seed=5):
    """|C(y_n) - C(y_0)| / C(y_0) of every lane after many steps."""
    generator = np.random.default_rng(seed)
    y = on_the_sphere(generator)
    dW, coins = increments(generator, h, steps), tosses(generator, steps)
    new, report = take_steps(scheme, RIGID_BODY, h, dW, y, coins)
    before, after = (y**2).sum(axis=0), (new**2).sum(axis=0)
    return np.abs(after - before) / before, report


STEPS = 1000 if COMPILED else 20


@pytest.mark.parametrize("name", [name for name, row in SCHEMES.items() if "Casimirs" in row.preserves])
@pytest.mark.parametrize("h", [1e-2, 0.2])
def test_casimirs_are_kept(name, h):
    errors, report = casimir_errors(SCHEMES[name].record, h, STEPS)
    assert errors.max() < 1e-13
    assert report[FAILURES] == 0


def test_euler_maruyama_does_not_keep_them_unless_renormalised():
    errors, _ = casimir_errors(SCHEMES["euler_maruyama"].record, 1e-2, STEPS)
    assert np.median(errors) > 1e-3
    for h in (1e-2, 1.0):
        errors, _ = casimir_errors(RENORMALISED, h, STEPS)
        assert errors.max() < 1e-13


@pytest.mark.parametrize("h", [1e-12, 1e-3, 1.0])  # angles of 1e-4, 1e5 and 1e8: all but one of the roads to a sine
@pytest.mark.parametrize("scheme", [LIE_TROTTER, ORDER_2], ids=["lie_trotter", "order2"])
def test_casimir_of_one_step_far_from_the_origin(scheme, h, generator):
    """It is kept to rounding whatever the angles: 6 rotations, or 13, each by a few roundings of 1e-16."""
    y = 1e8 * on_the_sphere(generator)
    new, _ = take_step(scheme, RIGID_BODY, h, increments(generator, h), y, tosses(generator))
    before, after = (y**2).sum(axis=0), (new**2).sum(axis=0)
    assert np.max(np.abs(after - before) / before) < 2e-15
    assert relative(new, y) > 1e-5


@pytest.mark.skipif(not COMPILED, reason="64 million steps")
@pytest.mark.parametrize("name", SPLITTINGS)
def test_casimir_of_splitting_walks_without_bias(name):
    """10^6 steps of 64 paths by the ensemble; C(y_0) = 1.  A bias of 1e-17 a step would show as 20 standard errors."""
    h = 2.0**-10
    states, _ = simulate(SCHEMES[name].record, h=h, steps=10**6)
    drift = (states[0, 0] ** 2).sum(axis=0) - np.sum(np.square(INITIAL))
    assert np.abs(drift).mean() <= 1e-12
    standard_error = drift.std(ddof=1) / np.sqrt(drift.size)
    assert abs(drift.mean()) <= 4 * standard_error
    assert standard_error < 1e-12 / 4  # so that the bound says something


# --- midpoint --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("h", [1e-3, 0.1, 0.5])
def test_midpoint_satisfies_its_equation(model, h, generator):
    y, dW = on_the_sphere(generator), increments(generator, h)
    new, report = take_step(Midpoint(), model, h, dW, y)
    assert relative(new, y + field(model, h, dW, 0.5 * (y + new))) < 1e-14
    # Negative control: explicit, or with the mean of two fields in place of the field at the mean.
    for wrong in (field(model, h, dW, y), 0.5 * (field(model, h, dW, y) + field(model, h, dW, new))):
        assert relative(new, y + wrong) > (1e-4 if h > 0.01 else 1e-8)
    assert report[SOLVES] == LANES and report[FAILURES] == 0
    assert LANES <= report[ITERATIONS] <= 8 * LANES
    assert report[RESIDUAL] <= Midpoint().tolerance


def test_midpoint_reports_what_it_could_not_solve(generator):
    y, dW = on_the_sphere(generator), increments(generator, 0.1)
    dW[:, 7] = 0.0
    still = (LOCKED, LOCKED, LOCKED)
    model = RIGID_BODY._replace(inertia=still)  # so that lane 7 is at rest and solved by its first guess
    for most in (0, 1):
        _, report = take_step(Midpoint(most_iterations=most), model, 0.1, dW, y)
        assert report[SOLVES] == LANES and report[ITERATIONS] == most * LANES
        assert report[FAILURES] == LANES - 1
        assert report[RESIDUAL] > 1e-8
    with np.errstate(all="ignore"):
        new, report = take_step(Midpoint(), model, 0.1, 1e3 * dW, y)
    assert 0 < report[FAILURES] < LANES  # increments this large are what truncation is for
    assert report[ITERATIONS] <= Midpoint().most_iterations * LANES
    assert np.array_equal(new[:, 7], y[:, 7])
    _, loose = take_step(Midpoint(tolerance=1.0, most_iterations=1), model, 0.1, dW, y)
    assert loose[FAILURES] == 0


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_midpoint_reports_a_residual_that_is_not_finite(bad, generator):
    """However NaN comes about: the processor's own, from inf - inf, has its sign bit set.  And it is not forgotten."""
    y, dW = on_the_sphere(generator), increments(generator, 0.1, steps=2)
    y[1, 20] = bad
    with np.errstate(all="ignore"):
        _, report = take_steps(Midpoint(), RIGID_BODY, 0.1, dW, y)
    assert report[FAILURES] == 2
    assert not np.isfinite(report[RESIDUAL])


def test_midpoint_adds_up_its_reports(generator):
    y, dW = on_the_sphere(generator), increments(generator, 0.1, steps=4)
    _, total = take_steps(Midpoint(), RIGID_BODY, 0.1, dW, y)
    parts = []
    for n in range(4):
        y, report = take_step(Midpoint(), RIGID_BODY, 0.1, dW[n], y)
        parts.append(report)
    assert np.array_equal(total[:RESIDUAL], np.sum(parts, axis=0)[:RESIDUAL])
    assert total[RESIDUAL] == np.max(parts, axis=0)[RESIDUAL]


class OfDimension1(NamedTuple):
    dimension = 1


class OfDimension2(NamedTuple):
    dimension = 2


class OfDimension3(NamedTuple):
    dimension = 3


class OfDimension8(NamedTuple):
    dimension = 8


OF_DIMENSION = {cls.dimension: cls() for cls in (OfDimension1, OfDimension2, OfDimension3, OfDimension8)}


@kernel
def eliminate_block(model, matrix):
    eliminate(model, matrix)


def solutions(systems, right):
    """Of systems [lane, row, column], with the layout that `eliminate` wants: column by column, lanes together."""
    d = systems.shape[1]
    augmented = np.concatenate([systems, right[:, :, np.newaxis]], axis=2)
    matrix = np.concatenate([augmented.transpose(2, 1, 0).ravel(), np.full(2 * LANES, np.nan)])
    eliminate_block(OF_DIMENSION[d], matrix)
    return matrix[d * d * LANES : d * (d + 1) * LANES].reshape(d, LANES).T


@pytest.mark.parametrize("d", [1, 2, 3, 8])
def test_elimination(d, generator):
    systems, right = generator.standard_normal((LANES, d, d)), generator.standard_normal((LANES, d))
    expected = np.linalg.solve(systems, right[:, :, np.newaxis])[:, :, 0]
    conditions = np.linalg.cond(systems)
    errors = np.linalg.norm(solutions(systems, right) - expected, axis=1) / np.linalg.norm(expected, axis=1)
    assert np.all(errors < 1e-15 * d * conditions)


@pytest.mark.parametrize("d", [2, 3, 8])
def test_elimination_needs_its_pivots(d, generator):
    """Systems that fail without exchanges of rows: leading entries 0 or tiny, and permutations."""
    systems = generator.standard_normal((LANES, d, d)) + 2.0 * np.eye(d)[:, ::-1]
    systems[0:16, 0, 0] = 0.0
    systems[16:24, 0, 0] = 1e-20
    systems[24:32, : d - 1, 0] = 0.0  # only the last row has an entry in the first column
    for lane in range(32, LANES):
        systems[lane] = np.eye(d)[generator.permutation(d)]
    right = generator.standard_normal((LANES, d))
    expected = np.linalg.solve(systems, right[:, :, np.newaxis])[:, :, 0]
    conditions = np.linalg.cond(systems)
    assert conditions.max() < 1e5
    with np.errstate(all="ignore"):
        found = solutions(systems, right)
    errors = np.linalg.norm(found - expected, axis=1) / np.linalg.norm(expected, axis=1)
    assert np.all(errors < 1e-14 * d * conditions)


def test_elimination_of_singular_systems_is_not_finite_and_stays_in_its_lane(generator):
    systems, right = generator.standard_normal((LANES, 3, 3)), generator.standard_normal((LANES, 3))
    clean = solutions(systems, right)
    systems[11] = 0.0
    with np.errstate(all="ignore"):
        found = solutions(systems, right)
    assert not np.any(np.isfinite(found[11]))
    assert np.array_equal(np.delete(found, 11, axis=0), np.delete(clean, 11, axis=0))
