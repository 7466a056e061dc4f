"""The weak study without noise, with paths that are lost, and from a spec to a file."""

import math

import numpy as np
import pytest
from helpers import BY_HAND, COMPILED, LANES, compiled_only
from states import begun, finished
from weak_cases import (
    FUNCTIONS,
    SPLITTINGS,
    after_blocks,
    case_of,
    completed,
    levels_plan_of,
    plan_of,
    results_of,
    values_by_hand,
)

from spi.expressions import parse_expression
from spi.kinds.plans import State
from spi.kinds.weak import study as weak
from spi.schemes import SCHEMES
from spi.statistics.estimators import ROUND
from spi.storage import Part


@pytest.mark.parametrize("scheme", ["splitting", "splitting_order2"])
def test_without_noise_nothing_is_left_to_chance(scheme):
    """The error is that of the deterministic scheme, here by the printed formulas."""
    steps = ["steps=2^-2 .. 2^-5", "reference_step=2^-7"] if COMPILED else ["steps=[2^-1]", "reference_step=2^-2"]
    case = case_of(*steps, "seconds=0.01", "samples=100")
    still = case.model._replace(sigma=(0.0, 0.0, 0.0))  # and not None, so that it has the kernels of three noises
    case = case.model_copy(update={"model": still})
    if COMPILED:
        levels, _ = results_of(case, scheme, "multilevel", levels_plan_of)
    else:
        p = levels_plan_of(case, scheme)
        levels = p.results(after_blocks(p, ROUND)).group().arrays
    in_plain, _ = results_of(case, scheme, "plain")
    assert levels["level_variance"].max() < 1e-17

    def values(h):
        y = case.initial
        for _ in range(round(case.final_time / h)):
            y = BY_HAND[scheme](still, h, (0.0, 0.0, 0.0), 1, y)
        return np.array([f(np.array(y)) for f in FUNCTIONS.values()])

    off = [values(h) - values(case.reference_step) for h in case.steps]
    for i, expected in enumerate(completed(case, scheme, off)):
        for found in (levels, in_plain):
            assert np.all(np.abs(found["error"][:, i] - expected) < 1e-12)
            assert np.all(found["error_stderr"][:, i] < 1e-12)
            assert np.all(found["resolved"][:, i])
    if COMPILED:
        for found in (levels, in_plain):
            assert np.all(np.abs(found["order"] - SCHEMES[scheme].weak_order) < 0.15)


BLOW_UP = [
    "schemes=[euler_maruyama]",
    "model.sigma=[0.05, 0.05, 0.05]",
    "initial=[1.5*cos(1.1), 0, 1.5*sin(1.1)]",
    "final_time=14",
    "steps=[1, 2^-5, 2^-6, 2^-7]",
    "reference_step=2^-8",
    "samples=256",
]


@compiled_only
def test_plain_counts_paths_that_blow_up():
    case = case_of(*BLOW_UP)
    found, attributes = results_of(case, "euler_maruyama", "plain")
    values = values_by_hand(case, "euler_maruyama")
    lost = [int((~np.isfinite(values[h])).any(axis=0).sum()) for h in case.steps]
    assert 0 < lost[0] < case.samples and lost[1:] == [0, 0, 0]
    assert found["nonfinite"].tolist() == lost
    assert attributes["reference_nonfinite"] == 0
    assert not found["resolved"][:, 0].any()
    assert not np.isfinite(found["error"][:, 0]).any()
    assert not np.isfinite(found["error_stderr"][:, 0]).any()
    assert np.isfinite(found["error"][:, 1:]).all() and np.isfinite(found["error_stderr"][:, 1:]).all()
    assert np.all(found["points_in_fit"] <= 3)


@compiled_only
def test_plain_reports_a_reference_that_blows_up():
    case = case_of(*BLOW_UP, "model.sigma=[60, 60, 60]", "final_time=1", "steps=[2^-5, 2^-6]", "samples=100")
    found, attributes = results_of(case, "euler_maruyama", "plain")
    values = values_by_hand(case, "euler_maruyama")[case.reference_step]
    assert attributes["reference_nonfinite"] == (~np.isfinite(values)).any(axis=0).sum() > 0
    assert not found["resolved"].any()
    assert np.isnan(found["order"]).all() and (found["points_in_fit"] == 0).all()


@compiled_only
def test_multilevel_counts_paths_that_blow_up_and_gives_their_level_no_more():
    case = case_of(*BLOW_UP, "seconds=0.5")
    found, _ = results_of(case, "euler_maruyama", "multilevel", levels_plan_of)
    lost = found["level_nonfinite"]
    assert 0 < lost[-1] < found["level_samples"][-1]
    assert lost[0] == 0
    assert not found["resolved"][:, 0].any()
    assert not np.isfinite(found["error"][:, 0]).any()
    assert np.isfinite(found["error"][:, 1:]).all() and np.isfinite(found["error_stderr"][:, 1:]).all()
    assert found["level_samples"][-1] == 2 * ROUND * LANES
    assert found["level_samples"][:-1].max() > 2 * ROUND * LANES
    found, _ = results_of(case, "euler_maruyama", "multilevel")  # by differences, each of which stands alone
    lost = found["difference_nonfinite"]
    assert 0 < lost[0] < found["difference_samples"][0] and not lost[1:].any()
    assert not np.isfinite(found["error"][:, 0]).any() and np.isfinite(found["error"][:, 1:]).all()
    assert found["difference_samples"][0] == 2 * ROUND * LANES < found["difference_samples"][1:].max()


def test_cost_is_known_before_and_progress_on_the_way():
    case = case_of("samples=150")
    steps, seconds = plan_of(case, "splitting", "plain").cost()[:2]
    per_path = sum(round(1 / h) for h in (case.reference_step, *case.steps))
    assert steps == 3 * LANES * per_path  # blocks are computed whole
    assert 1e-9 < seconds / steps < 1e-7
    assert weak.parts(case) == [Part(scheme, "multilevel") for scheme in SPLITTINGS]
    assert math.isnan(
        weak.plan(case_of("seconds=null", "standard_error=1"), Part("splitting", "multilevel")).cost().seconds
    )
    steps, seconds = plan_of(case_of("seconds=3"), "splitting_order2", "multilevel").cost()[:2]
    assert 3 <= seconds < 3.1 and 1e-9 < seconds / steps < 1e-7
    p = plan_of(case, "splitting", "plain")
    assert p.progress(State(p))[:2] == (0, 150)
    assert p.progress(begun(p, 2))[:2] == (128, 150)
    done = finished(p)
    assert p.progress(done)[:2] == (150, 150)
    stderr = p.results(done).group().variables["error_stderr"][1][0, 0]
    assert math.isclose(p.progress(done)[2], stderr, rel_tol=1e-12)


def test_solutions_that_are_kept_are_told_apart_by_their_functions():
    """As tuples sin(y1) and exp(y1) are equal: what is kept of one must not be taken for the other."""
    assert parse_expression("sin(y1)", 3) != parse_expression("exp(y1)", 3)
    found = []
    for function in ("sin(y1)", "exp(y1)"):
        plan = weak.plan(
            case_of("estimators=[kolmogorov]", f"functions={{phi: {function}}}"), Part("splitting", "kolmogorov")
        )
        found.append(plan.results(finished(plan)).group().arrays["limit"][0])
    assert found[0] != found[1]
