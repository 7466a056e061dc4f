"""Paths of which each begins at a state of its own, in all kinds of experiments."""

import math

import numpy as np
import pytest
from helpers import compiled_only
from states import check_going_on, chunks_of, finished, same_numbers

import spi
from spi.numerics.rng import LANES
from spi.running.load import SpecSource, plans_of
from spi.running.run import load

BODY = {"name": "rigid_body", "inertia": [2, 1, "2/3"], "noise_inertia": [1, 2, 3], "sigma": [1, 1, 1]}
GAUSS = {"law": "gaussian", "mean": [0.5, 0, 1], "sd": [0.1, 0.3, 0.2]}
PATHS = 3 * LANES + 10

HEAD = """\
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1, 1, 1]}
initial: {law: gaussian, mean: [0.5, 0, 1], sd: [0.1, 0.3, 0.2]}
schemes: [splitting]
"""
ERRORS = "final_time: 1\nsteps: [2^-3, 2^-4]\nreference_step: 2^-6\n"
KINDS = {
    "strong": f"{ERRORS}samples: {PATHS}",
    "weak": f"{ERRORS}samples: {PATHS}\nfunctions: y1^2\nestimators: [plain]",
    "stability": f"{ERRORS}samples: {PATHS}\nsweep: {{s: [1, 2]}}\ndamping: 0*s",
    "statistics": f"final_time: 1\nstep: 2^-3\nsamples: {PATHS}",
    "growth": f"steps: [2^-3]\nstep_count: 1024\nsamples: {PATHS}",
    "trajectory": "final_time: 1\nstep: 2^-3\npath: 70\npanels: [components]",
}


@pytest.fixture
def plan_of(tmp_path):
    def plan_of(kind, *overrides, text=""):
        path = tmp_path / "s.yaml"
        path.write_text(f"kind: {kind}\n{HEAD}{KINDS[kind]}\n{text}", encoding="utf-8")
        return plans_of(SpecSource.of(load(path, overrides=overrides)))[0]

    return plan_of


def states(seed=1):
    """Those of a run (paths, components), by the integrator."""
    return spi.Integrator(BODY, "splitting", 2**-3, initial=GAUSS).start(PATHS, seed=seed)


def test_a_path_begins_at_the_same_state_everywhere(plan_of):
    y = states()
    paths = spi.trajectory(BODY, "splitting", initial=GAUSS, final_time=1, step=2**-3, samples=PATHS)
    assert np.array_equal(paths.y.values[:, 0], y) and len(np.unique(y[:, 0])) == PATHS
    plan = plan_of("trajectory")
    assert np.array_equal(plan.results(finished(plan)).y, paths.y.values[70])
    found = plan_of("statistics", "functions={first: {start: y2}, y3: y3}", "samples=138")
    mean = found.results(finished(found)).mean
    assert math.isclose(mean[0, -1], y[:138, 1].mean(), abs_tol=1e-15)
    assert math.isclose(mean[1, -1], paths.y.values[:138, -1, 2].mean(), abs_tol=1e-15)
    assert not np.isclose(states(seed=2), y).any()


@pytest.mark.parametrize("kind", ["strong", "weak", "stability", "statistics", "growth"])
def test_bits_do_not_depend_on_the_division_of_the_work(plan_of, kind):
    plan = plan_of(kind)
    with chunks_of(1):
        check_going_on(plan, every=3)
        assert same_numbers(finished(plan, most=1), finished(plan, most=100))


def test_casimirs_are_compared_with_those_of_each_path(plan_of):
    """The spheres differ by a factor of 2; along each the length is kept, and errors are relative to each."""
    plan = plan_of("strong")
    found = plan.results(finished(plan))
    assert found.casimir_drift.max() < 1e-14
    assert 0.01 < found.error[0] < 1.0 and found.error[1] < found.error[0]
    euler = plan_of("strong", "schemes=[euler_maruyama]", f"samples={LANES}")
    drift = euler.results(finished(euler)).casimir_drift[0, 0]
    paths = spi.trajectory(BODY, "euler_maruyama", initial=GAUSS, final_time=1, step=2**-6, samples=LANES)
    own = np.abs(paths.casimirs.values - paths.casimirs.values[:, :1]).max()
    assert 0.1 * own < drift < 10 * own
    for kind in ("stability", "growth"):
        plan = plan_of(kind)
        result = plan.results(finished(plan))
        assert (result.casimirs.worst if kind == "stability" else result.casimir_worst).max() < 1e-13
        assert getattr(result, "law", None) is None


def test_levels_have_states_of_their_own(plan_of):
    """Of a multilevel estimator: the differences are independent, and each has the same state at both steps."""
    plan = plan_of("weak", "estimators=[multilevel]", "standard_error=0.01", "schemes=[splitting_order2]")
    found, other = plan.results(finished(plan)), plan_of("weak", "samples=20000", "schemes=[splitting_order2]")
    plain = other.results(finished(other))
    away = np.abs(found.error - plain.error)
    assert np.all(away < 4.5 * np.hypot(found.sampled.error_stderr, plain.sampled.error_stderr))
    assert plain.sampled.error_stderr[0, 0] < 0.5 * plain.sampled.sd[0] / math.sqrt(20000)


@pytest.mark.slow
@compiled_only
def test_a_linear_system_against_its_mean(tmp_path):
    """A body with y_3 = 1 turns by W(t): E y_1 and E y_1^2 follow from mean and covariance of the first states."""
    body = {"name": "rigid_body", "inertia": [1e12] * 3, "noise_inertia": [1, 1, 1], "sigma": [0, 0, 1]}
    covariance = [[0.04, 0.03, 0], [0.03, 0.09, 0], [0, 0, 0]]
    law = {"law": "gaussian", "mean": [0.5, 1, 1], "covariance": covariance}
    found = spi.expectations(
        body, "splitting", {"y1": "y1", "square": "y1^2"}, initial=law, final_time=1, steps=0.25, samples=40000
    )
    first, second = 0.25 + 0.04, 1 + 0.09
    truth = 0.5 * math.exp(-0.5), 0.5 * (first + second) + 0.5 * (first - second) * math.exp(-2)
    z = (found.expectation.values[:, 0] - truth) / found.expectation_stderr.values[:, 0]
    assert np.abs(z).max() < 4.5


def test_the_law_of_a_sphere_stays_uniform(plan_of):
    """Which long times know, also where the state that the sphere goes through is at rest."""
    plan = plan_of("growth", "initial={law: uniform_on_surface, through: [0, 0, 2]}")
    law = plan.results(finished(plan)).law
    assert np.abs(law.z).max() < 4.5
