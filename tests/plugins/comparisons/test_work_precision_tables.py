"""Readings and tables of work and precision, from results made by hand."""

import math
from dataclasses import replace

import pytest
from helpers import printed
from work_cases import answers
from work_results import H, work_group, work_results

from spi.plugins.comparisons.kinds.work_precision.results import WorkPrecision, requested
from spi.printing.text import duration
from spi.storage import StoredResults


def test_requested_errors_of_all_schemes_are_asked_for():
    readings = [WorkPrecision.of(work_group("one", scheme)) for scheme in ("splitting", "midpoint")]
    readings[1] = replace(readings[1], targets=(0.5, 0.01))
    assert requested(readings) == [1e-3, 0.01, 0.1, 0.5]


def test_printed_answers():
    strong, _, weak = answers(printed(work_results()))
    assert list(strong) == ["0.1", "0.01", "0.001"] and list(weak) == ["0.01", "1e-4", "1e-6"]
    assert strong["0.1"].split()[1:5] == ["splitting", "2^-4.9", "265", "ns"]
    assert strong["0.1"].split()[5:] == ["1.83", "2.9", "1", "tie", "1.04", "1.37"]
    assert strong["0.01"].split()[1:] == ["midpoint", "2^-10.3", "76.5", "µs", "-", "1", "-", "-", "-"]
    assert strong["0.001"].split()[1:] == ["none", *"-----"]
    assert weak["0.01"].split()[5:] == ["1.76", "≤", "4.8", "1", "1.26", "≤", "1.10"]
    assert weak["1e-6"].split()[1:] == ["splitting,", "weak", "order", "2", "2^-7.9", "3.43", "µs", *"----", "1"]


def test_answers_at_the_largest_step():
    """Where nothing is known of larger steps."""
    groups = [work_group("one", scheme, noisy=False) for scheme in ("splitting", "midpoint", "splitting_order2")]
    for group in groups:
        group.attributes["targets"] = (10.0, 0.19)
    text = printed(StoredResults({"kind": "work_precision"}, tuple(groups)))
    (found,) = answers(text)
    assert found["10"].split() == ["10", "splitting", "2^-3", "≤", "68.0", "ns", "1", "(7.2)", "(1.65)"]
    assert found["0.19"].split() == ["0.19", "splitting", "2^-3.1", "71.2", "ns", "1", "≤", "6.9", "≤", "1.57"]
    assert (
        "≤: the largest step" in text and "( ): so it is for both" in text and "tie:" not in text and "\n-:" not in text
    )


@pytest.mark.parametrize(("exact", "told"), [(True, "1.10"), (False, "tie 1.10")])
def test_bounds_are_not_widened(exact, told):
    """Errors of 5 % make one of 0.05 or of 1.96 * 0.05 in the logarithm of each time; the two are 1.1 apart."""
    groups = [work_group("weak", scheme, "weak", noisy=False) for scheme in ("splitting", "splitting_drift_first")]
    for group, factor in zip(groups, (1.0, 1.1), strict=True):
        del group.variables["error_bound"]
        values = {"error": 0.1 * H, "error_bound" if exact else "error_stderr": 0.005 * H, "resolved": H > 0}
        values |= dict.fromkeys([f"seconds_per_path{end}" for end in ("", "_low", "_high")], 1e-8 * factor / H)
        group.variables.update((name, (("h",), value)) for name, value in values.items())
        group.attributes.update(targets=(1e-3,))
    (found,) = answers(printed(StoredResults({"kind": "work_precision"}, tuple(groups))))
    assert found["0.001"].split("1  ")[-1].strip() == told


def test_a_note_stands_under_its_scheme():
    results = work_results(["one"])
    results.groups[1].attributes["note"] = "at 2^-11: not resolved"
    lines = printed(results).splitlines()
    assert lines[lines.index("    at 2^-11: not resolved") - 1].startswith("midpoint: order")


def test_durations():
    seconds = [4.83e-8, 9.996e-7, 1e-6, 1.2345e-5, 0.1, 3.0, 4321.0, 2e-13, math.nan]
    told = ["48.3 ns", "1.00 µs", "1.00 µs", "12.3 µs", "100 ms", "3.00 s", "4321 s", "0.20 ps", "nan"]
    assert [duration(s) for s in seconds] == told
