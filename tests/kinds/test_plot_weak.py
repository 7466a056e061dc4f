"""Figures of weak errors: what is drawn, not how it looks."""

import numpy as np
import pytest
from matplotlib.markers import CARETDOWN, CARETUP
from view_helpers import edge, legend_texts, line_of, points_of, rendered, save, title
from weak_results import H, weak, weak_group

from spi.report import views
from spi.schemes import SCHEMES

THREE = ("plain", "multilevel", "kolmogorov")
NAMES = ("plain Monte Carlo ($10^{6}$)", "multilevel", "Kolmogorov, no sampling")


def one_scheme(scheme="splitting", panels=("errors",), **stderrs):
    """All estimators of one function."""
    stderrs = {"plain": 1e-4, "multilevel": 1e-5} | stderrs
    groups = []
    for name in THREE:
        given = {"stderr": stderrs[name]} if name in stderrs else {}
        groups.append(weak_group(scheme, name, functions=1, prefixes=name == "plain", panels=panels, **given))
    return groups


def test_errors_of_three_estimators():
    """Samples are points with bars, what is not sampled a smooth line."""
    results = weak(*one_scheme())
    fig = views.figure(results)
    (ax,) = fig.axes
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log") and ax.get_xlabel() == "step size $h$"
    assert ax.get_ylabel().startswith("weak error") and r"\varphi(y_h(T))" in ax.get_ylabel()
    lines, points = legend_texts(fig)[:2], legend_texts(fig)[2:]
    assert {*lines, *points} == {*(f"{name}: order 1.00 [0.98, 1.02]" for name in NAMES), "slope 1"}
    drawn = points_of(ax, "multilevel")[::-1]
    np.testing.assert_array_equal(drawn, np.column_stack([H, results.groups[1].variables["error"][1][0]]))
    beside = points_of(ax, NAMES[0])[::-1]
    assert (beside[:, 0] > H).all() and (beside[:, 0] < 1.2 * H).all()
    assert [line_of(ax, name).get_linestyle() for name in NAMES] == ["None", "None", "-"]
    exact = line_of(ax, NAMES[2])
    assert exact.get_marker() in ("", "None") and exact.get_color() == SCHEMES["splitting"].look[1]
    np.testing.assert_array_equal(np.sort(exact.get_ydata()), np.sort(0.5 * H))
    text = fig.texts[1].get_text()
    assert r"\varphi(y)=\sin (2\pi\,y_{1}) + y_{2}" in text and "2^{-10}" in text and "samples" not in text


def test_by_number_of_paths():
    results = weak(*one_scheme("splitting_order2", ("errors", "samples")))
    fig = rendered(views.figure(results))
    left, right = fig.axes
    assert "plain" not in " ".join(str(line.get_label()) for line in left.lines)
    assert title(right) == "plain Monte Carlo by number of paths"
    paths = ["$10^{4}$ paths", "$10^{5}$ paths", "$10^{6}$ paths"]
    assert set(paths) <= {text.get_text() for text in right.texts} and {"multilevel: 2.00"} <= {
        text.get_text() for text in left.texts
    }  # too many for a legend
    assert "dashed: half the 95 % interval" in legend_texts(fig)
    floors = [
        line.get_ydata()[::-1] for line in right.lines if line.get_linestyle() == "--" and line.get_linewidth() < 1
    ]
    np.testing.assert_allclose(floors, 1.96 * results.groups[0].variables["prefix_error_stderr"][1][:, 0])
    shown, resolved = (results.groups[0].variables[f"prefix_{name}"][1][2, 0] for name in ("error", "error_stderr"))
    good = np.abs(shown) >= 2 * resolved
    np.testing.assert_array_equal(points_of(right, "$10^{6}$ paths")[::-1, 1], np.abs(shown[good]))


def test_all_paths_where_no_prefix_has_them():
    groups = one_scheme(panels=("samples",))
    groups[0].attributes["samples"] = 5 * 10**6
    assert "5000000 paths" in legend_texts(views.figure(weak(*groups)))


def test_accuracy_against_seconds():
    results = weak(*one_scheme(panels=("seconds",)))
    fig = rendered(views.figure(results))
    (accuracy,) = fig.axes
    middle = H[2]  # of 2^-3 .. 2^-8, 2^-5.5 rounds to the larger one
    assert title(accuracy) == "splitting, $h=2^{-5}$" and middle == 2**-5
    assert "multilevel: 100 times as fast" in legend_texts(fig)
    seconds, stderr = line_of(accuracy, "plain Monte Carlo").get_data()
    np.testing.assert_allclose(seconds, [0.04, 0.4, 4])
    np.testing.assert_allclose(stderr, 1e-4 * np.sqrt([100, 10, 1]))
    assert len(edge(accuracy, CARETDOWN)) == 1  # the bound of what is not sampled, far below


def test_seconds_without_the_other_estimators(tmp_path):
    plain, *_ = one_scheme(panels=("errors", "seconds"))
    assert len(views.figure(weak(plain)).axes) == 2
    plain.variables["prefix_error_stderr"][1][:] = 0.0
    plain.variables["error_stderr"][1][:] = np.inf
    save(weak(plain), tmp_path, "seconds")


@pytest.mark.share
@pytest.mark.parametrize("value", [np.nan, np.inf, 0.0, 1e300])
@pytest.mark.parametrize("which", ["all", "some"])
def test_what_is_not_finite(value, which):
    groups = one_scheme(panels=("errors", "samples", "seconds"))
    for group in groups:
        for name, (_, values) in group.variables.items():
            if values.dtype == float and not name.startswith(("level", "order")):
                values[..., : 1 if which == "some" else None] = value
            elif name == "resolved":
                values[..., : 1 if which == "some" else None] = False
    rendered(views.figure(weak(*groups)))


def test_paths_that_blow_up():
    group = weak_group("splitting", "plain", functions=1)
    group.variables["error"][1][0, :2] = 1e30, np.inf
    group.variables["error_stderr"][1][0, :2] = 1e30, np.nan
    group.variables["resolved"][1][0, :2] = False
    fig = views.figure(weak(group))
    (ax,) = fig.axes
    assert 1 < ax.get_ylim()[1] < 1e3 and "paths diverged, or beyond the axis" in legend_texts(fig)
    assert sorted(x for x, _ in edge(ax, CARETUP)) == [2**-4, 2**-3]


def test_only_schemes_with_prefixes_have_panels_of_seconds():
    without = weak_group("splitting_order2", "plain", panels=("seconds",))
    panels = [title(ax) for ax in views.figure(weak(*one_scheme(panels=("seconds",)), without)).axes]
    assert panels == ["splitting, $h=2^{-5}$"]


def test_panels_that_cannot_be_drawn():
    with pytest.raises(ValueError, match="'sphere' is not a known panel; known panels: errors, samples, seconds"):
        views.figure(weak(weak_group("splitting", "multilevel", panels=("sphere",))))
    with pytest.raises(ValueError, match="no panel that could be drawn"):
        views.figure(weak(weak_group("splitting", "multilevel", panels=("samples",))))
    with pytest.raises(ValueError, match="no scheme"):
        views.figure(weak())
