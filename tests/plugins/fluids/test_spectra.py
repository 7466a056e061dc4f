"""Spectra with intervals: E(k) in the kinds statistics and equilibrium, their tables and their panel."""

import numpy as np
import pytest
from helpers import COMPILED, loop_in_python
from view_helpers import bars_of, legend_texts, points_of

from spi import storage, views
from spi.plugins.fluids.models import fields
from spi.running import run as runner
from spi.specs import SpecError

SPEC = """\
kind: statistics
model: {name: zeitlin, n: 5, noise: {shell: 1, sigma: 0.5}}
initial: {random: {spectrum: k, energy: 0.5}}
final_time: 1/2
step: 2^-2
schemes: [splitting]
samples: 64
functions: {E: E(k) for k = 1..3, Z: enstrophy}
panels: [energy_spectrum]
"""


OVER_TIME = """\
kind: equilibrium
model: {name: zeitlin, n: 5, noise: {shell: 1, sigma: 0.5}}
initial: {random: {spectrum: k, energy: 0.5}}
final_time: 128
steps: [1]
schemes: [splitting]
samples: 4
functions: {E: E(k) for k = 1..(n+1)/2}
panels: [energy_spectrum]
"""


@pytest.mark.skipif(not COMPILED, reason="hundreds of steps")
def test_a_spectrum_over_paths(spec, tmp_path):
    """Means over the paths with intervals, each at its k, at all times; at the start that of the initial state."""
    experiment = spec(SPEC)
    (case,) = experiment.cases
    with loop_in_python():
        results = storage.read(runner.run(experiment, tmp_path))
    (one,) = views.readings(results)
    assert one.functions == ("E1", "E2", "E3", "Z")
    np.testing.assert_allclose(one.mean[:3, 0], fields.energy_spectrum(np.array(case.initial)), rtol=1e-12)
    np.testing.assert_allclose(one.mean[3], fields.enstrophy(np.array(case.initial)), rtol=1e-12)
    assert (one.mean_stderr[:3, 1:] > 0).all()
    fig = views.figure(results)
    (ax,) = fig.axes
    assert legend_texts(fig) == ["$t=0$", "$t=0.25$", "$t=0.5$"] and (ax.get_xscale(), ax.get_yscale()) == (
        "log",
        "log",
    )
    np.testing.assert_array_equal(points_of(ax, "$t=0.5$"), np.array([[1, 2, 3], one.mean[:3, 2]]).T)
    half = one.interval() * one.mean_stderr[:3, 2]
    expected = [[1, 2, 3], one.mean[:3, 2] - half, one.mean[:3, 2] + half]
    np.testing.assert_allclose(np.array(bars_of(ax, "$t=0.5$")), expected, rtol=1e-12)
    assert ax.get_ylabel() == "mean of $E(k)$ (95 %)"
    last = one.mean[:3, 2].min()
    results.groups[0].variables["mean"][1][2, 0] = 1e-23  # next to nothing at the start, where no interval is seen
    (ax,) = views.figure(results).axes
    assert 1e-4 * last < ax.get_ylim()[0] < 1e-2 * last


@pytest.mark.needs("dynamics")
def test_a_spectrum_over_time():
    """At the smallest step size, with the intervals of the means and the reference"""
    from long_results import equilibrium, equilibrium_group

    group = equilibrium_group("splitting", panels=("energy_spectrum",))
    group.attributes["texts"] = ("E(2)", "E(1)")
    average, half = (group.variables[name][1] for name in ("average", "average_half"))
    average[:] += [[0.0, 0.2]]
    half[:] = [[0.01, 0.02]]
    group.variables["reference"][1][:] = [0.5, 0.4]
    (ax,) = views.figure(equilibrium(group)).axes
    label = ax.lines[0].get_label()
    np.testing.assert_allclose(points_of(ax, label), [[1, average[2, 1]], [2, average[2, 0]]])
    ends = [[average[2, 1] - 0.02, average[2, 0] - 0.01], [average[2, 1] + 0.02, average[2, 0] + 0.01]]
    np.testing.assert_allclose(np.array(bars_of(ax, label))[1:], ends)
    assert legend_texts(ax.figure) == ["reference"]
    np.testing.assert_array_equal(points_of(ax, "reference"), [[1, 0.4], [2, 0.5]])


@pytest.mark.parametrize("text", [SPEC, OVER_TIME])
def test_the_panel_needs_two_shells(spec, text):
    with pytest.raises(SpecError, match=r"energy_spectrum', which is of functions E.k., as in functions: .E: E.k. for"):
        spec(text, text[text.index("functions") : text.index("panels")], "functions: {E: E(1)}\n")
