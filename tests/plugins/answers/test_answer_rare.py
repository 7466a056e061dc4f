"""Intervals of functions whose rare values few samples show, or none: means of a normal q, which are known."""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from spi.api.specs import of_mapping
from spi.expressions import canonical, parse_expression
from spi.expressions.summands import hidden_summands
from spi.numerics.rng import LANES
from spi.plugins.answers.kinds.answer import study
from spi.plugins.answers.kinds.answer.planner import MeanTerm, sampling_error
from spi.statistics.estimators import GROUPS, with_powers
from spi.statistics.tallies import Batch

MODEL = {"variables": ["q", "p"], "bracket": {"q p": 1}, "hamiltonian": "(q^2 + p^2)/2", "noises": ["q"], "sigma": [1]}
SPREAD = math.sqrt(0.5 - math.sin(2.0) / 4.0)  # of q(1), from (0, 0)
C = SPREAD * float(norm.isf(1e-4))  # P(q > C) = 1e-4


def mean(f, *places):
    """E f(q)."""
    ends = (-12.0 * SPREAD, *sorted(places), 12.0 * SPREAD)
    return sum(
        quad(lambda q: f(q) * norm.pdf(q, scale=SPREAD), *part, epsabs=1e-13, limit=200)[0] for part in pairwise(ends)
    )


def plan_of(function):
    data = {"kind": "answer", "model": MODEL, "functions": function, "initial": [0, 0], "final_time": 1}
    (case,) = of_mapping({**data, "accuracy": 1e-3, "sampling": True}, "answer").cases
    return study.plan(case, study.parts(case)[0])


def answers(function, paths, seeds=40):
    """(seeds,) values and half widths of means over q alone, infinite where they are not resolved."""
    plan, found = plan_of(function), []
    for seed in range(seeds):
        q = SPREAD * np.random.default_rng(seed).standard_normal(paths)
        values = np.array([phi(np.array([q, 0.0 * q])) for phi in plan.phis])
        blocks = values.reshape(len(values), -1, LANES).transpose(1, 0, 2)
        sums = with_powers(np.zeros((4, len(values), GROUPS)), blocks, Batch(0, 0, len(blocks), paths))
        totals = plan.empty(0)._replace(sums=sums[:, np.newaxis], paths=paths)
        of_all = MeanTerm(1.0, plan._spread_of_all(totals, -1), paths)
        own = of_all._replace(spread=of_all.spread.with_hidden(plan.owners))
        _, half, _ = sampling_error([own])
        unresolved = own.spread.unknown | plan._few([of_all])
        found.append((own.spread.mean[0], np.inf if unresolved[0] else half[0]))
    return np.array(found).T


def bell(q, at=2.2, width=0.01):
    return math.exp(-(((q - at) / width) ** 2))


BOUNDED = {
    "exp(-((q - 2.2)/0.01)^2)": mean(bell, 2.1, 2.2, 2.3),
    f"(1 + tanh(100*(q - {C!r})))/2": mean(lambda q: (1.0 + math.tanh(100.0 * (q - C))) / 2.0, C - 0.2, C, C + 0.2),
    f"q + 100*(q > {C!r})": 1e-2,
    f"q^2 + 50*(1 + tanh(100*(q - {C!r})))": SPREAD**2
    + mean(lambda q: 50.0 * (1.0 + math.tanh(100.0 * (q - C))), C - 0.2, C, C + 0.2),
    f"max(q > 0, 100*(q > {C!r}))": 0.5 + 99e-4,
    f"sin(q + 100*(q > {C!r}))": mean(lambda q: math.sin(q + 100.0 * (q > C)), C),
    f"q > {C!r}": 1e-4,
    "1/(1 + ((q - 2)/0.001)^2)": mean(lambda q: 1.0 / (1.0 + ((q - 2.0) / 0.001) ** 2), 1.99, 2.0, 2.01),
}


@pytest.mark.parametrize("paths", [2**10, 2**13, 2**16])
@pytest.mark.parametrize("function", BOUNDED)
def test_intervals_hold_what_no_sample_shows(function, paths):
    """Of 40 means at least 36, as 38 are meant to; without the rule of three for rare values hardly one would."""
    value, half = answers(function, paths)
    assert np.isfinite(half).all()
    assert (np.abs(value - BOUNDED[function]) <= half).sum() >= 36


@pytest.mark.parametrize(
    "function", ["exp(20*(q - 2))", f"q*(1 + 100*(q > {C!r}))", "q + exp(20*(q - 2))", "q*(q > 3)"]
)
def test_what_a_few_samples_carry_is_not_resolved(function):
    for paths in (2**10, 2**13):
        assert np.isinf(answers(function, paths)[1]).sum() >= 38


@pytest.mark.parametrize("s", [1.0, 2.0, 4.0, 6.0])
def test_of_heavy_tails_few_intervals_are_printed_that_are_too_short(s):
    """E exp(s q), the more so the heavier: those that are printed and wrong are at most 5 % and 3 standard errors."""
    for paths in (2**10, 2**14):
        value, half = answers(f"exp({s}*q)", paths, 100)
        wrong = np.isfinite(half) & (np.abs(value - math.exp(0.5 * (s * SPREAD) ** 2)) > half)
        assert wrong.sum() <= 11


@pytest.mark.parametrize("function", ["sin(2*q) + p", "q^2", "cos(q + p)", "exp(-q^2)", "tanh(q)", "q > 0.2"])
def test_ordinary_functions_keep_their_intervals(function):
    """1.96 standard errors, within the 1.5 % for the skewness of cos, and nothing is hidden."""
    plan = plan_of(function)
    assert not plan.hidden
    value, half = answers(function, 2**14, 4)
    q = SPREAD * np.random.default_rng(0).standard_normal(2**14)
    true = plan.phis[0](np.array([q, 0.0 * q])).std() / 2**7
    assert half[0] == pytest.approx(1.96 * true, rel=0.02) and value[0] == pytest.approx(value[1], abs=8 * true)


def test_summands_that_may_hide_rare_values():
    def hidden(text):
        return [canonical(part) for part in hidden_summands(parse_expression(text, 2))]

    assert hidden("y1 + 100*(y1 > 3)") == ["100*(y1 > 3)"]
    assert hidden("y1*(1 + 100*(y1 > 3))") == ["100*(y1 > 3)*y1"]
    assert hidden("(1 + tanh(100*(y1 - 3)))/2") == hidden("sin(2*y1) + y2") == hidden("exp(-y1^2)") == []
    assert hidden("y1 - 5*(y1 > 3) + max(y1, 2)") == ["-(5*(y1 > 3))", "max(y1, 2)"]
    assert hidden("2*y1 + sum((y(i) > i) for i = 1..2)") == ["y1 > 1", "y2 > 2"]
    assert len(hidden("y1 + sum((y1 > i) for i = 1..20)")) == 1
