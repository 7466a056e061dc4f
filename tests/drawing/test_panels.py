"""All figures alike: places and letters of panels, their limits, marks and legends, and panels declared."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.markers import CARETDOWN, CARETUP
from matplotlib.path import Path
from strong_results import strong_group
from view_helpers import bars_of, edge, legend_texts, line_of, points_of

from spi.drawing import fitting, layout, page, panels, plots, style
from spi.storage.stored import Description

H = 2.0 ** -np.arange(1, 7)
LOOK = {"color": "#0072b2", "marker": "o"}


def exponents():
    """Two exponents until three times."""
    from spi.plugins.dynamics.kinds.lyapunov.results import Exponents

    return Exponents(
        about=Description.of(strong_group("splitting")),
        number=np.array([1, 2]),
        t=np.array([1.0, 2.0, 3.0]),
        exponent=np.array([[1.0, 1.1, 1.2], [-3.0, -3.1, -3.2]]),
        exponent_stderr=np.full((2, 3), 0.5),
        total=np.full(3, -2.0),
        total_stderr=np.full(3, 0.25),
        change=2.0,
        nonfinite=0,
        step=0.5,
        samples=10,
        ns_per_step=1.0,
    )


def drawn(*lines, **given):
    """A panel with some lines, alone in a figure."""
    fig = layout.arranged("A", [(["a"], [[plots.Plot(lines, **given)]])], [])
    return fig, fig.axes[0]


def arranged(*groups, cases=1, facts=()):
    """A figure of groups of panels with a line each, the same for some cases."""
    line = plots.series(H, H, LOOK, "a")
    return layout.arranged(
        "A",
        [([f"case {c}"], [[plots.Plot([line]) for _ in range(n)] for n in groups]) for c in range(cases)],
        list(facts),
    )


@pytest.mark.parametrize(
    ("groups", "cases", "shape"),
    [((1,), 1, (1, 1)), ((2, 2), 1, (2, 2)), ((6,), 1, (2, 3)), ((4, 4), 1, (2, 4)), ((4, 4, 1), 1, (3, 3)),
     ((3,), 2, (2, 3)), ((2,), 3, (2, 3)), ((1,), 5, (2, 3)), ((5,), 2, (4, 3))],
)  # fmt: skip
def test_places_of_panels(groups, cases, shape):
    spots = [ax.get_subplotspec() for ax in arranged(*groups, cases=cases).axes]
    assert (1 + max(s.rowspan.start for s in spots), 1 + max(s.colspan.start for s in spots)) == shape
    assert len(spots) == cases * sum(groups)


@pytest.mark.parametrize("groups", [(1,), (30,), (4,) * 8, (1,) * 23])
def test_no_figure_is_much_higher_than_wide(groups):
    width, height = arranged(*groups).get_size_inches()
    assert height <= 1.4 * width


def test_a_title_without_room_beside_the_notes_at_lines_is_broken():
    noted = plots.Plot([plots.series(H, H, LOOK, "a", note="25.7 times as fast")], y="error", log=True)
    titled = noted._replace(title="splitting, weak order 2, $h=2^{-3}$: accuracy and error")
    with page.applied():
        fig = layout.arranged("A", [([], [[noted, titled]])], [])
        text = fig.axes[1]._left_title
        fig.draw_without_rendering()
        assert text.get_window_extent().x1 > fig.bbox.x1
        fitting.settle(fig)
        fig.draw_without_rendering()
    assert text.get_window_extent().x1 < fig.bbox.x1
    assert text.get_text() == "(b)  splitting, weak order 2, $h=2^{-3}$: accuracy and\nerror"


def test_a_heading_stays_within_the_figure_beside_a_label_of_two_lines():
    """The label of the axis takes room from it, and the more the more lines it has."""
    label = r"strong error  $\sup_n\,(\mathrm{E}|y_h(t_n)-y_{\mathrm{ref}}(t_n)|^2)^{1/2}$ in all norms"
    heading = ["eight noises", r"$y_0=(0.0693,\,0.12,\,0.00892,\,-0.0153,\,\ldots,\,-0.193)$"]
    case = (heading, [[plots.Plot([plots.series(H, H, LOOK, "a", note="1.03")], y=label, log=True)]])
    with page.applied():
        fig = layout.arranged("A", [case, case], [])
        fitting.settle(fig)
        fig.draw_without_rendering()
        last = fig.axes[-1]
        above = next(text for text in last.texts if "eight noises" in text.get_text())
        assert "\n" in last.get_ylabel()
        assert above.get_window_extent().x1 < fig.bbox.x1


def test_as_many_panels_in_a_row_as_a_column_of_a_paper_has_room_for():
    with page.applied(page.named("paper", "one")):
        assert {ax.get_subplotspec().colspan.start for ax in arranged(3).axes} == {0}


@pytest.mark.parametrize("count", [3, 12])
def test_a_legend_has_eight_entries_at_most(count):
    """Lines of more schemes have their names at their ends, none on another."""
    lines = [plots.series(H, (1 + k / 10) * H, LOOK, f"scheme {k}", note="order 1.00 [0.9, 1.1]") for k in range(count)]
    fig, ax = drawn(*lines, xscale="steps", log=True, slopes=(1,))
    ends = {text.get_text(): text for text in ax.texts}
    if count <= 8:
        assert not ends and legend_texts(fig) == [*(f"scheme {k}: order 1.00 [0.9, 1.1]" for k in range(3)), "slope 1"]
        return
    assert legend_texts(fig) == ["slope 1"] and list(ends) == [f"scheme {k}: 1.00" for k in range(count)]
    fig.draw_without_rendering()
    plots.part_ends(ax)
    boxes = sorted((text.get_window_extent() for text in ends.values()), key=lambda box: box.y0)
    assert all(one.y1 <= other.y0 + 1 for one, other in pairwise(boxes))


def test_texts_are_moved_apart_as_little_as_needed():
    assert plots._apart([0.0, 0.5, 1.0], 0.1) == pytest.approx([0.0, 0.5, 1.0])
    assert plots._apart([0.0, 0.5, 0.5, 1.0], 0.1) == pytest.approx([0.0, 0.45, 0.55, 1.0])


def test_an_interval_that_reaches_0_has_an_arrow_of_one_length():
    y, half = H.copy(), np.array([0.1, 0.1, 0.1, 0.1, 0.1, 0.1])
    line = plots.series(H, y, LOOK, "a", half, poor=y <= half)
    fig, ax = drawn(line, xscale="steps", log=True)
    (arrows,) = (line for line in ax.lines if isinstance(line.get_marker(), Path))
    np.testing.assert_array_equal(arrows.get_xdata(), np.sort(H)[:3])
    assert points_of(ax, "a")[:, 0].tolist() == np.sort(H)[3:].tolist() and "pale: not resolved" in legend_texts(fig)
    x, low, high = bars_of(ax, "a")
    np.testing.assert_allclose(low, np.where(x > 0.1, x - 0.1, x))
    np.testing.assert_allclose(high, x + 0.1)
    assert ax.get_ylim()[0] > 0


def test_values_beyond_the_axis_are_marked_at_its_edges():
    y = np.array([1.0, 1e9, np.inf, 0.0, np.nan, 2.0])
    fig, ax = drawn(plots.series(np.arange(6.0), y, LOOK, "a"), log=True, top=1e6)
    assert [x for x, _ in edge(ax, CARETUP)] == [1.0, 2.0] and [x for x, _ in edge(ax, CARETDOWN)] == [3.0]
    assert set(legend_texts(fig)) == {"a", "paths diverged, or beyond the axis", "0, or below the axis"}
    assert ax.get_ylim()[1] < 1e6


def test_a_dense_line_is_marked_where_it_leaves_and_where_it_ends():
    t = np.linspace(0, 1, 101)
    y = np.where(t > 0.805, np.nan, np.where((t > 0.305) & (t < 0.405), 9.0, 0.5))
    fig, ax = drawn(plots.Series(t, y, LOOK, "a"), ylim=(0.0, 1.0))
    assert [x for x, _ in edge(ax, CARETUP)] == pytest.approx([0.31])
    (cross,) = (line for line in ax.lines if line.get_marker() == "X")
    assert cross.get_xdata() == pytest.approx([0.8])
    assert "diverged, or not defined from there on" in legend_texts(fig)
    assert len(line_of(ax, "a").get_markevery() * [0]) < 10


def test_a_line_far_outside_is_drawn_on_its_way_out_and_in():
    y = np.array([2.0, 1e9, -1e9, 1e9, 3.0, np.nan, 2.0])
    _, ax = drawn(plots.Series(np.arange(7.0), y, LOOK, "a"), ylim=(1.0, 4.0))
    np.testing.assert_array_equal(line_of(ax, "a").get_ydata(), [2, 304, np.nan, 304, 3, np.nan, 2])


@pytest.mark.parametrize(("exponent", "named"), [(-15, True), (0, False), (7, True)])
def test_tiny_and_huge_values_have_their_power_in_the_label(exponent, named):
    _, ax = drawn(plots.series(H, H * 10.0**exponent, LOOK, "a"), y="$C$")
    assert (" in " in ax.get_ylabel()) == named
    ax.figure.draw_without_rendering()
    assert not ax.yaxis.get_offset_text().get_text()


@pytest.mark.parametrize(
    ("values", "scale"), [([1, 2, 20], "linear"), ([1, 2, 21], "log"), ([0, 1, 100], "linear"), ([0.25, 1, 2], "steps")]
)
def test_places_of_the_values_of_a_parameter(values, scale):
    places = plots.places(np.array(values, float))
    assert places.scale == scale and (np.diff(places.at) > 0).all()
    assert np.array_equal(places.at, [0, 1, 2] if values[0] == 0 else values)


@pytest.mark.needs("dynamics")
def test_panels_declared_by_a_field():
    """Its axes, its interval and its text come from the record."""
    record = exponents()
    looks = style.looks([[record]])
    panel = panels.CurvePanel("exponent", "t", "number", label="${f}$", zero=True)
    one, two = panel.expand([record], looks)
    assert (one.y, two.y, one.x) == (r"$\lambda_{1}$", r"$\lambda_{2}$", "time $t$")
    (line,) = two.series
    np.testing.assert_array_equal(line.y, record.exponent[1])
    np.testing.assert_allclose(line.high - line.low, 2 * record.exponent_half[1])
    assert line.band and line.look["marker"] == ""  # a single curve
    bare, _ = panels.CurvePanel("exponent", "t", "number").expand([record, record], looks)
    assert bare.y == r"Lyapunov exponent of $\lambda_{1}$" and bare.series[0].look["marker"]


@pytest.mark.needs("dynamics")
def test_a_quantity_that_is_one_number_is_a_fact_beside_others():
    record = exponents()
    record = replace(record, exponent=np.zeros_like(record.exponent))
    same = panels.CurvePanel("exponent", "t", "number", same="all exponents: {}")
    both = panels.Figures({"lyapunov": [same], "pullback": [panels.CurvePanel("total", "t")]})
    fig = both("A", [[record]])
    assert len(fig.axes) == 1 and "all exponents: 0" in fig.texts[1].get_text()
    assert len(panels.Figures({"lyapunov": [same], "pullback": []})("A", [[record]]).axes) == 2  # where it is all
