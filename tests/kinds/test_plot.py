"""Figures of strong errors, and what all figures share: what is drawn, not how it looks."""

import numpy as np
import pytest
from strong_results import LABELS, H, strong, unresolved
from strong_results import strong_group as group_of
from view_helpers import heading, legend_texts, line_of, points_of, rendered, save, title

from spi import views
from spi.drawing import style
from spi.storage import Order


def strong_group(scheme, case="three", constant=1.0, order=0.5, sigma=(1.0, 1.0, 1.0), h=H):
    error = constant * h**order
    stderr = np.full(h.size, 0.02) * error
    resolved = np.full(h.size, True)
    if scheme == "midpoint":
        stderr[-1], resolved[-1] = 0.8 * error[-1], False
    if scheme == "euler_maruyama":
        error[0], stderr[0], resolved[0] = np.inf, np.inf, False
    attributes = {
        "order": Order(order + 0.01, order - 0.01, order + 0.03, h.size),
        "case_title": f"case {case}, $5",
        "model_sigma": sigma,
        "truncate_noise": True,
    }
    return group_of(scheme, case, error, stderr, resolved, h, **attributes)


@pytest.fixture
def results():
    return strong(*(strong_group(scheme, constant=c) for scheme, c in zip(LABELS, (1.6, 0.9, 0.7), strict=True)))


def test_files_and_their_bytes(results, tmp_path):
    first = save(results, tmp_path / "a" / "b", "strong")
    second = save(results, tmp_path, "strong")
    assert first == (tmp_path / "a/b/strong.pdf", tmp_path / "a/b/strong.png")
    assert first[0].read_bytes().startswith(b"%PDF") and first[1].read_bytes().startswith(b"\x89PNG")
    assert [p.read_bytes() for p in first] == [p.read_bytes() for p in second]
    assert {p.name for p in first[0].parent.iterdir()} == {"strong.pdf", "strong.png"}


def test_strong_panel(results):
    """Points are those of the record that are resolved, pale ones are not, and what diverged stands at the edge."""
    fig = views.figure(results)
    (ax,) = fig.axes
    assert (ax.get_xscale(), ax.get_yscale(), title(ax)) == ("log", "log", "")
    assert ax.get_xlabel() == "step size $h$"
    assert ax.get_ylabel().startswith("strong error") and r"\sup_n" in ax.get_ylabel()
    fig.draw_without_rendering()
    assert [t.get_text() for t in ax.get_xticklabels()] == [f"$2^{{-{n}}}$" for n in (5, 7, 9, 11, 13)]
    texts = [t.get_text() for t in fig.texts]
    assert texts[0] == "Strong errors"
    for part in (r"I=(2,\,1,\,2/3)", r"\sigma=(1,\,1,\,1)", "T=1", "2^{-16}", "500 samples", "0.454", "truncated"):
        assert part in texts[1]
    assert legend_texts(fig) == [
        *(f"{label}: order 0.51 [0.49, 0.53]" for label in LABELS.values()),
        *("slope 1/2", "slope 1", "pale: not resolved", "paths diverged, or beyond the axis"),
    ]


def test_slopes_keep_off_the_data(results):
    (ax,) = views.figure(results).axes
    points = np.concatenate([points_of(ax, label) for label in LABELS.values()])
    for label, order, above in (("slope 1/2", 0.5, True), ("slope 1", 1.0, False)):
        x, y = line_of(ax, label).get_data()
        assert np.log(y[1] / y[0]) / np.log(x[1] / x[0]) == pytest.approx(order)
        ratio = points[:, 1] / (y[0] * (points[:, 0] / x[0]) ** order)
        assert (ratio < 0.7).all() if above else (ratio > 1.4).all()


def test_cases_side_by_side(results):
    """With one legend for all, fitted orders at the ends of lines, and slopes at their lines if there are many."""
    one = [strong_group(s, "one", 0.5, 1.0, (1.0, np.nan, np.nan)) for s in (*LABELS, "splitting_drift_first", "new")]
    fig = views.figure(strong(*results.groups, *one))
    left, right = fig.axes
    assert heading(left).splitlines() == [r"case three, \$5,  $\sigma=(1,\,1,\,1)$"]
    assert r"$\sigma=(1,\,\mathrm{off},\,\mathrm{off})$" in heading(right)
    assert r"\sigma" not in fig.texts[1].get_text() and "500 samples" in fig.texts[1].get_text()
    new = [group.attributes["scheme_label"] for group in one[3:]]
    assert [line_of(right, label).get_marker() for label in new] == ["s", style.OTHERS[0][0]]
    assert not {"slope 1/2", "slope 1"} & {*legend_texts(fig)} and len(legend_texts(fig)) <= 8
    ends = [[text.get_text() for text in ax.texts if text.get_in_layout()] for ax in fig.axes]
    assert ends == [["slope 1/2", "slope 1", *[order] * count] for order, count in (("0.51", 3), ("1.01", 5))]
    few = views.figure(strong(*results.groups[1:], *one[1:3]))
    assert legend_texts(few)[:2] == list(LABELS.values())[1:]
    assert "numbers at lines: fitted orders" in legend_texts(few)


@pytest.mark.parametrize("count", [1, 2, 20])
def test_any_number_of_steps(count):
    group = unresolved(strong_group("splitting", h=2.0 ** -np.arange(3, 3 + count)))
    fig = rendered(views.figure(strong(group)))
    assert legend_texts(fig)[0] == LABELS["splitting"]  # without an order
    assert 1 <= len(fig.axes[0].get_xticks()) <= 6


def test_a_title_of_a_character_that_nobody_sees_is_drawn(tmp_path):
    """U+FEFF, with which some editors begin a text; matplotlib raised an IndexError over it in a PDF."""
    drawn = strong(group_of("splitting", case_title="\ufeff"), group_of("splitting", "two", case_title="a\ufeffb"))
    drawn = drawn._replace(attributes={**drawn.attributes, "title": "\ufeff"})
    assert len(save(drawn, tmp_path, "title")) == 2
