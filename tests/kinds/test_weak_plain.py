"""Plain sampling of weak errors against sums written out in NumPy."""

import math

import numpy as np
import pytest
from helpers import COMPILED, compiled_only
from weak_cases import (
    FUNCTIONS,
    case_of,
    completed,
    has_order,
    results_of,
    stderr_by_hand,
    values_by_hand,
)

from spi.schemes import SCHEMES
from spi.statistics.estimators import is_resolved


@pytest.mark.parametrize("samples", [200, 511] if COMPILED else [70])
@pytest.mark.parametrize("scheme", ["splitting", "splitting_order2"])
def test_plain_is_what_plain_numpy_finds(scheme, samples):
    case = case_of(f"samples={samples}", "seed=11")
    found, attributes = results_of(case, scheme, "plain")
    values = values_by_hand(case, scheme)
    reference = values[case.reference_step]
    np.testing.assert_allclose(found["reference"], reference.mean(axis=1), rtol=1e-12)
    for i, errors in enumerate(completed(case, scheme, [values[h] - reference for h in case.steps])):
        h = case.steps[i]
        for f in range(len(FUNCTIONS)):
            assert math.isclose(found["error"][f, i], errors[f].mean(), rel_tol=1e-10)
            assert math.isclose(found["error_stderr"][f, i], stderr_by_hand(errors[f]), rel_tol=1e-8)
            assert math.isclose(found["expectation"][f, i], values[h][f].mean(), rel_tol=1e-10)
            assert math.isclose(found["expectation_stderr"][f, i], stderr_by_hand(values[h][f]), rel_tol=1e-8)
            # with what the number of groups leaves to chance
            textbook = errors[f].std(ddof=1) / math.sqrt(samples)
            assert abs(found["error_stderr"][f, i] / textbook - 1) < 0.5
    assert np.array_equal(found["resolved"], np.abs(found["error"]) >= 4 * found["error_stderr"])
    assert not found["nonfinite"].any() and attributes["reference_nonfinite"] == 0
    assert attributes["samples"] == samples
    assert attributes["functions"][1] == "y1^2"
    assert attributes["expected_order"] == SCHEMES[scheme].weak_order


def test_results_for_the_first_samples_are_those_of_a_shorter_run():
    samples, prefixes = (600, (64, 100, 512, 600)) if COMPILED else (130, (64, 100))
    case = case_of(f"samples={samples}", f"prefixes={list(prefixes)}")
    found, _ = results_of(case, "splitting_order2", "plain")
    for i, n in enumerate(prefixes):
        few, _ = results_of(case.model_copy(update={"samples": n, "prefixes": None}), "splitting_order2", "plain")
        assert np.array_equal(found["prefix_error"][i], few["error"])
        assert np.array_equal(found["prefix_error_stderr"][i], few["error_stderr"])
    assert np.all(np.diff(found["prefix_cpu_seconds"]) >= 0)


@compiled_only
def test_common_paths_resolve_errors_that_independent_paths_do_not():
    """Negative control for the coupling: the same number of samples, the reference with random numbers of its own."""
    case = case_of("steps=2^-5 .. 2^-7", "reference_step=2^-9", "samples=16384")
    common, _ = results_of(case, "splitting", "plain")
    other, _ = results_of(case.model_copy(update={"seed": 2}), "splitting", "plain")
    assert common["resolved"].all()
    assert has_order(common, 1)
    independent = common["expectation"] - other["reference"][:, np.newaxis]
    values = values_by_hand(case, "splitting", seed=2)[case.reference_step]
    stderr = np.hypot(common["expectation_stderr"], values.std(axis=1, keepdims=True) / math.sqrt(case.samples))
    assert not is_resolved(np.abs(independent), stderr).any()
    assert np.all(np.abs(independent - common["error"]) < 4 * stderr + 0.2 * np.abs(common["error"]))
    gain = stderr / common["error_stderr"]
    assert np.all(np.diff(gain, axis=1) > 0) and gain.min() > 4  # the smaller h, the more
