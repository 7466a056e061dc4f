"""Figures of stability, from results made by hand."""

import numpy as np
import pytest
from helpers import printed
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_hex
from matplotlib.markers import CARETDOWN, CARETUP
from stability_results import VALUES, H, predators, stability, stability_group
from view_helpers import (
    GREEN,
    ROWS,
    SCHEMES,
    bars_of,
    edge,
    heading,
    inches_of_panels,
    legend_texts,
    line_of,
    lines_of,
    points_of,
    title,
)

from spi.drawing import plots, sweeps
from spi.kinds.stability import figure
from spi.kinds.stability.keys import PANELS
from spi.kinds.stability.results import REGIMES, Stability
from spi.report import views


def colour_at(ax, x, y):
    found = [
        to_hex(cells.get_facecolor()[0])
        for cells in ax.collections
        if isinstance(cells, PolyCollection) and any(path.contains_point((x, y)) for path in cells.get_paths())
    ]
    assert len(found) == 1
    return found[0]


def test_maps_of_regimes():
    groups = [stability_group(scheme) for scheme in SCHEMES] + [predators("splitting")]
    fig = views.figure(stability(*groups))
    assert [title(ax) for ax in fig.axes] == ["Euler-Maruyama", "midpoint", "splitting", "splitting"]
    for ax, group in zip(fig.axes, groups, strict=True):
        assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
        for (i, j), number in np.ndenumerate(Stability.of(group).regimes):
            assert colour_at(ax, H[j], VALUES[i]) == to_hex(figure.LOOKS[number][0])
    assert fig.axes[0].get_ylabel() == r"$\sigma$" and not fig.axes[1].get_ylabel()
    assert {text.partition(":")[0] for text in legend_texts(fig)} == {
        *("accurate", "Casimir lost", "solver fails in more than 0.1 % of steps"),
        *("bounded, not accurate", "not bounded", "paths diverged"),
    }
    assert len({colour for colour, _ in figure.LOOKS}) == len(REGIMES)


def test_map_of_values_that_are_not_positive():
    group = predators("splitting", values=np.array([0.0, 0.5, 4.0]))
    (ax,) = views.figure(stability(group)).axes
    assert ax.get_yscale() == "linear" and [t.get_text() for t in ax.get_yticklabels()] == ["$0$", "$0.5$", "$4$"]
    assert colour_at(ax, 1.0, 2.0) == to_hex(figure.LOOKS[Stability.of(group).regimes[2, 0]][0])


@pytest.mark.parametrize(("values", "scale"), [((0.1, 1.0, 10.0), "log"), ((1.0, 1.001, 10.0), "linear")])
def test_map_of_values_with_uneven_gaps(values, scale):
    """Cells of values that nearly agree could not be seen on a logarithmic axis: they stand by rank."""
    (ax,) = views.figure(stability(stability_group("splitting", values=np.array(values)))).axes
    assert ax.get_yscale() == scale and len(ax.get_yticks()) == 3


def test_what_is_known_of_no_value_is_not_shown():
    group = stability_group("splitting", panels=("error", "iterations", "law"), law=True)
    group.variables["law_distance"][1][:] = np.nan
    implicit = stability_group("midpoint", panels=("error", "iterations", "law"))
    implicit.variables["solves"][1][:] = 0
    text = printed(stability(implicit))
    assert lines_of(text, "midpoint")[0][-4:] == ["0", "%", "<", "pi/4"]  # nothing of iterations
    (error,) = views.figure(stability(group, implicit)).axes
    assert error.get_ylabel().startswith("rms error")


def test_what_is_one_number_everywhere_is_a_fact():
    groups = [stability_group(scheme, panels=("finite", "error")) for scheme in SCHEMES]
    for group in groups:
        group.variables["finite"][1][...] = 1.0
    fig = views.figure(stability(*groups))
    assert len(fig.axes) == 1 and "share of finite paths: 1" in fig.texts[1].get_text()


@pytest.mark.parametrize("count", [1, 2, 5])
def test_cells_meet_half_way(count):
    places = 2.0 ** np.arange(1.0, count + 1)
    borders = sweeps.cell_borders(plots.Places(places, places, "log"))
    assert len(borders) == count + 1 and (borders[:-1] < places).all() and (places < borders[1:]).all()
    np.testing.assert_allclose(borders[1:-1], np.sqrt(places[1:] * places[:-1]))


