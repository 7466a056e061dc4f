"""Figures of work and precision, from results made by hand."""

import numpy as np
import pytest
from helpers import printed
from matplotlib.markers import CARETDOWN, CARETUP
from strong_results import unresolved
from view_helpers import bars_of, edge, points_of
from work_cases import answers
from work_results import MADE_UP, H, work_group, work_results

from spi.report import views
from spi.storage.records import Results


@pytest.fixture(scope="module")
def figure():
    return views.figure(work_results())


def label_of(scheme):
    return MADE_UP[scheme][0]


@pytest.fixture(scope="module")
def axes(figure):
    """The panels by case and what they show."""
    errors = [ax for ax in figure.axes if "Casimir" not in ax.get_ylabel()]
    casimirs = [ax for ax in figure.axes if "Casimir" in ax.get_ylabel()]
    return dict(zip(("one", "lost", "weak"), errors, strict=True)), dict(zip(("one", "lost"), casimirs, strict=True))


def test_points_of_errors(axes):
    one, lost = axes[0]["one"], axes[0]["lost"]
    for scheme in MADE_UP:
        variables = work_group("one", scheme).variables
        points = points_of(one, label_of(scheme))
        np.testing.assert_array_equal(points[:, 0], np.sort(variables["seconds_per_path"][1]))
        np.testing.assert_array_equal(np.sort(points[:, 1]), np.sort(variables["error"][1]))
    seconds = work_group("lost", "euler_maruyama").variables["seconds_per_path"][1]
    np.testing.assert_array_equal(points_of(lost, label_of("euler_maruyama"))[:, 0], np.sort(seconds[3:]))
    assert [x for x, _ in edge(lost, CARETUP)] == sorted(seconds[:3]) and not edge(one, CARETUP)
    assert lost.get_ylim()[1] < 1
    _, low, high = bars_of(one, label_of("splitting_order2"))
    stderr = work_group("one", "splitting_order2").variables["error_stderr"][1]
    np.testing.assert_allclose(np.sort(high - low), np.sort(2 * 1.96 * stderr), rtol=1e-6)


def test_resolved_errors_of_a_blow_up_do_not_widen_the_axes():
    groups = [work_group("one", scheme) for scheme in ("euler_maruyama", "midpoint", "splitting")]
    groups[0].variables["error"][1][0] = 1e6
    ax = views.figure(Results({"kind": "work_precision"}, tuple(groups))).axes[0]
    seconds = groups[0].variables["seconds_per_path"][1][0]
    assert ax.get_ylim()[1] < 1 and [x for x, _ in edge(ax, CARETUP)] == [seconds]


def test_requested_errors(axes):
    for case, seen in (("one", [0.01, 0.1]), ("weak", [1e-6, 1e-4, 0.01])):
        lines = [line for line in axes[0][case].lines if line.get_linestyle() == "--" and len(line.get_ydata())]
        low, high = axes[0][case].get_ylim()
        assert [line.get_ydata()[0] for line in lines] == [error for error in seen if low < error < high] != []


def test_points_of_casimirs(axes):
    casimirs, spoilt = axes[1]["one"], axes[1]["lost"]
    seconds = work_group("one", "splitting").variables["seconds_per_path"][1]
    assert [x for x, _ in edge(casimirs, CARETDOWN)] == [seconds[0]] and not edge(casimirs, CARETUP)
    np.testing.assert_array_equal(points_of(casimirs, label_of("splitting"))[:, 0], np.sort(seconds[1:]))
    np.testing.assert_array_equal(np.sort(points_of(casimirs, label_of("midpoint"))[:, 1]), np.sort(0.1 * H))
    lost = work_group("lost", "euler_maruyama").variables["seconds_per_path"][1]
    assert [x for x, _ in edge(spoilt, CARETUP)] == sorted(lost[:3]) and spoilt.get_ylim()[1] < 10


def test_a_scheme_without_casimirs_beside_others():
    groups = [work_group("one", scheme, casimirs=scheme == "midpoint") for scheme in ("midpoint", "splitting")]
    fig = views.figure(Results({"kind": "work_precision"}, tuple(groups)))
    drawn = [{line.get_label() for line in ax.lines} for ax in fig.axes]
    assert label_of("splitting") in drawn[0] - drawn[1] and label_of("midpoint") in drawn[1]


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
