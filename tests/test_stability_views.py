"""Tables and figures of stability and of long times, from results made by hand."""

import csv
import io
import json
import math
import warnings

import numpy as np
import pytest
from helpers import printed
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_hex
from matplotlib.markers import CARETDOWN, CARETUP
from stability_results import VALUES, H, long_time, long_time_group, predators, stability, stability_group

from spi import plot, tables
from spi.plot import growth, laws, layout, style
from spi.plot import regimes as maps
from spi.regimes import REGIMES, largest_step, regimes
from spi.tables.long_time import chance
from spi.tables.stability import STABILITY

SCHEMES = ("euler_maruyama", "midpoint", "splitting")
GREEN = style.SCHEMES["splitting"][1].lower()


@pytest.fixture(autouse=True)
def no_warnings():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def cell(group, value, h):
    where = np.flatnonzero(group.coordinates["value"] == value)[0], np.flatnonzero(group.coordinates["h"] == h)[0]
    return REGIMES[regimes(group)[where]]


def edge(ax, marker):
    """The marks of one kind at the edges of a panel: (x, colour) each."""
    lines = [line for line in ax.lines if line.get_marker() == marker and len(line.get_xdata())]
    return sorted((float(x), to_hex(line.get_color())) for line in lines for x in line.get_xdata())


def texts(legend):
    return [text.get_text() for text in legend.get_texts() if text.get_text().strip()]


def legends(fig):
    return [texts(legend) for legend in [*fig.legends, *(one for area in fig.subfigs for one in area.legends)]]


# --- regimes ---------------------------------------------------------------------------------------------------------


def test_regime_of_each_cell():
    explicit, implicit, splitting = (stability_group(scheme) for scheme in SCHEMES)
    assert cell(explicit, 30.0, 1.0) == "paths lost"
    assert cell(explicit, 3.0, 0.5) == "not bounded"
    assert cell(explicit, 1.0, 1.0) == "Casimir lost"
    assert cell(explicit, 0.3, 1.0) == "bounded, not accurate"
    assert cell(explicit, 0.1, 2**-7) == "accurate"
    assert cell(implicit, 30.0, 1.0) == "solver fails" and cell(implicit, 1.0, 1.0) == "bounded, not accurate"
    assert cell(implicit, 0.1, 1.0) == "accurate"
    assert set(regimes(splitting).ravel()) == {0, 1}
    np.testing.assert_array_equal(regimes(splitting) == 0, splitting.variables["error"][1] <= 0.1)


@pytest.mark.parametrize(
    "name, value, regime",
    [
        ("finite", 511 / 512, "paths lost"),
        ("finite", math.nan, "paths lost"),
        ("failures", 11, "solver fails"),
        ("failures", 10, "accurate"),
        ("largest_norm", 2.01, "not bounded"),
        ("largest_norm", math.nan, "not bounded"),
        ("casimir_worst", 0.0101, "Casimir lost"),
        ("casimir_worst", math.inf, "Casimir lost"),
        ("casimir_worst", 0.0099, "accurate"),
        ("error", 0.1, "accurate"),
        ("error", 0.1001, "bounded, not accurate"),
        ("error", math.nan, "bounded, not accurate"),
    ],
)
def test_thresholds(name, value, regime):
    group = stability_group("midpoint", casimirs=2)
    array = group.variables[name][1].astype(float)
    array[0, 3] = (0.0, value) if name == "casimir_worst" else value
    group.variables[name] = group.variables[name][0], array
    assert cell(group, 0.1, 2**-3) == regime and cell(group, 0.1, 2**-4) == "accurate"


