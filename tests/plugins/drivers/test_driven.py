"""Studies in which another process than Brownian motion drives: orders, the same bits however made, files."""

import numpy as np
import pytest
from helpers import compiled_only
from states import check_going_on, chunks_of, finished, plain, resumed, same_numbers

import spi
from spi.ensemble.loop import integrated, paths_of
from spi.kinds import KINDS
from spi.running.load import load
from spi.storage import Part

pytestmark = compiled_only

KEYS = """\
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1, 1, 1]}
initial: [cos(1.1), 0, sin(1.1)]
schemes: [splitting]
"""
STRONG = "kind: strong\nsamples: 128\nfinal_time: 1\nsteps: 2^-4 .. 2^-6\nreference_step: 2^-9\n" + KEYS
STATISTICS = "kind: statistics\nsamples: 70\nfinal_time: 4\nstep: 2^-6\nevery: 64\nstatistics: [mean]\n" + KEYS
LONG = "kind: growth\nsamples: 70\nsteps: [1/8]\nstep_count: 640\n" + KEYS
PATH = "kind: trajectory\npath: 65\nfinal_time: 4\nstep: 2^-6\npanels: [components]\n" + KEYS
COLOURED = "{kind: ornstein_uhlenbeck, tau: 1/4}"
FRACTIONAL = "{kind: fractional, hurst: 0.7}"


@pytest.fixture
def plan_of(tmp_path):
    def plan_of(text, noise, *overrides):
        path = tmp_path / "s.yaml"
        path.write_text(f"{text}noise: {noise}\n", encoding="utf-8")
        experiment = load(path, overrides=overrides)
        (case,) = experiment.cases
        return KINDS[experiment.kind].study.plan(case, Part(case.schemes[0]))

    return plan_of


def test_orders_are_those_of_the_driver(plan_of):
    found = {}
    for noise in (COLOURED, FRACTIONAL, "{kind: brownian}"):
        plan = plan_of(STRONG, noise)
        found[noise] = plan.results(finished(plan))
        assert found[noise].casimir_drift.max() < 1e-12
    order = [one.order.order for one in found.values()]
    assert [one.expected_order for one in found.values()] == pytest.approx([1.0, 0.9, 0.5])
    assert np.abs(np.array(order) - [1.0, 0.9, 0.5]).max() < 0.12
    assert found[COLOURED].about.driver == "Ornstein-Uhlenbeck, tau = 0.25"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scheme", "noise", "expected"),
    [
        ("splitting_joint", COLOURED, 2.0),
        ("splitting_symmetric", COLOURED, 2.0),
        ("splitting_order2", COLOURED, 1.5),
        ("splitting_joint", FRACTIONAL, 0.9),
        ("splitting", "{kind: fractional, hurst: 0.9}", 1.0),
        ("splitting_joint", "{kind: fractional, hurst: 0.9}", 1.3),
    ],
)
def test_orders_of_other_schemes(plan_of, scheme, noise, expected):
    plan = plan_of(STRONG, noise, f"schemes=[{scheme}]", "samples=2000", "steps=2^-5 .. 2^-8", "reference_step=2^-11")
    found = plan.results(finished(plan))
    assert found.expected_order == pytest.approx(expected)
    assert abs(found.order.order - expected) < 0.15


@pytest.mark.slow
@pytest.mark.parametrize(("noise", "expected"), [(COLOURED, 2.0), ("{kind: fractional, hurst: 0.3}", 0.8)])
def test_orders_with_one_noise(plan_of, noise, expected):
    one = "model={name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1, 0, 0]}"
    plan = plan_of(STRONG, noise, one, "schemes=[splitting_order2]", "samples=1000")
    found = plan.results(finished(plan))
    assert found.expected_order == pytest.approx(expected)
    assert abs(found.order.order - expected) < 0.15


@pytest.mark.parametrize(("text", "noise"), [(STATISTICS, COLOURED), (LONG, COLOURED), (STATISTICS, FRACTIONAL)])
def test_from_wherever_a_run_goes_on_the_same_bits_follow(plan_of, text, noise):
    with chunks_of(1):
        check_going_on(plan_of(text, noise), every=3)


def test_more_paths_go_on_from_fewer(plan_of):
    fewer, more = (plan_of(STATISTICS, COLOURED, f"samples={n}") for n in (64, 140))
    with chunks_of(1):
        assert same_numbers(resumed(more, plain(finished(fewer))), finished(more))


def test_kinds_have_the_same_paths(plan_of):
    plan = plan_of(PATH, FRACTIONAL)
    path = plan.results(finished(plan)).y
    other = plan_of(STATISTICS, FRACTIONAL)
    what = other.scheme, other.model, other.initial, other.grid, other.stream
    states, _ = integrated(*what, 1, 1, 70)
    assert np.array_equal(paths_of(states, 3)[0, :, 1], path[-1])


def test_a_file_of_brownian_increments_is_brownian_motion(plan_of, tmp_path):
    np.savez(tmp_path / "w.npz", dW=np.moveaxis(spi.increments(1, 70, 2**-6, 256, noises=3), 0, 1), step=2**-6)
    given, drawn = (plan_of(PATH, noise) for noise in ("{file: w.npz}", "{kind: brownian}"))
    assert np.array_equal(given.results(finished(given)).y, drawn.results(finished(drawn)).y)
    assert same_numbers(
        finished(plan_of(STATISTICS, "{file: w.npz}")), finished(plan_of(STATISTICS, "{kind: brownian}"))
    )
