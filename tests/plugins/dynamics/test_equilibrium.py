"""Means over time at equilibrium: what is recorded, errors, warnings, orders, and keys."""

import io
import re
from dataclasses import replace
from types import SimpleNamespace

import long_cases
import numpy as np
import pytest
from helpers import compiled_only, printed
from long_cases import RIGID, initial_rows
from states import finished

from spi import views
from spi.ensemble.increments import brownian
from spi.ensemble.loop import grid, integrated
from spi.ensemble.observer import state_recorder
from spi.ensemble.protocol import hamiltonian
from spi.numerics.rng import LANES
from spi.plugins.dynamics.kinds.equilibrium import study as equilibrium
from spi.plugins.dynamics.kinds.equilibrium.figure import PANELS
from spi.plugins.dynamics.kinds.equilibrium.means import SnapshotSeries, _order
from spi.plugins.dynamics.kinds.equilibrium.references import known_laws
from spi.plugins.dynamics.kinds.equilibrium.results import Equilibrium, step_for
from spi.running import shipped
from spi.running.run import load
from spi.schemes import scheme_entry
from spi.specs import SpecError
from spi.statistics.claims import quantities
from spi.storage import Order, Part, StoredResults

# fixtures
load_text, case_of = long_cases.load_text, long_cases.case_of

ALL = ("growth", "means", "histogram", "autocorrelation", "heat", "acceptance")
LONG = (
    RIGID.replace("kind: growth", "kind: equilibrium")
    .replace("step_count: 640", "final_time: 96")
    .replace("[1/8, 1/4]", "[1/4, 1/8]")
)
LONG += "functions: {height: y3, H: H}\nburn_in: 8\nspacing: 3/4\nbins: 8\n"


def averages(plan):
    return plan.results(finished(plan)).averages


@compiled_only
def test_averages_are_those_of_the_recorded_series(load_text):
    """Of a run in one go whose states are all known, and of formulas written out."""
    case = load_text(LONG, "samples=70", "steps=[1/4]").cases[0]
    plan = equilibrium.plan(case, Part("splitting"))
    found, series = averages(plan), SnapshotSeries.of(case, 0)
    assert (series.stride, series.total, series.used, series.lags) == (3, 128, 112, 16)
    assert found.kept == 112 and found.spacing == 0.75 and found.lag[:2].tolist() == [0, 0.75]
    scheme, times = scheme_entry("splitting").record, grid(1 / 4, 384)
    rows = np.empty((2, 129, 3 * LANES))
    start = initial_rows(scheme, case.model, case.initial, 2)[:, np.newaxis]
    noise = brownian(3)
    integrated(scheme, case.model, start, times, noise, 0, 2, 70, state_recorder(times, rows, 3))
    y = rows[:, 1:].reshape(2, 128, 3, LANES).transpose(2, 1, 0, 3).reshape(3, 128, -1)[:, 16:, :70]
    for f, x in enumerate((y[2], hamiltonian(case.model, tuple(y)))):
        mean, of_paths = x.mean(), x.mean(axis=0)
        assert found.average[0, f] == pytest.approx(mean, abs=1e-13)
        assert found.stderr_paths[0, f] == pytest.approx(of_paths.std(ddof=1) / np.sqrt(70), rel=1e-9)
        drift = x[56:].mean(axis=0) - x[:56].mean(axis=0)
        assert found.halves[0, f] == pytest.approx(drift.mean() / (drift.std(ddof=1) / np.sqrt(70)), rel=1e-8)
        batches = x.reshape(16, 7, 70).mean(axis=1)
        assert found.stderr_batches[0, f] == pytest.approx(batches.std(ddof=1) / np.sqrt(16 * 70), rel=1e-8)
        d = x - mean
        covariance = np.array([(d[lag:] * d[: 112 - lag]).mean() for lag in range(16)])
        lacking = found.variance[0, f] - covariance[0]  # the variance of the mean
        assert 0 < lacking < 3 * found.stderr_tau[0, f] ** 2
        np.testing.assert_allclose(found.correlation[0, f] * found.variance[0, f], covariance + lacking, atol=1e-13)
        edges = found.cell_low[0, f] + found.cell_width[0, f] * np.arange(9)
        wanted, _ = np.histogram(x, edges)
        np.testing.assert_allclose(found.density[0, f], wanted / x.size / found.cell_width[0, f], rtol=1e-12)
        assert wanted.sum() == x.size
        tau = found.tau[0, f] / 0.75
        assert found.stderr_tau[0, f] == pytest.approx(np.sqrt(2 * tau * found.variance[0, f] / x.size))