def test_worse_regimes_come_first():
    """What is lost in every way is taken from bad to good; a worse one always hides a better one."""
    group = predators("midpoint")
    group.coordinates["casimir"] = np.arange(1)
    group.variables["casimir_worst"] = ("value", "h", "casimir"), np.full((6, 8, 1), 0.5)
    bad = {"finite": 0.5, "failures": 5000, "largest_norm": 3.0, "casimir_worst": 0.5, "positive": 0.5, "error": 1.0}
    good = {"finite": 1.0, "failures": 0, "largest_norm": 1.0, "casimir_worst": 0.0, "positive": 1.0, "error": 0.0}
    found = []
    for healed in range(len(bad) + 1):
        for i, name in enumerate(bad):
            group.variables[name][1][0, 0] = (good if i < healed else bad)[name]
        found.append(REGIMES[regimes(group)[0, 0]])
    assert found == list(REGIMES[::-1])


def test_growth_is_that_beyond_the_true_one():
    """Where the solution itself grows, so do all step sizes, and only what goes further is lost."""
    group = stability_group("splitting", casimirs=0)
    norm = group.variables["largest_norm"][1]
    norm[:] = 50.0
    assert set(regimes(group).ravel()) == {0, 1}
    norm[0, 0] = 101.0
    assert cell(group, 0.1, 1.0) == "not bounded"


def test_populations_that_turn_negative():
    group = predators("euler_maruyama")
    assert cell(group, 1.0, 1.0) == "not positive" and cell(group, 0.1, 2**-7) == "accurate"


@pytest.mark.parametrize(
    "good, found",
    [
        ([0, 0, 1, 1], (0.25, False)),
        ([1, 0, 1, 1], (0.25, False)),
        ([1, 1, 1, 1], (1.0, True)),
        ([1, 1, 1, 0], (None, False)),
    ],
)
def test_largest_step_with_all_smaller_ones(good, found):
    h, expected = np.array([1.0, 0.5, 0.25, 0.125]), (math.nan if found[0] is None else found[0], found[1])
    for order in (slice(None), slice(None, None, -1)):
        assert largest_step(h[order], np.array(good)[order]) == pytest.approx(expected, nan_ok=True)


# --- tables ----------------------------------------------------------------------------------------------------------


def test_rows_of_stability():
    results = stability(stability_group("splitting", casimirs=2, law=True), predators("midpoint"))
    records = tables.rows(results)
    assert len(records) == 2 * 6 * 8
    first, other = records[11], records[6 * 8]
    solver = ("solves", "iterations", "failures", "largest_residual")
    assert tuple(first) == tuple(key for key in STABILITY if key not in ("positive", *solver))
    missing = ("casimir_worst", "casimir_median", "law_distance", "law_distance_stderr")
    assert tuple(other) == tuple(key for key in STABILITY if key not in missing)
    assert (first["sweep"], first["value"], first["h"], first["regime"]) == ("sigma", 0.3, 2**-3, "accurate")
    assert first["casimir_worst"] == results.groups[0].variables["casimir_worst"][1][1, 3].max()
    assert all(type(value) in (str, float, int) for record in records for value in record.values())
    assert json.loads(tables.as_json(records))[40]["law_distance"] is None  # at 30 the law is not known
    assert float(list(csv.DictReader(io.StringIO(tables.as_csv(records))))[5]["h"]) == H[5]


def lines_of(text, scheme):
    """The cells of the lines of a scheme in a printed table."""
    lines = text.splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith(scheme))
    block = [lines[start].removeprefix(scheme)]
    for line in lines[start + 1 :]:
        if not line.strip():
            return [one.split() for one in block]
        block.append(line)


def test_printed_stability():
    results = stability(*(stability_group(scheme) for scheme in SCHEMES))
    text = printed(results)
    assert all(len(line) <= 100 for line in text.splitlines() if " 2^-" in line and "paths" not in line)
    explicit, implicit, splitting = (lines_of(text, name) for name in ("Euler-Maruyama", "midpoint", "splitting"))
    assert explicit[2] == ["1", ">=", "2^0", "none", "none", "5.2e-1", "1"]
    assert explicit[3] == ["3", "2^-1", "none", "none", "inf", "3"]
    assert implicit[0] == ["0.1", ">=", "2^0", ">=", "2^0", ">=", "2^0", "1.0e-14", "0", "%", "3.0", "<", "pi/4"]
    assert implicit[3] == ["3", ">=", "2^0", "2^-3", "2^-7", "1.2e-5", "13", "%", "3.3-20.0", "3"]
    assert splitting[4][:6] == ["10", ">=", "2^0", ">=", "2^0", "none"]
    assert "512 paths each; errors against the scheme at 2^-14; 37.5 s on 4 threads" in text
    assert "case free, $5" in text and "relative error < 1e-8" in text


