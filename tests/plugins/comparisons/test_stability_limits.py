"""The stability study where paths are lost or leave the quadrant, and against the law of the limit."""

from contextlib import nullcontext

import numpy as np
import pytest
import stability_cases
from helpers import INITIAL, RIGID_BODY, compiled_only, loop_in_python
from paths_by_hand import paths_by_hand, rigid_euler_step
from stability_cases import PHI, PREDATORS, RIGID, plans_of, study, summary_by_hand
from states import ignore

from spi.exact import expectations
from spi.kinds.plans import State
from spi.models import MaxwellBloch
from spi.running import workers
from spi.schemes import scheme_entry
from spi.schemes.stages import compositions

# fixtures
cases_of = stability_cases.cases_of


@compiled_only
def test_explosions_are_counted_and_never_left_out(cases_of):
    """Of Euler-Maruyama some paths stay finite: their numbers must not stand for all."""
    cases = cases_of(RIGID, "sweep={s: [0.5, 8]}", "final_time=4", "samples=200")
    found, _ = study(cases, "euler_maruyama")
    strong = cases[1]
    paths = paths_by_hand(strong, "euler_maruyama")
    lost = [np.mean(~np.isfinite(paths[h][0][-1, :, : strong.samples]).all(axis=0)) for h in cases[0].steps]
    assert min(lost) > 0 and max(lost) < 1
    np.testing.assert_allclose(found["finite"], [[1.0] * 3, [1 - x for x in lost]], rtol=1e-14)
    for name in ("error", "largest_norm", "casimir_worst", "law_distance"):
        assert np.isfinite(found[name][0]).all()
        assert np.isinf(found[name][1]).all() and (found[name][1] > 0).all()
    # the median is that of all paths, the lost ones being infinitely far
    assert (np.isinf(found["casimir_median"][1, :, 0]) == (np.array(lost) >= 0.5)).all()
    splitting, _ = study(cases, "splitting")
    assert (splitting["finite"] == 1).all() and splitting["casimir_worst"].max() < 1e-13


@compiled_only
def test_failures_of_the_solver_are_counted(cases_of):
    cases = cases_of(RIGID, "sweep={s: [0.5, 50]}")
    found, _ = study(cases, "midpoint")
    assert not found["failures"][0].any()
    assert (found["failures"][1] > 0).all() and (found["failures"][1] < found["solves"][1]).all()
    assert (found["iterations"][1] <= 20 * found["solves"][1]).all()
    assert found["largest_residual"][0].max() < 1e-13 and not (found["largest_residual"][1] < 1e-13).any()
    assert found["casimir_worst"][0].max() < 1e-13 < found["casimir_worst"][1].min()
    assert not np.isnan(found["error"]).any() and not np.isnan(found["casimir_worst"]).any()


@compiled_only
@pytest.mark.parametrize("scheme", ["euler_maruyama", pytest.param("splitting", marks=pytest.mark.slow)])
def test_populations_stay_positive_only_by_splitting(cases_of, scheme):
    """Where the noise is extreme a population may become smaller than all floats, but never negative."""
    cases = cases_of(PREDATORS, f"schemes=[{scheme}]")
    with loop_in_python() if scheme == "euler_maruyama" else nullcontext():
        found, _ = study(cases, scheme)
    assert "casimir_worst" not in found  # there is no Casimir function
    assert np.isnan(found["truth"]).all() and np.isnan(found["law_distance"]).all()
    for i, point in enumerate(cases):
        paths = paths_by_hand(point, scheme)
        expected = summary_by_hand(point, paths, [lambda y: y[0]])
        assert np.array_equal(found["positive"][i], expected["positive"])
        assert np.array_equal(found["finite"][i], expected["finite"])
        least = min(np.nanmin(paths[h][0]) for h in cases[0].steps)
        if scheme == "splitting":
            assert least >= 0
        else:
            assert least < 0 and found["positive"][i].min() < 0.9
    if scheme == "splitting":
        assert (found["positive"][0] == 1).all()


@compiled_only
def test_law_distance_is_nothing_for_small_steps_and_clear_for_large_ones(cases_of):
    cases = cases_of(RIGID, "sweep={s: [1]}", "steps=[2^-1, 2^-8]", "reference_step=2^-9", "samples=8192")
    for scheme in ("splitting", "euler_maruyama"):
        found, _ = study(cases, scheme)
        z = found["law_distance"][0] / found["law_distance_stderr"][0]
        assert z[0] > 8
        assert z[1] < 4
        all_z = (found["expectation"][0] - found["truth"][0]) / found["expectation_stderr"][0]
        assert np.abs(all_z[1]).max() < 4
        assert found["law_distance_stderr"].max() < 0.01


@pytest.mark.parametrize("sigma", [0.3, 1.0])
def test_truth_does_not_depend_on_a_scheme(cases_of, sigma):
    cases = cases_of(RIGID, f"sweep={{s: [{sigma}]}}")
    model = cases[0].model
    flows = compositions(scheme_entry("splitting").composition, model)
    wanted = expectations.expectations(model, flows, INITIAL, 1.0, [0.5, 0.25, 0.125], PHI, 1e-6)
    limit, error = expectations.exact_expectations(model, INITIAL, 1.0, PHI, 1e-6)
    assert error.max() < 1e-6
    assert (np.abs(limit - wanted.limit) <= error + wanted.limit_bound).all()
    states = [State(plan) for plan in plans_of(cases, "splitting")]
    workers.advance_here(states, ignore)
    assert np.isnan(study(cases, "splitting", states)[0]["truth"]).all()
    workers.perform_tasks(states, ignore)
    found, _ = study(cases, "splitting", states)
    assert (np.abs(found["truth"][0] - wanted.limit) <= found["truth_bound"][0] + wanted.limit_bound).all()
    assert found["truth_bound"].max() < 1e-3


def test_truth_that_would_take_hours_is_not_known():
    initial = tuple(1000 * y for y in INITIAL)
    limit, error = expectations.exact_expectations(RIGID_BODY, initial, 2.0, PHI, 1e-3)
    assert np.isnan(limit).all() and np.isinf(error).all()


def test_truth_where_it_is_elementary():
    """On an axis nothing moves; with equal inertia and noise, E y falls as exp(-(sigma r)^2 T) to first order."""
    limit, error = expectations.exact_expectations(RIGID_BODY, (0.0, 2.0, 0.0), 3.0, PHI, 1e-6)
    assert limit.tolist() == [0.0, 4.0, 0.0] and not error.any()
    with pytest.raises(ValueError, match="no solver without sampling for MaxwellBloch"):
        expectations.exact_expectations(MaxwellBloch(), (1.0, 2.0, 3.0), 1.0, PHI, 1e-3)
    time = 1e-3
    ito = rigid_euler_step(RIGID_BODY, time, np.zeros((3, 1)), np.array(INITIAL)[:, None], [])[:, 0]
    limit, error = expectations.exact_expectations(
        RIGID_BODY, INITIAL, time, [lambda y, k=k: y[k] for k in range(3)], 1e-6
    )
    assert np.abs(limit - ito).max() < 3 * time**2 + error.max() < 1e-5
    assert np.abs(ito - INITIAL).max() > 1e-4
