"""The three estimators of weak errors agree; variances fall with the square of the step, errors with its order."""

import functools
from dataclasses import replace

import numpy as np
import pytest
from helpers import compiled_only
from weak_cases import (
    FUNCTIONS,
    SPLITTINGS,
    SYSTEMS,
    after_blocks,
    case_of,
    completed,
    levels_plan_of,
    results_of,
)

from spi.ensemble.loop import AS_TOSSED, COINS_TURNED
from spi.exact.expectations import expectations
from spi.plugins.solve.kinds.weak.kolmogorov import _order
from spi.schemes import SCHEMES
from spi.schemes.stages import compositions

RATES = {
    "rigid_body": ["steps=2^-3 .. 2^-9", "reference_step=2^-10"],
    # with weak noise only small steps show it, since the error of the drift alone has variance O(h^2)
    "maxwell_bloch": ["final_time=0.25", "steps=2^-4 .. 2^-10", "reference_step=2^-11"],
    "maxwell_bloch_weak_noise": [
        "model.sigma=[0.1, 0.1]",
        "initial=[1, 2, 3]",
        "final_time=0.25",
        "steps=2^-6 .. 2^-12",
        "reference_step=2^-13",
    ],
}


def variance_rates(system, scheme, reversals=None):
    """The rate for each function and its interval from the study, and from the four finest levels by hand."""
    p = levels_plan_of(case_of(*RATES[system], system=system.removesuffix("_weak_noise")), scheme)
    if reversals is not None:
        differences = [level._replace(grid=level.grid._replace(reversals=np.array(reversals))) for level in p.levels]
        p = replace(p, levels=(*differences[:-1], p.levels[-1]))
    found = p.results(after_blocks(p, 64)).group().arrays
    rates = [found[name] for name in ("level_variance_rate", "level_variance_rate_low", "level_variance_rate_high")]
    logarithms = np.log2(found["level_variance"][:, :4])
    return (*rates, np.polyfit(np.arange(4), logarithms.T, 1)[0])


@compiled_only
@pytest.mark.parametrize(
    "system", [name if name == "rigid_body" else pytest.param(name, marks=pytest.mark.slow) for name in RATES]
)
@pytest.mark.parametrize(
    ("scheme", "reversals", "expected"),
    [
        ("splitting", None, 1),
        ("splitting_order2", None, 2),
        # Negative controls: no antithetic paths; then antithetic ones with coins turned but increments in their order.
        ("splitting_order2", (AS_TOSSED,) * 4, 1),
        ("splitting_order2", (AS_TOSSED, COINS_TURNED) * 2, 1),
    ],
    ids=["splitting", "antithetic", "not antithetic", "coins turned only"],
)
def test_the_variance_of_a_level_falls_with_the_square_of_the_step_if_antithetic_and_else_linearly(
    system, scheme, reversals, expected
):
    rate, low, high, finest = variance_rates(system, scheme, reversals)
    bend = 0.25 if (system, scheme) == ("maxwell_bloch_weak_noise", "splitting") else 0.1
    assert np.all(np.abs(finest - expected) < bend)
    assert np.all((low - bend < expected) & (expected < high + bend))
    assert np.all(np.abs(rate - expected) < 2 * bend)
    assert np.all(low > 1.5) if expected == 2 else np.all(high < 1.5)


COARSE = ["steps=2^-2 .. 2^-4", "reference_step=2^-5"]


@functools.cache
def exact(system, scheme, reverse=False):
    """Without sampling: (values and their errors, arrays [function, h] from 2^-2 to 2^-5; the limits)."""
    case = case_of(*COARSE, system=system)
    words = compositions(SCHEMES[scheme].composition, case.model)
    if reverse:
        words = tuple((probability, flows[::-1]) for probability, flows in words)
    steps = [*case.steps, case.reference_step]
    found = expectations(case.model, words, case.initial, 1.0, steps, list(FUNCTIONS.values()), accuracy=1e-4)
    assert found.value_bound.max() < 2e-4
    return found.value, found.value_bound, found.limit


def deviations(found, stderr, value, error):
    """By how many standard errors estimates are off, the largest."""
    return (np.abs(found - value) / np.hypot(stderr, error)).max()


