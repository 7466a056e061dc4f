"""Figures of weak errors: what is drawn, not how it looks."""

import numpy as np
import pytest
from helpers import printed
from matplotlib.figure import Figure
from view_helpers import legend_texts, rendered
from weak_results import H, weak, weak_group

from spi.drawing import style
from spi.kinds.weak import figure
from spi.report import views

THREE = ("plain", "multilevel", "kolmogorov")


def one_scheme(scheme="splitting", panels=("errors",), **stderrs):
    """All estimators of one function."""
    stderrs = {"plain": 1e-4, "multilevel": 1e-5} | stderrs
    groups = []
    for name in THREE:
        given = {"stderr": stderrs[name]} if name in stderrs else {}
        groups.append(weak_group(scheme, name, functions=1, prefixes=name == "plain", panels=panels, **given))
    return groups


def sampled(ax, label):
    """Points of the series with that label, (h, error), and the ends of their bars."""
    (container,) = (c for c in ax.containers if c.get_label().startswith(label))
    return np.column_stack(container[0].get_data()), np.array(container[2][0].get_segments())


def curve(ax, label):
    (line,) = (line for line in ax.lines if line.get_label().startswith(label))
    return line


def test_errors_of_three_estimators():
    results = weak(*one_scheme())
    fig = views.figure(results)
    (ax,) = fig.axes
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log") and ax.get_ylabel().startswith("weak error")
    assert " ".join(legend_texts(ax)).count("order 1.00 [0.98, 1.02]") == 3
    points, bars = sampled(ax, "multilevel")
    np.testing.assert_array_equal(points, np.column_stack([H, results.groups[1].variables["error"][1][0]]))
    np.testing.assert_allclose(bars[:, 1, 1] - bars[:, 0, 1], 2 * 1.96e-5)
    np.testing.assert_array_equal(np.sort(curve(ax, "Kolmogorov").get_ydata()), np.sort(0.5 * H))
    text = fig.texts[1].get_text()
    assert r"\varphi(y)=\mathrm{sin}(2\pi\,y_{1}) + y_{2}" in text and "2^{-10}" in text and "samples" not in text


def test_negative_errors_and_the_sampling_floor():
    group = weak_group("splitting_order2", "multilevel", stderr=1e-5)
    error, resolved = group.variables["error"][1], group.variables["resolved"][1]
    assert (error[1, :4] < 0).all() and not resolved[1, 3:].any() and resolved[1, :3].all()
    error[1, 5] = 1e-9  # by chance; its interval reaches up to 2e-5
    ax = views.figure(weak(group)).axes[1]
    assert ax.get_title() == r"square: $\varphi(y)=y_{1}^{2}$"
    filled, hollow = (c[0] for c in ax.containers)
    np.testing.assert_array_equal(filled.get_ydata(), -error[1, :3])
    np.testing.assert_array_equal(hollow.get_ydata(), np.abs(error[1, 3:5]))
    assert filled.get_markerfacecolor() != "none" and hollow.get_markerfacecolor() == "none"
    (bar,) = ax.collections[-1].get_segments()  # of the error by chance, which lies below the panel
    np.testing.assert_allclose(bar[1], [2**-8, 1e-9 + 1.96e-5])
    assert [line.get_xdata().tolist() for line in ax.lines if list(line.get_ydata()) == [0.0]] == [[2**-8]]
    assert "hollow: not resolved" in legend_texts(ax)[-1]


def test_slopes_of_both_orders():
    groups = [weak_group(scheme, "kolmogorov", functions=1) for scheme in ("splitting", "splitting_order2")]
    (ax,) = views.figure(weak(*groups)).axes
    for p in (1, 2):
        x, y = curve(ax, f"slope {p}").get_data()
        assert np.log(y[1] / y[0]) / np.log(x[1] / x[0]) == pytest.approx(p)
    assert "2^{-10}" not in ax.figure.texts[1].get_text()  # there is no reference
    assert "Kolmogorov" in ax.figure.texts[1].get_text()


def test_the_band_of_a_curve_only_where_it_can_be_seen():
    group = weak_group("splitting_order2", "kolmogorov", functions=1)
    assert not views.figure(weak(group)).axes[0].collections
    group.variables["error_bound"][1][:] = 1e-6
    (band,) = views.figure(weak(group)).axes[0].collections
    assert band.get_paths()[0].vertices[:, 1].max() == pytest.approx(0.5 / 64 + 1e-6)


