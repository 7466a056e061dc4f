"""Regimes and tables of stability, from results made by hand."""

import math

import numpy as np
import pytest
from helpers import printed
from stability_results import VALUES, predators, stability, stability_group

from spi import views
from spi.plugins.comparisons.kinds.stability.results import REGIMES, Stability, largest_step
from spi.statistics.claims import quantities


def cell(group, value, h):
    where = np.flatnonzero(group.coordinates["value"] == value)[0], np.flatnonzero(group.coordinates["h"] == h)[0]
    return REGIMES[Stability.of(group).regimes[where]]


@pytest.mark.parametrize(
    "name, value, regime",
    [
        ("finite", 511 / 512, "paths diverged"),
        ("finite", math.nan, "paths diverged"),
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
    for name in ("casimir_worst", "casimir_median"):
        group.variables[name] = ("value", "h", "casimir"), np.full((6, 8, 1), 0.5)
    bad = {"finite": 0.5, "failures": 5000, "largest_norm": 3.0, "casimir_worst": 0.5, "positive": 0.5, "error": 1.0}
    good = {"finite": 1.0, "failures": 0, "largest_norm": 1.0, "casimir_worst": 0.0, "positive": 1.0, "error": 0.0}
    found = []
    for healed in range(len(bad) + 1):
        for i, name in enumerate(bad):
            group.variables[name][1][0, 0] = (good if i < healed else bad)[name]
        found.append(REGIMES[Stability.of(group).regimes[0, 0]])
    assert found == list(REGIMES[::-1])


def test_quantities_are_of_each_value_of_the_sweep():
    results = stability(stability_group("splitting"))
    found = {one.swept for one in quantities([*views.readings(results)])}
    assert found == {(results.groups[0].attributes["sweep"], value) for value in VALUES}


def test_growth_is_that_beyond_the_true_one():
    """Where the solution itself grows, so do all step sizes, and only what goes further is lost."""
    group = stability_group("splitting", casimirs=0)
    norm = group.variables["largest_norm"][1]
    norm[:] = 50.0
    assert set(Stability.of(group).regimes.ravel()) == {0, 1}
    norm[0, 0] = 101.0
    assert cell(group, 0.1, 1.0) == "not bounded"


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
    assert largest_step(h, np.array(good, bool)) == pytest.approx(expected, nan_ok=True)


def test_nearly_all_is_not_all():
    group = predators("splitting")
    group.variables["positive"][1][0, 0] = 1 - 1e-6
    assert "99.9999 %" in printed(stability(group))