def test_printed_without_casimir():
    groups = predators("euler_maruyama"), predators("splitting", note="as [expected]")
    text = printed(stability(*groups))
    assert lines_of(text, "Euler-Maruyama")[2] == ["1", ">=", "2^0", "none", "72", "%", "1"]
    assert lines_of(text, "splitting")[0][3:] == [">=", "2^0", "100", "%", "<", "pi/4"]
    assert "Casimir" not in text and "splitting: as [expected]" in text


def test_nearly_all_is_not_all():
    group = predators("splitting")
    group.variables["positive"][1][0, 0] = 1 - 1e-6
    assert "99.9999 %" in printed(stability(group))


def test_rows_of_long_times():
    one, two = long_time_group("splitting"), long_time_group("midpoint", casimirs=2, law=False)
    records = tables.rows(long_time(one, two))
    assert len(records) == 2 * 3 * 27
    assert list(records[0])[3:] == ["h", "n", "casimir_mean", "casimir_rms", "casimir_worst", "casimir_one"]
    last = records[26]
    assert (last["n"], last["nonfinite"], last["growth"], last["bias_stderr"]) == (2**26, 0, 0.5, 1e-18)
    assert last["law_distance[H]"] == one.variables["law_distance"][1][0, 3] and last["mean_exact[y1^2]"] == 0.5
    assert "casimir_rms_2" in records[-1] and "mean[y1]" not in records[-1] and "growth_low_1" in records[-1]
    assert all(type(value) in (str, float, int) for record in records for value in record.values())


def test_printed_long_times():
    results = long_time(*(long_time_group(scheme) for scheme in SCHEMES))
    text = printed(results)
    casimirs, law = text.split("stationary law")
    explicit = lines_of(casimirs, "Euler-Maruyama")
    assert explicit[0] == ["2^-2", "512", "inf", "inf", "not", "fitted", "2.0e-17", "20.0"]
    rms = results.groups[2].variables["casimir_rms"][1][0, -1, 0]
    found = lines_of(casimirs, "splitting")[0]
    assert found == ["2^-2", "0", f"{rms:.1e}", f"{3.5 * rms:.1e}", "0.50", "[0.47,", "0.53]", "1.5e-18", "1.5"]
    v = {name: values for name, (_, values) in results.groups[1].variables.items()}
    z = np.abs(v["mean"][0] - v["mean_exact"]) / v["mean_stderr"][0]
    assert lines_of(law, "midpoint")[0][-2:] == [f"{z.max():.1f}", results.groups[1].coordinates["moment"][z.argmax()]]
    assert lines_of(law, "midpoint")[0][:7] == ["2^-2", "3.3e-3", "±", "1.2e-3", "5.8e-3", "±", "1.2e-3"]
    assert lines_of(law, "Euler-Maruyama")[0][-2:] == ["not", "finite"]
    assert "512 paths of 2^26 = 6.7e+07 steps each, 4096 snapshots of each path" in text
    assert chance(1) == pytest.approx(1.96, abs=1e-3) and chance(9) == pytest.approx(2.766, abs=1e-3)


def test_printed_long_times_of_two_casimirs_and_none():
    text = printed(long_time(long_time_group("splitting", casimirs=2, law=False)))
    assert text.count("C1") == text.count("C2") == 3 and "stationary law" not in text
    assert (
        lines_of(printed(long_time(long_time_group("splitting", casimirs=0))), "splitting")[0][1:] == ["0"] + ["-"] * 5
    )


