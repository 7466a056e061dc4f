"""The strong study against the same numbers computed in plain NumPy, and on what its results may not depend.

The oracle takes the normals of the generator and writes everything else out anew, from the printed equations:
increments, schemes, errors, drifts, standard errors and the fit.  All seeds are fixed.
"""

import math
import re
from pathlib import Path

import numba
import numpy as np
import pytest
from helpers import COMPILED
from states import begun, check_going_on, finished, same_numbers

from spi import ensemble
from spi.dispatch import kernel
from spi.estimators import GROUPS, group_counts
from spi.kinds.state import State
from spi.kinds.strong import study as strong
from spi.kinds.strong.study.errors import errors
from spi.protocol import REPORT
from spi.records import Part
from spi.rng import BROWNIAN, LANES, STEPS_PER_DRAW, draw_normals
from spi.run import load

EXPERIMENT = Path(__file__).parents[1] / "experiments" / "rigid_body_strong.yaml"
SIZES = [] if COMPILED else ["steps=2^-2 .. 2^-4", "reference_step=2^-5"]

compiled_only = pytest.mark.skipif(not COMPILED, reason="too many steps without the compiler")


@pytest.fixture(autouse=True)
def _no_stopwatch_without_the_compiler(monkeypatch):
    if not COMPILED:
        monkeypatch.setattr(strong, "nanoseconds_per_step", lambda p, h: 1.0)


def case_of(*overrides, profile="quick"):
    return load(EXPERIMENT, profile, [*(SIZES if profile == "quick" else ()), *overrides]).cases[0]


def study(case, scheme):
    """(variables by name, attributes) of a whole study."""
    plan = strong.plan(case, Part(scheme))
    group = plan.group(finished(plan))
    assert list(group.coordinates["h"]) == list(case.steps)
    return {name: values for name, (_, values) in group.variables.items()}, group.attributes


# --- the oracle ------------------------------------------------------------------------------------------------------


@kernel
def draw(seed, channel, draws, block, words, normals):
    for n in range(draws):
        draw_normals(seed, np.uint64(BROWNIAN), channel, np.uint64(n), block, words, normals[n])


