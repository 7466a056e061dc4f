"""Figures of stability, from results made by hand."""

import numpy as np
import pytest
from helpers import printed
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_hex
from matplotlib.markers import CARETDOWN, CARETUP
from stability_results import VALUES, H, predators, stability, stability_group
from view_helpers import GREEN, ROWS, SCHEMES, edge, legends, lines_of

from spi.kinds.stability import figure
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
    for ax, group in zip([*fig.axes[:3], fig.axes[5]], groups, strict=True):
        for (i, j), number in np.ndenumerate(Stability.of(group).regimes):
            assert colour_at(ax, H[j], VALUES[i]) == to_hex(figure.LOOKS[number][0])
    (legend,) = legends(fig)
    assert sorted(text.partition(":")[0].partition(" in ")[0] for text in legend) == sorted(
        name for name in REGIMES if name != "not positive"
    )
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
    group = stability_group("splitting", panels=("iterations", "law"), law=True)
    group.variables["law_distance"][1][:] = np.nan
    implicit = stability_group("midpoint", panels=("iterations", "law"))
    implicit.variables["solves"][1][:] = 0
    text = printed(stability(implicit))
    assert lines_of(text, "midpoint")[0][-4:] == ["0", "%", "<", "pi/4"]  # nothing of iterations
    iterations, law = views.figure(stability(group, implicit)).axes
    assert [t.get_text() for t in iterations.texts] == ["no implicit scheme"]
    assert [t.get_text() for t in law.texts] == ["the law is not known"]


@pytest.mark.parametrize("count", [1, 2, 5])
def test_cells_meet_half_way(count):
    places = 2.0 ** np.array([3.0, 1.0, 2.0, 5.0, 4.0])[:count]
    found = figure.edges(places, True)
    assert ((found[:, 0] < places) & (places < found[:, 1])).all()
    found = found[np.argsort(found[:, 0])]
    np.testing.assert_allclose(found[1:, 0], found[:-1, 1])


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
    (legend,) = legends(fig)
    h = [f"$h=2^{{{n}}}$" for n in (0, -2, -5, -7)]
    for entry in ("Euler-Maruyama", *h, "worst path", "median path", "0, or an angle $\\leq\\pi/4$"):
        assert entry in legend
    assert sum("not finite" in entry for entry in legend) == sum("hollow" in entry for entry in legend) == 1


def test_bars_are_95_percent_and_hollow_is_zero():
    group = stability_group("splitting", panels=("law",), law=True, h=H[:1])
    (ax,) = views.figure(stability(group)).axes
    distance, stderr = (group.variables[name][1][:5, 0] for name in ("law_distance", "law_distance_stderr"))
    filled, hollow = (container for container in ax.containers)
    clear = distance > 2 * stderr
    assert 0 < clear.sum() < 5 and hollow[0].get_markerfacecolor() == "none"
    np.testing.assert_array_equal(filled[0].get_ydata(), distance[clear])
    np.testing.assert_array_equal(hollow[0].get_ydata(), distance[~clear])
    bars = np.array(filled[2][0].get_segments())[:, :, 1]
    np.testing.assert_allclose(bars[:, 1], distance[clear] + 1.96 * stderr[clear])


def test_one_value_over_the_step_size():
    groups = [
        stability_group(s, c, panels=("error",), values=np.array([v]))
        for c, v in (("a", 1.0), ("b", 3.0))
        for s in SCHEMES
    ]
    fig = views.figure(stability(*groups))
    assert [ax.get_xlabel() for ax in fig.axes] == ["step size $h$"] * 2
    (_, line) = next(c for c in fig.axes[0].containers if to_hex(c[0].get_color()) == GREEN)[0].get_data()
    np.testing.assert_array_equal(line, groups[2].variables["error"][1][0])
    assert edge(fig.axes[1], CARETUP) == [(1.0, "#d55e00")] and not edge(fig.axes[0], CARETUP)
