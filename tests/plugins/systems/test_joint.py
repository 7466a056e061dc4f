"""Joint flows, noise flows that share the increment of the step, and loops between them."""

import itertools
import math

import numpy as np
import pytest
import scheme_cases
from helpers import (
    COMPILED,
    INITIAL,
    LANES,
    RIGID_BODY,
    composed,
    random_states,
    take_step,
    take_steps,
    turned,
)
from scheme_cases import increments, relative, tosses
from scipy.integrate import solve_ivp
from yaml_cases import SYSTEMS, made

from spi.checks.model_checks import check_model
from spi.ensemble.protocol import area_pairs, joint_noises, joint_parts, noises
from spi.ensemble.scheme_protocol import needs_areas
from spi.exact.expectations import exact_expectations, expectations
from spi.models import MaxwellBloch, RigidBody
from spi.models.delegation import Damped
from spi.schemes import composed as entry_of
from spi.schemes import weak_exponents
from spi.schemes.splitting import (
    JOINT,
    JOINT_AREAS,
    JOINT_LIE,
    LIE_TROTTER_AREAS,
    has_antithetic_path,
    splitting,
)
from spi.schemes.stages import compositions, flows, is_own_reverse, substeps, sweeps
from spi.specs.compositions import weak_order

# fixtures
generator, model = scheme_cases.generator, scheme_cases.model

PAIRS = ((0, 1), (0, 2), (1, 2))
HALF, DRIFT = flows("drift", fraction=1 / 2), flows("drift")
AROUND = splitting(flows("noise", fraction=1 / 2, shared=True), DRIFT, flows("noise", "backwards", 1 / 2, shared=True))
WITHIN = splitting(HALF, flows("noise", "symmetric", shared=True), flows("drift", "backwards", 1 / 2))
JOINT_LOOPS = splitting(
    flows("joint", fraction=1 / 2, shared=True), flows("loops"), flows("joint", "backwards", 1 / 2, shared=True)
)
JOINT_COIN = splitting(flows("joint", coin=True))
JOINT_SYMMETRIC = splitting(flows("joint", "symmetric"))


# --- by hand ---------------------------------------------------------------------------------------------------------


def joint(model, k, t, s, y):
    """exp(t Y_{H_k} + s Y_{Ĥ_k}) by the printed rotation, for arrays; a noise that is off has no flow."""
    sigma = model.sigma[k] or 0.0
    return turned(k, (t / model.inertia[k] + sigma * s / model.noise_inertia[k]) * y[k], y, np.sin, np.cos)


def in_turn(model, h, dW, y, parts):
    """Joint flows (k, share of the time, share of the increment) one after the other."""
    for k, of_time, of_noise in parts:
        y = joint(model, k, of_time * h, of_noise * dW[k], y)
    return y


def middle_loops(model, areas, coins, y, together=False):
    """The loops for A_kl, by rotations; or one for all, since {Ĥ_k, Ĥ_l} = -+ y1 y2 y3 / (Î_k Î_l)."""
    pairs, inertia = area_pairs(model), model.noise_inertia
    products = [model.sigma[k] * model.sigma[m] * area for (k, m), area in zip(pairs, areas, strict=True)]
    if together and pairs:
        sign = {(0, 1): 1.0, (0, 2): -1.0, (1, 2): 1.0}
        every = [sign[k, m] / (inertia[k] * inertia[m]) for k, m in pairs]
        products = [sum(c / every[0] * product for c, product in zip(every, products, strict=True))]
    for (k, m), product in zip(pairs, products, strict=False):
        a = coins * np.sqrt(np.abs(product))
        b = np.sign(product) * a
        for j, t in ((k, a), (m, b), (k, -a), (m, -b)):
            y = turned(j, t / model.noise_inertia[j] * y[j], y, np.sin, np.cos)
    return y


THERE = [(k, 1 / 2, 1 / 2) for k in range(3)]