def fine_increments(case):
    """sqrt(h_ref) times the normals, an array [step, noise, path]."""
    steps, blocks = round(case.final_time / case.reference_step), -(-case.samples // LANES)
    draws = -(-steps // STEPS_PER_DRAW)
    words, normals = np.empty(STEPS_PER_DRAW * LANES, np.uint64), np.empty((draws, STEPS_PER_DRAW * LANES))
    increments = np.empty((steps, 3, blocks * LANES))
    for block in range(blocks):
        for k in range(3):
            draw(np.uint64(case.seed), np.uint64(k), draws, np.uint64(block), words, normals)
            increments[:, k, block * LANES : (block + 1) * LANES] = normals.reshape(-1, LANES)[:steps]
    return math.sqrt(case.reference_step) * increments[:, :, : case.samples]


def clipped(dW, h):
    """The increments of steps h that lie within sqrt(h) A_h, A_h = sqrt(4 |ln h|), the others put on its ends."""
    bound = math.sqrt(h) * math.sqrt(4 * abs(math.log(h)))
    return np.clip(dW, -bound, bound)


AXES = np.eye(3)


def field(k, inertia, y):
    """B(y) grad (y_k^2 / 2 I_k) = (y_k / I_k) y x e_k, which is a column of the printed matrix B(y)."""
    return y[k] / inertia[k] * np.cross(y, AXES[k][:, np.newaxis], axis=0)


def by_euler_maruyama(model, h, dW, y):
    """The Itô form: f_k' f_k turns twice about the axis k, which takes y to -(y_k / Î_k)^2 (y - y_k e_k)."""
    new = y.copy()
    for k, sigma in enumerate(model.sigma):
        across = y.copy()
        across[k] = 0.0
        new += h * field(k, model.inertia, y) + sigma * dW[k] * field(k, model.noise_inertia, y)
        new -= 0.5 * h * sigma**2 * (y[k] / model.noise_inertia[k]) ** 2 * across
    return new


def turned(k, angle, y):
    """exp(t (y_k / I_k) (y x e_k)): turned by -angle about the axis k (Rodrigues' formula)."""
    axis = AXES[k][:, np.newaxis]
    along = axis * y[k]
    return along + np.cos(angle) * (y - along) + np.sin(angle) * np.cross(y, axis, axis=0)


def by_splitting(model, h, dW, y):
    """Eq. slpI: the noises first, then the pieces of H."""
    for k, sigma in enumerate(model.sigma):
        y = turned(k, sigma * dW[k] * y[k] / model.noise_inertia[k], y)
    for k in range(3):
        y = turned(k, h * y[k] / model.inertia[k], y)
    return y


BY_HAND = {"euler_maruyama": by_euler_maruyama, "splitting": by_splitting}


def paths_by_hand(case, scheme):
    """h -> states [step, component, path] for the reference step and all others."""
    fine, result = fine_increments(case), {}
    for h in (case.reference_step, *case.steps):
        dW = fine.reshape(-1, round(h / case.reference_step), 3, case.samples).sum(axis=1)
        y, states = np.repeat(np.array(case.initial)[:, np.newaxis], case.samples, axis=1), []
        with np.errstate(over="ignore", invalid="ignore"):
            for increments in clipped(dW, h) if case.truncate_noise else dW:
                y = BY_HAND[scheme](case.model, h, increments, y)
                states.append(y)
        result[h] = np.array(states)
    return result


def group_of_paths(samples):
    return np.array([np.argmax(group_counts(p + 1) - group_counts(p)) for p in range(samples)])


def stderr_by_hand(squares):
    """Of the root mean square, by leaving out one group at a time and averaging anew."""
    groups = group_of_paths(len(squares))
    n, value, terms = len(squares), math.sqrt(squares.mean()), []
    sizes = [(groups == g).sum() for g in range(GROUPS) if (groups == g).any()]
    without = [math.sqrt(squares[groups != g].mean()) for g in range(GROUPS) if (groups == g).any()]
    pseudo = [n / m * value - (n / m - 1) * w for m, w in zip(sizes, without, strict=True)]
    mean = sum(m / n * p for m, p in zip(sizes, pseudo, strict=True))
    terms = [(p - mean) ** 2 / (n / m - 1) for m, p in zip(sizes, pseudo, strict=True)]
    return math.sqrt(np.mean(terms))


# --- the whole study against the oracle ------------------------------------------------------------------------------


@pytest.mark.parametrize("truncate", ["true", "false"])
@pytest.mark.parametrize("scheme", BY_HAND)
def test_whole_study_is_what_plain_numpy_finds(scheme, truncate):
    case = case_of("schemes=[euler_maruyama, splitting]", f"truncate_noise={truncate}", "samples=200", "seed=11")
    found, attributes = study(case, scheme)
    paths = paths_by_hand(case, scheme)
    reference, expected = paths[case.reference_step], []
    for i, h in enumerate(case.steps):
        y = paths[h]
        squares = ((y - reference[round(h / case.reference_step) - 1 :: round(h / case.reference_step)]) ** 2).sum(1)
        curve = np.sqrt(squares.mean(axis=1))
        expected.append(curve.max())
        assert math.isclose(found["error"][i], curve.max(), rel_tol=1e-10)
        assert found["error_time"][i] == (curve.argmax() + 1) * h
        assert math.isclose(found["error_stderr"][i], stderr_by_hand(squares[curve.argmax()]), rel_tol=1e-8)
        assert math.isclose(found["error_final"][i], curve[-1], rel_tol=1e-10)
        assert math.isclose(found["error_final_stderr"][i], stderr_by_hand(squares[-1]), rel_tol=1e-8)
        drift = np.abs((y**2).sum(axis=1) - 1).max()
        assert math.isclose(found["casimir_drift"][i, 0], drift, rel_tol=1e-10, abs_tol=2e-14)
    assert found["nonfinite"].tolist() == [0] * len(case.steps)
    assert found["resolved"].all()
    slope = np.polyfit(np.log(np.array(case.steps) - case.reference_step), np.log(expected), 1)[0]
    assert abs(attributes["order"] - slope) < 0.01  # how the fit allows for the reference is tested elsewhere
    assert attributes["order_ci"][0] < slope < attributes["order_ci"][1]
    assert attributes["note"] == ""
    # Negative control: what is compared depends on the bound of the increments.
    fine = fine_increments(case)
    coarse = fine.reshape(len(fine) // 2, 2, 3, -1).sum(axis=1)
    if COMPILED:
        assert (clipped(coarse, 2 * case.reference_step) != coarse).sum() > 0


@pytest.mark.parametrize("samples", [1, 63, 64, 65, 70, 128, 200, 511, 512, 513, 700])
def test_a_path_is_counted_in_the_group_that_it_is_added_to(samples):
    """Else standard errors are wrong, by a factor of 2 and more for few blocks."""
    if not COMPILED and samples > 70:
        pytest.skip("too many steps without the compiler")
    before, after = (
        finished(strong.plan(case_of("schemes=[euler_maruyama]", f"samples={n}"), Part("euler_maruyama"))).total()
        for n in (samples, samples + 1)
    )
    changed = np.flatnonzero((before.squares != after.squares).any(axis=1))
    assert changed.tolist() == np.flatnonzero(group_counts(samples + 1) - group_counts(samples)).tolist()


@pytest.mark.parametrize("samples", [64, 128, 500])
def test_standard_errors_are_those_of_a_root_of_a_mean(samples):
    """sd(|d|^2) / (2 rms sqrt(n)), with what the number of groups leaves to chance."""
    case = case_of("schemes=[euler_maruyama]", f"samples={samples if COMPILED else 64}", "seed=3")
    found, _ = study(case, "euler_maruyama")
    paths = paths_by_hand(case, "euler_maruyama")
    distance = ((paths[case.steps[0]][-1] - paths[case.reference_step][-1]) ** 2).sum(axis=0)
    delta = distance.std(ddof=1) / (2 * math.sqrt(distance.mean() * case.samples))
    groups = np.count_nonzero(group_counts(case.samples))
    assert abs(found["error_final_stderr"][0] / delta - 1) < 3 / math.sqrt(2 * (groups - 1)) + 0.1


# --- on what the results may not depend ------------------------------------------------------------------------------


@pytest.mark.parametrize("scheme", BY_HAND)
def test_batches_do_not_matter(scheme):
    plan = strong.plan(case_of("samples=330" if COMPILED else "samples=150"), Part(scheme))
    whole = finished(plan, plan.blocks)
    for blocks in (1, 2, 5, None):
        assert same_numbers(finished(plan, blocks), whole)


@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="one thread only")
@compiled_only
@pytest.mark.parametrize("scheme", BY_HAND)
def test_threads_do_not_matter(scheme):
    plan, before = strong.plan(case_of("samples=330"), Part(scheme)), ensemble.thread_count()
    states = []
    try:
        for threads in (1, 2):
            ensemble.use_threads(threads)
            states.append(finished(plan))
    finally:
        ensemble.use_threads(before)
    assert same_numbers(*states)


def test_going_on_from_every_state_gives_the_same_bits():
    plan = strong.plan(case_of("samples=330" if COMPILED else "samples=200"), Part("splitting"))
    found = check_going_on(plan)
    # before the first block, after each, and after each time of a step
    assert len(found) == 1 + plan.blocks + len(plan.case.steps)


def test_the_first_samples_of_many_are_the_samples_of_few():
    many, few = (strong.plan(case_of(f"samples={n}"), Part("splitting")) for n in (256, 128))
    first, all_of_few = begun(many, 2).so_far(), finished(few).total()
    assert same_numbers(first, all_of_few)
    for a, b in zip(errors(many, first), errors(few, all_of_few), strict=True):
        assert np.array_equal(a, b)


def test_seeds_matter_and_orders_of_schemes_do_not():
    case = case_of("schemes=[euler_maruyama, splitting]")
    turned_round = case_of("schemes=[splitting, euler_maruyama]")
    first = finished(strong.plan(case, Part("splitting")))
    assert same_numbers(first, finished(strong.plan(turned_round, Part("splitting"))))
    assert not same_numbers(first, finished(strong.plan(case.model_copy(update={"seed": 2}), Part("splitting"))))


def test_steps_of_the_same_grid_do_not_influence_one_another():
    """A step size that is left out, also between two others, changes nothing else."""
    steps = ["2^-4", "2^-5", "2^-6", "2^-7"] if COMPILED else ["2^-2", "2^-3", "2^-4"]
    whole, _ = study(case_of("schemes=[splitting]"), "splitting")
    part, _ = study(case_of("schemes=[splitting]", f"steps=[{steps[0]}, {steps[2]}]"), "splitting")
    for name in ("error", "error_stderr", "error_final", "casimir_drift"):
        assert np.array_equal(part[name], whole[name][[0, 2]])


# --- paths that leave the finite numbers -----------------------------------------------------------------------------


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
    paths = paths_by_hand(case, "euler_maruyama")
    lost = [int((~np.isfinite(paths[h][-1]).all(axis=0)).sum()) for h in case.steps]
    assert 0 < lost[0] < case.samples
    assert lost[1:] == [0, 0, 0, 0]
    assert found["nonfinite"].tolist() == lost
    assert attributes["reference_nonfinite"] == 0
    for name in ("error", "error_final", "casimir_drift"):
        assert np.isinf(found[name][0]).all()
        assert np.isfinite(found[name][1:]).all()
    assert not np.isfinite(found["error_stderr"][0])
    assert found["resolved"].tolist() == [False, True, True, True, True]
    assert attributes["points_in_fit"] == 4
    assert 0.5 < attributes["order"] < 1.2  # hardly any noise
    assert "left the finite numbers" in attributes["note"]


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
    reference = paths_by_hand(case, "euler_maruyama")[case.reference_step][-1]
    assert attributes["reference_nonfinite"] == (~np.isfinite(reference).all(axis=0)).sum() > 0
    assert np.isinf(found["error"]).all()
    assert math.isnan(attributes["order"])
    assert np.isnan(attributes["order_ci"]).all()


# --- few samples -----------------------------------------------------------------------------------------------------


def test_one_sample_has_an_error_but_no_standard_error():
    found, attributes = study(case_of("schemes=[splitting]", "samples=1"), "splitting")
    assert (found["error"] > 0).all()
    assert np.isnan(found["error_stderr"]).all()
    assert not found["resolved"].any()
    assert math.isnan(attributes["order"])
    assert attributes["points_in_fit"] == 0
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
    assert attributes["points_in_fit"] == np.count_nonzero(found["resolved"])


# --- what the paper says ---------------------------------------------------------------------------------------------


def contains(attributes, order):
    low, high = attributes["order_ci"]
    return low <= order <= high and high - low < 0.1


@compiled_only
def test_orders_with_three_noises_are_one_half_and_only_the_splitting_keeps_the_casimir():
    case = case_of("schemes=[euler_maruyama, splitting]", profile="laptop")
    assert (case.samples, case.reference_step, case.steps) == (500, 2.0**-16, tuple(2.0 ** -np.arange(5, 14)))
    (euler, euler_attributes), (splitting, attributes) = (study(case, scheme) for scheme in case.schemes)
    assert contains(attributes, 0.5)
    assert contains(euler_attributes, 0.5)
    assert not contains(attributes, 1.0)
    assert splitting["casimir_drift"].max() < 1e-12
    assert euler["casimir_drift"].min() > 1e-3
    assert attributes["expected_order"] == 0.5
    assert splitting["resolved"].all()


@compiled_only
def test_order_with_one_noise_is_one():
    case = case_of("schemes=[splitting]", "model.sigma=[1, 0, 0]", profile="laptop")
    _, attributes = study(case, "splitting")
    assert contains(attributes, 1.0)
    assert attributes["expected_order"] == 1.0


# --- the rest --------------------------------------------------------------------------------------------------------


def test_an_implicit_scheme_reports_on_its_solver():
    case = case_of("samples=70")
    found, _ = study(case, "midpoint")
    assert set(REPORT[:-1]) <= set(found)  # the last one is for angles
    steps = np.round(case.final_time / np.array(case.steps))
    assert found["solves"].tolist() == (steps * 2 * LANES).tolist()  # blocks are computed whole
    assert (found["iterations"] >= found["solves"]).all()
    assert not found["failures"].any()
    assert found["largest_residual"].max() < 1e-13
    assert found["casimir_drift"].max() < 1e-12
    assert not set(REPORT) & set(study(case, "euler_maruyama")[0])


def test_progress_and_cost():
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
    steps, seconds, needed = plan.cost()
    per_path = round(case.final_time / case.reference_step) + sum(round(case.final_time / h) for h in case.steps)
    assert steps == 150 * per_path
    assert 1e-9 < seconds / steps < 1e-7
    assert needed >= state.total().squares.nbytes
    assert strong.parts(case) == [Part(scheme) for scheme in case.schemes]
    assert np.allclose(found["seconds"], found["ns_per_step"] * 1e-9 * 150 * case.final_time / np.array(case.steps))
    assert (found["ns_per_step"] > 0).all()
    assert attributes["wall_seconds"] > 0
    assert attributes["samples"] == 150
