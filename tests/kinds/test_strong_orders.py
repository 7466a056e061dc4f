"""The strong study where paths are lost or few, the orders that the paper states, and reports."""

import math
import re

import numpy as np
from helpers import compiled_only
from paths_by_hand import paths_by_hand
from states import begun, finished
from strong_cases import case_of, study

from spi.kinds.plans import State
from spi.kinds.strong import study as strong
from spi.schemes import strong_order
from spi.storage import Part


@compiled_only
def test_blow_up_is_counted_and_left_out_of_the_fit():
    """One step size is far too large for Euler-Maruyama; nearly all of its paths overflow, in y or in |y|^2."""
    case = case_of(
        "schemes=[euler_maruyama]",
        "model.sigma=[0.05, 0.05, 0.05]",
        "initial=[1.5*cos(1.1), 0, 1.5*sin(1.1)]",
        "truncate_noise=false",
        "final_time=16",
        "steps=[1, 2^-5, 2^-6, 2^-7, 2^-8]",
        "reference_step=2^-10",
        "samples=256",
    )
    found, attributes = study(case, "euler_maruyama")
    paths = paths_by_hand(case, "euler_maruyama", sizes=case.steps)
    lost = [int((~np.isfinite(paths[h][0][-1]).all(axis=0)).sum()) for h in case.steps]
    assert 0 < lost[0] < case.samples
    assert lost[1:] == [0, 0, 0, 0]
    assert found["nonfinite"].tolist() == lost
    assert attributes["reference_nonfinite"] == 0
    for name in ("error", "error_final", "casimir_drift"):
        assert np.isinf(found[name][0]).all()
        assert np.isfinite(found[name][1:]).all()
    assert not np.isfinite(found["error_stderr"][0])
    assert found["resolved"].tolist() == [False, True, True, True, True]
    assert found["points_in_fit"] == 4
    assert 0.5 < found["order"] < 1.2  # hardly any noise
    assert "diverged" in attributes["note"]


@compiled_only
def test_paths_that_are_finite_but_whose_squares_are_not_are_infinitely_far():
    case = case_of(
        "schemes=[euler_maruyama]", "model.sigma=[4, 4, 4]", "samples=256", "steps=2^-4 .. 2^-9", "reference_step=2^-12"
    )
    found, _ = study(case, "euler_maruyama")
    for name in ("error", "error_final", "casimir_drift"):
        assert np.isinf(found[name]).any()
        assert not (np.isfinite(found[name]) & (found[name] > 1e300)).any()


@compiled_only
def test_a_reference_that_blows_up_is_reported():
    case = case_of("schemes=[euler_maruyama]", "model.sigma=[60, 60, 60]", "samples=64")
    found, attributes = study(case, "euler_maruyama")
    reference = paths_by_hand(case, "euler_maruyama", sizes=[case.reference_step])[case.reference_step][0][-1]
    assert attributes["reference_nonfinite"] == (~np.isfinite(reference).all(axis=0)).sum() > 0
    assert np.isinf(found["error"]).all()
    assert math.isnan(found["order"])
    assert np.isnan([found["order_low"], found["order_high"]]).all()


def test_one_sample_has_an_error_but_no_standard_error():
    found, attributes = study(case_of("schemes=[splitting]", "samples=1"), "splitting")
    assert (found["error"] > 0).all()
    assert np.isnan(found["error_stderr"]).all()
    assert not found["resolved"].any()
    assert math.isnan(found["order"])
    assert found["points_in_fit"] == 0
    assert "not resolved" in attributes["note"]


def test_too_few_samples_are_said_to_be_too_few():
    """With 3 samples some seed leaves a point unresolved; what the note asks for then follows the formula."""
    for seed in range(1, 30):
        found, attributes = study(case_of("schemes=[splitting]", "samples=3", f"seed={seed}"), "splitting")
        if not found["resolved"].all():
            break
    needed = 3 * (4 * found["error_stderr"] / found["error"])[~found["resolved"]].max() ** 2
    said = re.fullmatch(r"in brackets: not resolved, would need about (\d+) samples", attributes["note"])
    assert float(said[1]) == float(f"{needed:.1g}")
    assert found["points_in_fit"] == np.count_nonzero(found["resolved"])


def contains(found, order):
    low, high = found["order_low"], found["order_high"]
    return low <= order <= high and high - low < 0.1


@compiled_only
def test_orders_with_three_noises_are_one_half_and_only_the_splitting_keeps_the_casimir():
    case = case_of("schemes=[euler_maruyama, splitting]", profile="laptop")
    assert (case.samples, case.reference_step, case.steps) == (500, 2.0**-16, tuple(2.0 ** -np.arange(5, 14)))
    (euler, _), (splitting, attributes) = (study(case, scheme) for scheme in case.schemes)
    assert contains(splitting, 0.5)
    assert contains(euler, 0.5)
    assert not contains(splitting, 1.0)
    assert splitting["casimir_drift"].max() < 1e-12
    assert euler["casimir_drift"].min() > 1e-3
    assert attributes["expected_order"] == 0.5
    assert splitting["resolved"].all()


@compiled_only
def test_order_with_one_noise_is_one():
    """Run with strengths 0 rather than None, whose kernel other tests need as well; theory is asked with None."""
    case = case_of("schemes=[splitting]", "model.sigma=[1, 0, 0]", profile="laptop")
    assert strong_order(case.row("splitting"), case.model, case.initial, case.noise) == 1.0
    zeros = case.model_copy(update={"model": case.model._replace(sigma=(1.0, 0.0, 0.0))})
    found, _ = study(zeros, "splitting")
    assert contains(found, 1.0)


def test_progress_and_cost(monkeypatch):
    monkeypatch.setattr("spi.kinds.blocks.LEAST_TIMED", 0.0)
    case = case_of("samples=150")
    plan = strong.plan(case, Part("splitting"))
    state = finished(plan)
    found, attributes = study(case, "splitting")
    done, total, stderr = plan.progress(state)
    assert (done, total) == (150, 150)
    assert math.isclose(stderr, found["error_final_stderr"][0], rel_tol=1e-12)
    middle = plan.progress(begun(plan, 2))
    assert middle[:2] == (128, 150) and middle[2] > 0
    unbegun = plan.progress(State(plan))
    assert unbegun[:2] == (0, 150) and math.isnan(unbegun[2])
    steps, seconds, needed = plan.cost()[:3]
    per_path = round(case.final_time / case.reference_step) + sum(round(case.final_time / h) for h in case.steps)
    assert steps == 192 * per_path  # whole blocks
    assert 1e-9 < seconds / steps < 1e-7
    assert needed >= state.total().squares.nbytes
    assert strong.parts(case) == [Part(scheme) for scheme in case.schemes]
    assert np.allclose(found["seconds"], found["ns_per_step"] * 1e-9 * 150 * case.final_time / np.array(case.steps))
    assert (found["ns_per_step"] > 0).all()
    assert attributes["wall_seconds"] > 0
    assert attributes["samples"] == 150
    monkeypatch.setattr("spi.kinds.blocks.LEAST_TIMED", 1e3)  # a run that is too short to be timed
    assert np.isnan(study(case, "splitting")[0]["ns_per_step"]).all()