# --- figures of stability --------------------------------------------------------------------------------------------


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
    fig = plot.figure(stability(*groups))
    assert len(fig.axes) == 6 and sum(ax.axison for ax in fig.axes) == 4
    assert [ax.get_title() for ax in fig.axes[:3]] == ["Euler-Maruyama", "midpoint", "splitting"]
    for ax, group in zip([*fig.axes[:3], fig.axes[5]], groups, strict=True):
        assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
        for (i, j), number in np.ndenumerate(regimes(group)):
            assert colour_at(ax, H[j], VALUES[i]) == to_hex(maps.LOOKS[number][0])
    assert fig.axes[0].get_ylabel() == r"$\sigma$" and not fig.axes[1].get_ylabel()
    (legend,) = legends(fig)
    assert [text.partition(":")[0] for text in legend] == [
        *("accurate", "Casimir lost", "solver fails in more than 0.1 % of steps"),  # column by column
        *("bounded, not accurate", "not bounded", "paths lost"),
    ]
    assert len({colour for colour, _ in maps.LOOKS}) == len(REGIMES)


def test_map_of_values_that_are_not_positive():
    group = predators("splitting", values=np.array([0.0, 0.5, 4.0]))
    (ax,) = plot.figure(stability(group)).axes
    assert ax.get_yscale() == "linear" and [t.get_text() for t in ax.get_yticklabels()] == ["$0$", "$0.5$", "$4$"]
    assert colour_at(ax, 1.0, 2.0) == to_hex(maps.LOOKS[regimes(group)[2, 0]][0])


@pytest.mark.parametrize("count", [1, 2, 5])
def test_cells_meet_half_way(count):
    places = 2.0 ** np.array([3.0, 1.0, 2.0, 5.0, 4.0])[:count]
    found = maps.edges(places, True)
    assert ((found[:, 0] < places) & (places < found[:, 1])).all()
    found = found[np.argsort(found[:, 0])]
    np.testing.assert_allclose(found[1:, 0], found[:-1, 1])


def test_line_panels_and_their_edges():
    words = "finite casimir norm error law failures iterations angle"
    groups = [stability_group(scheme, panels=words, law=True) for scheme in SCHEMES]
    fig = plot.figure(stability(*groups))
    assert len(fig.axes) == 8 and all(ax.get_xscale() == "log" for ax in fig.axes)
    by_word = dict(zip(words.split(), fig.axes, strict=True))
    orange, blue = (style.SCHEMES[scheme][1].lower() for scheme in ("euler_maruyama", "midpoint"))
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
    (legend,) = legends(fig)
    h = [f"$h=2^{{{n}}}$" for n in (0, -2, -5, -7)]
    for entry in ("Euler-Maruyama", *h, "worst path", "median path", "0, or an angle $\\leq\\pi/4$"):
        assert entry in legend
    assert sum("not finite" in entry for entry in legend) == sum("hollow" in entry for entry in legend) == 1


def test_bars_are_95_percent_and_hollow_is_zero():
    group = stability_group("splitting", panels="law", law=True, h=H[:1])
    (ax,) = plot.figure(stability(group)).axes
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
        stability_group(s, c, panels="error", values=np.array([v]))
        for c, v in (("a", 1.0), ("b", 3.0))
        for s in SCHEMES
    ]
    fig = plot.figure(stability(*groups))
    assert [ax.get_xlabel() for ax in fig.axes] == ["step size $h$"] * 2
    assert [ax.get_title().splitlines()[0] for ax in fig.axes] == [
        rf"case {c}, \$5,  $\sigma$$\,={v}$" for c, v in (("a", 1), ("b", 3))
    ]
    (_, line) = next(c for c in fig.axes[0].containers if to_hex(c[0].get_color()) == GREEN)[0].get_data()
    np.testing.assert_array_equal(line, groups[2].variables["error"][1][0])
    assert edge(fig.axes[1], CARETUP) == [(1.0, "#d55e00")] and not edge(fig.axes[0], CARETUP)


