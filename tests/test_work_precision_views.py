"""Work points from errors and times, and the tables and figures of work and precision."""

import json
import math
import warnings
from itertools import takewhile

import numpy as np
import pytest
from helpers import printed
from matplotlib.colors import to_hex
from work_results import MADE_UP, H, work_group, work_results

from spi import printing, views
from spi.kinds.work_precision.reading import read, requested
from spi.kinds.work_precision.reading.work_points import (
    WorkCurve,
    WorkPoint,
    cheapest,
    interval_of_median,
    time_factor,
    work_for,
)
from spi.kinds.work_precision.table import COLUMNS
from spi.printing.text import duration
from spi.records import Results
from spi.schemes import SCHEMES


def curve(error, h=H, half=None, resolved=None, seconds=None, spread=1.0):
    """A curve; without ``seconds`` a step takes 1 s."""
    error = np.asarray(error, float)
    half = np.zeros(len(error)) if half is None else half
    resolved = np.isfinite(error) if resolved is None else np.asarray(resolved)
    seconds = 1.0 / h if seconds is None else seconds
    return WorkCurve(h, error, half, resolved, seconds, seconds / spread, seconds * spread)


@pytest.fixture
def no_warnings():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


# --- the time for an error -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("target", [0.0317, 0.01, 2.5e-3])
def test_power_laws_are_met_exactly(order, target):
    error = 0.8 * H**order
    target = target if error[-1] < target < error[0] else math.sqrt(error[0] * error[1])
    point = work_for(target, curve(error, seconds=3.0 / H))
    assert point.h == pytest.approx((target / 0.8) ** (1 / order), rel=1e-12)
    assert point.seconds == pytest.approx(3.0 / point.h, rel=1e-12)
    assert point.low == pytest.approx(point.seconds) == point.high and not point.at_most


def test_ends_of_what_was_run():
    error = 0.5 * H
    assert work_for(0.99 * error[-1], curve(error)) is None
    last = work_for(error[-1], curve(error))
    assert last.h == pytest.approx(H[-1]) and not last.at_most
    for target in (error[0], 100.0):
        assert work_for(target, curve(error, spread=1.1)) == (8.0, 8.0 / 1.1, 8.0 * 1.1, 0.125, True)
    assert work_for(0.0, curve(error)) is None and work_for(0.01, curve(np.full(9, np.nan))) is None


def test_the_order_of_the_steps_does_not_matter():
    given = curve(0.5 * H**1.3, half=0.01 * H)
    turned = WorkCurve(*(values[::-1] for values in given))
    assert work_for(0.01, given) == work_for(0.01, turned)


def test_luck_is_not_rewarded():
    """An error that is small by chance at a large step, as one that crosses zero."""
    error = 0.5 * H
    error[1] = 1e-4
    point = work_for(0.02, curve(error))
    assert point.h == pytest.approx(0.125 * 2 ** -(math.log(0.0625 / 0.02) / math.log(4)))  # as if it were 2^-6
    error[3] = 0.03  # the last above the target, so it is one of the neighbours
    point = work_for(0.02, curve(error))
    assert H[4] < point.h < H[3]


def test_points_that_are_not_resolved():
    error = np.array([0.4, 0.2, 0.1, 0.05])
    h, half = H[:4], np.full(4, 0.05)
    point = work_for(0.141, curve(error, h, half, [True, True, False, True]))
    assert math.log(0.2 / 0.141) / math.log(0.2 / 0.05) == pytest.approx(math.log(h[1] / point.h) / math.log(4))
    assert work_for(0.07, curve(error, h, half, [True, True, True, False])) is None
    # the interval at the second step includes the target, so that the first one is the neighbour
    assert h[2] < work_for(0.19, curve(error, h, half, [True, False, True, True])).h < h[0]
    # the whole interval lies above it, so that nothing larger than the third step is known to do
    missed = curve([0.05, 0.4, 0.1, 0.05], h, half, [True, False, True, True])
    assert work_for(0.15, missed) == (32.0, 32.0, 32.0, h[2], True)


@pytest.mark.parametrize("bad", [np.inf, np.nan])
def test_lost_paths_are_no_neighbours(bad, no_warnings):
    error = np.array([0.01, bad, 0.05, 0.02])
    point = work_for(0.06, curve(error, H[:4], resolved=[True, False, True, True]))
    assert point.h == H[2] and point.at_most
    assert work_for(0.06, curve(error[[0, 2, 3, 1]], H[:4])) is None
    large = curve([0.01, 1e200, 0.05], H[:3], np.array([0.001, np.inf, 0.001]), [True, False, True])
    assert work_for(0.06, large).h == H[2]


