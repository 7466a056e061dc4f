"""Records, JSON, CSV and printed tables."""

import csv
import io
import json
import math

import numpy as np
import pytest
from helpers import printed

from spi import tables
from spi.records import Group, Results

H = 2.0 ** -np.arange(5, 14)


def strong_group(case, scheme, label, order, implicit=False):
    error = 0.3 * H**order
    error[0] = np.inf if scheme == "euler_maruyama" else error[0]
    resolved = np.isfinite(error)
    resolved[-1] = False
    variables = {
        "error": (("h",), error),
        "error_stderr": (("h",), np.where(resolved, 0.01, 0.7) * 0.3 * H**order),
        "error_time": (("h",), np.ones(9)),
        "error_final": (("h",), 0.9 * error),
        "error_final_stderr": (("h",), 0.009 * H**order),
        "casimir_drift": (("h", "casimir"), np.outer(np.arange(9), [1e-16, -1e-16])),
        "nonfinite": (("h",), np.where(np.isfinite(error), 0, 37)),
        "resolved": (("h",), resolved),
        "seconds": (("h",), 1e-3 / H),
        "ns_per_step": (("h",), np.full(9, 6.25)),
    }
    if implicit:
        variables |= {
            "solves": (("h",), np.full(9, 100)),
            "iterations": (("h",), np.full(9, 320)),
            "failures": (("h",), np.zeros(9, dtype=int)),
            "largest_residual": (("h",), np.full(9, 2.2e-16)),
        }
    attributes = {
        "order": order,
        "order_ci": (order - 0.02, order + 0.02),
        "expected_order": 0.5,
        "samples": 500,
        "scheme_label": label,
        "case_title": "three [noises]",
        "note": "at 2^-13: not resolved, needs about 4000 samples",
    }
    return Group(case, scheme, {"h": H, "casimir": np.arange(2)}, variables, attributes)


@pytest.fixture
def results():
    groups = (
        strong_group("three", "euler_maruyama", "Euler-Maruyama", 0.5),
        strong_group("three", "midpoint", "midpoint", 0.5, implicit=True),
        strong_group("three", "splitting", "splitting, noise first (slpI)", 0.51),
        strong_group("one", "splitting", "splitting, noise first (slpI)", 0.5),
    )
    groups[-1].attributes.update(order=math.nan, order_ci=(math.nan, math.nan))
    return Results({"kind": "strong", "title": "Strong errors, stochastic rigid body"}, groups)


def test_rows(results):
    records = tables.rows(results)
    assert len(records) == 4 * 9
    explicit, implicit = records[1], records[9]
    assert tuple(explicit) == tables.STRONG[:-4] and tuple(implicit) == tables.STRONG
    assert explicit["case"] == "three" and explicit["scheme"] == "euler_maruyama" and explicit["h"] == 2**-6
    assert explicit["error"] == 0.3 * 2.0**-3 and explicit["casimir_drift"] == 1e-16
    assert (explicit["order"], explicit["order_low"], explicit["order_high"]) == (0.5, 0.48, 0.52)
    assert records[0]["error"] == math.inf and records[0]["nonfinite"] == 37 and records[0]["resolved"] is False
    assert all(type(value) in (str, float, int, bool) for record in records for value in record.values())


def test_rows_without_casimirs(results):
    group = results.groups[0]
    group.variables["casimir_drift"] = (("h", "casimir"), np.zeros((9, 0)))
    assert "casimir_drift" not in tables.rows(results)[0]
    assert "2^-13" in printed(results)


def test_json(results):
    records = tables.rows(results)
    back = json.loads(tables.as_json(records), parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))
    assert [list(record) for record in back] == [list(record) for record in records]
    assert back[0]["error"] is None and back[0]["resolved"] is False
    assert back[30]["order"] is None
    assert back[10]["error"] == records[10]["error"]


def test_csv(results):
    records = tables.rows(results)
    back = list(csv.DictReader(io.StringIO(tables.as_csv(records))))
    assert tuple(back[0]) == tables.STRONG and len(back) == len(records)
    assert float(back[0]["error"]) == math.inf and back[0]["solves"] == "" and back[9]["solves"] == "100"
    for key in ("h", "error", "casimir_drift", "ns_per_step"):
        np.testing.assert_array_equal([float(record[key]) for record in back], [record[key] for record in records])


def test_csv_of_nothing():
    assert tables.as_csv([]).strip() == "" and json.loads(tables.as_json([])) == []


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
    assert "(3e-3 ± 5e-3)" in last and last.rstrip().endswith("not resolved")
    first = next(line for line in text.splitlines() if "2^-5" in line)
    assert "(inf)" in first and "37" in first and "not finite" in first


