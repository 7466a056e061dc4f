"""Statistics over time: by hand, against exact laws of a rotation about one axis, with the same bits however made."""

import math

import numpy as np
import pytest
from helpers import COMPILED, INITIAL, compiled_only
from scipy import stats
from states import check_going_on, chunks_of, finished, same_numbers
from weak_cases import stderr_by_hand

import spi
from spi.kinds.statistics import study
from spi.kinds.statistics.claims import quantities
from spi.kinds.statistics.results import Statistics
from spi.kinds.statistics.study import simultaneous
from spi.running.run import load
from spi.specs import SpecError
from spi.storage.records import Part

BODY = "{name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1, 1, 1]}"
#: A body with y_3 = 1 turns about its third axis by the angle W(t); with such moments nothing else moves it.
AXIS = "{name: rigid_body, inertia: [1e12, 1e12, 1e12], noise_inertia: [1, 1, 1], sigma: [0, 0, 1]}"
SPEC = f"""\
title: A title
kind: statistics
model: {BODY}
initial: [cos(1.1), 0, sin(1.1)]
final_time: 1
step: 2^-4
every: 2
schemes: [splitting]
samples: 100
seed: 3
functions:
  square: y1^2
  energy: H
  length: C1
  highest: {{maximum: y3}}
  lowest: {{minimum: y3}}
  area: {{integral: y3}}
  first: {{start: y3}}
  out: {{passage: "y1 < 0.4"}}
statistics: [mean, variance, covariance, quantiles, histogram]
"""


@pytest.fixture
def case_of(tmp_path):
    def case_of(*overrides):
        path = tmp_path / "s.yaml"
        path.write_text(SPEC, encoding="utf-8")
        return load(path, overrides=overrides).cases[0]

    return case_of


def plan_of(case, scheme="splitting"):
    return study.plan(case, Part(scheme))


def results_of(case, scheme="splitting"):
    plan = plan_of(case, scheme)
    return plan.results(finished(plan))


def test_statistics_are_those_of_the_paths(case_of):
    """Of every function by hand, from the paths that `spi.trajectory` gives."""
    case = case_of()
    found = results_of(case)
    model = {"name": "rigid_body", "inertia": [2, 1, "2/3"], "noise_inertia": [1, 2, 3], "sigma": [1, 1, 1]}
    paths = spi.trajectory(model, "splitting", initial=INITIAL, final_time=1, step=2**-4, every=2, samples=100, seed=3)
    y = np.moveaxis(paths.y.values, -1, 0)
    middle = np.concatenate((np.zeros((100, 1)), np.cumsum((y[2, :, 1:] + y[2, :, :-1]) / 16, axis=1)), axis=1)
    by_hand = {
        "square": y[0] ** 2,
        "energy": paths.hamiltonian.values,
        "length": (y**2).sum(axis=0),
        "highest": np.maximum.accumulate(y[2], axis=1),
        "lowest": np.minimum.accumulate(y[2], axis=1),
        "area": middle,
        "first": np.broadcast_to(y[2][:, :1], y[2].shape),
        "out": np.maximum.accumulate(y[0] < 0.4, axis=1),
    }
    assert found.functions == tuple(by_hand) and found.t.tolist() == paths.t.values.tolist()
    values = np.array(list(by_hand.values()), float)  # (F, paths, T)
    assert np.allclose(found.mean, values.mean(axis=1), atol=1e-13)
    assert np.allclose(found.variance, values.var(axis=1, ddof=1), rtol=1e-9, atol=1e-13)
    for t in range(len(found.t)):
        assert np.allclose(found.covariance[:, :, t], np.cov(values[:, :, t]), rtol=1e-9, atol=1e-13)
    assert np.allclose(found.mean_stderr[:, -1], [stderr_by_hand(of_one[:, -1]) for of_one in values], atol=1e-13)
    last, q = values[0, :, -1], found.quantiles
    assert (q.quantile_low[0, -1] <= np.quantile(last, q.level)).all()
    assert (np.quantile(last, q.level) <= q.quantile_high[0, -1]).all()
    assert np.abs(q.quantile[0, -1] - np.quantile(last, q.level, method="inverted_cdf")).max() < 0.05
    h = found.histogram
    assert np.allclose((h.density * h.bin_width[..., np.newaxis]).sum(axis=-1)[:7] + h.outside[:7], 1)
    edges = h.bin_low[0, -1] + h.bin_width[0, -1] * np.arange(65)
    assert np.allclose(h.density[0, -1], np.histogram(last, edges, density=False)[0] / 100 / h.bin_width[0, -1])