def test_interval_of_a_work_point():
    """(k e)^2 + t^2 in logarithms, at a quarter of the way between two points."""
    half = np.array([0.04, 0.01])
    found = curve([0.2, 0.1], H[:2], half, seconds=np.array([1.0, 8.0]))
    target = 0.2 / 2**0.25
    point = work_for(target, found)
    e = 0.75 * (0.04 / 0.2) + 0.25 * (0.01 / 0.1)
    assert point.seconds == pytest.approx(8**0.25)
    assert math.log(point.high / point.seconds) == pytest.approx(3 * e) == math.log(point.seconds / point.low)
    found = found._replace(low=np.array([0.9, 8.0]), high=np.array([1.2, 8.8]))
    point = work_for(target, found)
    down, up = 0.75 * math.log(1 / 0.9), 0.75 * math.log(1.2) + 0.25 * math.log(1.1)
    assert math.log(point.seconds / point.low) == pytest.approx(math.hypot(3 * e, down))
    assert math.log(point.high / point.seconds) == pytest.approx(math.hypot(3 * e, up))


@pytest.mark.parametrize(("shared", "least", "most"), [(True, 0.935, 0.985), (False, 0.97, 1.0)])
def test_coverage(shared, least, most):
    """95 % where errors and times of all steps are wrong by a common factor, more where they are independent."""
    rng = np.random.default_rng(5)
    order, target, covered, runs = 0.5, 0.03, 0, 1000
    exact = 1.0 / (target / 0.8) ** (1 / order)
    for _ in range(runs):
        z = rng.standard_normal(1 if shared else 9)
        repeats = np.exp(0.2 * rng.standard_normal((15, 1 if shared else 9)))
        low, middle, high = np.quantile(repeats, [0.25, 0.5, 0.75], axis=0) / H
        error = 0.8 * H**order * (1 + 0.05 * z)
        ends = interval_of_median(middle, low, high, 15)
        point = work_for(target, WorkCurve(H, error, 1.96 * 0.05 * error, H > 0, middle, *ends))
        covered += point.low <= exact <= point.high
    assert least <= covered / runs <= most


def test_interval_of_a_median():
    rng = np.random.default_rng(1)
    for repeats, least, most in ((5, 0.87, 0.93), (9, 0.92, 0.97), (15, 0.94, 0.98), (101, 0.99, 1.01)):
        low, middle, high = np.quantile(np.exp(0.1 * rng.standard_normal((4000, repeats))), [0.25, 0.5, 0.75], axis=1)
        low, high = interval_of_median(middle, low, high, repeats)
        assert least < np.mean((low <= 1) & (high >= 1)) < most
    assert interval_of_median(2.0, 1.0, 3.0, 1000) == (1.0, 3.0)


# --- the cheapest ----------------------------------------------------------------------------------------------------


def point(seconds, spread=1.1, at_most=False):
    return WorkPoint(seconds, seconds / spread, seconds * spread, 0.1, at_most)


def test_cheapest():
    best, factors = cheapest({"a": point(6.0), "b": point(2.0), "c": None, "d": point(2.2)})
    assert best == "b" and list(factors) == ["d", "a"]
    assert factors["d"].tie and not factors["a"].tie
    assert factors["a"].value == 3.0
    assert math.log(factors["a"].high / 3) == pytest.approx(math.hypot(*[math.log(1.1)] * 2))
    assert math.log(3 / factors["a"].low) == pytest.approx(math.hypot(*[math.log(1.1)] * 2))
    assert cheapest({"a": None}) == (None, {}) and cheapest({"a": point(1.0), "b": None}) == ("a", {})


def test_factors_use_the_ends_that_face_each_other():
    one, other = WorkPoint(1.0, 0.1, 1.2, 0.1), WorkPoint(2.0, 1.8, 40.0, 0.1)
    factor = time_factor(one, other)
    assert math.log(2 / factor.low) == pytest.approx(math.hypot(math.log(1.2), math.log(2 / 1.8)))
    assert math.log(factor.high / 2) == pytest.approx(math.hypot(math.log(10), math.log(20)))


