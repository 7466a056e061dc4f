"""Figures of stability, from results made by hand."""

import numpy as np
import pytest
from helpers import printed
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_hex
from matplotlib.markers import CARETUP
from stability_results import VALUES, H, predators, stability, stability_group
from view_helpers import (
    SCHEMES,
    edge,
    heading,
    legend_texts,
    line_of,
    lines_of,
    title,
)

from spi import views
from spi.plugins.comparisons.kinds.stability import figure
from spi.plugins.comparisons.kinds.stability.results import REGIMES, Stability


def colour_at(ax, x, y):
    found = [
        to_hex(cells.get_facecolor()[0])
        for cells in ax.collections
        if isinstance(cells, PolyCollection) and any(path.contains_point((x, y)) for path in cells.get_paths())
    ]
    assert len(found) == 1
    return found[0]


@pytest.mark.parametrize("overrides", [(), ("model.sigma=[0, 0]",)])
def test_parameters_that_follow_from_a_swept_word_have_their_formulas(overrides):
    """But for those that are not what was run, and without what formulas of the state say of it."""
    results = stability(stability_group("splitting", word="noise_factor"))
    model = "{variables: [u, v], hamiltonian: u*noise_factor, sigma: [noise_factor, 2*noise_factor/3], tau: 3}"
    results.attributes["spec"] = f"model: {model}\nsweep: {{noise_factor: [1, 2]}}"
    results.attributes["overrides"] = overrides
    factor = r"\mathrm{noise\ factor}"
    text = views.figure(results).texts[1].get_text()
    assert (rf"$\sigma=({factor},\,2\,{factor}/3)$" in text) == (not overrides)
    assert "hamiltonian" not in text and "tau" not in text


def test_maps_of_regimes():
    groups = [stability_group(scheme) for scheme in SCHEMES] + [predators("splitting")]
    for i, (name, value) in enumerate({"finite": 0.5, "casimir_worst": 0.5, "largest_norm": 3.0}.items()):
        groups[0].variables[name][1][0, i] = value
    groups[1].variables["failures"][1][0, 0] = 5000
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


@pytest.mark.parametrize(
    ("values", "scale"), [((0.1, 1.0, 10.0), "log"), ((1.0, 1.001, 10.0), "linear"), ((0.0, 0.5, 4.0), "linear")]
)
def test_map_of_values_with_uneven_gaps(values, scale):
    """Cells of values that nearly agree could not be seen on a logarithmic axis: they stand by rank."""
    (ax,) = views.figure(stability(stability_group("splitting", values=np.array(values)))).axes
    assert ax.get_yscale() == scale and len(ax.get_yticks()) == 3


def test_what_is_known_of_no_value_is_not_shown():
    group = stability_group("splitting", panels=("error", "iterations"))
    implicit = stability_group("midpoint", panels=("error", "iterations"))
    implicit.variables["solves"][1][:] = 0
    text = printed(stability(implicit))
    assert lines_of(text, "midpoint")[0][-4:] == ["0", "%", "<", "pi/4"]  # nothing of iterations
    (error,) = views.figure(stability(group, implicit)).axes
    assert error.get_ylabel().startswith("rms error")


def test_one_value_over_the_step_size():
    groups = [
        stability_group(s, c, panels=("error",), values=np.array([v]))
        for c, v in (("a", 1.0), ("b", 3.0))
        for s in SCHEMES
    ]
    groups[3].variables["error"][1][0, 0] = np.inf
    fig = views.figure(stability(*groups))
    assert [ax.get_xlabel() for ax in fig.axes] == ["step size $h$"] * 2
    assert [heading(ax).splitlines()[0] for ax in fig.axes] == [
        rf"case {c}, \$5,  $\sigma$$\,={v}$" for c, v in (("a", 1), ("b", 3))
    ]
    values = line_of(fig.axes[0], "splitting").get_ydata()
    np.testing.assert_array_equal(values[::-1], groups[2].variables["error"][1][0])
    assert edge(fig.axes[1], CARETUP) == [(1.0, "#d55e00")] and not edge(fig.axes[0], CARETUP)
