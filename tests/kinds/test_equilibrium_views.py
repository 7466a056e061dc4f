"""Tables and figures of long times, from results made by hand."""

from dataclasses import replace

import numpy as np
import pytest
from equilibrium_results import equilibrium, equilibrium_group
from helpers import printed
from matplotlib.colors import to_hex
from matplotlib.markers import CARETUP
from view_helpers import GREEN, SCHEMES, bars_of, edge, legend_texts, lines_of, points_of

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


def test_long_times():
    groups = [equilibrium_group(scheme) for scheme in SCHEMES]
    fig = views.figure(equilibrium(*groups))
    assert len(fig.axes) == 1 + 4 + 4
    assert "512 paths of $2^{26}$ steps" in fig.texts[1].get_text() and "T=" not in fig.texts[1].get_text()
    (walk,) = (ax for ax in fig.axes if ax.get_ylabel().startswith("rms of $C(y_n)"))
    assert [x for x, _ in edge(walk, CARETUP)][:3] == [2**9, 2**14, 2**15]
    laws = [ax.get_xlabel() for ax in fig.axes if ax.get_xlabel().startswith("distribution")]
    assert laws == [f"distribution function of ${name}$" for name in ("y_{1}", "y_{2}", "y_{3}", "H")]
    assert {"exact", "slope 1/2", "slope 1", "$10^{-11}$"} <= set(legend_texts(fig))


def test_law_against_the_exact_one():
    groups = [equilibrium_group(scheme, panels=("law", "distance")) for scheme in ("midpoint", "splitting")]
    fig = views.figure(equilibrium(*groups))
    ax, distances = fig.axes[2], fig.axes[6]  # of y3
    np.testing.assert_allclose(points_of(ax, "splitting")[:, 1], 20 * groups[1].variables["fraction"][1][0, 2])
    _, low, high = bars_of(ax, "splitting")
    np.testing.assert_allclose((high - low) / 2, 1.96 * 20 * 6e-4)
    pale = {to_hex(line.get_color()): len(line.get_xdata()) for line in distances.lines if line.get_alpha()}
    assert pale == {"#0072b2": 1, GREEN: 3}
    assert distances.get_ylim()[0] <= 6e-4


def test_lost_everywhere():
    group = equilibrium_group("splitting", casimirs=2)
    group.variables["nonfinite"][1][:] = 3
    group.variables["casimir_rms"][1][:] = np.inf
    group.variables["mean"][1][:] = np.nan
    for name in ("fraction", "law_distance", "law_distance_stderr"):
        group.variables[name][1][:] = np.nan
    assert len(views.figure(equilibrium(group)).axes) == 2 + 4  # growth and distances
    assert "not finite" in printed(equilibrium(group))


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
