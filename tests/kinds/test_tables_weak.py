"""Records and printed tables of weak errors."""

import math

import numpy as np
import pytest
from helpers import printed
from weak_results import H, by_differences, weak, weak_group

from spi import views


@pytest.fixture
def results():
    return weak(
        weak_group("splitting", "plain", prefixes=True),
        weak_group("splitting", "multilevel", stderr=1e-5),
        weak_group("splitting", "kolmogorov"),
        weak_group("splitting_order2", "multilevel", case="other", functions=1),
    )


def test_printed_errors(results):
    text = printed(results)
    assert "…" not in text and all(len(line) <= 100 for line in text.splitlines() if "±" in line)
    assert text.count("case main, $5") == 1 and text.count("case other, $5") == 1
    assert "0.0626 ± 0.0002" in text and "0.06250000 ± 1e-10" in text and "-0.01250000 ± 1e-10" in text
    poor = [line.rstrip() for line in text.splitlines() if "(0 ± 2e-4)" in line]
    assert len(poor) == 1 and "2^-6 " in poor[0] and text.count("( ): not resolved") == 1
    assert "phi = sin(2*pi*y1) + y2" in text and "square = y1^2" in text


def test_levels_not_to_be_trusted(results):
    v = results.groups[1].variables
    v["level_kurtosis"][1][0, 2], v["level_consistency"][1][1, 6], v["level_nonfinite"][1][3] = 345.6, 1.3, 7
    v["level_kurtosis"][1][0, 0], v["level_consistency"][1][0, 0] = math.nan, math.nan
    v["level_variance_rate_low"][1][0] = math.nan  # the jackknife's, where a level without some paths has no variance
    text = printed(results)
    assert "2.000 ± ?" in text and "[nan" not in text and " 346 " in text and " 1.30 " in text
    assert text.count("kurtosis above 100: heavy tails: few samples carry the variance, so that intervals may") == 1
    assert text.count("consistency above 1: the means of neighbouring levels disagree") == 1
    assert any("2^-6" in line and line.rstrip().endswith(" 7") for line in text.splitlines())


def test_without_what_may_be_missing(results):
    """No sd, no expected order, no rates, no notes that can be read."""
    plain, multilevel, exact = results.groups[:3]
    for group in (plain, multilevel, exact):
        group.attributes.pop("expected_order")
        for name in ("sd", "level_mean_rate", "level_variance_rate"):
            group.variables.pop(name, None)
    exact.attributes["notes"] = "{"
    multilevel.attributes["level_cost_rate"] = math.nan
    text = printed(weak(plain, multilevel, exact))
    assert "4.00 s" in text and "expected" not in text
    assert "levels h^" not in text and "errors are not corrected for what it lacks, as theory states no order" in text


def test_one_path_and_levels_that_cost_the_same(results):
    plain, multilevel = results.groups[:2]
    plain.variables["error_stderr"][1][...], plain.attributes["samples"] = math.nan, 1
    multilevel.attributes["level_cost_rate"] = -0.01
    text = printed(weak(plain, multilevel))
    assert "splitting, plain: one path has no standard error: not resolved\n" in text and "nan" not in text
    assert " -0.01\n" in text


def test_agreement(results):
    """Sampled errors are off by one standard error, (error - exact) / stderr = 1, -1, ..."""
    records = views.rows(results)
    compared = [record for record in records if "agreement" in record]
    assert {(r["case"], r["estimator"]) for r in compared} == {("main", "plain"), ("main", "multilevel")}
    assert len(compared) == 24
    assert [round(record["agreement"], 4) for record in compared] == [1, -1] * 12
    text = printed(results)
    assert "sampled errors less those without sampling" in text and "disagree" not in text
    rows = [line.split()[-2:] for line in text.splitlines() if line.rstrip().endswith((" 0.00016", " 0.0051"))]
    assert rows == [["1.0", "0.00016"], ["-1.0", "0.0051"]]


def test_disagreement(results):
    results.groups[0].variables["error"][1][1, 2] += 4e-4
    results.groups[1].variables["error"][1][0, :] = math.nan
    for group in results.groups[:3]:
        group.variables["error"][1][1, 3] = 0.0
    text = printed(results)
    assert text.count("in std. errors above 4: the estimates disagree") == 1
    assert math.isnan(next(r["agreement"] for r in views.rows(results) if r["estimator"] == "multilevel"))


def test_differences():
    group = by_differences()
    text = printed(weak(group))
    assert text.count("1.00 [0.90, 1.10]  2.00 [1.90, 2.10]  1.00 [0.90, 1.10]") == 2 and text.count("  0.95\n") == 2
    told = "lacks (h_ref/h)^2 = 6.2 % of the error of splitting_order2 at the finest step (order 2), which is added"
    assert told in text
    group.variables["difference_kurtosis"][1][0, 1:3] = 101.0, 150.0
    group.variables["difference_consistency"][1][1, 0] = 1.5
    group.variables["difference_nonfinite"][1][1] = 7
    text = printed(weak(group))
    assert " 101 " in text and " 150 " in text and text.count("kurtosis above 100: heavy tails") == 1
    assert text.count("consistency above 1: the expectation is not that of its levels") == 1
    assert any(line.split()[:1] == ["2^-4"] and line.split()[-1] == "7" for line in text.splitlines())


@pytest.mark.parametrize(("bend", "told"), [(0.0, False), (20.0, True)])
def test_a_reference_whose_error_is_not_of_its_order_is_told(bend, told):
    """Errors 0.5 h + bend h^2: what the smallest step makes of the reference's own error, and the next, differ."""
    group = weak_group("splitting", "plain", functions=1, stderr=1e-6)
    h, h_ref = H[-2:][::-1], 2.0**-10
    errors = 0.5 * H + bend * H**2 - (0.5 * h_ref + bend * h_ref**2)  # against the reference
    (own, by_next) = errors[:-3:-1] / (h / h_ref - 1)
    signs = np.where(np.arange(64) % 2, 1.0, -1.0)[:, None, None]
    without = errors + own + 1e-6 * signs * H**0 / 63**0.5
    group.variables.update(
        error=(("function", "h"), errors[None] + own), error_without=(("left_out", "function", "h"), without)
    )
    text = printed(weak(group._replace(coordinates={**group.coordinates, "left_out": np.arange(64)})))
    line = f"the reference's own error, {own:.1e} by the smallest step, would be {by_next - own:.1e} more by the next"
    assert ("errors are not yet C h, and may be off by about that" in text) is told
    assert (line.replace("e-0", "e-") in text) is told


@pytest.mark.parametrize(("extrapolate", "expected", "told"), [(1, 3.0, 1), (1, 2.0, 0), (1, None, 0), (0, 3.0, 0)])
def test_an_extrapolated_order_that_is_not_the_one_assumed_is_told(extrapolate, expected, told):
    """The errors are of order 2 [1.98, 2.02]."""
    group = weak_group("splitting_order2", "plain", functions=1, extrapolate=extrapolate)
    group.attributes.pop("expected_order")
    group.attributes.update({} if expected is None else {"expected_order": expected})
    line = "the order is not the one assumed: extrapolated errors should fall like h^3; the function may have a"
    assert printed(weak(group)).count(line) == told
