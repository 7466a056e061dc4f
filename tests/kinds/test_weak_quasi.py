"""Weak errors by scrambled points: against solutions without sampling, and against independent paths."""

import numpy as np
import pytest
from helpers import compiled_only
from phis import functions_of
from states import finished
from weak_cases import case_of, plan_of

from spi.exact.expectations import expectations
from spi.kinds.blocks import values_at_end
from spi.schemes import SCHEMES
from spi.schemes.stages import compositions
from spi.statistics.estimators import group_counts
from spi.statistics.tallies import Batch

SCHEME = "splitting_order2"
FUNCTIONS = {"phi": "sin(2*pi*y1)", "square": "y1^2"}
BODY = "model={{name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [{0}, {0}, {0}]}}"


def quasi(*overrides, sigma=1, samples=512):
    what = "functions={phi: sin(2*pi*y1), square: y1^2}", f"samples={samples}", "estimators=[quasi]"
    return case_of(*what, "steps=[2^-3]", BODY.format(sigma), *overrides)


def exact(case, steps=(0.125, 0.0625)):
    """E phi at h = 2^-3 and 2^-4, or at other steps, without sampling."""
    acting = compositions(SCHEMES[SCHEME].composition, case.model)
    found = expectations(
        case.model, acting, case.initial, 1.0, np.array(steps), functions_of(tuple(FUNCTIONS.values()), 3)
    )
    return found.limit[:, np.newaxis] + found.weak_error


def found_with(case, scheme=SCHEME):
    plan = plan_of(case, scheme, "quasi")
    return plan.results(finished(plan))


def gains(sigma, scheme=SCHEME, points=4096):
    """The variance of independent paths over that of as many points, of E phi at h = 2^-4."""
    case = quasi(sigma=sigma, samples=64 * points)
    plan = plan_of(case, scheme, "quasi")
    total = finished(plan).total()
    mean = total.values[:, -1] / group_counts(64 * points)  # of the reference, of each scramble
    variance = (mean[1] - mean[0] ** 2).mean(axis=-1)
    return variance / points / mean[0].var(axis=-1, ddof=1)


@compiled_only
def test_the_solution_lies_within_the_standard_errors_that_scrambles_have():
    """Over 40 seeds; and the control: standard errors as of independent paths would be far too large."""
    case, deviations = quasi(), []
    truth = exact(case)
    for seed in range(40):
        found = found_with(quasi(f"seed={seed}", samples=4096))
        sampled = found.sampled
        deviations.append((found.expectation - truth[:, :1])[:, 0] / sampled.expectation_stderr[:, 0])
        deviations.append((sampled.reference - truth[:, 1]) / sampled.expectation_stderr[:, 0])
    deviations = np.array(deviations)
    assert np.abs(deviations).max() < 4.0
    assert 0.88 < np.mean(np.abs(deviations) < 2.0) <= 1.0  # 0.95 of 160, of which pairs share their paths
    assert 0.75 < deviations.std() < 1.25
    assert found.quasi.gain[1] > 3.0


@compiled_only
@pytest.mark.parametrize(
    ("scheme", "sigma", "least"),
    [
        (SCHEME, 1.0, (5.0, 18.0)),
        (SCHEME, 0.25, (500.0, 800.0)),
        pytest.param("splitting", 1.0, (6.0, 20.0), marks=pytest.mark.slow),  # without coins they are worth more
        pytest.param("splitting", 0.25, (1000.0, 3000.0), marks=pytest.mark.slow),
    ],
)
def test_points_are_worth_many_independent_paths(scheme, sigma, least):
    assert np.all(gains(sigma, scheme) > least)


@compiled_only
def test_more_samples_begin_with_the_same_paths():
    few, more = (plan_of(quasi(samples=n), SCHEME, "quasi") for n in (512, 4096))
    values = [values_at_end(p, p.grid, p.stream, Batch.of_first(8))[0] for p in (few, more)]
    assert np.array_equal(*values)
    assert few.deciding(0) == more.deciding(0)  # so that sums are gone on with
