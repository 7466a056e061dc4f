"""Tables, rows and figures of every kind, from records that its schema fills: what holds of all of them."""

import copy
import csv
import io
import json
import math
from contextlib import contextmanager

import numpy as np
import pytest
from exported import missing
from filled_results import filled, panels_of
from helpers import printed

from spi import views
from spi.kinds import KINDS
from spi.printing import as_csv, as_json
from spi.storage import StoredResults


def results_of(kind, **others):
    groups = filled(kind, **others), filled(kind, "midpoint", **others)
    return StoredResults({"kind": kind, "title": "The title"}, groups)


@contextmanager
def unchanged(results):
    """Within it results are shown, which changes nothing of them."""
    before = copy.deepcopy(results)
    yield
    for group, other in zip(results.groups, before.groups, strict=True):
        assert group.attributes == other.attributes
        for name, (_, values) in group.variables.items():
            np.testing.assert_array_equal(values, other.variables[name][1])


@pytest.mark.parametrize("kind", KINDS)
def test_every_array_is_in_a_table_with_its_interval(kind, monkeypatch):
    """Under its own name, and one that is left out is noticed."""
    results, record = results_of(kind), KINDS[kind].results.Record
    tables, exported = views.data_tables(results), record.exported
    assert missing(results, tables) == []
    for table in tables.values():
        check_rows(table.rows)
    for name in results.groups[0].variables:
        monkeypatch.setattr(
            record, "exported", lambda one, name=name: {k: v for k, v in exported(one).items() if k != name}
        )
        without = {table: it for table, it in views.data_tables(results).items() if table != "orders"}  # it repeats
        assert name in missing(results, without)


def check_rows(rows):
    """They are plain values, and the same in JSON and CSV."""
    assert rows and all(type(value) in (str, float, int, bool) for row in rows for value in row.values())
    back = json.loads(as_json(rows), parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))
    assert [list(row) for row in back] == [list(row) for row in rows]
    table = list(csv.DictReader(io.StringIO(as_csv(rows))))
    assert len(table) == len(rows) and set(table[0]) == {key for row in rows for key in row}
    for text, row in zip(table, rows, strict=True):
        floats = {key: value for key, value in row.items() if type(value) is float}
        assert all(float(text[key]) == value or value != value for key, value in floats.items())


@pytest.mark.parametrize("kind", KINDS)
def test_a_table_names_title_and_schemes_and_cuts_nothing(kind):
    results = results_of(kind)
    with unchanged(results):
        text, _ = printed(results), views.rows(results)
    assert "The title" in text and "…" not in text and "\x1b" not in text
    assert kind == "answer" or ("splitting" in text and "midpoint" in text)  # the program chose the scheme


@pytest.mark.share(15)
@pytest.mark.parametrize(("kind", "panel"), [(kind, panel) for kind in KINDS for panel in panels_of(kind) or [None]])
def test_every_panel_shows_something(kind, panel):
    results = results_of(kind, **({"panels": (panel,)} if panel else {}))
    with unchanged(results):
        fig = views.figure(results)
    assert any(ax.lines or ax.collections or ax.patches or ax.images or ax.texts for ax in fig.axes)


#: What is lost, with what is known of it, where all paths diverge.
LOST = {
    "strong": ("error", "error_stderr", "error_final", "error_final_stderr", "casimir_drift"),
    "trajectory": ("y", "hamiltonian", "casimirs"),
    "weak": ("error", "error_stderr", "prefix_error", "prefix_error_stderr", "history_error", "history_error_stderr"),
    "work_precision": ("error", "error_stderr", "casimir_drift"),
    "stability": ("error", "error_stderr", "largest_norm", "casimir_worst", "casimir_median"),
    "growth": ("casimir_mean", "casimir_rms", "casimir_worst", "casimir_one", "mean", "law_distance"),
    "equilibrium": ("casimir_mean", "casimir_rms", "casimir_worst", "casimir_one", "average"),
    "statistics": ("mean", "mean_stderr", "variance", "variance_stderr"),
    "lyapunov": ("exponent", "exponent_stderr", "total", "total_stderr"),
    "answer": ("value", "stderr", "half"),
}


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_lost_is_shown_all_the_same(kind):
    """One scheme has NaN where the other has infinite values; the panels keep the places that the layout gave them."""
    results = results_of(kind)
    values = math.nan, (math.nan if kind == "lyapunov" else math.inf)
    for group, value in zip(results.groups, values, strict=True):
        for name in {*LOST[kind], "resolved"} & group.variables.keys():
            group.variables[name][1][...] = False if name == "resolved" else value
    as_json(views.rows(results))
    dashes = {"stability": ("none",), "statistics": (" - ",), "equilibrium": (" - ", "inf")}
    said = dashes.get(kind, tuple(map(str, values)))
    text = printed(results)
    assert all(one in text for one in said) or "not finite" in text or kind == "lyapunov"
    fig = views.figure(results)
    fig.set_layout_engine("none")
    fig.draw_without_rendering()


@pytest.mark.parametrize("kind", KINDS)
def test_what_cannot_be_drawn_is_said(kind):
    with pytest.raises(ValueError, match="no scheme"):
        views.figure(StoredResults({"kind": kind, "title": ""}, ()))
    if panels_of(kind):
        with pytest.raises(ValueError, match=r"panels: has 'nothing'; known|no panel that could be drawn"):
            views.figure(results_of(kind, panels=("nothing",)))