@compiled_only
@pytest.mark.parametrize("samples", [12, 1])
def test_intervals_hold_the_exact_value(load_text, samples):
    """Of the uniform law; benchmarks/intervals.py does the same with 1000 runs and other laws."""
    runs, time = 60, 512 if samples > 1 else 2048
    case = load_text(LONG, f"samples={samples}", "steps=[1]", f"final_time={time}", "spacing=1", "burn_in=32").cases[0]
    cases = [case.model_copy(update={"seed": seed}) for seed in range(1, runs + 1)]
    found = [averages(equilibrium.plan(one, Part("splitting"))) for one in cases]
    off = np.array([one.average[0] for one in found]) - [0.0, (0.5 + 1.0 + 1.5) / 6]
    half = np.array([one.average_half[0] for one in found])
    for f in range(2):
        held = (np.abs(off[:, f]) <= half[:, f]).sum()
        assert held >= 0.95 * runs - 4.5 * np.sqrt(runs * 0.95 * 0.05)
        assert (np.abs(off[:, f]) <= 0.3 * half[:, f]).sum() < 0.7 * runs  # negative control
    z = off.mean(axis=0) / (off.std(axis=0, ddof=1) / np.sqrt(runs))
    assert np.abs(z).max() < 4.5


@compiled_only
def test_a_mean_of_very_few_values_has_an_interval(load_text):
    """Times that few values make negative are no shorter than those of independent values: 40 runs of 6 values."""
    keys = "samples=1", "steps=[1/16]", "final_time=8", "spacing=1", "burn_in=2"
    case = load_text(LONG, *keys).cases[0]
    cases = [case.model_copy(update={"seed": seed}) for seed in range(1, 41)]
    found = [averages(equilibrium.plan(one, Part("splitting"))) for one in cases]
    tau, half = (np.array([getattr(one, name)[0] for one in found]) for name in ("tau", "average_half"))
    least = np.array([one.stderr_tau[0] / np.sqrt(one.variance[0] / 6) for one in found])
    assert (tau >= 0).all() and (tau == 0).any() and np.isfinite(half).all() and (half > 0).all()
    assert least.min() > 1 - 1e-12
    reading = equilibrium.plan(cases[0], Part("splitting"))
    text = printed(StoredResults({"kind": "equilibrium", "title": ""}, (reading.results(finished(reading)).group(),)))
    assert "≤ " in text and "inf" not in text


@compiled_only
def test_equal_paths_tell_as_much_as_one(load_text):
    """70 paths without noise: the mean, tau and the quantities that follow have the errors of one path."""
    keys = "model.sigma=[0, 0, 0]", "schemes=[splitting_symmetric]", "steps=[1/4]"
    keys += ("derived={twice: 2*height, constant: 3 + 2*casimir}",)
    text = LONG.replace("functions: {", "functions: {casimir: C1, ")
    cases = [load_text(text, *keys, f"samples={n}").cases[0] for n in (70, 1)]
    plans = [equilibrium.plan(case, Part("splitting_symmetric")) for case in cases]
    many, one = (plan.results(finished(plan)) for plan in plans)
    height = 1
    for name in ("average_half", "stderr_tau", "stderr_batches", "tau_stderr", "variance_stderr"):
        values = [getattr(found.averages, name)[0, height] for found in (many, one)]
        assert values[0] == pytest.approx(values[1], rel=1e-6) and values[0] > 0
    assert np.isnan(many.averages.halves[0, height]) == np.isnan(one.averages.halves[0, height])
    text = " ".join([*many.remarks(), printed(StoredResults({"kind": "equilibrium", "title": ""}, (many.group(),)))])
    assert "inf" not in text and "± ?" not in text
    stderr = np.array([found.averages.quantities.stderr[0] for found in (many, one)])
    np.testing.assert_allclose(stderr[0], stderr[1], rtol=1e-6)
    assert stderr[0, 0] > 1e-4 and stderr[0, 1] < 1e-12


@compiled_only
def test_few_paths_that_carry_a_mean_are_told(load_text):
    """1 / (1 - y3)^2 has no mean under the uniform law; y3 and H have no line about that."""
    text = LONG.replace("functions: {", "functions: {far: 1/(1 - y3)^2, ")
    plan = equilibrium.plan(load_text(text, "steps=[1/4]", "samples=256").cases[0], Part("splitting"))
    lines = [line for line in plan.results(finished(plan)).remarks() if "heavy tails" in line]
    assert len(lines) == 1 and ", far, h = 0.25: heavy tails: few samples carry the variance, so that" in lines[0]


