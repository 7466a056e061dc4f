"""Figures of strong errors, and what all figures share: what is drawn, not how it looks."""

import numpy as np
import pytest
from matplotlib.colors import to_hex
from strong_results import LABELS, H, strong, unresolved
from strong_results import strong_group as group_of
from view_helpers import legend_texts, rendered, save

from spi.report import views
from spi.schemes import SCHEMES
from spi.storage.records import Order


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


def scheme_line(ax, label):
    (container,) = (c for c in ax.containers if c.get_label().startswith(label))
    return container[0]


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
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log") and ax.get_ylabel().startswith("strong error")
    for part in ("Strong errors", r"\sigma=(1,\,1,\,1)", "T=1", "2^{-16}", "500 samples", "truncated"):
        assert part in "".join(text.get_text() for text in fig.texts)
    legend = " ".join(legend_texts(ax))
    assert legend.count("order 0.51 [0.49, 0.53]") == 3 and "pale: not resolved" in legend and "diverged" in legend
    for label, group in zip(LABELS.values(), results.groups, strict=True):
        line, error = scheme_line(ax, label), group.variables["error"][1]
        assert to_hex(line.get_color()).upper() == SCHEMES[group.variant].look[1]
        np.testing.assert_array_equal(line.get_ydata(), error[np.isfinite(error) & group.variables["resolved"][1]])
    (pale,) = (c[0] for c in ax.containers if c[0].get_alpha())
    assert pale.get_xdata().tolist() == [2**-13]
    (edge,) = (line for line in ax.lines if line.get_ydata() is not None and list(line.get_ydata()) == [1.0])
    assert edge.get_xdata().tolist() == [2**-5]


def test_error_bars_are_95_percent(results):
    (ax,) = views.figure(results).axes
    bars = ax.containers[-1][2][0].get_segments()
    error = results.groups[-1].variables["error"][1]
    np.testing.assert_allclose([bar[1, 1] - bar[0, 1] for bar in bars], 2 * 1.96 * 0.02 * error)


def test_slopes_keep_off_the_data(results):
    (ax,) = views.figure(results).axes
    points = np.concatenate([np.column_stack([g.coordinates["h"], g.variables["error"][1]]) for g in results.groups])
    points = points[np.isfinite(points[:, 1])]
    for label, order, above in (("slope 1/2", 0.5, True), ("slope 1", 1.0, False)):
        (line,) = (line for line in ax.lines if line.get_label() == label)
        x, y = line.get_data()
        assert np.log(y[1] / y[0]) / np.log(x[1] / x[0]) == pytest.approx(order)
        ratio = points[:, 1] / (y[0] * (points[:, 0] / x[0]) ** order)
        assert (ratio < 0.7).all() if above else (ratio > 1.4).all()


@pytest.mark.parametrize("count", [1, 2, 20])
def test_any_number_of_steps(count):
    group = strong_group("splitting", h=2.0 ** -np.arange(3, 3 + count))
    group = unresolved(group)
    (ax,) = rendered(views.figure(strong(group))).axes
    assert legend_texts(ax)[0].endswith("order not resolved")
    assert 1 <= len(ax.get_xticks()) <= 6


def test_a_title_of_a_character_that_nobody_sees_is_drawn(tmp_path):
    """U+FEFF, with which some editors begin a text; matplotlib raised an IndexError over it in a PDF."""
    drawn = strong(group_of("splitting", case_title="\ufeff"), group_of("splitting", "two", case_title="a\ufeffb"))
    drawn = drawn._replace(attributes={**drawn.attributes, "title": "\ufeff"})
    assert len(save(drawn, tmp_path, "title")) == 2
