"""What a kind of experiment consists of, and that a further one is one file of 61 lines and a line in KINDS."""

import io
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import spread_kind

from spi import storage, views
from spi.kinds import KINDS, Kind
from spi.kinds.plans import State
from spi.printing.tables import _common
from spi.running import run as runs
from spi.storage.stored import Stored, fact

SPEC = """\
title: Spread
kind: KIND
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3]}
initial: [cos(1.1), 0, sin(1.1)]
final_time: 1
step: 2^-3
schemes: [splitting]
samples: 70
functions: {a: y1^2, b: y3}
"""
CLAIMS = "expect: {splitting: {a: {mean: 0.2 +- 0.1, variance: 1e-9}}}\n"


@pytest.fixture
def spread(monkeypatch, tmp_path):
    """The spec of an experiment of the kind in tests/spread_kind.py, which is registered as one of the program's."""
    monkeypatch.setitem(KINDS, "spread", Kind("spread_kind"))
    runs.layers.cache_clear()
    spec = tmp_path / "spread.yaml"
    spec.write_text(SPEC.replace("KIND", "spread") + CLAIMS, encoding="utf-8")
    yield spec
    runs.layers.cache_clear()


@pytest.mark.parametrize("name", [*KINDS, "spread"])
def test_every_kind_has_all_of_its_modules(name, spread):
    kind = KINDS[name]
    assert kind.keys.Case.__doc__
    assert callable(kind.study.parts) and callable(kind.study.plan)
    assert issubclass(kind.results.Record, Stored)
    assert kind.keys.Case.quantities and kind.results.Record.row_axes
    assert callable(kind.figure.draw)
    with pytest.raises(AttributeError, match="no module 'plots', only keys, study"):
        _ = kind.plots


def test_a_further_kind_is_one_file_and_a_line(spread, tmp_path):
    """Its table, rows, claims and figure follow."""
    source = Path(spread_kind.__file__).read_text(encoding="utf-8")
    assert source.count("\n") <= 61
    assert source in Path(__file__).parents[2].joinpath("CONTRIBUTING.md").read_text(encoding="utf-8")
    experiment = runs.load(spread)
    assert runs.cost(experiment).path_steps == 128 * 8
    file = runs.run(experiment, tmp_path)
    results = storage.read(file)
    (reading,) = views.readings(results)
    assert [one.verdict for one in views.verdicts(results)][1] == views.rows(results)[0]["claim[variance]"]
    assert views.rows(results)[1]["mean"] == reading.mean[0, 1]
    views.print_tables(results, text := io.StringIO())
    assert "splitting" in text.getvalue() and "±" in text.getvalue()
    assert "splitting: 70 paths until t = 1 with h = 0.125\n" in text.getvalue()
    for picture in views.save(views.figure(results), tmp_path, "spread"):
        assert picture.stat().st_size > 1000


def test_a_further_kind_has_the_numbers_of_statistics_and_a_report(spread, tmp_path):
    file = runs.run(runs.load(spread), tmp_path)
    results = storage.read(file)
    (reading,) = views.readings(results)
    other = tmp_path / "other.yaml"
    other.write_text(SPEC.replace("KIND", "statistics") + "statistics: [mean, variance]\n", encoding="utf-8")
    (known,) = views.readings(storage.read(runs.run(runs.load(other), tmp_path)))
    np.testing.assert_allclose(reading.mean, known.mean, rtol=1e-12)
    np.testing.assert_allclose(reading.variance[:, 1:], known.variance[:, 1:], rtol=1e-6)
    from spi.plugins.report.views import page, sections

    text = page.page([sections.section(file, results, "a")], [page.picture(results, "a", "A figure")])
    assert "Spread" in text and "svg" in text


@pytest.mark.parametrize(
    ("facts", "said"),
    [
        ({"step": 0.5, "samples": 3}, "3 paths with h = 0.5"),
        ({"step": 0.5, "samples": 3, "nonfinite": 1}, "3 paths with h = 0.5, 1 of them diverged"),
        ({"step": 0.5, "samples": 3, "ns_per_step": 7.0}, "3 paths with h = 0.5, 7.00 ns per step and path"),
        ({"step": 0.5, "samples": 3, "ns_per_step": 510660.7}, "3 paths with h = 0.5, 511 µs per step and path"),
        (
            {"order": 1.0, "order_low": 0.9, "order_high": 1.1, "points_in_fit": 3},
            "order 1.000 [0.900, 1.100] (measured; theory states none)",
        ),
    ],
)
def test_each_common_fact_is_said_without_the_others(facts, said):
    assert list(_common(SimpleNamespace(get=facts.get))) == [said]


def test_keys_of_the_case_alone_become_facts_of_a_record(spread, monkeypatch):
    class Named(spread_kind.Spread):
        row: str = fact("what is also called as a method of the case", default="own")

    monkeypatch.setattr(spread_kind.SpreadPlan, "record", Named)
    (plan,) = runs.plans(runs.load(spread))
    whole = plan.whole(State(plan))
    assert hasattr(plan.case, "row") and "row" not in whole
    assert (whole["samples"], whole["step"]) == (70, 0.125)


def test_the_further_kind_is_not_known_without_its_line(tmp_path):
    spec = tmp_path / "spread.yaml"
    spec.write_text(SPEC.replace("KIND", "spread"), encoding="utf-8")
    with pytest.raises(Exception, match="is 'spread'; known: strong"):
        runs.load(spec)


def test_the_example_keeps_the_rules_of_the_floors(tmp_path):
    from test_floors import violations

    package = tmp_path / "spi"
    shutil.copytree(Path(__file__).parents[2] / "spi", package, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(spread_kind.__file__, package / "kinds" / "spread.py")
    assert violations(package) == []