@compiled_only
def test_roundings_of_casimirs_are_not_tested_and_a_drift_is(load_text):
    """Splitting preserves C1; the Euler-Maruyama scheme does not."""
    case = load_text(LONG, "steps=[1/8]", "final_time=24", "schemes=[splitting, euler_maruyama]").cases[0]
    plans = [equilibrium.plan(case, Part(scheme)) for scheme in ("splitting", "euler_maruyama")]
    exact, moving = (plan.results(finished(plan)) for plan in plans)
    assert 0 < exact.rounding[0, 0] == exact.casimir_worst[0, -1, 0] < 1e-13 and np.isnan(exact.bias_deviation).all()
    assert abs(exact.bias[0, 0]) < 1.96 * exact.bias_stderr[0, 0] and exact.bias_stderr[0, 0] < 1e-13
    assert moving.rounding is None and moving.bias_deviation[0, 0] > 3
    results = StoredResults({"kind": "equilibrium", "title": ""}, (exact.group(),))
    text = printed(results)
    assert "Casimir functions: constant up to rounding" in text and "bias/step" not in text
    views.print_tables(results, whole := io.StringIO(), everything=True)
    assert "bias/step" in whole.getvalue() and "in std." not in whole.getvalue()
    assert "bias/step" in printed(results._replace(groups=(moving.group(),)))


@pytest.mark.parametrize("finest", [False, True])
def test_the_order_of_a_bias(finest):
    h, error, generator = 2.0 ** -np.arange(5), 2e-6, np.random.default_rng(4)
    noise = 8 * error * generator.standard_normal((64, 5))
    noise -= noise.mean(axis=0)
    mean = 0.3 - 0.02 * h**2 + 8 * noise.mean(axis=0)
    case, reference = SimpleNamespace(steps=tuple(h), samples=512), float(mean[-1]) if finest else 0.3
    order, constant = _order(case, finest, reference, mean, mean - noise / 63, np.full(5, error))
    assert order.low < 2.0 < order.high and order.order == pytest.approx(2.0, abs=0.1)
    assert constant == pytest.approx(-0.02, rel=0.05)


@compiled_only
def test_results_survive_a_file(load_text):
    plan = equilibrium.plan(load_text(LONG).cases[0], Part("splitting"))
    reading = plan.results(finished(plan))
    again = Equilibrium.of(reading.group())
    assert again.averages.functions == ("height", "H") and again.averages.temperature == np.inf
    np.testing.assert_array_equal(again.averages.correlation, reading.averages.correlation)
    assert len(again.averages.order) == 2 and np.isnan(again.averages.order[0].order)
    assert reading.steps_each == 384


@compiled_only
def test_tables_and_figures_tell_what_is_known_and_what_is_doubtful(load_text):
    """Eight paths that are too short and begin at one state, a wrong reference, and one that is the finest step."""
    keys = ("samples=8", "reference={height: 1/2, H: finest}", "burn_in=0", "accuracy=1e-3", "panels=[growth, means]")
    case = load_text(LONG, *keys).cases[0]
    plan = equilibrium.plan(case, Part("splitting"))
    reading = plan.results(finished(plan))
    results = StoredResults({"kind": "equilibrium", "title": "Means"}, (reading.group(),))
    text = printed(results)
    assert "means over time" in text and "bias (95 %)" in text and "heat capacity" not in text
    assert "autocorrelation times, fewer than 50; run longer" in text
    assert "paths of time" in text and "for an accuracy of 0.0010" in text
    fig = views.figure(results)
    assert all(r"\overline" in ax.get_ylabel() and "reference" in ax.get_ylabel() for ax in fig.axes[-2:])
    told = {one.name: one for one in quantities([reading])}
    assert {"average", "tau", "halves", "deviation"} <= set(told) and "heat_capacity" not in told
    deviations = [one for one in quantities([reading]) if one.name == "deviation"]
    assert [one.h for one in deviations if one.function == "height"] == [0.25, 0.125]
    assert max(one.value for one in deviations if one.function == "height") > 4.5
    every = views.figure(results._replace(groups=(replace(reading, panels=ALL).group(),)))
    assert len(every.axes) == 1 + 2 * 3 and len(views.rows(results)) == 2 * 2
    gone = replace(reading, panels=("histogram",), nonfinite=np.ones_like(reading.nonfinite))
    with pytest.raises(ValueError, match="no panel that could be drawn"):
        views.figure(results._replace(groups=(gone.group(),)))


