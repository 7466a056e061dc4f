"""Tables and figures of long times, from results made by hand."""

from dataclasses import replace

import numpy as np
import pytest
from equilibrium_results import equilibrium, equilibrium_group
from helpers import printed

from spi import views
from spi.plugins.dynamics.kinds.equilibrium.results import chance


def test_statistics_of_a_reading():
    (found,) = views.readings(equilibrium(equilibrium_group("midpoint")))
    assert found.largest_finite == 0 and replace(found, nonfinite=np.array([3, 1, 0])).largest_finite == 2
    assert replace(found, nonfinite=np.array([3, 1, 2])).largest_finite is None
    assert replace(found, h=found.h[::-1]).largest_finite == 2  # the largest, not the first
    exact = 1 / (1 + np.arange(9))
    np.testing.assert_allclose(found.law.z, (found.law.mean - exact) / 1e-3)
    (bare,) = views.readings(equilibrium(equilibrium_group("splitting", law=False)))
    assert bare.law is None and bare.solver is None and bare.about.final_time is None


def test_paths_that_diverge_and_the_largest_of_many_deviations():
    group = equilibrium_group("splitting")
    group.variables["nonfinite"][1][:] = 3
    group.variables["mean"][1][:] = np.nan
    assert "not finite" in printed(equilibrium(group))
    assert chance(1) == pytest.approx(1.96, abs=1e-3) and chance(9) == pytest.approx(2.766, abs=1e-3)