@pytest.mark.parametrize(
    "values, scale, ticks",
    [([1.0, 2.0, 20.0], "linear", None), ([1.0, 2.0, 21.0], "log", None), ([0.0, 1.0, 100.0], "linear", [0, 1, 2])],
)
def test_scale_of_the_swept_values(values, scale, ticks):
    (ax,) = plot.figure(stability(stability_group("splitting", panels="finite", values=np.array(values)))).axes
    assert ax.get_xscale() == scale and (ticks is None or ax.get_xticks().tolist() == ticks)


def test_maps_above_lines_and_cases_in_rows():
    cases = [stability_group(s, c, panels="regimes casimir error") for c in "ab" for s in SCHEMES]
    fig = plot.figure(stability(*cases, predators("splitting", panels="regimes casimir error")))
    assert len(fig.axes) == 3 * 3 + 3 * 2
    assert [text.get_text() for text in fig.axes[-2].texts] == ["no Casimir"]
    assert [area._suptitle.get_text().partition(",")[0] for area in fig.subfigs] == [
        "case a",
        "case b",
        "case predators",
    ] * 2


def test_what_is_asked_must_be_known():
    with pytest.raises(ValueError, match="no panel 'casimirs'; known panels: regimes, finite, casimir"):
        plot.figure(stability(stability_group("splitting", panels="casimirs")))
    with pytest.raises(ValueError, match="no panel 'regimes'; known panels: growth, law"):
        plot.figure(long_time(long_time_group("splitting", panels="regimes")))
    with pytest.raises(ValueError, match="no panel that could be drawn"):
        plot.figure(long_time(long_time_group("splitting", panels="law", law=False)))


# --- figures of long times -------------------------------------------------------------------------------------------


def test_long_times():
    groups = [long_time_group(scheme) for scheme in SCHEMES]
    fig = plot.figure(long_time(*groups))
    assert len(fig.axes) == 2 + 4 + 4
    assert "512 paths of $2^{26}$ steps" in fig.texts[1].get_text() and "T=" not in fig.texts[1].get_text()
    walk, means = fig.axes[:2]
    assert [ax.get_title() for ax in fig.axes[2:]] == ["$y_{1}$", "$y_{2}$", "$y_{3}$", "$H$"] * 2
    entries = texts(walk.get_legend())
    assert len(entries) == 9 and entries[6] == r"splitting, $h=2^{-2}$: $n^{0.50}$ [0.47, 0.53]"
    assert entries[0] == "Euler-Maruyama, $h=2^{-2}$"  # nothing could be fitted
    assert [x for x, _ in edge(walk, CARETUP)] == [2**9, 2**14, 2**15]
    assert texts(means.get_legend())[:2] == ["95 % if the law is exact", "Euler-Maruyama, $h=2^{-6}$"]
    law = next(legend for legend in legends(fig) if "exact" in legend)
    assert law == ["Euler-Maruyama, $h=2^{-6}$", "midpoint, $h=2^{-2}$", "splitting, $h=2^{-2}$", "exact"]


def test_reference_slopes_and_path_0():
    group = long_time_group("splitting", panels="growth", law=False)
    (ax,) = plot.figure(long_time(group, long_time_group("midpoint", panels="growth", law=False))).axes
    for line, slope in (("--", 0.5), (":", 1.0)):
        (drawn,) = (one for one in ax.lines if one.get_linestyle() == line and one.get_color() == growth.SLOPE)
        x, y = drawn.get_data()
        assert np.log(y[1] / y[0]) / np.log(x[1] / x[0]) == pytest.approx(slope)
        if slope == 0.5:  # above the best of the scheme's curves
            best = group.variables["casimir_rms"][1][:, :, 0]
            best, n = best[best[:, -1].argmin(), 2:], group.coordinates["n"][2:]
            assert (y[0] * np.sqrt(n / x[0]) / best).min() == pytest.approx(1.7)
    levels = [line.get_ydata()[0] for line in ax.lines if line.get_linestyle() == "-."]
    assert levels == [1e-11]
    thin = [line for line in ax.lines if line.get_linewidth() == 0.5 and to_hex(line.get_color()) == GREEN]
    one = np.abs(group.variables["casimir_one"][1][0, :, 0])
    np.testing.assert_array_equal(thin[0].get_ydata(), np.where(one > 0, one, np.nan))