def test_steps_are_those_by_hand(model, generator):
    h, y, dW, coins = 0.3, random_states(generator), increments(generator, 0.3), tosses(generator)
    areas = 0.1 * generator.standard_normal((len(area_pairs(model)), LANES))
    there = in_turn(model, h, dW, y, THERE)
    noise_there, drift_there = ([(k, *share) for k in range(3)] for share in ((0, 1 / 2), (1 / 2, 0)))
    around = [*noise_there, *((k, 1, 0) for k in range(3)), *noise_there[::-1]]
    within = [*drift_there, *noise_there[:2], (2, 0, 1), *noise_there[1::-1], *drift_there[::-1]]
    by_hand = [
        (JOINT_LIE, in_turn(model, h, dW, y, [(k, 1, 1) for k in range(3)])),
        (JOINT, in_turn(model, h, dW, there, THERE[::-1])),
        (JOINT_LOOPS, in_turn(model, h, dW, middle_loops(model, areas, coins, there), THERE[::-1])),
        (JOINT_AREAS, in_turn(model, h, dW, middle_loops(model, areas, coins, there, together=True), THERE[::-1])),
        (AROUND, in_turn(model, h, dW, y, around)),
        (WITHIN, in_turn(model, h, dW, y, within)),
    ]
    for scheme, expected in by_hand:
        rows = np.concatenate([dW, areas]) if needs_areas(scheme) else dW
        new, _ = take_step(scheme, model, h, rows, y, coins)
        assert relative(new, expected) < 1e-14
    for (_, first), (_, second) in itertools.combinations(by_hand if area_pairs(model) else by_hand[:2], 2):
        assert relative(first, second) > 1e-3


def test_a_coin_reverses_joint_flows(generator):
    h, y, dW, coins = 0.3, random_states(generator), increments(generator, 0.3), tosses(generator)
    new, _ = take_step(JOINT_COIN, RIGID_BODY, h, dW, y, coins)
    heads = in_turn(RIGID_BODY, h, dW, y, [(k, 1, 1) for k in range(3)])
    tails = in_turn(RIGID_BODY, h, dW, y, [(k, 1, 1) for k in (2, 1, 0)])
    assert relative(new, np.where(coins > 0, heads, tails)) < 1e-14
    assert relative(heads, tails) > 1e-2


# --- what loops supply -----------------------------------------------------------------------------------------------


def noise_field(model, k, y):
    """B grad Ĥ_k for Ĥ_k = y_k^2 / (2 Î_k), or y_k of a system in YAML."""
    return np.cross(y, np.eye(3)[k]) * (y[k] / model.noise_inertia[k] if model is RIGID_BODY else 1.0)


def noise_derivative(model, k, y, v):
    e = np.eye(3)[k]
    if model is not RIGID_BODY:
        return np.cross(v, e)
    return (np.cross(v, e) * y[k] + np.cross(y, e) * v[k]) / model.noise_inertia[k]


def moved_exactly(model, y, w, a):
    """The flow over the time 1 of sum_k w_k Y_k + sum_{k<l} a_kl [Y_k, Y_l]: with areas the step to second order."""

    def field(t, y):
        fields = [noise_field(model, k, y) for k in range(3)]
        found = sum(w[k] * fields[k] for k in range(3))
        for (k, m), area in zip(PAIRS, a, strict=True):
            bracket = noise_derivative(model, m, y, fields[k]) - noise_derivative(model, k, y, fields[m])
            found = found + area * bracket
        return found

    return solve_ivp(field, (0.0, 1.0), y, rtol=1e-12, atol=1e-14).y[:, -1]


UNEVEN = splitting(
    flows("noise", fraction=1 / 4, shared=True), flows("loops"), flows("noise", "backwards", 3 / 4, shared=True), DRIFT
)


LINEAR = "{algebra: so(3), hamiltonian: y1^2 + y2^2, noises: [y1, y2, y3]}"
AREAS_LAST = splitting(flows("noise"), flows("areas"), DRIFT)


