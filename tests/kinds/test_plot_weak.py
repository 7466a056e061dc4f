"""Figures of weak errors: what is drawn, not how it looks."""

import numpy as np
import pytest
from helpers import printed
from matplotlib.markers import CARETDOWN, CARETUP
from view_helpers import edge, legend_texts, line_of, points_of, rendered, save, title
from weak_results import H, weak, weak_group

from spi import views
from spi.drawing import style
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


@pytest.mark.needs("solve")
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


def test_the_band_of_a_curve_only_where_it_can_be_seen():
    group = weak_group("splitting_order2", "kolmogorov", functions=1)
    assert not views.figure(weak(group)).axes[0].collections
    group.variables["error_bound"][1][:] = 1e-6
    (band,) = views.figure(weak(group)).axes[0].collections
    assert band.get_paths()[0].vertices[:, 1].max() == pytest.approx(0.5 / 64 + 1e-6)


@pytest.mark.needs("solve")
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


def test_paths_that_blow_up():
    group = weak_group("splitting", "plain", functions=1)
    group.variables["error"][1][0, :2] = 1e30, np.inf
    group.variables["error_stderr"][1][0, :2] = 1e30, np.nan
    group.variables["resolved"][1][0, :2] = False
    fig = views.figure(weak(group))
    (ax,) = fig.axes
    assert ax.get_ylim()[1] < 1  # what is beyond the axis does not widen it
    assert "paths diverged, or beyond the axis" in legend_texts(fig)
    assert sorted(x for x, _ in edge(ax, CARETUP)) == [2**-4, 2**-3]


def test_no_bar_for_one_path_and_for_errors_of_0():
    """Neither has an interval: the errors of one path lie within the frame, and no line stands for an error of 0."""
    for error, stderr in ((1e-2 * H, np.nan), (0.0 * H, 0.0)):
        group = weak_group("splitting", "multilevel", functions=1)
        group.variables["error"][1][0] = error
        group.variables["error_stderr"][1][0] = stderr
        group.variables["resolved"][1][...] = False
        (ax,) = views.figure(weak(group)).axes
        lines = [segment for lines in ax.collections for segment in lines.get_segments()]
        assert all(np.ptp(segment[:, 1]) == 0 for segment in lines)
        bottom, top = ax.get_ylim()
        assert not error.any() or bottom < error.min() < error.max() < top


def test_formulas():
    assert style.formula("3.141592653589793*y12^10 - exp(0.25*y1)") == r"\pi\,y_{12}^{10} - \exp (0.25\,y_{1})"
    assert style.formula("2*y2^2 - y1", ("q_1", "P6")) == r"2\,P_{6}^{2} - q_{1}"
    assert style.maths("y3^2") == "$y_{3}^{2}$" and style.maths("y1 <= 1/2") == r"$y_{1} \leq  1/2$"
    assert style.maths("maximum of y3") == "maximum of $y_{3}$" and style.maths("a $ b_") == r"a \$ b_"


def test_components_have_the_names_of_the_system():
    """In the line above a figure, in the titles of panels, and under the table."""
    results = weak(weak_group("splitting", "multilevel", variables=("P1", "P2", "G3")))
    fig, text = views.figure(results), printed(results)
    titles = " ".join(map(title, fig.axes))
    assert "P_{1}" in titles and "y_{1}" not in titles
    assert "P1" in text and "y1" not in text
    assert [style.count(n) for n in (500, 10**6, 12345)] == ["500", "$10^{6}$", "12345"]
