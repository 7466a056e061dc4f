"""Weak errors of functions of which all paths have the same value: no error is exactly 0."""

import numpy as np
import pytest
from helpers import compiled_only
from states import finished
from weak_cases import case_of, levels_plan_of, plan_of

from spi.kinds.weak.results import WeakErrors

#: Of which no path is there, of which a path may be there, and of which nobody knows how large it can be.
FUNCTIONS = "functions={never: (1 + (y3 - 9)/abs(y3 - 9))/2, kink: abs(y3 - 9) + y3 - 9, phi: sin(2*pi*y1)}"
SHORT = "steps=[2^-3, 2^-4]", "reference_step=2^-5", FUNCTIONS, "seconds=0.02"


def of(plan):
    return WeakErrors.of(plan.results(finished(plan)).group())


def rule_of_three(samples):
    return 1 - 0.05 ** (1 / np.asarray(samples, float))


@compiled_only
@pytest.mark.parametrize(
    ("estimator", "scheme", "factor"), [("plain", "splitting_order2", 4 / 3), ("quasi", "splitting", 2)]
)
def test_what_no_path_shows_is_bounded_or_not_known(estimator, scheme, factor):
    """What the reference lacks is added, r/(1 - r) for r = (h_ref/h)^p at the smallest step; kernels of other tests."""
    found = of(plan_of(case_of(*SHORT, "samples=512"), scheme, estimator))
    assert not found.error[:2].any() and not found.resolved[:2].any()
    assert np.allclose(found.half[0], factor * rule_of_three(512), rtol=1e-9)
    assert np.allclose(found.expectation_half[0], rule_of_three(512), rtol=1e-9)
    assert np.isnan(found.half[1]).all() and np.isnan(found.expectation_half[1]).all()
    assert (found.half[2] > 0).all() and found.half[2].max() < 0.5


@compiled_only
@pytest.mark.parametrize("estimator", ["levels", "differences"])
def test_levels_whose_values_are_all_equal_are_bounded_and_sampled_again(estimator):
    plan = (levels_plan_of if estimator == "levels" else plan_of)(case_of(*SHORT), "splitting", "multilevel")
    found = of(plan)
    samples = found.levels.samples
    assert not found.error[0].any() and np.isnan(found.half[1]).all()
    if estimator == "levels":
        assert found.levels.h[0] < found.levels.h[1]
        of_steps = np.cumsum(rule_of_three(samples))[::-1]
        assert np.allclose(found.half[0], of_steps + of_steps[-1], rtol=1e-9)
    else:
        assert (found.half[0] >= rule_of_three(found.differences.samples)).all()
    assert samples.min() > 1024 and (found.expectation_half[0] > 0).all()
    assert (found.history.error_stderr[:, 0] > 0).all()