def before(scheme):
    """What a step says of the pairs in its loops, and in the flows of brackets."""
    times = [time for *_, time in sweeps(scheme.stages, RIGID_BODY)]
    return {one.before for time in times for one in getattr(time, "lacking", ())}


@pytest.mark.parametrize(
    ("scheme", "p", "linear"),
    [
        (LIE_TROTTER_AREAS, 1, False),
        (splitting(flows("noise", "backwards"), flows("loops"), DRIFT), 0, False),
        (JOINT_LOOPS, 1 / 2, False),
        (JOINT_AREAS, 1 / 2, False),
        (UNEVEN, 1 / 16 + 3 / 16, False),
        (splitting(flows("joint"), flows("loops")), 1, False),
        (AREAS_LAST, 1, False),
        (AREAS_LAST, 1, True),
        (JOINT_AREAS, 1 / 2, True),
    ],
)
def test_loops_and_areas_supply_what_is_lacking_at_second_order(scheme, p, linear):
    """Without time, increments e w and areas e^2 a: a step is off by O(e^3), and without areas by O(e^2)."""
    assert before(scheme) == {p}
    model = made(LINEAR).record if linear else RIGID_BODY
    w, a = np.array([0.7, -0.5, 0.9]), np.array([0.4, -0.3, 0.5])
    distances = {}
    for sign, e in itertools.product((1, 0, -1), (0.1, 0.05)):
        rows = np.repeat(np.concatenate([e * w, sign * e * e * a])[:, np.newaxis], LANES, axis=1)
        y, coins = np.repeat(np.reshape(INITIAL, (3, 1)), LANES, axis=1), np.where(np.arange(LANES) % 2, 1.0, -1.0)
        new, _ = take_step(scheme, model, 0.0, rows, y, coins)
        distances[sign, e] = np.linalg.norm(new.mean(axis=1) - moved_exactly(model, INITIAL, e * w, e * e * a))
    assert distances[1, 0.1] / distances[1, 0.05] > 6.5
    for wrong in (0, -1):  # negative controls
        assert distances[wrong, 0.1] / distances[wrong, 0.05] < 5
        assert distances[wrong, 0.05] > 5 * distances[1, 0.05]


def test_areas_take_one_loop_where_brackets_are_multiples_of_one_function():
    """Those of the rigid body are; a system in YAML does not say so, and has a loop for each pair."""
    counts = [len(sweeps(JOINT_AREAS.stages, record)) for record in (RIGID_BODY, made(LINEAR).record)]
    flows_of_halves = [2 * len(joint_parts(record)) for record in (RIGID_BODY, made(LINEAR).record)]
    assert np.subtract(counts, flows_of_halves).tolist() == [4, 12]
    assert len(sweeps(JOINT_LOOPS.stages, RIGID_BODY)) == 6 + 12
    assert check_model(RIGID_BODY, [INITIAL, (0.3, -0.8, 0.4)], written=False) == []


def test_wrong_factors_of_brackets_are_found():
    class Wrong(RigidBody):
        def bracket_factors(model):
            return 1.0, 2.0, 3.0

    (first, *_) = check_model(Wrong(*RIGID_BODY), [(0.3, -0.8, 0.4)], written=False)
    assert "bracket_factors: the brackets of the pairs (0, 1) and (0, 2) are no such multiples" in first


# --- stages as data --------------------------------------------------------------------------------------------------