def test_bits_do_not_depend_on_the_division_of_the_work(case_of):
    case = case_of("samples=300", "functions={square: y1^2, out: {passage: y1 < 0.4}}")
    plan = plan_of(case)
    with chunks_of(2):
        whole = finished(plan)
        check_going_on(plan)
        assert same_numbers(finished(plan, 2), whole)
    few, many = (results_of(case_of(f"samples={n}", "functions=y1")) for n in (70, 200))
    assert np.array_equal(few.histogram.bin_low, many.histogram.bin_low)  # so that more samples go on with the counts


def test_results_are_written_and_read_and_judged(case_of):
    case = case_of("reference={length: 1 + 0*t}", "functions={length: C1, square: y1^2}")
    found = results_of(case)
    again = Statistics.of(found.group())
    assert np.array_equal(again.mean, found.mean) and again.histogram is not None
    assert np.array_equal(again.reference, found.reference, equal_nan=True)
    told = {(one.name, one.function): one for one in quantities([again])}
    of_values = {(name, f) for name in ("mean", "variance") for f in case.functions}
    assert told.keys() == of_values | {("deviation", "length")} | {("quantile", name) for name in case.quantile_names}
    median = told["quantile", "square, 0.5-quantile"]
    assert median.low < median.value == again.quantiles.quantile[1, -1, 1] < median.high
    assert told["mean", "square"].value == found.mean[1, -1]


def test_chosen_times_are_those_of_every(case_of):
    every, chosen = case_of(), case_of("every=1", "times=[1, 1/2]")
    one, other = results_of(every), results_of(chosen)
    assert chosen.stride == 8 and other.t.tolist() == [0.5, 1.0]
    kept = [i for i, name in enumerate(one.functions) if name in ("square", "energy", "first")]
    assert np.allclose(one.mean[kept][:, [4, 8]], other.mean[kept], atol=1e-14)


def test_a_band_holds_all_means_at_once():
    """For one mean it is 1.96 standard errors, for 16 independent ones the quantile of the largest of 16."""
    rng = np.random.default_rng(2)
    without = rng.standard_normal((64, 1, 16))
    alone = simultaneous(np.zeros((1, 1)), without[..., :1], np.ones((1, 1)))
    several = simultaneous(np.zeros((1, 16)), without, np.ones((1, 16)))
    same = simultaneous(np.zeros((1, 16)), np.repeat(without[..., :1], 16, axis=-1), np.ones((1, 16)))
    assert np.allclose([alone[0], same[0]], 1.96, atol=0.06)
    assert math.isclose(several[0], stats.norm.isf(0.5 * (1 - 0.95 ** (1 / 16))), abs_tol=0.12)


