"""Records, JSON, CSV and printed tables."""

import io
import math

import numpy as np
import pytest
from helpers import printed
from strong_results import H, strong, unresolved
from strong_results import strong_group as group_of

from spi import views
from spi.printing.text import decimal, duration, fraction, interval_text, power_of_two, with_interval
from spi.storage import Order, StorageError


def strong_group(case, scheme, label, order, implicit=False):
    error = 0.3 * H**order
    error[0] = np.inf if scheme == "euler_maruyama" else error[0]
    resolved = np.isfinite(error)
    resolved[-1] = False
    stderr = np.where(resolved, 0.01, 0.7) * 0.3 * H**order
    note = "at 2^-13: not resolved, needs about 4000 samples"
    told = {"order": Order(order, order - 0.02, order + 0.02, 7), "scheme_label": label, "note": note}
    return group_of(scheme, case, error, stderr, resolved, implicit=implicit, case_title="three [noises]", **told)


@pytest.fixture
def results():
    groups = (
        strong_group("three", "euler_maruyama", "Euler-Maruyama", 0.5),
        strong_group("three", "midpoint", "midpoint", 0.5, implicit=True),
        strong_group("three", "splitting", "splitting, noise first (slpI)", 0.51),
        strong_group("one", "splitting", "splitting, noise first (slpI)", 0.5),
    )
    unresolved(groups[-1])
    return strong(*groups, title="Strong errors, stochastic rigid body")


def test_printed_table(results):
    text = printed(results)
    assert "\x1b" not in text and "…" not in text
    table_lines = [line for line in text.splitlines() if "±" in line]
    assert len(table_lines) == 9 * 4 - 1 and all(len(line) <= 100 for line in table_lines)
    assert "three [noises]" in text and "Strong errors, stochastic rigid body" in text
    assert "Euler-Maruyama: order 0.500 [0.480, 0.520] (expected 1/2)" in text
    assert "splitting, noise first (slpI): order not resolved (expected 1/2)" in text
    assert "needs about 4000 samples" in text
    assert "solver: 3.2 iterations a step, 0 failures, largest residual 2.2e-16" in text
    last = next(line for line in table_lines if "2^-13" in line)
    assert "(0.003 ± 0.005)" in last and "( ): not resolved" in text
    first = next(line for line in text.splitlines() if "2^-5" in line)
    assert "(inf)" in first and "37" in first


def test_what_is_said_of_lost_references_and_large_angles(results):
    assert "reference paths" not in printed(results) and "rad" not in printed(results)
    group = results.groups[2]
    group.attributes["reference_nonfinite"] = 3
    group.variables["largest_angle"] = (("h",), np.array([0.0] * 8 + [2e6]))
    text = printed(results)
    assert text.count("3 reference paths diverged (NaN or infinity)") == 1
    assert text.count("angles up to 2.0e+06 rad, which double precision knows to about 4e-10 rad") == 1


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.parametrize("columns", ["60", "150"])
def test_colours_on_a_terminal_of_any_width(results, monkeypatch, columns):
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("COLUMNS", columns)
    monkeypatch.delenv("NO_COLOR", raising=False)
    text = Terminal()
    views.print_tables(results, text)
    assert "37\x1b[0m" in text.getvalue() and "\x1b[1;31m" in text.getvalue() and "…" not in text.getvalue()
    assert "0.0375 ± 0.0008" in text.getvalue()


def test_results_of_an_unknown_kind_are_said_to_be_that(results):
    other = results._replace(attributes={"kind": "new"})
    for view in (views.rows, printed):
        with pytest.raises(StorageError, match="these are results of kind 'new'; known kinds: strong, trajectory"):
            view(other)


@pytest.mark.parametrize(
    "value, half, text",
    [
        (3.4217e-3, 0.0712e-3, "0.00342 ± 0.00008"),  # rounded up, as all half widths
        (3.4217e-7, 0.0132e-7, "3.422e-7 ± 0.014e-7"),
        (3.4217e-7, 0.0130e-7, "3.422e-7 ± 0.013e-7"),
        (0.4003, 0.07 * 1.0000000000000002, "0.40 ± 0.07"),
        (72.3456789, 1.467e-5, "72.34568 ± 1.5e-5"),
        (0.123456789, 1.467e-5, "0.123457 ± 0.000015"),
        (1e8, 1.23, "1.000000e8 ± 1.3"),
        (123.0, 950.0, "100 ± 1000"),
        (9.996, 0.04, "10.00 ± 0.04"),
        (0.5, 0.02, "0.50 ± 0.02"),
        (1e-3, 4e-3, "0.001 ± 0.004"),
        (12.5, 0.5, "12.5 ± 0.5"),
        (0.0, 0.0, "0"),
        (0.0, 5e-324, "0"),
        (1.0, 1e-310, "1.000"),
        (2.5e-5, 0.0, "2.500e-5"),
        (51234.2, 310.0, "51200 ± 400"),
        (1234567.0, 89.0, "1.23457e6 ± 0.00009e6"),
        (0.06612345, 2e-13, "0.06612345 ± 2e-13"),
        (math.inf, math.nan, "inf"),
    ],
)
def test_with_interval(value, half, text):
    assert with_interval(value, half) == text


@pytest.mark.parametrize(
    "value, ends, text",
    [
        (1.0, (1.0 - 1e-15, 1.0 + 1.1e-15), "1.000000 ± 1.1e-15"),  # ends are known to 2e-16
        (1.0, (1.0 - 1e-14, 1.0 + 4e-14), "1.0 [1.0, 1.0]"),
        (0.5, (0.4, 0.7), "0.50 [0.40, 0.70]"),
        (1e-20, (0.9e-20, 1.3e-20), "1.0e-20 [9.0e-21, 1.3e-20]"),
    ],
)
def test_ends_that_are_even_but_for_rounding_are_one_half_width(value, ends, text):
    assert interval_text(value, ends) == text


def test_numbers_that_are_huge_without_a_noise_have_no_hundreds_of_digits():
    assert [decimal(x) for x in (-2.34, 99999.94, 1e308, -1e6)] == ["-2.3", "99999.9", "1.0e308", "-1.0e6"]
    assert [duration(x) for x in (0.0, 1e300)] == ["0", "1e+300 s"]


def test_numbers():
    assert [power_of_two(h) for h in (2**-13, 1.0, 0.3)] == ["2^-13", "2^0", "0.3"]
    assert [fraction(x) for x in (0.5, 1.0, 1.5, 2 / 3, 0.123)] == ["1/2", "1", "3/2", "2/3", "0.123"]
