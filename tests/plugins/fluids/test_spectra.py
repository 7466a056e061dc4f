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


def computed(experiment, folder):
    with loop_in_python():
        results = storage.read(runner.run(experiment, folder))
    return results, views.readings(results)[0]


@pytest.mark.skipif(not COMPILED, reason="hundreds of steps")
def test_a_spectrum_over_paths(spec, tmp_path):
    """Means over the paths with intervals, each at its k, at all times; at the start that of the initial state."""
    experiment = spec(SPEC)
    (case,) = experiment.cases
    results, one = computed(experiment, tmp_path)
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


@pytest.mark.skipif(not COMPILED, reason="hundreds of steps")
def test_a_spectrum_over_time(spec, tmp_path):
    results, one = computed(spec(OVER_TIME), tmp_path)
    assert one.averages.texts == ("E(1)", "E(2)", "E(3)")
    (ax,) = views.figure(results).axes
    (line,) = ax.lines[:1]
    np.testing.assert_array_equal(line.get_ydata(), one.averages.average[0])
    (bars,) = [lines for lines in ax.collections if hasattr(lines, "get_segments") and len(lines.get_segments())]
    half = [np.ptp(segment[:, 1]) / 2 for segment in bars.get_segments()]
    np.testing.assert_allclose(half, one.averages.average_half[0], rtol=1e-12)


@pytest.mark.parametrize("text", [SPEC, OVER_TIME])
def test_the_panel_needs_two_shells(spec, text):
    with pytest.raises(SpecError, match=r"energy_spectrum', which is of functions E.k., as in functions: .E: E.k. for"):
        spec(text, text[text.index("functions") : text.index("panels")], "functions: {E: E(1)}\n")