def test_upper_bounds_decide_nothing():
    assert time_factor(point(1.0), point(5.0, at_most=True))[1:] == (0.0, pytest.approx(5 * 1.1 ** math.sqrt(2)))
    surely = time_factor(point(1.0, at_most=True), point(5.0))
    assert surely.high == math.inf and surely.low > 4 and not surely.tie
    assert time_factor(point(1.0, at_most=True), point(5.0, at_most=True)).tie


# --- tables ----------------------------------------------------------------------------------------------------------


def test_rows():
    records = views.rows(work_results())
    assert len(records) == 3 * 5 * 9
    first, weak = records[0], records[-1]
    assert list(first) == [name for name in COLUMNS if name not in ("error_bound", "eps")]
    missing = {"eps", "error_stderr", "casimir_drift", "samples"}
    assert list(weak) == [name for name in COLUMNS if name not in missing]
    group = work_group("one", "euler_maruyama")
    values = {name: values for name, (_, values) in group.variables.items()}
    assert first["error"] == values["error"][0] and first["casimir_drift"] == values["casimir_drift"][0].max()
    assert first["seconds_per_path_high"] == values["seconds_per_path_high"][0] and first["h"] == 0.125
    lost = records[45]
    assert lost["nonfinite"] == 512 and lost["casimir_drift"] == math.inf and lost["resolved"] is False
    assert all(type(value) in (str, float, int, bool) for record in records for value in record.values())
    assert json.loads(printing.as_json(records))[45]["error"] is None
    bare = work_group("one", "splitting")
    del bare.variables["nonfinite"]
    assert "nonfinite" not in views.rows(Results({"kind": "work_precision"}, (bare,)))[0]


def test_a_scheme_at_several_eps_keeps_its_name():
    group = work_group("one", "splitting")
    groups = [
        group._replace(variant=f"splitting_eps_{eps:g}", attributes=group.attributes | {"eps": eps})
        for eps in (0.1, 0.01)
    ]
    results = Results({"kind": "work_precision"}, tuple(groups))
    records = views.rows(results)
    assert [(r["scheme"], r["eps"]) for r in records[::9]] == [("splitting", 0.1), ("splitting", 0.01)]
    assert "splitting, eps = 0.1: order" in printed(results)


# --- readings --------------------------------------------------------------------------------------------------------


def test_reading_of_strong_errors():
    group = work_group("lost", "euler_maruyama")
    found = read(group)
    assert (found.measure, found.exact, found.estimator, found.functions) == ("strong", False, "", ())
    assert (found.samples, found.order.points, found.about.variant) == (500, 9, "euler_maruyama")
    v = group.arrays
    for name in ("error", "error_stderr", "resolved", "nonfinite", "seconds_per_path", "ns_per_step"):
        np.testing.assert_array_equal(getattr(found, name), v[name])
    np.testing.assert_array_equal(found.casimir_drift, np.maximum(*v["casimir_drift"].T))
    np.testing.assert_array_equal(found.half, 1.96 * v["error_stderr"])
    np.testing.assert_array_equal(found.curve.half, found.half)
    ends = interval_of_median(v["seconds_per_path"], v["seconds_per_path_low"], v["seconds_per_path_high"], 7)
    np.testing.assert_array_equal(found.curve[4:], [v["seconds_per_path"], *ends])


def test_reading_of_weak_errors():
    """A bound takes the place of half an interval, and there are no Casimirs."""
    group = work_group("weak", "splitting", "weak")
    del group.variables["nonfinite"]
    found = read(group)
    assert (found.measure, found.exact, found.estimator, found.samples) == ("weak", True, "kolmogorov", None)
    assert found.functions == ("sin(6.283185307179586*y1)",)
    assert found.casimir_drift is None and found.nonfinite is None
    np.testing.assert_array_equal(found.half, group.arrays["error_stderr"])
    none = work_group("one", "splitting")
    none.variables["casimir_drift"] = ("h", "casimir"), np.empty((9, 0))
    assert read(none).casimir_drift is None


def test_requested_errors_of_all_schemes_are_asked_for():
    readings = [read(work_group("one", scheme)) for scheme in ("splitting", "midpoint")]
    readings[1] = readings[1]._replace(targets=(0.5, 0.01))
    assert requested(readings) == [1e-3, 0.01, 0.1, 0.5]


def answers(text):
    """Of each table of requested errors the cells of its rows."""
    lines = iter(text.splitlines())
    for line in lines:
        if line.startswith("cheapest scheme"):
            next(line for line in lines if line.startswith("───"))
            rows = takewhile(lambda line: line[:1].isdigit(), lines)
            yield {row.split()[0]: row for row in rows}