def test_law_against_the_exact_one():
    groups = [long_time_group(scheme, panels="law distance") for scheme in ("midpoint", "splitting")]
    fig = plot.figure(long_time(*groups))
    ax, distances = fig.axes[2], fig.axes[6]  # of y3
    (bars,) = (c for c in ax.containers if to_hex(c[0].get_color()) == GREEN)
    np.testing.assert_allclose(bars[0].get_ydata(), 20 * groups[1].variables["fraction"][1][0, 2])
    half = np.diff(np.array(bars[2][0].get_segments())[:, :, 1])[:, 0] / 2
    np.testing.assert_allclose(half, 1.96 * 20 * 6e-4)
    hollow = [c for c in distances.containers if c[0].get_markerfacecolor() == "none"]
    assert {to_hex(c[0].get_color()): len(c[0].get_xdata()) for c in hollow} == {"#0072b2": 1, GREEN: 3}
    assert distances.get_ylim()[0] <= 6e-4 and {ax.get_ylim() for ax in fig.axes[:4]} == {ax.get_ylim()}


def test_far_densities_do_not_hide_the_others():
    far, near = long_time_group("midpoint"), long_time_group("splitting")
    far.variables["fraction"][1][0, :, 5:] = 0.0
    far.variables["fraction"][1][0, :, 0] = 1.0
    low, high = laws.law_limits([far, near], ["y1", "H"])
    assert 0.3 < low < 0.95 and 1.05 < high < 1.7
    ax = plot.figure(long_time(far, near)).axes[2]
    assert len(edge(ax, CARETDOWN)) == 15 and len(edge(ax, CARETUP)) == 1


def test_lost_everywhere():
    group = long_time_group("splitting", casimirs=2)
    group.variables["nonfinite"][1][:] = 3
    group.variables["casimir_rms"][1][:] = np.inf
    group.variables["mean"][1][:] = np.nan
    for name in ("fraction", "law_distance", "law_distance_stderr"):
        group.variables[name][1][:] = np.nan
    fig = plot.figure(long_time(group))
    assert len(fig.axes) == 3 + 4 + 4
    assert any("paths lost at all" in text for legend in legends(fig) for text in legend)
    assert "nan" in printed(long_time(group))


def test_growth_of_cases_side_by_side():
    two = [long_time_group("splitting", case, panels="growth", law=False) for case in ("one", "two")]
    fig = plot.figure(long_time(*two))
    assert [ax.get_title() for ax in fig.axes] == [r"case one, \$5", r"case two, \$5"]
    assert plot.figure(long_time(long_time_group("splitting", casimirs=0, panels="growth"))).axes[0].texts


def test_legend_rows_fit():
    entry = layout.mark("o", "eight and twenty characters ")
    for width, shape in ((30.0, (2, 5)), (8.0, (3, 3)), (3.0, (7, 1))):
        rows = layout._rows(layout.Line([None], (3.0, 3.0), legend=[[entry] * 5, [entry] * 2]), width)
        assert (len(rows), len(rows[0])) == shape and len({len(row) for row in rows}) == 1


def test_drawn_to_the_end():
    """Layouts raise no warning either; nor do they leave the panels without room."""
    one = stability(stability_group("euler_maruyama", panels="regimes error", values=VALUES[2:4], h=H[:2]))
    two = long_time(*(long_time_group(s, panels="growth moments", last=10) for s in SCHEMES))
    for results in (one, two):
        fig = plot.figure(results)
        fig.draw_without_rendering()
        inches = [ax.get_window_extent().transformed(fig.dpi_scale_trans.inverted()) for ax in fig.axes]
        assert all(box.width > 1.5 and box.height > 1.3 for box in inches)
