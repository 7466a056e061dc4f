"""Damping: one more exact flow, Casimir functions that decay as they should, and what specs may ask for."""

import pkgutil

import numpy as np
import pytest
import spec_files
from extending import Oscillator
from helpers import (
    LANES,
    RIGID_BODY,
    SCHEMES,
    LinearlyDamped,
    compiled_only,
    final_states,
    loop_in_python,
    take_step,
)
from model_cases import MODELS_UNDER_TEST, close
from states import finished

from spi.checks.model_checks import along, derivative
from spi.compiler.inlining import uncompiled
from spi.ensemble.fields import drift_field, step_field, step_field_derivative, step_gradient
from spi.ensemble.observer import growth
from spi.ensemble.protocol import (
    casimir_degrees,
    casimirs,
    conserved,
    dimension,
    drift_flow,
    noise_indices,
    noises,
    piece_indices,
    pieces,
)
from spi.ensemble.scheme_protocol import advance, report_row, work_size
from spi.models import RigidBody
from spi.models.delegation import Damped, damped, undamped
from spi.numerics.angles import ANY_ANGLES
from spi.running.run import plans
from spi.schemes.stages import compositions
from spi.specs import SpecError

GAMMA = 0.7

# --- the flow --------------------------------------------------------------------------------------------------------


@pytest.fixture(params=[pytest.param(case, id=case[0]) for case in MODELS_UNDER_TEST])
def case(request):
    """(a damped model, a state)."""
    _, model, sampler = request.param
    with uncompiled():
        yield damped(model, GAMMA), tuple(sampler(np.random.default_rng(4)).tolist())


def test_there_is_one_piece_more_and_nothing_else(case):
    model, y = case
    inner = undamped(model)
    assert pieces(model) == pieces(inner) + 1
    for fact in (dimension, noises, conserved, noise_indices, casimir_degrees):
        assert fact(model) == fact(inner)
    assert casimirs(model, y) == casimirs(inner, y)
    assert damped(inner, 0.0) is inner and undamped(inner) is inner


def test_the_flows_belong_to_the_field(case):
    """All drift flows together, and so the damped field is what the flow of the last piece says."""
    model, y = case
    flows = [derivative(lambda t, k=k: drift_flow(model, k, t, y, ANY_ANGLES)) for k in piece_indices(model)]
    assert close(np.sum(flows, axis=0), drift_field(model, y), 1e-10)
    assert close(flows[-1], -GAMMA * np.array(y), 1e-11)
    assert not close(np.sum(flows[:-1], axis=0), drift_field(model, y), 1e-2)
    assert close(drift_flow(model, len(flows) - 1, 2.0, y, ANY_ANGLES), np.exp(-2 * GAMMA) * np.array(y), 1e-15)


def test_newtons_matrix_has_the_damping(case):
    model, y = case
    generator = np.random.default_rng(8)
    v, dW = generator.standard_normal(dimension(model)), generator.standard_normal(noises(model) * LANES)
    gradient = step_gradient(model, 0.3, dW, 0, y)
    found = step_field_derivative(model, 0.3, dW, 0, y, gradient, tuple(v.tolist()))
    assert close(found, derivative(lambda s: step_field(model, 0.3, dW, 0, along(y, v)(s))), 1e-10)
    without = step_field_derivative(undamped(model), 0.3, dW, 0, y, gradient, tuple(v.tolist()))
    assert close(np.subtract(found, without), -0.3 * GAMMA * v, 1e-12)


def test_casimir_functions_have_the_degrees_that_are_stated(case):
    model, y = case
    scaled = casimirs(model, tuple(1.5 * np.array(y)))
    for c, (degree, value) in enumerate(zip(casimir_degrees(model), casimirs(model, y), strict=True)):
        assert scaled[c] == pytest.approx(1.5**degree * value, rel=1e-13)


def test_the_damping_acts_after_the_pieces_in_their_order():
    model = damped(RIGID_BODY, GAMMA)
    ((_, acting),) = compositions(SCHEMES["splitting"].composition, model)
    assert [k for part, k, _ in acting if part == "drift"] == [0, 1, 2, 3]
    ((_, acting), _) = compositions(SCHEMES["splitting_order2"].composition, model)
    half = [(k, share) for part, k, share in acting[:7] if part == "drift"]
    assert half == [(0, 0.25), (1, 0.25), (2, 0.25), (3, 0.5), (2, 0.25), (1, 0.25), (0, 0.25)]


# --- schemes ---------------------------------------------------------------------------------------------------------


def take_step_uncompiled(scheme, model, h, dW, y):
    """The state after a step, as plain Python makes it."""
    block, report = y.ravel().copy(), report_row()
    with uncompiled():
        advance(scheme, model, h, dW.ravel(), np.ones(LANES), block, np.empty(work_size(scheme, model)), report)
    return block.reshape(y.shape), report


@pytest.mark.share(1)
@pytest.mark.parametrize("name", ["splitting", "splitting_drift_first", "splitting_order2"])
def test_casimirs_decay_to_rounding_and_with_no_other_factor(name):
    generator, h = np.random.default_rng(6), 0.25
    y, dW = generator.standard_normal((3, LANES)), 0.5 * generator.standard_normal((3, LANES))

    def worst(model, take_step=take_step):
        new, _ = take_step(SCHEMES[name].record, model, h, dW, y)
        return np.abs((new**2).sum(axis=0) * np.exp(2 * GAMMA * h) / (y**2).sum(axis=0) - 1).max()

    assert worst(damped(RIGID_BODY, GAMMA)) < 2e-15
    assert worst(RIGID_BODY) > 0.1
    assert worst(LinearlyDamped(RIGID_BODY, GAMMA, RIGID_BODY.sigma), take_step_uncompiled) > 1e-3


