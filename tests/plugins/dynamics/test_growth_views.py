"""Tables, figures and claims of dynamics, from results made by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers import printed
from long_results import growth, growth_group
from whole_dynamics import MEANS, WHOLE

from spi import views
from spi.plugins.dynamics.kinds.growth.results import chance
from spi.statistics.claims import quantities


def test_statistics_of_a_reading():
    (found,) = views.readings(growth(growth_group("midpoint")))
    assert found.largest_finite == 0 and replace(found, nonfinite=np.array([3, 1, 0])).largest_finite == 2
    assert replace(found, nonfinite=np.array([3, 1, 2])).largest_finite is None
    assert replace(found, h=found.h[::-1]).largest_finite == 2  # the largest, not the first
    exact = 1 / (1 + np.arange(9))
    np.testing.assert_allclose(found.law.z, (found.law.mean - exact) / 1e-3)
    (bare,) = views.readings(growth(growth_group("splitting", law=False)))
    assert bare.law is None and bare.solver is None and bare.about.final_time is None


def test_paths_that_diverge_and_the_largest_of_many_deviations():
    group = growth_group("splitting")
    group.variables["nonfinite"][1][:] = 3
    group.variables["mean"][1][:] = np.nan
    assert "not finite" in printed(growth(group))
    assert chance(1) == pytest.approx(1.96, abs=1e-3) and chance(9) == pytest.approx(2.766, abs=1e-3)


def test_the_growth_that_came_out_has_the_interval_of_the_fit():
    found = [one for one in quantities(views.readings(WHOLE["growth"])) if one.name == "growth"]
    assert (found[0].value, found[0].low, found[0].high) == pytest.approx((0.5, 0.47, 0.53))


def test_the_largest_deviation_is_that_of_all_times():
    """As by Euler-Maruyama with much noise: the mean is known at the first times, and then no number."""
    nan, one = math.nan, np.ones((1, 3))
    lost = replace(MEANS, mean=np.array([[1.0, 2.0, nan]]), difference=np.array([[0.0, 0.1, nan]]), t=np.arange(3.0))
    lost = replace(lost, difference_stderr=np.array([[0.0, 0.1, nan]]), reference=one, quantiles=None, variance=None)
    lost = replace(lost, since=None, autocorrelation=None, mean_stderr=one)
    told = {one.name: (one.value, one.lost) for one in quantities([lost])}
    assert told["deviation"] == (1.0, "not finite: 1 of 3 times") and told["mean"][1] == "not finite at the last time"
    at_first = replace(lost, mean=one, difference=0 * one, reference=np.array([[nan, 1.0, 1.0]]))
    told = {one.name: (one.value, one.lost) for one in quantities([at_first])}
    assert told["deviation"] == (0.0, "")  # nothing was known at the first time
