"""What a person chooses of a figure: by options of `spi plot`, by words of Python, and by the key ``figure``."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from damage import call
from figure_checks import collisions
from matplotlib.figure import Figure
from strong_results import H, strong, strong_group

import spi
from spi import storage, views
from spi.drawing import page, plots, style, sweeps
from spi.specs.figures import FIGURE_KEYS, read_figure
from spi.statistics.claims import Quantity
from spi.statistics.crossings import crossings
from spi.statistics.curves import curves
from spi.storage.stored import Claimed, Description, Swept

#: A value of each, as text and as data that mean the same.
SAME = {
    "panels": ("error,casimirs", ["error", "casimirs"]),
    "overlay": ("cases", "cases"),
    "crossing": ("error", "error"),
    "title": ("Two", "Two"),
    "labels": ("error=the error, h=step", {"error": "the error", "h": "step"}),
    "log": ("xy", "xy"),
    "xlim": ("2^-8..1", [0.00390625, "1"]),
    "ylim": ("-1..1/2", (-1, 0.5)),
    "legend": ("inside", "inside"),
    "colors": ("splitting=red, midpoint=#0000ff", {"splitting": "red", "midpoint": "#0000ff"}),
    "style": ("paper", "paper"),
    "size": ("5x2.5in", (5.0, "2.5in")),
    "width": ("5in", 5),
    "height": ("4in", 4),
    "font": ("serif", "STIXGeneral"),
    "font_size": ("8", 8),
}


def errors(*cases, **attributes):
    groups = [
        strong_group(scheme, case, case_title=f"case {case}")
        for case in cases or ("one",)
        for scheme in ("splitting", "midpoint")
    ]
    return strong(*groups, **attributes)


@pytest.mark.parametrize("name", FIGURE_KEYS)
def test_a_text_and_the_data_of_yaml_and_python_mean_the_same(name):
    text, data = SAME[name]
    assert read_figure({name: text}) == read_figure({name: data})


def test_the_options_the_words_and_the_key_draw_one_figure(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    chosen = {"title": False, "size": "12x8cm", "legend": "none", "xlim": "2^-10..2^-6", "colors": "red"}
    storage.write("plain.h5", errors())
    storage.write("keyed.h5", errors(figure_keys=json.dumps(chosen)))
    options = [f"--{name}={value}" for name, value in chosen.items() if name != "title"]
    code, out, err = call("plot", "plain.h5", *options, "--no-title")
    assert (code, out) == (0, "") and "caption: Strong errors." in err
    assert call("plot", "keyed.h5")[0] == 0
    assert Path("plain.png").read_bytes() == Path("keyed.png").read_bytes()
    assert call("plot", "keyed.h5", "--title", "Another", "--out", "x")[0] == 0  # an option goes before the key
    assert Path("x/keyed.png").read_bytes() != Path("keyed.png").read_bytes()
    figure = spi.load("plain.h5").plot(**chosen)
    (ax,) = figure.panels
    assert figure.get_size_inches().tolist() == pytest.approx([12 / 2.54, 8 / 2.54]) and not figure.legends
    assert figure.texts == [] and ax.get_xlim() == (2.0**-10, 2.0**-6)
    assert [ax.lines[0].get_color(), ax.get_title(loc="left")] == ["#ff0000", ""]


def test_scales_and_limits():
    """Of the panels that have lines; a reference slope is no straight line on linear axes."""
    usual, linear = views.figure(errors()).panels[0], views.figure(errors(), log="none").panels[0]
    assert (usual.get_yscale(), linear.get_yscale(), linear.get_xscale()) == ("log", "linear", "linear")
    assert len(usual.lines) == len(linear.lines) + 2
    (ax,) = views.figure(errors(), log="none", xlim=(0, 2**-10), ylim=(-1, 1)).panels
    assert (ax.get_xlim(), ax.get_ylim()) == ((0, 2**-10), (-1, 1))
    (cut,) = views.figure(errors(), log="none", xlim=(0, 2**-10)).panels
    assert cut.get_ylim()[1] < 0.5 * linear.get_ylim()[1]  # that of what is seen


@pytest.mark.parametrize("power", [0.5, -0.5])
def test_a_legend_within_a_panel_covers_no_results(power):
    results = strong(strong_group("splitting", error=H**power), strong_group("midpoint", error=1.5 * H**power))
    fig = views.figure(results, legend="inside", width="12cm")
    with page.applied(page.of(fig)):
        assert [one for one in collisions(fig) if not one.endswith("lies on panel 0")] == []
    box = fig.axes[0].get_legend().get_window_extent()
    for line in (line for line in fig.axes[0].lines if "slope" not in line.get_label()):
        assert not line.get_transform().transform_path(line.get_path()).intersects_bbox(box, filled=False)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--log", "z"], "--log: is 'z'; must be x, y, xy or none"),
        (["--xlim", "2..1"], "--xlim: is '2..1'; must be two ends, the smaller one first, such as 0..2"),
        (["--size", "8cm"], "--size: is '8cm'; must be a width and a height, such as 8.6x6cm"),
        (["--size", "8x6cm", "--width", "one"], "--size: is given beside width; leave out one of them"),
        (["--colors", "reed"], "--colors: has 'reed'; must be colours such as red,#0072B2"),
        (["--colors", "spliting=red"], "r.h5: colors: has 'spliting'; did you mean 'splitting'?"),
        (["--panels", "error,error"], "--panels: has 'error' twice; remove one"),
        (["--panels", "eror"], "r.h5: panels: has 'eror'; did you mean 'error'?"),
        (["--panels", "all"], "r.h5: panels: has 'all'; known: error, final, casimirs"),
        (["--overlay", "T"], "r.h5: overlay: is 'T', which is not the second of two swept words; must be cases"),
        (["--crossing", "error"], "r.h5: crossing: is for lines over a swept word, and nothing is swept; leave it out"),
        (["--labels", "eror=E"], "r.h5: labels: has 'eror'; did you mean 'error'?"),
        (["--xlim", "0..1"], "r.h5: xlim: begins at 0 on a logarithmic axis; must begin above 0, or choose log: none"),
        (["--size", "3x3cm"], "--size: is '3x3cm'; must be 2.5 to 20 inches wide and 1 to 40 inches high"),
        (["--labels", "error"], "--labels: is 'error'; must be labels by name"),
        (["--labels", "binder=B"], "r.h5: labels: has 'binder'; known: error, h"),
        (["--ylim=-1..1"], "r.h5: ylim: begins at -1 on a logarithmic axis"),
    ],
)
def test_a_wrong_choice_is_refused_in_one_line(options, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    storage.write("r.h5", errors())
    code, out, err = call("plot", "r.h5", *options)
    assert code in (1, 2) and (out, err.count("\n")) == ("", 1) and err.startswith(f"spi: {message}")


def test_a_legend_without_room_in_its_panel_stands_below():
    crossed = strong(strong_group("splitting", error=H**0.5), strong_group("midpoint", error=1e-4 * H**-0.5))
    high, low = (views.figure(crossed, legend="inside", size=size) for size in ("17x16cm", "17x4.5cm"))
    inside = high.axes[0].get_legend()
    assert not high.legends and low.axes[0].get_legend() is None
    texts = [{text.get_text() for text in legend.get_texts()} - {" "} for legend in (inside, *low.legends)]
    assert texts[0] == texts[1] and len(texts[0]) == 4
    with page.applied(page.of(low)):
        assert collisions(low) == []


@pytest.mark.parametrize(
    ("size", "label", "tick"), [(1e-7, "x in $10^{-7}$", "2"), (1.0, "x", "2.0"), (1e5, "x", "200000")]
)
def test_tiny_numbers_at_a_linear_axis_are_counted_in_a_power_of_ten(size, label, tick):
    ax = Figure().add_subplot()
    plots.Plot([plots.series(size * np.arange(5.0), np.ones(5), {"color": "red"})], x="x").draw(ax)
    ax.figure.draw_without_rendering()
    assert ax.get_xlabel() == label and tick in [text.get_text() for text in ax.get_xticklabels()]


@pytest.mark.parametrize("legend", ["below", "inside"])
@pytest.mark.parametrize(("size", "texts"), [("8.6x6cm", 0), ("8.6x7cm", 1), ("8.6x11cm", 2)])
def test_what_a_small_figure_has_no_room_for_is_the_caption(size, texts, legend):
    """First the parameters and then the title; a legend that no panel has room for is below."""
    fig = views.figure(errors(), size=size, legend=legend)
    assert len(fig.texts) == texts and style.has_caption(fig) == (texts < 2)
    with page.applied(page.of(fig)):
        assert [one for one in collisions(fig) if "legend" not in one or fig.legends] == []
    assert fig.axes[0].get_window_extent().height > 0.4 * fig.dpi


def test_a_label_without_room_is_its_words(tmp_path):
    low = views.figure(errors("one", "two"), size="16x6cm").panels[0]
    assert low.get_ylabel().replace("\n", " ") == "strong error"
    assert "sup" in views.figure(errors("one", "two"), width="16cm").panels[0].get_ylabel()
    assert np.isfinite(low.get_ylim()).all()


def test_an_overlay_has_the_lines_of_all_cases_in_one_panel():
    """Each with the title of its case, in a colour and with a marker of its own; parameters are what they share."""
    two = strong(*(strong_group("splitting", case, case_title=f"$L={case}$") for case in ("8", "16")))
    fig = views.figure(two, overlay="cases", labels={"error": "my error"}, colors={"16": "red"})
    (ax,) = fig.panels
    texts = [text.get_text() for text in fig.legends[0].get_texts()]
    assert {"$L=8$", "$L=16$"} <= {text.split(":")[0] for text in texts} and ax.get_ylabel() == "my error"
    lines = {str(line.get_label()): line for line in ax.lines}
    assert lines["$L=16$"].get_color() == "#ff0000" and lines["$L=8$"].get_marker() != lines["$L=16$"].get_marker()
    labels = {line.get_label() for line in views.figure(errors("8", "16"), overlay="cases").panels[0].lines}
    assert {"case 8, splitting, noise first (slpI)", "case 16, midpoint"} <= labels
    with pytest.raises(ValueError, match="overlay: is 'K', which is not the second of two swept words; must be cases"):
        views.figure(two, overlay="K")


NAMED = Claimed("equal", is_named=True)


def swept(name, values, over, shift=0.0, second=False, function="binder"):
    """A curve (value - shift) with errors of 0.01, over one word or over two."""
    points = []
    for T in values:
        for K in (1.0, 2.0) if second else (math.nan,):
            told = {"second_word": "K", "second_value": K} if second else {}
            about = described(f"{name}_{T}_{K}", Swept(word=over, value=T, owner=name, title=f"{name} sites", **told))
            value = T * (K if second else 1) - shift
            points.append(Quantity("derived", about, value, value - 0.01, value + 0.01, function, h=0.5, claim=NAMED))
    return curves(points, ["derived"])


def described(case, swept):
    told = {"seed": 1, "model": "m", "parameters": {}, "initial": None, "final_time": 1.0, "truncate_noise": False}
    told |= {"case_title": "", "scheme": "splitting", "scheme_label": "", "eps": None}
    return Description(case=case, variant="splitting", swept=swept, **told)


def drawn(cases, **chosen):
    with page.applied(page.named(**chosen)):
        return sweeps.draw("A title", cases)


T = (1.0, 1.2, 1.4, 1.6)


def test_where_two_curves_cross_is_known_with_its_interval():
    """x and 2x - 1.3, whose errors are independent, cross at 1.3; the interval is that of a parabola."""
    one, other = swept("small", T, "T")[0], swept("large", T, "T")[0]
    steep = tuple(
        p._replace(value=2 * p.value - 1.3, low=2 * p.value - 1.31, high=2 * p.value - 1.29) for p in other.points
    )
    (crossing,) = crossings([("8", one), ("16", other._replace(points=steep))])
    ((place, half, value, value_half),) = crossing.places
    weights = (9**2 + 9**2 + 1 + 1) ** 0.5 / 16  # of the parabola in the middle of four points, (-1, 9, 9, -1) / 16
    assert (place, value) == (pytest.approx(1.3), pytest.approx(1.3))
    assert half == pytest.approx(0.01 * 2**0.5 * weights) and value_half == pytest.approx(0.01 * 5**0.5 * weights)
    cases = [("8", [one], []), ("16", [other._replace(points=steep)], [])]
    fig = drawn(cases, overlay="cases", crossing="binder", labels={"binder": "Binder cumulant"})
    (ax,) = fig.panels
    assert ax.get_ylabel() == r"$\mathrm{Binder\ cumulant}$" and ax.get_title(loc="left").strip() == ""
    assert r"crossing at $T=1.300\pm0.012$" in [text.get_text() for text in fig.legends[0].get_texts()]
    assert "$h=2^{-1}$" in " ".join(text.get_text() for text in fig.texts)  # and not in the label
    with pytest.raises(ValueError, match="crossing: needs two lines over a number, and there are 1; give overlay"):
        drawn(cases, crossing="binder")


def test_the_second_swept_word_as_lines():
    (curve,) = swept("one", T, "T", second=True)
    lines = sweeps.each_value([curve])
    assert [line.second_word for line in lines] == ["", ""] and [len(line.points) for line in lines] == [4, 4]
    fig = drawn([("", lines, [])])
    assert {"$K=1$", "$K=2$"} <= {line.get_label() for line in fig.panels[0].lines}


@pytest.mark.parametrize(
    ("claim", "labels", "title"),
    [
        (NAMED, {}, r"$\mathrm{binder}$"),
        (NAMED, {"binder": "Binder cumulant"}, r"$\mathrm{Binder\ cumulant}$"),
        (Claimed("equal", symbol=r"\mathrm{E}\,"), {}, r"$\mathrm{E}\,[\mathrm{binder}]$"),
        (Claimed("equal"), {}, r"derived of $\mathrm{binder}$"),
        (Claimed("equal"), {"derived": "mean"}, r"mean of $\mathrm{binder}$"),
    ],
)
def test_the_title_of_a_map_says_its_quantity_as_axes_do(claim, labels, title):
    (curve,) = swept("one", T, "T", second=True)
    curve = curve._replace(points=tuple(point._replace(claim=claim) for point in curve.points))
    with page.applied(page.named(labels=labels)):
        (ax,) = sweeps.draw_maps("A title", [("", [curve], [])]).panels
    assert ax.get_title(loc="left") == title


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        (r"at $\lambda = 4$", r"at $\lambda = 4$"),
        ("from $5 to $6", r"from \$5 to \$6"),
        (r"wrong $\frac$", r"wrong \$\frac\$"),
        ("a $ alone", r"a \$ alone"),
    ],
)
def test_mathematics_in_a_text_is_set_and_other_dollars_are_dollars(text, shown):
    assert style.plain(text) == shown
    views.figure(strong(strong_group("splitting"), title=text)).draw_without_rendering()


def test_greek_names_are_greek_letters():
    names = ("lambda", "mu_2", "Omega", "mass", "w0", "eps")
    assert [style.symbol(name) for name in names] == [r"\lambda", r"\mu_{2}", r"\Omega", "", "w_{0}", r"\varepsilon"]
    assert style.maths("2*mu + lambda_1") == r"$2\,\mu  + \lambda _1$"


def test_a_crossing_names_its_lines():
    """The longer form says which lines there are, which the key `overlay` may not contradict."""
    wanted = {"crossing": "binder", "overlay": "cases"}
    for given in ({"of": "binder", "between": "cases"}, "of=binder, between=cases"):
        assert read_figure({"crossing": given}) == wanted
    with pytest.raises(ValueError, match="overlay: is K, but crossing is between cases; leave out one of them"):
        read_figure({"crossing": "of=binder,between=cases", "overlay": "K"})
    with pytest.raises(ValueError, match="crossing: is 'of=binder'; must be a quantity, or of: a quantity and between"):
        read_figure({"crossing": "of=binder"})