def test_the_step_for_a_bias():
    unknown = Order(np.nan, np.nan, np.nan, 0)
    told = {"constant": np.array([-0.02, np.nan]), "order": (Order(2.0, 1.9, 2.1, 5), unknown)}
    errors = {"bias": np.array([[0.1, 0.1], [0.1, 1e-4], [0.1, 1e-5]]), "bias_half": np.full((3, 2), 2e-4)}
    what = SimpleNamespace(h=np.array([1.0, 0.5, 0.25])), SimpleNamespace(**told, **errors)
    assert step_for(*what, 0, 2e-4)[0] == pytest.approx(0.1)
    assert step_for(*what, 1, 1e-3) == (0.5, "no bias is seen there")
    assert step_for(*what, 1, 1e-5) == (0.25, "the smallest here, its bias is not known")


@pytest.mark.needs("systems")
def test_of_many_spheres_what_is_not_known_is_left_out_or_refused(tmp_path):
    """The energy of a ring of four spins has mean and variance, but no histogram; a product of three has no mean."""
    path = shipped.folder() / "spin_ring_equilibrium.yaml"
    case = load(path, "quick").cases[0]
    found = known_laws(case, [np.linspace(-4, 4, 6) * np.ones((3, 1))])
    assert np.isfinite([found.value, found.error, found.variance]).all() and np.isnan(found.shares).all()
    assert -4 < found.value[0] < -2 and found.variance[0] > 0.5
    with pytest.raises(SpecError, match="reference: is 'exact', but means on many spheres are known of polynomials"):
        load(path, "quick", ["functions.across=x(1)*x(2)*x(3)"])


def test_what_is_not_given(load_text):
    case = load_text(LONG.replace("functions: {height: y3, H: H}\nburn_in: 8\nspacing: 3/4\n", "")).cases[0]
    assert case.functions == {"H": "H"} and case.between == 0.25 and case.burnt == pytest.approx(19.2)
    assert case.panels == ("means", "histogram", "autocorrelation")
    long = load_text(LONG.replace("spacing: 3/4\n", ""), "final_time=2^14").cases[0]
    assert long.between == 4 and SnapshotSeries.of(long, 0).stride == 16 and SnapshotSeries.of(long, 1).stride == 32


@pytest.mark.needs("systems")
def test_references_name_parameters_the_temperature_and_each_other(load_text):
    hot = LONG.replace("sigma: [1, 1, 1]}", "sigma: [1, 1, 1]}\ntemperature: 1/4")
    parameters = "parameters: {a: 3}, algebra: so(3), hamiltonian: a*y1^2, noises: [y1, y2, y3], sigma: [1, 1, 1]}"
    text = re.sub(r"model: \{.*", f"model: {{{parameters}", hot)
    case = load_text(text, "schemes=[splitting]", "reference={height: a*T, H: height^2 + 1}").cases[0]
    known = known_laws(case, [np.zeros((2, 2))])
    np.testing.assert_array_equal(known.value, [0.75, 1.5625])


@compiled_only
def test_what_is_constant_has_no_autocorrelation_time(load_text):
    """C1 - 1 is 1e-15 or so along paths: no time, no deviation, no warning; H has all three sizes."""
    overrides = ["schemes=[splitting]", "steps=[1/4]", "samples=64"]
    text = RIGID.replace("kind: growth", "kind: equilibrium").replace("step_count: 640", "final_time: 256")
    text += "functions: {casimir: C1 - 1, H: H}\nreference: {casimir: 0}\n"
    plan = equilibrium.plan(load_text(text, *overrides).cases[0], Part("splitting"))
    found = plan.results(finished(plan))
    averages = found.averages
    assert 0 < averages.variance[0, 0] < 1e-26
    assert np.isnan(averages.tau[0, 0]) and np.isnan(averages.halves[0, 0]) and averages.tau[0, 1] > 0
    assert abs(averages.deviation[0, 0]) < 2
    remarks = [line for line in found.remarks() if "casimir" in line]
    assert len(remarks) == 1 and "casimir is constant up to rounding (" in remarks[0]
    looks = {found.about.variant: ("o", "#000000")}
    for panels in ("histogram", "autocorrelation"):
        shown = [plot for panel in PANELS[panels] for plot in panel.expand([found], looks)]
        assert len(shown) == 1 and "casimir" not in shown[0].title
