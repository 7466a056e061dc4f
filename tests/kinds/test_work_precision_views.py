"""Figures of work and precision, from results made by hand."""

import numpy as np
import pytest
from helpers import printed
from matplotlib.colors import to_hex
from strong_results import unresolved
from work_cases import answers
from work_results import MADE_UP, H, work_group, work_results

from spi.report import views
from spi.schemes import SCHEMES
from spi.storage.records import Results


@pytest.fixture(scope="module")
def figure():
    return views.figure(work_results())


def series(ax, scheme):
    """The points of a scheme, without those of the legend."""
    marker, colour = SCHEMES[scheme].look
    lines = [line for line in ax.lines if line.get_marker() == marker and to_hex(line.get_color()).upper() == colour]
    return [line for line in lines if len(line.get_xdata())]


def edge(ax, end):
    return {tuple(np.ravel(line.get_xdata())) for line in ax.lines if set(np.ravel(line.get_ydata())) == {end}}


def test_panels(figure):
    one, lost, weak, casimirs, _, empty = figure.axes
    assert one.get_ylabel().startswith("strong error") and weak.get_ylabel().startswith("weak error")
    assert not empty.axison and casimirs.get_ylabel().startswith("Casimir error") and r"\sigma" in lost.get_title()
    assert [one.xaxis.get_major_formatter()(x) for x in (1e-7, 1e-6)] == ["100 ns", "1 µs"]


def test_points_of_errors(figure):
    one, lost = figure.axes[:2]
    for scheme in MADE_UP:
        variables = work_group("one", scheme).variables
        (line,) = series(one, scheme)
        np.testing.assert_array_equal(line.get_xdata(), variables["seconds_per_path"][1])
        np.testing.assert_array_equal(line.get_ydata(), variables["error"][1])
    seconds = work_group("lost", "euler_maruyama").variables["seconds_per_path"][1]
    (line,) = series(lost, "euler_maruyama")
    np.testing.assert_array_equal(line.get_xdata(), seconds[3:])
    assert edge(lost, 1) == {tuple(seconds[:3])} and edge(one, 1) == set()
    assert lost.get_ylim()[1] < 1
    bars = one.containers[-1][2][0].get_segments()
    stderr = work_group("one", "splitting_order2").variables["error_stderr"][1]
    np.testing.assert_allclose([bar[1, 1] - bar[0, 1] for bar in bars], 2 * 1.96 * stderr)


def test_resolved_errors_of_a_blow_up_do_not_widen_the_axes():
    groups = [work_group("one", scheme) for scheme in ("euler_maruyama", "midpoint", "splitting")]
    groups[0].variables["error"][1][0] = 1e6
    ax = views.figure(Results({"kind": "work_precision"}, tuple(groups))).axes[0]
    assert ax.get_ylim()[1] < 1 and edge(ax, 1) == {(groups[0].variables["seconds_per_path"][1][0],)}


def test_weak_errors_have_bounds_and_pale_points(figure):
    weak = figure.axes[2]
    bars = weak.containers[0][2][0].get_segments()
    np.testing.assert_allclose([bar[1, 1] - bar[0, 1] for bar in bars], 2e-8, rtol=1e-5)
    pale = [line for line in series(weak, "splitting_order2") if line.get_alpha()]
    assert len(pale) == 1 and len(pale[0].get_xdata()) == 1 and pale[0].get_linestyle() == "None"


def test_requested_errors(figure):
    for ax, seen in ((figure.axes[0], [0.01, 0.1]), (figure.axes[2], [1e-6, 1e-4, 0.01])):
        across = [line.get_ydata()[0] for line in ax.lines if line.get_linestyle() == "--" and len(line.get_ydata())]
        assert across == seen


def test_points_of_casimirs(figure):
    casimirs, spoilt = figure.axes[3:5]
    seconds = work_group("one", "splitting").variables["seconds_per_path"][1]
    assert edge(casimirs, 0) == {(seconds[0],)} and edge(casimirs, 1) == set()
    (line,) = series(casimirs, "splitting")
    np.testing.assert_array_equal(line.get_xdata(), seconds[1:])
    (line,) = series(casimirs, "midpoint")
    np.testing.assert_array_equal(line.get_ydata(), 0.1 * H)
    lost = work_group("lost", "euler_maruyama").variables["seconds_per_path"][1]
    assert edge(spoilt, 1) == {tuple(lost[:3])} and spoilt.get_ylim()[1] < 10


def test_a_scheme_without_casimirs_beside_others():
    groups = [work_group("one", scheme, casimirs=scheme == "midpoint") for scheme in ("midpoint", "splitting")]
    fig = views.figure(Results({"kind": "work_precision"}, tuple(groups)))
    assert series(fig.axes[0], "splitting") and series(fig.axes[1], "midpoint")
    assert not series(fig.axes[1], "splitting")


@pytest.mark.parametrize("variables", [("error",), ("error", "error_stderr", "casimir_drift", "seconds_per_path")])
def test_nothing_to_draw(variables):
    group = work_group("one", "splitting")
    for name in variables:
        axes, values = group.variables[name]
        group.variables[name] = axes, np.full(values.shape, np.nan)
    group.variables["resolved"] = ("h",), np.zeros(9, bool)
    unresolved(group)
    results = Results({"kind": "work_precision", "title": "none"}, (group,))
    views.figure(results).draw_without_rendering()
    text = printed(results)
    assert "order not resolved" in text and all("none" in row for row in next(answers(text)).values())
