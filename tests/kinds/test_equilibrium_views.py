"""Tables and figures of long times, from results made by hand."""

from dataclasses import replace

import numpy as np
import pytest
from equilibrium_results import equilibrium, equilibrium_group
from helpers import printed
from view_helpers import SCHEMES, lines_of

from spi.kinds.equilibrium.results import chance
from spi.report import views


def test_printed_long_times():
    results = equilibrium(*(equilibrium_group(scheme) for scheme in SCHEMES))
    text = printed(results)
    casimirs, law = text.split("stationary law")
    explicit = lines_of(casimirs, "Euler-Maruyama")
    assert explicit[0] == ["2^-2", "512", "inf", "inf", "not", "fitted", "2.0e-17", "20.0"]
    rms = results.groups[2].variables["casimir_rms"][1][0, -1, 0]
    found = lines_of(casimirs, "splitting")[0]
    assert found == ["2^-2", "0", f"{rms:.1e}", f"{3.5 * rms:.1e}", "0.50", "[0.47,", "0.53]", "1.5e-18", "1.5"]
    v = {name: values for name, (_, values) in results.groups[1].variables.items()}
    z = np.abs(v["mean"][0] - v["mean_exact"]) / v["mean_stderr"][0]
    assert lines_of(law, "midpoint")[0][-2:] == [f"{z.max():.1f}", results.groups[1].coordinates["moment"][z.argmax()]]
    assert lines_of(law, "midpoint")[0][:7] == ["2^-2", "0.0033", "±", "0.0012", "0.0058", "±", "0.0012"]
    assert lines_of(law, "Euler-Maruyama")[0][-2:] == ["not", "finite"]
    assert "512 paths of 2^26 = 6.7e+07 steps each, 4096 snapshots of each path" in text
    assert chance(1) == pytest.approx(1.96, abs=1e-3) and chance(9) == pytest.approx(2.766, abs=1e-3)


def test_statistics_of_a_reading():
    explicit, implicit = views.readings(equilibrium(equilibrium_group("euler_maruyama"), equilibrium_group("midpoint")))
    assert (explicit.largest_finite, implicit.largest_finite) == (2, 0)
    assert replace(explicit, nonfinite=np.array([3, 1, 2])).largest_finite is None
    assert replace(implicit, h=implicit.h[::-1]).largest_finite == 2  # the largest, not the first
    exact = 1 / (1 + np.arange(9))
    np.testing.assert_allclose(implicit.law.z, (implicit.law.mean - exact) / 1e-3)
    assert implicit.law.variables == ("y1", "y2", "y3", "H") and implicit.law.fraction.shape == (3, 4, 20)
    (bare,) = views.readings(equilibrium(equilibrium_group("splitting", law=False)))
    assert bare.law is None and bare.solver is None and bare.about.final_time is None