@pytest.mark.parametrize(
    ("name", "order"), [("splitting", 1), ("splitting_order2", 2), ("midpoint", 2), ("euler_maruyama", 1)]
)
def test_orders_without_noise(name, order):
    """Against the damped oscillator, y(t) = exp(-gamma t) R(t) y_0; the noise has no increments."""
    model, y0, turn = damped(Oscillator((0.7,)), GAMMA), np.array([0.6, -1.1]), 2.0
    c, s = np.cos(turn), np.sin(turn)
    exact = np.exp(-GAMMA * turn) * np.array([[c, s], [-s, c]]) @ y0
    steps = np.array([8, 16, 32])
    errors = []
    for n in steps:
        y = np.repeat(y0[:, np.newaxis], LANES, axis=1)
        for _ in range(n):
            y, _ = take_step(SCHEMES[name].record, model, turn / n, np.zeros((1, LANES)), y)
        errors.append(np.linalg.norm(y[:, 0] - exact))
    assert np.polyfit(np.log2(turn / steps), np.log2(errors), 1)[0] == pytest.approx(order, abs=0.15)


# --- studies ---------------------------------------------------------------------------------------------------------

HEAD = """\
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1, 1, 1]}
initial: [cos(1.1), 0, sin(1.1)]
damping: 0.5
schemes: [splitting, euler_maruyama]
"""
STRONG = HEAD + "kind: strong\nfinal_time: 1\nsteps: 2^-3 .. 2^-5\nreference_step: 2^-6\nsamples: 60\n"
TRAJECTORY = HEAD + "kind: trajectory\nfinal_time: 2\nstep: 1/8\npanels: [casimir_errors]\n"
GROWTH = HEAD + "kind: growth\nsteps: [1/8]\nstep_count: 1280\nsamples: 60\n"
WEAK = HEAD + (
    "kind: weak\nfinal_time: 1\nsteps: [2^-2, 2^-3]\nreference_step: 2^-4\nfunctions: y1^2\n"
    "estimators: [plain]\nsamples: 1000\n"
)
load_text = spec_files.load_text


@pytest.mark.share(1)
@compiled_only
@pytest.mark.parametrize(
    ("text", "name", "asked"),
    [
        (STRONG, "casimir_drift", "spi.kinds.strong.study.path_observer"),
        (TRAJECTORY, "casimir_changes", "spi.kinds.trajectory.study.growth"),
        pytest.param(
            GROWTH,
            "casimir_worst",
            "spi.plugins.dynamics.kinds.long_paths.study.growth",
            marks=pytest.mark.needs("dynamics"),
        ),
    ],
    ids=["strong", "trajectory", "growth"],
)
def test_studies_compare_casimirs_with_their_decay(load_text, monkeypatch, text, name, asked):
    (plan,) = plans(load_text(text, "schemes=[splitting]"))

    def group_and_worst():
        group = plan.results(finished(plan)).group()
        return group, np.abs(group.variables[name][1]).max()

    with loop_in_python():
        group, worst = group_and_worst()
    assert worst < 1e-13 and group.attributes["model_damping"] == 0.5
    # negative control: with another decay
    right = pkgutil.resolve_name(asked)
    monkeypatch.setattr(asked, lambda model, *about, **more: right(model._replace(damping=0.4), *about, **more))
    with loop_in_python():
        _, worst = group_and_worst()
    assert worst > 1e-3


@compiled_only
def test_expectations_of_the_damped_equation(load_text):
    """E |y|^2 = exp(-2 gamma) at time 1, to rounding, where the function is the Casimir."""
    plan = plans(load_text(WEAK, "functions=y1^2 + y2^2 + y3^2", "schemes=[splitting]", "samples=64"))[0]
    with loop_in_python():
        states = final_states(plan.scheme, plan.model, h=2.0**-4, steps=16, blocks=1)[0]
        group = plan.results(finished(plan)).group()
    assert np.allclose((states**2).sum(axis=0), np.exp(-1.0), rtol=1e-14)
    assert np.abs(group.variables["error"][1]).max() < 1e-14


# --- specs -----------------------------------------------------------------------------------------------------------


def test_layers_override_the_damping(load_text):
    text = TRAJECTORY + "cases: [{name: a}, {name: b, damping: 2/3}, {name: c, damping: 0}]\n"
    a, b, c = (case.model for case in load_text(text).cases)
    assert isinstance(a, Damped) and a.damping == 0.5 and a.model == RIGID_BODY
    assert b.damping == 2 / 3 and type(c) is RigidBody
    assert [case.model.damping for case in load_text(text, "damping=0.25").cases] == [0.25] * 3
    assert load_text(text).hash != load_text(text, "damping=0.25").hash
    assert load_text(TRAJECTORY, "damping=0").hash == load_text(TRAJECTORY.replace("damping: 0.5\n", "")).hash
    assert "damping" not in load_text(text).effective["cases"]["c"]


def test_growth_is_that_of_each_degree():
    model = damped(MODELS_UNDER_TEST[5][1], GAMMA)
    assert growth(model, 2.0) == pytest.approx([np.exp(4 * GAMMA), np.exp(6 * GAMMA)])
    assert growth(RIGID_BODY, np.arange(3.0)) == 1.0


def test_models_with_casimirs_of_unknown_degrees_are_refused_by_name(load_text, monkeypatch):
    monkeypatch.setattr(RigidBody, "casimir_degrees", ())
    with pytest.raises(SpecError, match=r"damping: is for models that state .* rigid_body does not; leave it out"):
        load_text(STRONG)