def test_printed_table():
    text = printed(work_results())
    assert "…" not in text and max(map(len, text.splitlines())) <= 100
    assert "Work and precision" in text and "strong noise" in text
    first = next(line for line in text.splitlines() if line.startswith("midpoint"))
    assert first.split()[1:6] == ["2^-3", "1.23e-1", "±", "0.03e-1", "493"]
    lost = [line for line in text.splitlines() if line.rstrip().endswith(("not finite", "not resolved"))]
    assert len(lost) == 4 and "(inf)" in lost[0] and "512" in lost[0] and "(1.4e-8 ± 1.0e-8)" in lost[-1]
    assert "splitting, weak order 2: order 2.010 [1.990, 2.030] (expected 2)" in text
    assert "strong error (95 %)" in text and "weak error (bound)" in text and "sin(2*pi*y1)" in text
    assert "to T = 1, the median of 7 repeats" in text


def test_printed_answers():
    strong, _, weak = answers(printed(work_results()))
    assert list(strong) == ["1e-1", "1e-2", "1e-3"] and list(weak) == ["1e-2", "1e-4", "1e-6"]
    assert strong["1e-1"].split()[1:5] == ["splitting", "2^-4.9", "265", "ns"]
    assert strong["1e-1"].split()[5:] == ["1.83", "2.9", "1", "tie", "1.04", "1.37"]
    assert strong["1e-2"].split()[1:] == ["midpoint", "2^-10.3", "76.5", "µs", "-", "1", "-", "-", "-"]
    assert strong["1e-3"].split()[1:] == ["none", *"-----"]
    assert weak["1e-2"].split()[5:] == ["1.76", "≤", "4.8", "1", "1.26", "≤", "1.10"]
    assert weak["1e-6"].split()[1:] == ["splitting,", "weak", "order", "2", "2^-7.9", "3.43", "µs", *"----", "1"]


def test_answers_at_the_largest_step():
    """Where nothing is known of larger steps."""
    groups = [work_group("one", scheme, noisy=False) for scheme in ("splitting", "midpoint", "splitting_order2")]
    for group in groups:
        group.attributes["targets"] = (10.0, 0.19)
    text = printed(Results({"kind": "work_precision"}, tuple(groups)))
    (found,) = answers(text)
    assert found["1e1"].split() == ["1e1", "splitting", "2^-3", "≤", "68.0", "ns", "1", "(7.2)", "(1.65)"]
    assert found["1.9e-1"].split() == ["1.9e-1", "splitting", "2^-3.1", "71.2", "ns", "1", "≤", "6.9", "≤", "1.57"]
    assert (
        "≤: the largest step" in text and "( ): so it is for both" in text and "tie:" not in text and "\n-:" not in text
    )


@pytest.mark.parametrize(("exact", "told"), [(True, "1.10"), (False, "tie 1.10")])
def test_bounds_are_not_widened(exact, told):
    """Errors of 5 % make one of 0.05 or of 1.96 * 0.05 in the logarithm of each time; the two are 1.1 apart."""
    groups = [work_group("weak", scheme, "weak", noisy=False) for scheme in ("splitting", "splitting_drift_first")]
    for group, factor in zip(groups, (1.0, 1.1), strict=True):
        values = {"error": 0.1 * H, "error_stderr": 0.005 * H, "resolved": H > 0}
        values |= dict.fromkeys([f"seconds_per_path{end}" for end in ("", "_low", "_high")], 1e-8 * factor / H)
        group.variables.update((name, (("h",), value)) for name, value in values.items())
        group.attributes.update(exact=exact, targets=(1e-3,))
    (found,) = answers(printed(Results({"kind": "work_precision"}, tuple(groups))))
    assert found["1e-3"].split("1  ")[-1].strip() == told


def test_remarks_only_for_marks_that_occur():
    text = printed(work_results(("one",), ("splitting", "splitting_drift_first")))
    assert "tie: the 95 % interval" in text and "-: not reached" in text and "≤" not in text and "( )" not in text


def test_a_note_stands_under_its_scheme():
    results = work_results(["one"])
    results.groups[1].attributes["note"] = "at 2^-11: not resolved"
    lines = printed(results).splitlines()
    assert lines[lines.index("    at 2^-11: not resolved") - 1].startswith("midpoint: order")


