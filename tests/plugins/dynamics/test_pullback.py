"""Pull-back pictures: many states on one path of noise, where all is known, and how they are stored and drawn."""

import math

import numpy as np
import pytest
from helpers import compiled_only
from states import chunks_of, finished, same_numbers
from test_lyapunov import in_python

import spi
from spi.ensemble.random_states import block_states
from spi.plugins.dynamics.drawing.maps import mollweide
from spi.plugins.dynamics.kinds.lyapunov import figure, study
from spi.plugins.dynamics.kinds.lyapunov.results import Exponents, kaplan_yorke
from spi.running.load import load
from spi.statistics.tallies import Batch
from spi.storage import Part

BODY = {"name": "rigid_body", "inertia": [2, 1, "2/3"], "noise_inertia": [1, 2, 3], "sigma": [1, 1, 1]}
SPEC = """\
title: A title
kind: lyapunov
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1, 1, 1]}
initial: [cos(1.1), 0, sin(1.1)]
final_time: 4
step: 2^-3
schemes: [munthe_kaas_areas]
samples: 64
pullback: {times: [1, 2], points: 150}
"""


@pytest.fixture
def plan_of(tmp_path):
    def written(*overrides, model=None):
        path = tmp_path / "s.yaml"
        path.write_text(SPEC, encoding="utf-8")
        case = load(path, overrides=overrides).cases[0]
        case = case if model is None else case.model_copy(update={"model": model(case.model)})
        return study.plan(case, Part(case.schemes[0]))

    return written


def about_axis_3(model):
    return model._replace(inertia=(1e12, 1e12, 1e12), noise_inertia=(1e12, 1e12, 1.0), sigma=(0.0, 0.0, 1.0))


def states(plan):
    """(T, points, d)"""
    return np.moveaxis(plan.pulled.states(Batch.of_first(2)), 0, 2).transpose(0, 2, 3, 1).reshape(2, 128, 3)


def test_noise_about_one_axis_turns_each_state_by_a_known_angle(plan_of):
    """The angle is y_3 W, W the increment of the noise from -t to 0; the states begin uniform on the sphere."""
    plan = plan_of(model=about_axis_3)
    W = np.cumsum(plan.pulled._noise.dW[:, 0, 2])[[7, 15]]
    begin = block_states(plan.case.points_law, plan.stream, 0, 2).reshape(2, 3, 64).transpose(0, 2, 1).reshape(128, 3)
    assert abs(begin[:, 2].mean()) < 4.5 / math.sqrt(3 * 128) and np.abs((begin**2).sum(axis=1) - 1).max() < 1e-12
    for found, angle in zip(states(plan), np.outer(W, begin[:, 2]), strict=True):
        turned = (begin[:, 0] + 1j * begin[:, 1]) * np.exp(-1j * angle)
        assert np.abs(found[:, 0] + 1j * found[:, 1] - turned).max() < 1e-9
        assert np.abs(found[:, 2] - begin[:, 2]).max() < 1e-9


def test_the_noise_ends_with_the_same_step(plan_of):
    """Steps on the increments of path 0 in reversed order, by the integrator; longer pictures change no shorter one."""
    plan = plan_of()
    begin = block_states(plan.case.points_law, plan.stream, 0, 2).reshape(2, 3, 64).transpose(0, 2, 1).reshape(128, 3)
    integrator = spi.Integrator(BODY, "munthe_kaas_areas", 2**-3, initial=plan.case.initial)
    drawn = [np.repeat(one, 128, axis=1) for one in integrator.noise(1, 16)]
    for found, n in zip(states(plan), (8, 16), strict=True):
        assert np.array_equal(found, integrator.steps(begin, *(one[:n][::-1] for one in drawn)))
        assert np.abs(found - integrator.steps(begin, *(one[:n] for one in drawn))).max() > 0.1
    assert np.array_equal(states(plan_of("pullback.times=[2, 4]"))[0], states(plan)[1])