def test_joint_flows_as_data():
    assert joint_parts(RIGID_BODY) == (("joint", 0), ("joint", 1), ("joint", 2))
    one = RIGID_BODY._replace(sigma=(None, 1.0, None))
    assert joint_parts(one) == (("drift", 0), ("joint", 1), ("drift", 2))
    damped = Damped(one, 0.1, one.sigma)
    assert joint_parts(damped) == (("drift", 0), ("joint", 1), ("drift", 2), ("drift", 3))
    crossed = type("Crossed", (RigidBody,), {"joint_noises": ((1,),), "__module__": RigidBody.__module__})
    assert joint_parts(crossed(*RIGID_BODY)) == (
        ("joint", 0), ("drift", 1), ("drift", 2), ("noise", 0), ("noise", 2)
    )  # fmt: skip
    ((_, acting),) = compositions(JOINT_LIE.stages, RIGID_BODY)
    assert acting == tuple((part, k, 1.0) for k in range(3) for part in ("drift", "noise"))
    assert [sweep[1:4] for sweep in sweeps(JOINT.stages, MaxwellBloch())] == [
        ("joint", 0, 0.5), ("joint", 1, 1.0), ("joint", 0, 0.5)
    ]  # fmt: skip


def test_shared_increments_take_no_sub_steps_and_are_not_independent():
    for scheme in (JOINT, AROUND, WITHIN):
        assert substeps(scheme.stages) == 1
        with pytest.raises(ValueError, match="share an increment are not independent"):
            compositions(scheme.stages, RIGID_BODY)
        assert not is_own_reverse(scheme.stages, RIGID_BODY)
        assert weak_order(scheme.stages, RIGID_BODY) == 1
        assert weak_exponents(entry_of("own", scheme.stages, 1.0), RIGID_BODY, 3) == (1, 2, 3)
    assert has_antithetic_path(JOINT) and has_antithetic_path(WITHIN) and not has_antithetic_path(JOINT_LIE)
    one = RIGID_BODY._replace(sigma=(1.0, None, None))
    once = ("noise", 0, 1.0)
    assert [k for k in compositions(WITHIN.stages, one)[0][1] if k[0] == "noise"] == [once]  # it acts only once
    assert weak_order(WITHIN.stages, one) == 2
    assert substeps(JOINT_SYMMETRIC.stages) == 2 and is_own_reverse(JOINT_SYMMETRIC.stages, RIGID_BODY)


@pytest.mark.parametrize(
    ("make", "complaint"),
    [
        (lambda: flows("drift", shared=True), "the drift has no increments"),
        (lambda: flows("loops", shared=True), "loops have neither"),
        (lambda: flows("noise", fraction=1 / 3, shared=True), "multiple of 1/8, at most 1$"),
        (lambda: splitting(HALF, HALF, flows("noise", shared=True, fraction=1 / 2), flows("noise", fraction=1 / 2)),
         "shared in all of its stages, or in none"),
        (lambda: splitting(flows("joint"), DRIFT), "of the drift add up to 2"),
        (lambda: splitting(flows("joint", "symmetric"), flows("loops")), "or shared in all of them"),
    ],
)  # fmt: skip
def test_what_makes_no_step_is_refused(make, complaint):
    with pytest.raises(ValueError, match=complaint):
        make()


# --- systems in YAML -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "groups"),
    [
        (SYSTEMS["heavy top"][0], None),
        ("{algebra: so(3), hamiltonian: y1^2 + y2^2 + y3^2/3, noises: [y3, y1^3, y1 + y2]}", ((1,), (), (0,))),
        ("{algebra: so(3)^2, hamiltonian: y1*y4 + y2*y5, noises: [y4, y1, y5^2, y1*y5]}", ((0, 1), (2,))),
        ("{algebra: so(3), hamiltonian: y1, noises: [cos(y1), y1^2]}", ((0, 1),)),
        ("{algebra: so(3), hamiltonian: y1, noises: [y2]}", ()),
        ("{algebra: so(3)^2, hamiltonian: y1, noises: [y1*y4, y4]}", ((0, 1),)),
        ("{algebra: so(3)^2, hamiltonian: y1, noises: [y4]}", ()),
    ],
)
def test_families_of_systems(text, groups, generator):
    """The generic checks compare joint flows with single ones; here a step with all of a family's noises at once."""
    record = made(text).record
    if groups is not None:
        assert joint_noises(record) == groups
    y, dW = random_states(generator, type(record).dimension), increments(generator, 0.3)
    dW = 0.3 * generator.standard_normal((noises(record), LANES))
    ((_, acting),) = compositions(JOINT_LIE.stages, record)
    new, _ = take_step(JOINT_LIE, record, 0.2, dW, y)
    assert (
        relative(new[:, :3], np.transpose([composed(record, acting, 0.2, y[:, n], dW[:, n]) for n in range(3)])) < 1e-13
    )