def test_line_panels_and_their_edges():
    words = ("finite", "casimir", "norm", "error", "law", "failures", "iterations", "angle")
    groups = [stability_group(scheme, panels=words, law=True) for scheme in SCHEMES]
    fig = views.figure(stability(*groups))
    assert len(fig.axes) == 8 and all(ax.get_xscale() == "log" for ax in fig.axes)
    by_word = dict(zip(words, fig.axes, strict=True))
    orange, blue = (ROWS[scheme].look[1].lower() for scheme in ("euler_maruyama", "midpoint"))
    lost = [value for i, value in enumerate(VALUES) for j in (0, 2, 5, 7) if groups[0].variables["finite"][1][i, j] < 1]
    for word in ("casimir", "norm", "error"):
        assert [x for x, _ in edge(by_word[word], CARETUP)] == lost
    assert (3.0, orange) in edge(by_word["error"], CARETUP)
    assert {x for x, _ in edge(by_word["law"], CARETUP)} == {3.0, 10.0}  # not at 30, where the law is not known
    assert {x for x, c in edge(by_word["failures"], CARETDOWN) if c == blue} == {0.1, 0.3, 1.0}
    assert (0.1, GREEN) in edge(by_word["angle"], CARETDOWN) and not edge(by_word["iterations"], CARETDOWN)
    assert by_word["iterations"].get_yscale() == "linear" and by_word["finite"].get_ylim()[1] > 1
    dotted = [line for line in by_word["casimir"].lines if line.get_linestyle() == ":"]
    assert len(dotted) == 3 * 4
    h = [f"$h=2^{{{n}}}$" for n in (0, -2, -5, -7)]
    assert {*h, "dotted: median path, else the worst", "paths diverged, or beyond the axis"} <= set(legend_texts(fig))


def test_bars_are_95_percent_and_pale_is_zero():
    group = stability_group("splitting", panels=("law",), law=True, h=H[:1])
    (ax,) = views.figure(stability(group)).axes
    distance, stderr = (group.variables[name][1][:5, 0] for name in ("law_distance", "law_distance_stderr"))
    clear = distance > 1.96 * stderr
    (pale,) = (line for line in ax.lines if line.get_alpha())
    assert 0 < clear.sum() < 5
    np.testing.assert_array_equal(points_of(ax, "splitting")[:, 1], distance[clear])
    np.testing.assert_array_equal(pale.get_ydata(), distance[~clear])
    _, _, high = bars_of(ax, "splitting")
    np.testing.assert_allclose(high[clear], distance[clear] + 1.96 * stderr[clear])


def test_one_value_over_the_step_size():
    groups = [
        stability_group(s, c, panels=("error",), values=np.array([v]))
        for c, v in (("a", 1.0), ("b", 3.0))
        for s in SCHEMES
    ]
    fig = views.figure(stability(*groups))
    assert [ax.get_xlabel() for ax in fig.axes] == ["step size $h$"] * 2
    assert [heading(ax).splitlines()[0] for ax in fig.axes] == [
        rf"case {c}, \$5,  $\sigma$$\,={v}$" for c, v in (("a", 1), ("b", 3))
    ]
    values = line_of(fig.axes[0], "splitting").get_ydata()
    np.testing.assert_array_equal(values[::-1], groups[2].variables["error"][1][0])
    assert edge(fig.axes[1], CARETUP) == [(1.0, "#d55e00")] and not edge(fig.axes[0], CARETUP)


@pytest.mark.parametrize(
    "values, scale, ticks",
    [([1.0, 2.0, 20.0], "linear", None), ([1.0, 2.0, 21.0], "log", None), ([0.0, 1.0, 100.0], "linear", [0, 1, 2])],
)
def test_scale_of_the_swept_values(values, scale, ticks):
    (ax,) = views.figure(stability(stability_group("splitting", panels=("finite",), values=np.array(values)))).axes
    assert ax.get_xscale() == scale and (ticks is None or ax.get_xticks().tolist() == ticks)


def test_a_row_for_each_case():
    cases = [stability_group(s, c, panels=("regimes", "error")) for c in "ab" for s in SCHEMES]
    fig = views.figure(stability(*cases, predators("splitting", panels=("regimes", "casimir", "error"))))
    rows = [ax.get_subplotspec().rowspan.start for ax in fig.axes]
    assert rows == [0] * 4 + [1] * 4 + [2] * 2  # no Casimir of the last case
    assert [heading(ax).partition(",")[0] for ax in fig.axes if heading(ax)] == ["case a", "case b", "case predators"]


def test_what_is_asked_must_be_known():
    assert tuple(figure.PANELS) == PANELS  # what a figure can draw, and what a spec may ask for
    with pytest.raises(ValueError, match="'casimirs' is not a known panel; known panels: regimes, finite, casimir"):
        views.figure(stability(stability_group("splitting", panels=("casimirs",))))


def test_drawn_to_the_end():
    """Layouts raise no warning either; nor do they leave the panels without room."""
    group = stability_group("euler_maruyama", panels=("regimes", "error"), values=VALUES[2:4], h=H[:2])
    inches = inches_of_panels(views.figure(stability(group)))
    assert all(width > 1.5 and height > 1.3 for width, height in inches)