@pytest.mark.share(1)
@compiled_only
@pytest.mark.parametrize("scheme", SPLITTINGS)
@pytest.mark.parametrize("system", SYSTEMS)
def test_the_three_estimators_agree(system, scheme):
    """Differences to the reference, differences between levels, expectations; and for no other scheme."""
    case = case_of(*COARSE, "samples=131072", "seconds=0.3", system=system)
    in_plain, _ = results_of(case, scheme, "plain")
    levels, _ = results_of(case, scheme, "multilevel", levels_plan_of)
    level_stderr = np.sqrt(levels["level_variance"] / levels["level_samples"])

    def largest_deviations(value, error):
        errors = np.array(completed(case, scheme, (value[:, :-1] - value[:, -1:]).T)).T
        both = error[:, :-1] + error[:, -1:]
        between = (value[:, :-1] - value[:, 1:])[:, ::-1]
        return [
            deviations(in_plain["error"], in_plain["error_stderr"], errors, both),
            deviations(levels["error"], levels["error_stderr"], errors, both),
            deviations(levels["level_mean"], level_stderr, between, both),
            deviations(in_plain["expectation"], in_plain["expectation_stderr"], value[:, :-1], error[:, :-1]),
            deviations(levels["expectation"], levels["expectation_stderr"], value[:, :-1], error[:, :-1]),
        ]

    right = largest_deviations(*exact(system, scheme)[:2])
    assert max(right) < 4
    others = [(other, False) for other in SPLITTINGS if other != scheme]
    if scheme == "splitting":
        others.append((scheme, True))  # the same flows in reversed order
    for other in others:
        wrong = largest_deviations(*exact(system, *other[:1], reverse=other[1])[:2])
        assert min(wrong[:3]) > 10
        assert min(wrong[3:]) > 6
    # What the reference lacks is extrapolated by the order of the scheme, best at the smallest step.
    value, _, limit = exact(system, scheme)
    lacking = np.abs(value[:, -1] - limit)
    off = np.abs(levels["error"][:, -1] - (value[:, -2] - limit))
    assert np.all(off < 4 * np.hypot(levels["error_stderr"][:, -1], 1e-4) + 0.5 * lacking)


@pytest.mark.share(1)
@compiled_only
@pytest.mark.parametrize("scheme", ["splitting", "splitting_drift_first"])
@pytest.mark.parametrize("system", SYSTEMS)
def test_errors_by_differences_agree_with_those_without_sampling(system, scheme):
    """At all steps together, too; and neither for another scheme, nor without the error of the scheme of order 2."""
    case = case_of(*COARSE, "seconds=0.3", system=system)
    found, attributes = results_of(case, scheme, "multilevel")
    assert attributes["compared_with"] == "splitting_order2"

    def distances(errors, scheme):
        value, bound, limit = exact(system, scheme)
        return (errors - (value[:, :-1] - limit[:, np.newaxis])) / np.hypot(found["error_stderr"], bound[:, :-1])

    right = distances(found["error"], scheme)
    assert np.abs(right).max() < 4
    assert np.all((right**2).sum(axis=1) < 22)  # chi squared of three: above with probability 7e-5
    for other in SPLITTINGS:
        assert other == scheme or np.abs(distances(found["error"], other)).max() > 10
    assert np.abs(distances(found["difference_mean"], scheme)).max() > 6
    value, bound, _ = exact(system, scheme)
    assert deviations(found["expectation"], found["expectation_stderr"], value[:, :-1], bound[:, :-1]) < 4


@pytest.mark.parametrize(("scheme", "order", "other"), [("splitting", 1, 2), ("splitting_order2", 2, 1)])
def test_orders_without_sampling(scheme, order, other):
    case = case_of("steps=2^-3 .. 2^-7", "reference_step=2^-8", "functions=y1^2")
    found, attributes = results_of(case, scheme, "kolmogorov")
    assert found["resolved"].all()
    # Nothing is left to chance, so the interval says how straight the line is, not how near its slope to the order.
    assert abs(found["order"][0] - order) < 0.05
    assert found["order_high"][0] - found["order_low"][0] < 0.2
    assert not found["order_low"][0] <= other <= found["order_high"][0]
    assert attributes["estimator"] == "kolmogorov"
    model, words = case.model, compositions(SCHEMES[scheme].composition, case.model)
    direct = expectations(model, words, case.initial, 1.0, case.steps, [FUNCTIONS["square"]])
    assert np.array_equal(found["error"], direct.weak_error)
    assert np.array_equal(found["expectation"], direct.value)
    assert np.array_equal(found["limit"], direct.limit)


def test_errors_of_0_have_no_order():
    assert np.isnan(_order(np.array([0.5, 0.25, 0.125]), np.zeros(3), np.zeros(3)).order)