def test_durations():
    seconds = [4.83e-8, 9.996e-7, 1e-6, 1.2345e-5, 0.1, 3.0, 4321.0, 2e-13, math.nan]
    told = ["48.3 ns", "1.00 µs", "1.00 µs", "12.3 µs", "100 ms", "3.00 s", "4321 s", "0.20 ps", "nan"]
    assert [duration(s) for s in seconds] == told


# --- figures ---------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def figure():
    return views.figure(work_results())


def series(ax, scheme):
    """The points of a scheme, without those of the legend."""
    marker, colour = SCHEMES[scheme].look
    lines = [line for line in ax.lines if line.get_marker() == marker and to_hex(line.get_color()).upper() == colour]
    return [line for line in lines if len(line.get_xdata())]


def edge(ax, end):
    return {tuple(np.ravel(line.get_xdata())) for line in ax.lines if set(np.ravel(line.get_ydata())) == {end}}


def test_panels(figure):
    one, lost, weak, casimirs, _, empty = figure.axes
    for ax in figure.axes[:5]:
        assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
    assert not empty.axison and casimirs.axison
    assert one.get_ylabel().startswith("strong error") and weak.get_ylabel().startswith("weak error")
    assert lost.get_ylabel() == "" and casimirs.get_ylabel().startswith("Casimir error")
    assert casimirs.get_xlabel() == weak.get_xlabel() == "processor time of a path"
    assert one.get_title().splitlines()[0] == "case one" and r"\sigma" in lost.get_title()
    assert one.get_xlim() == casimirs.get_xlim()
    ticks = [one.xaxis.get_major_formatter()(x) for x in (1e-7, 1e-6)]
    assert ticks == ["100 ns", "1 µs"]


def test_points_of_errors(figure):
    one, lost = figure.axes[:2]
    for scheme in MADE_UP:
        variables = work_group("one", scheme).variables
        (line,) = series(one, scheme)
        np.testing.assert_array_equal(line.get_xdata(), variables["seconds_per_path"][1])
        np.testing.assert_array_equal(line.get_ydata(), variables["error"][1])
    seconds = work_group("lost", "euler_maruyama").variables["seconds_per_path"][1]
    (line,) = series(lost, "euler_maruyama")
    np.testing.assert_array_equal(line.get_xdata(), seconds[3:])
    assert edge(lost, 1) == {tuple(seconds[:3])} and edge(one, 1) == set()
    assert lost.get_ylim()[1] < 1
    bars = one.containers[-1][2][0].get_segments()
    stderr = work_group("one", "splitting_order2").variables["error_stderr"][1]
    np.testing.assert_allclose([bar[1, 1] - bar[0, 1] for bar in bars], 2 * 1.96 * stderr)


def test_resolved_errors_of_a_blow_up_do_not_widen_the_axes():
    groups = [work_group("one", scheme) for scheme in ("euler_maruyama", "midpoint", "splitting")]
    groups[0].variables["error"][1][0] = 1e6
    ax = views.figure(Results({"kind": "work_precision"}, tuple(groups))).axes[0]
    assert ax.get_ylim()[1] < 1 and edge(ax, 1) == {(groups[0].variables["seconds_per_path"][1][0],)}


def test_weak_errors_have_bounds_and_pale_points(figure):
    weak = figure.axes[2]
    bars = weak.containers[0][2][0].get_segments()
    np.testing.assert_allclose([bar[1, 1] - bar[0, 1] for bar in bars], 2e-8, rtol=1e-5)
    pale = [line for line in series(weak, "splitting_order2") if line.get_alpha()]
    assert len(pale) == 1 and len(pale[0].get_xdata()) == 1 and pale[0].get_linestyle() == "None"


def test_requested_errors(figure):
    for ax, seen in ((figure.axes[0], [0.01, 0.1]), (figure.axes[2], [1e-6, 1e-4, 0.01])):
        across = [line.get_ydata()[0] for line in ax.lines if line.get_linestyle() == "--" and len(line.get_ydata())]
        assert across == seen


def test_labels_of_steps(figure):
    one, lost, weak = figure.axes[:3]
    assert sorted(text.get_text() for text in one.texts) == ["$2^{-11}$"] * 5 + ["$2^{-3}$"] * 5
    assert "$2^{-6}$" in {text.get_text() for text in lost.texts}
    assert "$2^{-10}$" in {text.get_text() for text in weak.texts}
    figure.draw_without_rendering()
    for ax in (one, lost, weak):
        boxes = [text.get_window_extent() for text in ax.texts]
        assert not any(a.overlaps(b) for i, a in enumerate(boxes) for b in boxes[:i])
        assert all(ax.get_window_extent().contains(*corner) for box in boxes for corner in (box.p0, box.p1))


