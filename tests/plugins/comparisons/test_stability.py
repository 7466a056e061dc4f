"""The stability study against a plain NumPy computation from the same increments; all seeds are fixed."""

import math

import numpy as np
import pytest
import stability_cases
from helpers import COMPILED, INITIAL, compiled_only
from paths_by_hand import paths_by_hand
from stability_cases import EPS, PHI, RIGID, plans_of, study, summary_by_hand
from states import check_going_on, taken

# fixtures
cases_of = stability_cases.cases_of


def check_against_numpy(cases, scheme, eps=lambda point: None):
    """Every stored quantity of a study of the rigid body."""
    found, group = study(cases, scheme)
    names = {"finite", "largest_norm", "error", "error_stderr", "casimir_worst", "casimir_median"}
    names |= {"expectation", "expectation_stderr", "truth", "truth_bound", "law_distance", "law_distance_stderr"}
    solver = {"solves", "iterations", "failures", "largest_residual"}
    assert set(found) - {"largest_angle"} == names | (solver if scheme == "midpoint" else set())
    assert found["error"].shape == (len(cases), len(cases[0].steps))
    for i, point in enumerate(cases):
        expected = summary_by_hand(point, paths_by_hand(point, scheme, eps(point)), PHI)
        drifts = scheme == "euler_maruyama"
        for name in ("error", "error_stderr", "largest_norm", "expectation", "expectation_stderr"):
            np.testing.assert_allclose(found[name][i], expected[name], rtol=1e-9, atol=1e-14, err_msg=name)
        for name in ("casimir_worst", "casimir_median"):
            absolute = 0 if drifts else 1e-14
            np.testing.assert_allclose(found[name][i, :, 0], expected[name], rtol=1e-9, atol=absolute, err_msg=name)
            assert drifts == (found[name][i].min() > 1e-4)
        assert np.array_equal(found["finite"][i], expected["finite"])
        if "splitting" in scheme:
            np.testing.assert_allclose(found["largest_angle"][i], expected["largest_angle"], rtol=1e-12)
        away = np.abs(expected["expectation"] - found["truth"][i])
        farthest = away.argmax(axis=1)[:, None]
        np.testing.assert_allclose(found["law_distance"][i], away.max(axis=1), rtol=1e-9)
        stderr = np.take_along_axis(expected["expectation_stderr"], farthest, 1)[:, 0]
        doubt = np.hypot(stderr, found["truth_bound"][i][farthest[:, 0]])
        np.testing.assert_allclose(found["law_distance_stderr"][i], doubt, rtol=1e-9)
    return found, group


@pytest.mark.parametrize("scheme", ["splitting", "euler_maruyama", pytest.param("midpoint", marks=compiled_only)])
def test_whole_study_is_what_plain_numpy_finds(cases_of, scheme):
    """Two values, three step sizes, and a second block of which only six lanes count."""
    cases = cases_of(RIGID)
    found, group = check_against_numpy(cases, scheme)
    if scheme == "splitting":
        assert (found["largest_angle"] == 0).any() and found["largest_angle"].max() > math.pi / 4
    if scheme == "midpoint":  # blocks are computed whole, and lanes that are no paths do not count
        assert found["solves"].tolist() == [[cases[0].samples * round(1 / h) for h in cases[0].steps]] * 2
        assert (found["iterations"] >= found["solves"]).all()
        assert not found["failures"].any()
        assert 0 < found["largest_residual"].max() < 1e-13
    assert group.coordinates["value"].tolist() == [0.5, 2.0]
    assert group.coordinates["function"].tolist() == ["a", "b", "c"]
    facts = group.attributes
    assert (facts["sweep"], facts["samples"], facts["accurate"], facts["seed"]) == ("s", 70, 0.1, 5)
    assert facts["functions"] == ("y1", "y2^2", "y1*y3")
    assert facts["initial"] == INITIAL
    assert "model_sigma" not in facts  # it differs from value to value
    assert facts["model_inertia"] == (2.0, 1.0, 2 / 3)


@pytest.mark.parametrize("overrides", [[], pytest.param(["reference_scheme=ap_splitting"], marks=pytest.mark.slow)])
def test_swept_eps_is_what_plain_numpy_finds(cases_of, overrides):
    """The multiscale scheme and its reference have the eps of each value; the truth is that of the limit eps = 0."""
    cases = cases_of(EPS, *overrides)
    found, group = study(cases, "ap_splitting")
    for i, (point, eps) in enumerate(zip(cases, [0, 0.6], strict=True)):
        assert point.eps == (eps,)
        expected = summary_by_hand(point, paths_by_hand(point, "splitting", eps), PHI)
        for name in ("error", "error_stderr", "expectation", "largest_angle"):
            np.testing.assert_allclose(found[name][i], expected[name], rtol=1e-9, atol=1e-14, err_msg=name)
    assert np.abs(found["error"][1] / found["error"][0] - 1).max() > 0.1  # eps matters
    assert np.isfinite(found["truth"]).all() and np.array_equal(found["truth"][0], found["truth"][1])
    assert group.attributes["scheme_label"] == "AP splitting"


def test_one_path_has_no_standard_errors(cases_of):
    found, _ = study(cases_of(RIGID, "samples=1"), "splitting")
    assert (found["error"] > 0).all() and np.isfinite(found["law_distance"]).all()
    for name in ("error_stderr", "expectation_stderr", "law_distance_stderr"):
        assert np.isnan(found[name]).all()


def test_going_on_from_the_middle_gives_the_same_bits(cases_of):
    plan = plans_of(cases_of(RIGID, "samples=200" if COMPILED else "samples=130"), "splitting")[1]
    found = check_going_on(plan)
    assert len(found) == 1 + plan.blocks + 1  # before the first block, after each, and after the truth
    progress = [plan.progress(taken(plan, plain)) for plain in found]
    done = [one.done for one in progress]
    assert (np.diff(done[:-1]) > 0).all() and done[0] == 0
    assert done[-2:] == [progress[-1].total] * 2  # only the true expectations are still missing