@compiled_only
def test_the_laws_of_a_rotation_about_one_axis(case_of):
    """Its angle is normal: the mean, the histogram and quantiles of y_1, and the first time when y_1 < 0."""
    about = f"model={AXIS}", "initial=[1, 0, 1]", "samples=40000", "final_time=2", "every=1", "step=2^-5"
    functions = "functions={y1: y1, square: y1^2, turned: {passage: y1 < 0}, remembered: {start: y1}}"
    found = results_of(case_of(*about, functions, "reference={y1: exp(-t/2), square: (1 + exp(-2*t))/2}"))
    assert np.nanmax(np.abs(found.deviation)) < 4
    assert np.abs(found.mean[0] - np.exp(-0.5 * found.t))[-1] > 0.1 * found.mean_stderr[0, -1]  # it is sampled
    turns = 2 * math.pi * np.arange(-4, 5)

    def below(x):
        """The distribution function of cos W(2)."""
        a = np.arccos(np.clip(x, -1, 1))[..., np.newaxis]
        sd = math.sqrt(2)
        return (stats.norm.cdf((2 * math.pi - a + turns) / sd) - stats.norm.cdf((a + turns) / sd)).sum(axis=-1)

    h = found.histogram
    edges = h.bin_low[0, -1] + h.bin_width[0, -1] * np.arange(65)
    expected = np.diff(below(edges)) * found.samples
    counts = h.density[0, -1] * h.bin_width[0, -1] * found.samples
    large = expected > 5
    assert stats.chisquare(counts[large], expected[large] * counts[large].sum() / expected[large].sum()).pvalue > 1e-3
    q = found.quantiles
    assert (below(q.quantile_low[0, -1]) <= q.level).all() and (q.level <= below(q.quantile_high[0, -1])).all()
    k = np.arange(40)
    odd = 2 * k + 1
    share = 1 - (4 / math.pi * (-1.0) ** k / odd * np.exp(-(odd**2) * found.t[-1] / 2)).sum()
    corrected, error = found.corrected.share[2, -1], found.corrected.share_stderr[2, -1]
    assert abs(corrected - share) < 3 * error + 0.008  # of order 1 in the time between two looks, 2^-5
    assert share - found.mean[2, -1] > 15 * found.mean_stderr[2, -1]  # what is monitored at some times comes too late


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("times=[0.3]", "no multiple of the step"),
        ("times=[2]", "must not exceed final_time"),
        ("quantiles=[1.5]", "quantiles"),
        ("every=3", "take 1, which divides both"),
        ("functions={phi: y4}", "functions.phi: is 'y4'"),
        ("functions={phi: C2}", "known are H, C1"),
        ("functions={phi: {passage: y1}}", "not a condition such as y1 > 0.5"),
        ("functions={phi: {passing: y1 > 1}}", "functions"),
        ("reference={psi: t}", "is not the name of a function"),
        ("reference={square: y1}", "must be an expression in t"),
        ("statistics=[median]", "statistics"),
        ("final_time=1.01", "is not a multiple"),
    ],
)
def test_mistakes_are_one_line(case_of, override, message):
    with pytest.raises(SpecError) as caught:
        case_of(override, *["every=1"] * override.startswith("times"))
    assert len(caught.value.messages) == 1 and message in str(caught.value)


@pytest.mark.slow
@pytest.mark.skipif(not COMPILED, reason="too many paths without the compiler")
def test_means_are_those_without_sampling(case_of):
    """At the same steps, by the backward equation of the same scheme on the sphere."""
    found = results_of(case_of("samples=200000", "functions={phi: sin(2*pi*y1), square: y1^2}", "statistics=[mean]"))
    spec = {
        "kind": "weak",
        "model": {"name": "rigid_body", "inertia": [2, 1, "2/3"], "noise_inertia": [1, 2, 3], "sigma": [1, 1, 1]},
        "initial": list(INITIAL),
        "final_time": 1,
        "steps": [2**-4, 2**-3],
        "reference_step": 2**-5,
        "functions": {"phi": "sin(2*pi*y1)", "square": "y1^2"},
        "schemes": ["splitting"],
        "estimators": ["kolmogorov"],
    }
    exact = spi.run(spec, out=None)["splitting"].expectation.sel(h=2**-4).values
    assert (np.abs(found.mean[:, -1] - exact) < 4 * found.mean_stderr[:, -1]).all()
