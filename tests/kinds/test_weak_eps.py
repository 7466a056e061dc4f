"""Weak errors at several eps: the largest over eps, what tables say of it, and figures."""

import math

import numpy as np
import pytest
from helpers import printed
from matplotlib.colors import to_hex
from view_helpers import legend_texts, line_of, rendered
from weak_results import H, at_eps, weak, weak_group

from spi import views
from spi.statistics.estimators import GROUPS, largest_over

EPS = (1e-2, 1e-3, 1e-4)
WORST = 1 + np.array([0.0, 0.1, -0.2])  # errors of the three eps, relative to one another


def several_eps(functions=1, eps=EPS, **attributes):
    return [at_eps("ap_splitting", e, functions, factor, **attributes) for e, factor in zip(eps, WORST, strict=True)]


def test_largest():
    h, exact = H[:4], np.array([[1.0, 0.4, 0.25, 0.1], [-0.9, -0.5, -0.2, -0.125]])
    noise = 1e-3 * np.linspace(-1, 1, GROUPS)
    top = largest_over(h, exact, exact[:, None] * (1 + noise[:, None] / (GROUPS - 1)))
    assert top.which.tolist() == [0, 1, 0, 1] and top.value.tolist() == [1.0, 0.5, 0.25, 0.125]
    # of a mean over equal groups with these deviations
    np.testing.assert_allclose(top.stderr, top.value * noise.std(ddof=1) / math.sqrt(GROUPS), rtol=1e-9)
    assert top.resolved.all() and 0.9 < top.order.low < 1 < top.order.high < 1.1 and top.order.points == 4


def test_largest_of_what_is_not_finite():
    errors = np.array([[np.nan, np.inf, 0.25], [0.5, 0.4, 0.1]])
    top = largest_over(H[:3], errors, np.repeat(errors[:, None], 4, axis=1))
    assert top.which.tolist() == [0, 0, 0] and math.isnan(top.value[0]) and top.value[1] == np.inf
    assert top.resolved.tolist() == [False, False, True] and math.isnan(top.order.order)


def test_table_of_the_largest():
    text = printed(weak(*several_eps(functions=2), weak_group("splitting", "multilevel")))
    for name in ("phi", "square"):
        (line,) = (line for line in text.splitlines() if f"AP splitting, multilevel, {name}, largest over eps:" in line)
        order, low, high = (float(x) for x in line.replace("[", "").replace("]", "").replace(",", "").split()[-5:-2])
        assert low < order < high and abs(order - 1) < 0.01 and line.endswith("(expected 1)")
    edge = "eps < sqrt(h_ref) = 0.031: the reference shows the scheme's own limit"
    assert text.count(edge) == 3 and text.count("largest over eps") == 2


def test_table_where_eps_is_resolved_or_the_reference_another():
    text = printed(weak(*several_eps(eps=(1.0, 0.5, 0.0), reference_scheme="ap_splitting")))
    assert "sqrt(h_ref)" not in text and "eps = 0.5" in text
    assert "the reference at h_ref = 2^-10 is ap_splitting: errors are not corrected for what it lacks" in text
    text = printed(weak(*several_eps(eps=(1.0, 0.5, 1e-3), reference_scheme="ap_splitting")))
    assert "eps = 0.001, multilevel: eps < sqrt(h_ref) = 0.031: the reference shows the limit of ap_splitting" in text


@pytest.mark.parametrize("lacking", ["one eps", "no values left out"])
def test_no_largest(lacking):
    groups = several_eps()[: 1 if lacking == "one eps" else None]
    if lacking != "one eps":
        groups[1].variables.pop("error_without")
    assert "largest" not in printed(weak(*groups))
    assert "largest" not in " ".join(legend_texts(views.figure(weak(*groups))))


def test_errors_at_several_eps():
    groups = [*several_eps(), weak_group("splitting", "multilevel", functions=1)]
    fig = rendered(views.figure(weak(*groups)))
    (ax,) = fig.axes
    labels = legend_texts(fig)
    assert labels[0].startswith(r"largest over $\varepsilon$: order 1.00 [")
    schemes = [*(rf"AP splitting, $\varepsilon=10^{{-{n}}}$" for n in (2, 3, 4)), "splitting"]
    assert labels[1:5] == [f"{scheme}: order 1.00 [0.98, 1.02]" for scheme in schemes]
    assert "slope 1" in labels
    facts = " ".join(" ".join(text.get_text() for text in fig.texts).split())
    assert r"$\varepsilon<\sqrt{h_{\mathrm{ref}}}$: the reference shows the scheme's own limit" in facts
    lines = [line_of(ax, scheme) for scheme in schemes]
    assert len({line.get_marker() for line in lines}) == 4 == len({to_hex(line.get_color()) for line in lines})
    top = line_of(ax, r"largest over $\varepsilon$")
    np.testing.assert_allclose(np.sort(top.get_ydata()), np.sort(groups[1].variables["error"][1][0]))
