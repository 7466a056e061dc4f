"""The strong study against plain NumPy, and on what its results may not depend; all seeds are fixed."""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers import COMPILED
from paths_by_hand import clipped, fine_increments, paths_by_hand
from states import finished, same_numbers
from strong_cases import case_of, study

from spi.kinds.strong import study as strong
from spi.statistics.estimators import GROUPS, group_counts
from spi.storage import Part


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


@pytest.mark.parametrize("truncate", ["true", "false"])
@pytest.mark.parametrize("scheme", ["euler_maruyama", "splitting"])
def test_whole_study_is_what_plain_numpy_finds(scheme, truncate):
    case = case_of("schemes=[euler_maruyama, splitting]", f"truncate_noise={truncate}", "samples=200", "seed=11")
    found, attributes = study(case, scheme)
    paths = paths_by_hand(case, scheme)
    reference, expected = paths[case.reference_step][0][..., : case.samples], []
    for i, h in enumerate(case.steps):
        y = paths[h][0][..., : case.samples]
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
    assert abs(found["order"] - slope) < 0.01  # how the fit allows for the reference is tested elsewhere
    assert found["order_low"] < slope < found["order_high"]
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


def test_a_scheme_that_is_named_as_the_reference_is_its_own():
    """The order is the same; named for another scheme the reference is not allowed for."""
    case = case_of("schemes=[splitting]")
    state = finished(strong.plan(case, Part("splitting")))
    orders = [
        replace(state.plan, case=case.model_copy(update={"reference_scheme": name})).results(state).order.order
        for name in (None, "splitting", "midpoint")
    ]
    assert orders[0] == orders[1] < orders[2]


def test_paths_that_begin_at_0():
    found, attributes = study(case_of("schemes=[euler_maruyama]", "initial=[0, 0, 0]"), "euler_maruyama")
    assert not found["error"].any() and not found["casimir_drift"].any()
    assert attributes["note"] == "exact"


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