def test_bits_and_the_file(plan_of):
    plan = plan_of()
    with chunks_of(2):
        whole = finished(plan)
        assert same_numbers(finished(plan, 1), whole)
        found = plan.results(whole)
        plain = study.plan(plan.case.model_copy(update={"pullback": None}), plan.part)
        assert plain.deciding(0) == plan.deciding(0) != plan.deciding(1)
        assert same_numbers(finished(plain).total(), whole.total())
    again = Exponents.of(found.group())
    pictures = again.pictures
    assert np.array_equal(pictures.density, found.pictures.density) and again.panels == ("lyapunov", "pullback")
    area = pictures.width.prod(axis=1)
    assert (
        pictures.density.sum(axis=(1, 2)) * area == pytest.approx([1, 1])
        and not pictures.outside.any()
        and pictures.is_sphere
    )
    d = states(plan)[1]
    pairs = np.linalg.norm(d - np.roll(d.reshape(2, 64, 3), 32, axis=1).reshape(128, 3), axis=1)
    assert abs(pictures.distance[1] - pairs.mean()) < 4 * pictures.distance_stderr[1]
    assert pictures.typical[1] < pictures.distance[1] < 2
    assert len(figure.draw("A", [[again]]).axes) == 3 + 2


def test_pictures_where_the_surface_is_no_sphere(plan_of):
    model = "model={name: maxwell_bloch, sigma: [1, 1]}", "schemes=[splitting]"
    plan = plan_of(*model, "initial={law: gaussian, mean: [0, 1, 0], sd: 0.1}")
    found = in_python(plan).pictures
    assert found.sides == ("y1", "y2") and not found.is_sphere
    assert found.density.sum(axis=(1, 2)) * found.width.prod(axis=1) + found.outside == pytest.approx([1, 1])


def test_the_projection_keeps_areas():
    z, turn = np.meshgrid(np.linspace(-0.99, 0.99, 199), np.linspace(-3, 3, 7))
    dx = [(mollweide(z, turn + e)[0] - mollweide(z, turn - e)[0]) / (2 * e) for e in (1e-3,)]
    dy = [(mollweide(z + e, turn)[1] - mollweide(z - e, turn)[1]) / (2 * e) for e in (1e-3,)]
    assert np.abs(dx[0] * dy[0] - 1).max() < 5e-3
    width, height = mollweide(np.array([0.0, 1.0]), np.array([math.pi, 0.0]))
    assert math.pi * width[0] * height[1] == pytest.approx(4 * math.pi)


def test_the_dimension_of_kaplan_and_yorke():
    assert kaplan_yorke(np.array([0.02, -0.1])) == pytest.approx(1.2)
    assert kaplan_yorke(np.array([[-0.1, 0.5, 1.0], [-0.2, -0.5, 0.5]])) == pytest.approx([0.0, 2.0, 2.0])
    assert kaplan_yorke(np.array([1.0, 0.5, -3.0, -9.0])) == pytest.approx(2.5)
    found = kaplan_yorke(np.array([[0.02, np.nan, 0.1], [-0.1, -0.1, -np.inf]]))
    assert found[0] == pytest.approx(1.2) and np.isnan(found[1:]).all()


@pytest.mark.needs("systems")
@pytest.mark.slow
@compiled_only
def test_near_bodies_meet_at_the_rate_of_the_largest_exponent(plan_of):
    """At 1/T = 16 the typical distance falls as exp(-0.1915 t) on average over paths of noise, and at 1/T = 0 grows."""
    system = "{algebra: so(3), hamiltonian: y1^2/2 + y2^2/4 + y3^2/6, noises: [y1, y2, y3], sigma: [1/2, 1/2, 1/2]}"
    near = "initial={law: gaussian, mean: [0.6, 0.48, 0.64], sd: 1e-6, project: true}"
    of = f"model={system}", near, "schemes=[splitting_symmetric]", "final_time=60", "step=2^-4"
    slopes = {}
    for temperature in ("1/16", "inf"):
        for seed in range(1, 25):
            plan = plan_of(*of, f"temperature={temperature}", "pullback={times: [10, 60], points: 64}", f"seed={seed}")
            found = plan.pulled.results(finished(plan).total(1))
            slopes.setdefault(temperature, []).append(math.log(found.typical[1] / found.typical[0]) / 50)
    cold, hot = (np.array(each) for each in slopes.values())
    assert abs(cold.mean() + 0.1915) < 4.5 * cold.std() / math.sqrt(23) < 0.1
    assert hot.mean() > 0.02