def test_by_number_of_paths():
    results = weak(*one_scheme("splitting_order2", ("errors", "samples")))
    left, right = rendered(views.figure(results)).axes
    assert not any("plain" in text for text in legend_texts(left))
    assert legend_texts(right)[:3] == ["$10^{4}$ paths", "$10^{5}$ paths", "$10^{6}$ paths"]
    floors = [line.get_ydata() for line in right.lines if line.get_linestyle() == "--" and len(line.get_xdata())]
    np.testing.assert_allclose(floors, 1.96 * results.groups[0].variables["prefix_error_stderr"][1][:, 0])
    shown = results.groups[0].variables["prefix_error"][1][2, 0]
    points, _ = sampled(right, "$10^{6}$")
    np.testing.assert_array_equal(points[:, 1], np.abs(shown[np.abs(shown) >= 4e-4]))


def test_accuracy_against_seconds():
    results = weak(*one_scheme(panels=("seconds",)))
    accuracy, estimates = rendered(views.figure(results)).axes
    middle = H[2]  # of 2^-3 .. 2^-8, 2^-5.5 rounds to the larger one
    assert accuracy.get_title() == "splitting, $h=2^{-5}$: accuracy" and middle == 2**-5
    _, multilevel, exact, _ = legend_texts(accuracy)
    assert "100 times as fast" in multilevel and "$10^{12}$ times as fast" in exact
    seconds, stderr = curve(accuracy, "plain").get_data()
    np.testing.assert_allclose(seconds, [0.04, 0.4, 4])
    np.testing.assert_allclose(stderr, 1e-4 * np.sqrt([100, 10, 1]))
    (constant,) = {round(c[0].get_ydata()[-1], 12) for c in estimates.containers if c.get_label() == "multilevel"}
    assert constant == round(0.5 * middle + 1e-5, 12)
    (line,) = (line for line in estimates.lines if line.get_label().startswith("Kolmogorov"))
    assert list(line.get_ydata()) == [0.5 * middle] * 2


def test_paths_that_blow_up():
    group = weak_group("splitting", "plain", functions=1)
    group.variables["error"][1][0, :2] = 1e30, np.inf
    group.variables["error_stderr"][1][0, :2] = 1e30, np.nan
    group.variables["resolved"][1][0, :2] = False
    (ax,) = views.figure(weak(group)).axes
    assert 1 < ax.get_ylim()[1] < 1e3 and legend_texts(ax)[-1] == "paths diverged (NaN or infinity) or nearly so"
    (edge,) = (line for line in ax.lines if list(line.get_ydata()) == [1.0, 1.0])
    assert edge.get_xdata().tolist() == [2**-3, 2**-4]


def test_no_bar_for_one_path_and_for_errors_of_0():
    """Neither has an interval: the errors of one path lie within the frame, and no line stands for an error of 0."""
    look = {"marker": "o", "color": "#000000"}
    for error, half in ((1e-2 * H, np.nan), (0.0 * H, 0.0)):
        one = figure.Series(H, error, np.full(len(H), half), np.zeros(len(H), bool), "one", look)
        ax = Figure().subplots()
        figure.errors_panel(ax, [one], "")
        lines = [segment for lines in ax.collections for segment in lines.get_segments()]
        assert all(np.ptp(segment[:, 1]) == 0 for segment in lines)
        bottom, top = ax.get_ylim()
        assert not error.any() or bottom < error.min() < error.max() < top


def test_one_step_size():
    groups = [
        g._replace(coordinates={**g.coordinates, "h": H[:1]})
        for g in one_scheme(panels=("errors", "samples", "seconds"))
    ]
    for group in groups:
        for name, (axes, values) in group.variables.items():
            if axes[-1:] == ("h",):
                group.variables[name] = (axes, values[..., :1])
            elif name.startswith("order"):
                group.variables[name] = (axes, values * np.nan)
    assert legend_texts(rendered(views.figure(weak(*groups))).axes[0])[0].endswith("order not resolved")


def test_formulas():
    assert style.formula("3.141592653589793*y12^10 - exp(0.25*y1)") == r"\pi\,y_{12}^{10} - \mathrm{exp}(0.25\,y_{1})"
    assert style.formula("2*y2^2 - y1", ("q_1", "P6")) == r"2\,\mathrm{P6}^{2} - \mathrm{q\_1}"


def test_components_have_the_names_of_the_system():
    """In the line above a figure, in the titles of panels, and under the table."""
    results = weak(weak_group("splitting", "multilevel", variables=("P1", "P2", "G3")))
    fig, text = views.figure(results), printed(results)
    titles = " ".join(ax.get_title() + ax.get_title("left") for ax in fig.axes)
    assert r"\mathrm{P1}" in titles and "y_{1}" not in titles
    assert "P1" in text and "y1" not in text
    assert [style.count(n) for n in (500, 10**6, 12345)] == ["500", "$10^{6}$", "12345"]
    assert figure.frame([]) is None
