"""Figures for papers: their width, their letters, and that no text lies on another at any size."""

import warnings

import pytest
from figure_checks import collisions
from long_time_results import long_time, long_time_group
from stability_results import stability, stability_group
from strong_results import LABELS, H, strong, strong_group

from spi import views
from spi.drawing import page


@pytest.fixture(autouse=True)
def no_warnings():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def errors(cases):
    names = ("one", "two", "three", "four")[:cases]
    told = {"order": 0.5, "order_ci": (0.49, 0.53)}
    groups = [
        strong_group(scheme, case, 0.1 * (1 + i) * H**0.5, 0.01 * H**0.5, H > 0, H, case_title=f"case {case}", **told)
        for case in names
        for i, scheme in enumerate(LABELS)
    ]
    return strong(*groups)


RESULTS = {
    "strong": lambda: errors(1),
    "strong, four cases": lambda: errors(4),
    "stability": lambda: stability(stability_group("splitting"), stability_group("euler_maruyama")),
    "long_time": lambda: long_time(long_time_group("splitting"), long_time_group("midpoint")),
}
PAPERS = [("one", "serif"), ("two", "sans"), ("130mm", "serif")]


@pytest.mark.parametrize(("width", "font"), PAPERS)
@pytest.mark.parametrize("what", RESULTS)
def test_no_text_lies_on_another(what, width, font):
    fig = views.figure(RESULTS[what](), style="paper", width=width, font=font)
    assert fig.get_figwidth() == pytest.approx(page.inches(width))
    with page.applied(page.of(fig)):
        assert collisions(fig) == []


def test_overlapping_texts_are_noticed():
    fig = views.figure(errors(1), style="paper")
    fig.text(0.5, 0.5, "one")
    fig.text(0.51, 0.5, "two")
    fig.text(0.99, 0.5, "too far to the right")
    found = collisions(fig)
    assert "'one' lies on 'two'" in found and "'one' lies on panel 0" in found
    assert "'too far to the right' is cut off" in found


def test_title_and_parameters_are_the_caption():
    fig = views.figure(errors(1), style="paper")
    assert not fig.texts
    assert "T=1" in views.caption(fig) and "500 samples" in views.caption(fig)


@pytest.mark.parametrize(
    ("style", "width", "font", "message"),
    [
        ("paper", "three", None, "width: is 'three'; must be one or two"),
        ("paper", "1in", None, "2.5 to 20 inches"),
        ("paper", None, "DejaVu Serf", "did you mean 'DejaVu Serif'"),
        ("screen", "one", None, "width: is for figures in the style paper only"),
        ("print", None, None, "style: is 'print'; must be screen or paper"),
    ],
)
def test_what_is_no_style(style, width, font, message):
    with pytest.raises(ValueError, match=message):
        views.check_style(style, width, font)