def trajectory_group(case, scheme, label, casimirs=2, **attributes):
    t = np.arange(5) * 0.25
    variables = {
        "y": (("t", "component"), np.column_stack([1.0 + t, -t])),
        "hamiltonian": (("t",), 2.0 - t / 3),
        "casimirs": (("t", "casimir"), np.outer(1 + 1e-15 * t, 1.0 + np.arange(casimirs))),
    }
    attributes = {
        "scheme_label": label,
        "case_title": "one [path]",
        "step": 0.25,
        "nonfinite_from": math.nan,
        "casimir_drift": tuple(1e-15 * 2**c for c in range(casimirs)),
        **attributes,
    }
    return Group(
        case, scheme, {"t": t, "component": np.arange(2), "casimir": np.arange(casimirs)}, variables, attributes
    )


@pytest.fixture
def trajectories():
    explicit = trajectory_group("one", "euler_maruyama", "Euler-Maruyama", nonfinite_from=0.75)
    explicit.variables["y"][1][3:] = np.nan
    explicit.variables["hamiltonian"][1][3:] = np.nan
    implicit = trajectory_group("one", "midpoint", "midpoint", solver_failures=2, solver_iterations_mean=3.25)
    bare = trajectory_group("two", "splitting", "splitting", casimirs=0)
    return Results({"kind": "trajectory", "title": "Trajectories"}, (explicit, implicit, bare))


def test_rows_of_trajectories(trajectories):
    records = tables.rows(trajectories)
    assert len(records) == 15
    columns = ["case", "scheme", "t", "y_1", "y_2", "hamiltonian", "casimir_1", "casimir_2"]
    assert list(records[0]) == columns and list(records[-1]) == columns[:-2]
    assert records[7] == dict(
        zip(columns, ("one", "midpoint", 0.5, 1.5, -0.5, 2 - 0.5 / 3, 1 + 5e-16, 2 + 1e-15), strict=True)
    )
    assert json.loads(tables.as_json(records))[3]["y_1"] is None
    assert all(type(value) in (str, float) for record in records for value in record.values())


def test_printed_trajectories(trajectories):
    text = printed(trajectories)
    assert "Trajectories" in text and "one [path]" in text and all(len(line) <= 100 for line in text.splitlines())
    rows = {line.split()[0]: line.split()[1:] for line in text.splitlines() if " 2^-2 " in line}
    assert rows["Euler-Maruyama"] == ["2^-2", "4", "nan", "1.0e-15", "2.0e-15", "-0.5", "0.75"]
    assert rows["midpoint"] == ["2^-2", "4", "1.66667", "1.0e-15", "2.0e-15", "-1", "2", "3.2"]
    assert rows["splitting"] == ["2^-2", "4", "1.66667", "-1"]
    assert text.count("of C1") == 1 and text.count("failures") == 1


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.parametrize("columns", ["60", "150"])
def test_colours_on_a_terminal_of_any_width(results, monkeypatch, columns):
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("COLUMNS", columns)
    monkeypatch.delenv("NO_COLOR", raising=False)
    text = Terminal()
    tables.print_table(results, text)
    assert "37\x1b[0m" in text.getvalue() and "\x1b[1;31m" in text.getvalue() and "…" not in text.getvalue()
    assert "3.75e-2 ± 0.07e-2" in text.getvalue()


def test_unknown_kind(results):
    group = Group(
        "a",
        "splitting",
        {"t": np.array([0.0, 0.5]), "component": np.arange(2)},
        {"y": (("t", "component"), np.array([[1.0, 2.0], [np.nan, 1 / 3]])), "seed": ((), np.array(7))},
        {"samples": 3},
    )
    other = Results({"kind": "new"}, (group,))
    assert tables.rows(other)[1]["y[1]"] == 1 / 3
    text = printed(other)
    assert "0.333333" in text and "samples: 3" in text and "seed: 7" in text
    wide = printed(results._replace(attributes={"kind": "other"}))
    assert "…" not in wide and all(f"{0.3 * h**0.51:.6g}" in wide for h in H[:-1])


@pytest.mark.parametrize(
    "value, half, text",
    [
        (3.4217e-3, 0.0712e-3, "3.42e-3 ± 0.07e-3"),
        (3.4217e-3, 0.0132e-3, "3.422e-3 ± 0.013e-3"),
        (9.996, 0.04, "10.00 ± 0.04"),
        (0.5, 0.02, "5.0e-1 ± 0.2e-1"),
        (1e-3, 4e-3, "1e-3 ± 4e-3"),
        (12.5, 0.5, "1.25e1 ± 0.05e1"),
        (0.0, 0.0, "0.000e0"),
        (2.5e-5, 0.0, "2.500e-5"),
        (math.inf, math.nan, "inf"),
    ],
)
def test_with_interval(value, half, text):
    assert tables.with_interval(value, half) == text


def test_numbers():
    assert [tables.power_of_two(h) for h in (2**-13, 1.0, 0.3)] == ["2^-13", "2^0", "0.3"]
    assert [tables.fraction(x) for x in (0.5, 1.0, 1.5, 2 / 3, 0.123)] == ["1/2", "1", "3/2", "2/3", "0.123"]