def test_points_of_casimirs(figure):
    casimirs, spoilt = figure.axes[3:5]
    seconds = work_group("one", "splitting").variables["seconds_per_path"][1]
    assert edge(casimirs, 0) == {(seconds[0],)} and edge(casimirs, 1) == set()
    (line,) = series(casimirs, "splitting")
    np.testing.assert_array_equal(line.get_xdata(), seconds[1:])
    (line,) = series(casimirs, "midpoint")
    np.testing.assert_array_equal(line.get_ydata(), 0.1 * H)
    lost = work_group("lost", "euler_maruyama").variables["seconds_per_path"][1]
    assert edge(spoilt, 1) == {tuple(lost[:3])} and spoilt.get_ylim()[1] < 10


def test_legends(figure):
    texts = [[text.get_text() for text in ax.get_legend().get_texts()] for ax in figure.axes[3:]]
    schemes = [f"{label}: order 0.51 [0.49, 0.53]" for label, *_ in MADE_UP.values()]
    unchanged = "the Casimirs have not changed at all"
    assert texts[0] == [*schemes, "requested errors", unchanged]
    assert texts[1] == [*schemes, "requested errors", "paths left the finite numbers or nearly so", unchanged]
    assert texts[2][5:] == ["requested errors", "pale: not resolved, left out of the fit"]
    assert all(ax.get_legend() is None for ax in figure.axes[:3])


def test_without_casimirs_there_is_one_panel():
    (ax,) = views.figure(work_results(("weak",), ("splitting", "midpoint"))).axes
    assert ax.get_legend() is not None and ax.get_title() == ""


def test_a_scheme_without_casimirs_beside_others():
    groups = [work_group("one", scheme, casimirs=scheme == "midpoint") for scheme in ("midpoint", "splitting")]
    fig = views.figure(Results({"kind": "work_precision"}, tuple(groups)))
    assert series(fig.axes[0], "splitting") and series(fig.axes[1], "midpoint")
    assert not series(fig.axes[1], "splitting")


def test_five_cases_leave_one_place_free():
    fig = views.figure(work_results(["one", "two", "three", "four", "five"], ["splitting"]))
    assert len(fig.axes) == 10
    assert len({round(ax.get_position().x0, 3) for ax in fig.axes}) == 3


def test_times_that_differ_little_have_more_ticks():
    group = work_group("one", "splitting")
    for name in ("seconds_per_path", "seconds_per_path_low", "seconds_per_path_high"):
        group.variables[name] = (("h",), group.variables[name][1] ** 0.25)
    fig = views.figure(Results({"kind": "work_precision"}, (group,)))
    fig.draw_without_rendering()
    low, high = fig.axes[0].get_xlim()
    assert high < 20 * low and sum(low <= tick <= high for tick in fig.axes[0].get_xticks()) >= 2


def test_four_cases_are_a_square():
    names = ("one", "two", "three", "four")
    fig = views.figure(work_results(names, ("splitting",), casimirs=False))
    titles = [ax.get_title().splitlines()[0] for ax in fig.axes if ax.get_title()]
    assert titles == [f"case {name}" for name in names] and len(fig.axes) == 4
    tops = [ax.get_position().y0 for ax in fig.axes]
    assert tops[0] == pytest.approx(tops[1]) and tops[2] == pytest.approx(tops[3]) and tops[2] < tops[0]


@pytest.mark.parametrize("variables", [("error",), ("error", "error_stderr", "casimir_drift", "seconds_per_path")])
def test_nothing_to_draw(variables, no_warnings):
    group = work_group("one", "splitting")
    for name in variables:
        axes, values = group.variables[name]
        group.variables[name] = axes, np.full(values.shape, np.nan)
    group.variables["resolved"] = ("h",), np.zeros(9, bool)
    group.attributes.update(order=math.nan, order_ci=(math.nan, math.nan))
    results = Results({"kind": "work_precision", "title": "none"}, (group,))
    views.figure(results).draw_without_rendering()
    text = printed(results)
    assert "order not resolved" in text and all("none" in row for row in next(answers(text)).values())
