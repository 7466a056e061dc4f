"""The rule of what is rounding, against roundings that are made, and where studies meet them."""

import math

import numpy as np
import pytest
import weak_cases
from helpers import printed
from states import finished
from strong_cases import case_of as strong_case
from strong_cases import study

from spi.kinds.strong import study as strong
from spi.printing import tables
from spi.printing.sweeps import headline
from spi.statistics.claims import INCONCLUSIVE, judge, quantities
from spi.statistics.curves import curves
from spi.statistics.rounding import (
    all_exact,
    is_rounding,
    note_exact,
    rounding,
    size_of,
    size_of_values,
    with_rounding,
)
from spi.storage import Part, StoredResults

ABOUT_ONE_AXIS = {"inertia": (math.inf, math.inf, 0.7), "noise_inertia": (1.0, 1.0, 3.0), "sigma": (0.0, 0.0, 1.0)}


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e12])
def test_many_turns_and_one_differ_by_rounding(size):
    """Of the plane by 1 rad in all; a turn that is wrong by 1e-12 is none."""
    for n in (2**4, 2**10, 2**14):
        z = np.full(16, size, complex) * np.exp(1j * np.arange(16))
        start, step = z, np.exp(1j / n)
        for _ in range(n):
            z = z * step
        away = np.abs(z - start * np.exp(1j))
        assert is_rounding(away, size, n).all()
        assert away.max() > 1e-3 * rounding(size, n)
        assert not is_rounding(np.abs(z * np.exp(1e-9j) - start * np.exp(1j)), size, n).any()
    assert not is_rounding(np.array([np.nan, np.inf]), size, 4).any()


def test_sizes_of_functions_are_of_their_terms():
    state = (0.6, 0.0, 0.8)
    assert size_of(state) == 1.0 and size_of(None) == size_of((0.0, 0.0)) == 1.0
    casimir = size_of_values(lambda y: (y**2).sum(axis=0) - 1, state)
    assert 0.5 < casimir < 4.0  # 2 sum y_i^2, and 0 by its value
    assert 0.3 < size_of_values(lambda y: y[1], state) < 1.0  # 0 there, but not elsewhere
    assert size_of_values(lambda y: 1e6 * y[0] ** 2, state) > 1e5
    assert size_of_values(lambda y: np.where(y[1] > 0, 1.0, 0.0), state) < 1e4


def test_intervals_are_no_shorter_than_rounding():
    stderr, difference = np.array([1e-17, 1e-17, 1e-3]), np.array([6e-16, 1e-9, 1e-16])
    found = with_rounding(stderr, difference, 1.0, 64)
    assert found[0] == rounding(1.0, 64) / 1.96 and found[1] == 1e-17 and found[2] == 1e-3
    assert note_exact(difference, is_rounding(difference, 1.0, 64)) == "2 of 3 errors are exact up to rounding (6e-16)"
    assert note_exact(difference[1:2], np.array([False])) == ""
    notes = "not reached; q: 2 of 3 errors are exact up to rounding (6e-16); p: exact"
    assert [all_exact(notes, name) for name in ("q", "p", "", "r")] == ["", "exact", "exact", ""]


def test_strong_errors_that_are_rounding_have_no_order():
    """Drift and noise turn about one axis: the splitting is exact, and errors are about 1e-15."""
    claim = "expect={splitting: {order: 1}}"
    case = strong_case("schemes=[splitting]", "truncate_noise=false", "samples=64", claim)
    exact = case.model_copy(update={"model": case.model._replace(**ABOUT_ONE_AXIS)})
    found, attributes = study(exact, "splitting")
    assert 0 < found["error"].max() < 1e-13
    assert not found["resolved"].any() and math.isnan(found["order"])
    assert attributes["note"].startswith("exact up to rounding (")
    assert study(case, "splitting")[1]["note"] == ""  # negative control: about three axes


def test_no_claim_about_rounding_is_contradicted():
    case = strong_case("schemes=[splitting]", "truncate_noise=false", "samples=64", "expect={splitting: {order: 1}}")
    exact = case.model_copy(update={"model": case.model._replace(**ABOUT_ONE_AXIS)})
    plan = strong.plan(exact, Part("splitting"))
    found = plan.results(finished(plan))
    verdicts = judge(case.claims, quantities([found]))
    (one,) = [one for one in verdicts if one.claim.quantity == "order" and one.found]
    assert (one.verdict, tables.came_out(one)) == (INCONCLUSIVE, found.note)
    text = printed(StoredResults({"kind": "strong", "title": ""}, (found.group(),)))
    assert f": {found.note}\n" in text and "not resolved (" not in text and "order not resolved" not in text
    assert "exact up to rounding (" in headline(curves(quantities([found]), ["order"]))


def test_weak_errors_that_are_rounding_have_no_order():
    case = weak_cases.case_of("samples=64", "truncate_noise=false")
    exact = case.model_copy(update={"model": case.model._replace(**ABOUT_ONE_AXIS)})
    found, attributes = weak_cases.results_of(exact, "splitting", "plain")
    assert np.abs(found["error"]).max() < 1e-13
    assert not found["resolved"].any() and np.isnan(found["order"]).all()
    assert "exact" in attributes["note"]
    assert not weak_cases.results_of(case, "splitting", "plain")[1].get("note")