@pytest.mark.slow
@pytest.mark.skipif(not COMPILED, reason="compares with the compiler")
@pytest.mark.parametrize("scheme", [JOINT_COIN, JOINT_AREAS], ids=["coin", "areas"])
def test_kernels(scheme, generator):
    """Of one piece that goes with two noises and another with one, in an order that a coin decides."""
    record = made("{algebra: so(3)^2, hamiltonian: y1*y4 + y2*y5, noises: [y4, y1, y5^2, y3]}").record
    assert joint_noises(record) == ((0, 1), (2,))
    pairs = len(area_pairs(record)) if needs_areas(scheme) else 0
    y, coins = random_states(generator, 6), tosses(generator)
    dW = 0.3 * generator.standard_normal((1, 4 + pairs, LANES))
    compiled, _ = take_steps(scheme, record, 0.2, dW, y, coins[np.newaxis])
    plain, _ = take_step(scheme, record, 0.2, dW[0], y, coins)
    assert relative(compiled, plain) < 1e-13 and relative(compiled, y) > 0.1


# --- weak orders, without sampling -----------------------------------------------------------------------------------


def square(y):
    return y[0] ** 2 + y[1]


def local_weak_error(parts, h, nodes=12):
    """E phi after one step of joint flows, by Gauss's rule over the three increments, less E phi of the equation."""
    x, weights = np.polynomial.hermite_e.hermegauss(nodes)
    weights = weights / weights.sum()
    dW = math.sqrt(h) * np.stack(np.meshgrid(x, x, x), axis=0).reshape(3, -1)
    weight = np.einsum("i,j,k->ijk", weights, weights, weights).ravel()
    y = np.repeat(np.reshape(INITIAL, (3, 1)), dW.shape[1], axis=1)
    exact, _ = exact_expectations(RIGID_BODY, INITIAL, h, [square], 1e-11)
    return float(weight @ square(np.array(in_turn(RIGID_BODY, h, dW, y, parts))) - exact[0])


def test_one_increment_in_both_halves_has_weak_order_1():
    """The local error is of order 2, where independent halves have order 3."""
    shared = [local_weak_error(THERE + THERE[::-1], h) for h in (1 / 16, 1 / 32)]
    assert 3.6 < shared[0] / shared[1] < 4.4
    independent = []
    for h in (1 / 16, 1 / 32):
        steps = compositions(JOINT_SYMMETRIC.stages, RIGID_BODY)
        found = expectations(RIGID_BODY, steps, INITIAL, h, [h], [square], accuracy=1e-11)
        independent.append(float(found.value[0, 0] - exact_expectations(RIGID_BODY, INITIAL, h, [square], 1e-11)[0][0]))
    assert 7 < independent[0] / independent[1] < 9
    assert abs(independent[1]) < 0.2 * abs(shared[1])


@pytest.mark.parametrize(("scheme", "order"), [(JOINT_LIE, 1), (JOINT_COIN, 2), (JOINT_SYMMETRIC, 2)])
def test_weak_orders_of_joint_flows_with_increments_of_their_own(scheme, order):
    assert weak_order(scheme.stages, RIGID_BODY) == order
    steps = [2.0**-4, 2.0**-5]
    found = expectations(
        RIGID_BODY, compositions(scheme.stages, RIGID_BODY), INITIAL, 1.0, steps, [square], accuracy=1e-8
    )
    assert abs(np.log2(found.weak_error[0, 0] / found.weak_error[0, 1]) - order) < 0.15
