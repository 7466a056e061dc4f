"""Figures for papers: their width, their letters, that no text lies on another, and that they need no colours."""

import importlib
from pathlib import Path

import numpy as np
import pytest
import yaml
from damage import call
from figure_checks import alike_without_colours, collisions
from strong_results import LABELS, H, strong, strong_group
from trajectory_results import trajectories, trajectory_group
from weak_results import at_eps, weak, weak_group

from spi import storage, views
from spi.drawing import page, style
from spi.kinds import KINDS
from spi.schemes import SCHEMES
from spi.storage import Order


def errors(cases):
    names = ("one", "two", "three", "four")[:cases]
    told = {"order": Order(0.5, 0.49, 0.53, 9)}
    groups = [
        strong_group(scheme, case, 0.1 * (1 + i) * H**0.5, 0.01 * H**0.5, H > 0, H, case_title=f"case {case}", **told)
        for case in names
        for i, scheme in enumerate(LABELS)
    ]
    return strong(*groups)


def paths():
    """Paths on a sphere, with their Casimir and Hamiltonian."""
    t = np.linspace(0.0, 10.0, 101)
    y = 0.8 * np.column_stack([np.cos(t), np.sin(t) * np.cos(t), np.sin(t) ** 2])
    panels = ("casimirs", "hamiltonian", "sphere", "components")
    return trajectories(*(trajectory_group(s, t, y, np.ones((101, 1)), panels=panels) for s in LABELS))


def weak_errors():
    estimators = ("plain", "multilevel", "quasi", "kolmogorov")
    return weak(*(weak_group("splitting", e, functions=1, prefixes=e == "plain") for e in estimators))


def of_plugin(module, kind, *schemes):
    """Results of a kind of a plug-in, from the module of its tests that makes them."""
    of = importlib.import_module(module)
    group = getattr(of, f"{kind}_group")
    return getattr(of, kind)(*map(group, schemes))


RESULTS = {
    "strong": lambda: errors(1),
    "strong, four cases": lambda: errors(4),
    "stability": lambda: of_plugin("stability_results", "stability", "splitting", "euler_maruyama"),
    "trajectory": paths,
    "weak": weak_errors,
    "weak, several eps": lambda: weak(*(at_eps("ap_splitting", eps) for eps in (1.0, 0.1, 0.01))),
    "work_precision": lambda: importlib.import_module("work_results").work_results(),
    "growth": lambda: of_plugin("long_results", "growth", "splitting", "midpoint"),
    "equilibrium": lambda: of_plugin("long_results", "equilibrium", "splitting", "midpoint"),
}


@pytest.mark.share(3)
@pytest.mark.parametrize("what", [what for what in RESULTS if what.partition(",")[0] in KINDS])
@pytest.mark.parametrize(("width", "font"), [("one", "serif"), ("two", "sans"), ("130mm", "serif")])
def test_no_text_lies_on_another(what, width, font):
    fig = views.figure(RESULTS[what](), style="paper", width=width, font=font)
    assert fig.get_figwidth() == pytest.approx(page.inches(width))
    with page.applied(page.of(fig)):
        assert collisions(fig) == []
    assert alike_without_colours(fig) == []


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
    assert "T=1" in style.caption(fig) and "500 samples" in style.caption(fig)


def test_no_two_schemes_of_an_experiment_have_one_colour():
    for path in Path("experiments").glob("*.yaml"):
        spec = yaml.safe_load(path.read_text())
        for case in [spec, *spec.get("cases", [])]:
            colours = [SCHEMES[one].look[1] for one in map(str, case.get("schemes", [])) if one in SCHEMES]
            assert len(set(colours)) == len(colours), path


def test_a_final_time_is_not_called_as_a_temperature_is():
    """In all cases of a figure of which one has a temperature, in whose law and heat capacity it is T."""
    told = [{"final_time": "$T=2$"}, {"final_time": "$T=2$", "model_temperature": "$temperature=1/2$"}]
    assert style.split_facts(told[:1])[0] == ["$T=2$"]
    assert style.split_facts(told)[0] == [r"$\mathrm{final\ time}=2$"]


def test_numbers_of_few_digits_are_exact():
    shown = [style.number(value) for value in (0.03125, -0.6000000000000001, 2 / 3, 1e-6, 3e8, 0.4535961)]
    assert shown == ["0.03125", "-0.6", "2/3", "10^{-6}", r"3\cdot10^{8}", "0.454"]


def test_the_command_writes_a_figure_with_embedded_letters(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    storage.write("r.h5", errors(1))
    code, out, err = call("plot", "r.h5", "--style", "paper", "--width", "two")
    assert (code, out) == (0, "") and "caption: " in err
    assert sorted(path.name for path in Path().iterdir()) == ["r.h5", "r_paper.pdf", "r_paper.png"]
    written = Path("r_paper.pdf").read_bytes()
    assert b"/FontFile2" in written and b"/Type3" not in written


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--height", "0.2in"], "--height: is '0.2in'; must be a length of 1 to 40 inches, as in 4.5in or 110mm"),
        (["--height", "high"], "--height: is 'high'; must be a length of 1 to 40 inches, as in 4.5in or 110mm"),
        (["--font-size", "40"], "--font-size: is 40; must be 4 to 24 points"),
        (["--style", "paper", "--font", "Nonsense"], "--font: 'Nonsense' is not an installed TrueType family"),
        (["--style", "paper", "--width", "three"], "--width: is 'three'; must be one or two"),
        (["--style", "paper", "--width", "1in"], "--width: is '1in'; must be one or two (columns), or a length of 2.5"),
    ],
)
def test_a_wrong_option_is_refused_in_one_line(options, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    storage.write("r.h5", errors(1))
    code, out, err = call("plot", "r.h5", *options)
    assert (code, out, err.count("\n")) == (2, "", 1) and err.startswith(f"spi: {message}")
    assert [path.name for path in Path().iterdir()] == ["r.h5"]


def test_a_height_without_room_for_the_panels_is_refused_with_what_they_need(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    storage.write("r.h5", errors(4))
    code, out, err = call("plot", "r.h5", "--height", "2in")
    assert (code, out) == (2, "") and err.startswith("spi: ") and err.count("\n") == 1
    assert "height: is 2 inches; 2 rows of panels need at least" in err


@pytest.mark.parametrize("style", ["screen", "paper"])
def test_a_figure_has_the_size_and_the_letters_asked_for(style):
    fig = views.figure(errors(4), style=style, width="15cm", height=6.0, font="serif", font_size=7)
    assert fig.get_size_inches().tolist() == pytest.approx([15 / 2.54, 6.0])
    assert fig.axes[0].xaxis.label.get_fontsize() == pytest.approx(70 / 9 if style == "screen" else 7)
    assert fig.axes[0].xaxis.label.get_fontname() == "STIXGeneral"
    with page.applied(page.of(fig)):
        assert collisions(fig) == []
