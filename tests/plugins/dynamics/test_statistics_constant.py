"""Statistics of what is constant up to rounding: that constant, and nothing that is made of roundings."""

from dataclasses import replace

import numpy as np
import pytest
from filled_results import filled
from helpers import loop_in_python, printed
from states import finished
from statistics_cases import results_of, written

from spi import views
from spi.plugins.dynamics.kinds.statistics import study
from spi.plugins.dynamics.kinds.statistics.figure import PANELS
from spi.running.load import load
from spi.statistics.claims import CONFIRMED, CONSISTENT, INCONCLUSIVE, judge, quantities
from spi.statistics.rounding import rounding
from spi.storage import Part, StoredResults

ENSTROPHY = 0.4725  # that of the issue
FUNCTIONS = "functions={enstrophy: 0.4725*(y1^2+y2^2+y3^2), gone: C1 - 1, square: y1^2, tail: 1 + tanh(100*(2 - y1))}"
CONSTANT, TAIL = [0, 1], 3
SPEC = """\
title: A fluid
kind: statistics
model: {name: zeitlin, n: 3, noise: {shell: 1, sigma: 1/4, hamiltonian: linear}}
initial: {random: {spectrum: "k^4*exp(-k^2/6)", energy: 0.025, seed: 1}}
final_time: 1
step: 2^-3
schemes: [splitting_symmetric]
samples: 64
seed: 3
functions: {enstrophy: C1, energy: H}
statistics: [mean, variance]
"""


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    more = "reference={enstrophy: 0.4725, gone: 0}", "autocorrelation={enstrophy: 1/2, square: 1/2}"
    more += ("time_correlations={until: 1/2}", "final_time=4", "every=1")
    return results_of(written(tmp_path_factory.mktemp("constant"), FUNCTIONS, *more))


def test_means_and_quantiles_are_the_constant(found):
    for f, value in zip(CONSTANT, (ENSTROPHY, 0.0), strict=True):
        assert np.abs(found.mean[f] - value).max() < 1e-14
        assert (found.mean[f, 1:] == found.quantiles.quantile[f, 1:].T).all()
        low, mean, high = (found.get(name)[f, -1] for name in ("mean_low", "mean", "mean_high"))
        bound = rounding(2 * ENSTROPHY if f == 0 else 2.0, 64)
        assert low <= value <= high and 0.1 * bound < high - mean < 2 * bound
        assert (found.quantiles.quantile_low[f, -1] < mean).all() and (
            mean < found.quantiles.quantile_high[f, -1]
        ).all()
    assert found.quantiles.quantile[2, -1, -1] > found.quantiles.quantile[2, -1, 0] + 0.1  # control


def test_no_deviation_is_made_of_roundings(found):
    assert np.abs(found.deviation[CONSTANT]).max() < 1.0
    assert (np.abs(found.difference[CONSTANT]).max() > 0) and np.isfinite(found.deviation[CONSTANT]).all()


def test_nothing_that_is_made_of_roundings_is_told(found):
    assert np.isnan(found.autocorrelation[0]).all() and np.isfinite(found.autocorrelation[2, -1])
    assert np.isnan(found.histogram.density[CONSTANT, 1:]).all() and np.isfinite(found.histogram.density[2]).all()
    for name in ("correlation", "integral", "spectrum", "correlation_half"):
        values = getattr(found.time, name)
        assert np.isnan(values[CONSTANT]).all() and np.isfinite(values[2]).all()
    assert (found.variance[CONSTANT] >= 0).all() and (found.variance[CONSTANT] < 1e-28).all()
    assert (found.variance_stderr[CONSTANT, 1:] > 1e-30).all()
    remarks = [line.strip() for line in found.remarks() if "constant" in line]
    assert len(remarks) == 2 and remarks[0].startswith("enstrophy is constant up to rounding (")
    assert 1e-17 < float(remarks[0].split("(")[1].rstrip(")")) < 1e-14


def test_a_tail_that_no_path_has_reached_is_no_constant(found):
    assert not found.is_constant[TAIL] and found.is_constant[CONSTANT].all() and not found.is_constant[2]
    assert np.isnan(found.mean_stderr[TAIL, 1:]).all()


def test_a_wrong_reference_is_seen(tmp_path):
    found = results_of(written(tmp_path, FUNCTIONS, "reference={enstrophy: 0.4725 + 1e-12, gone: 1e-12}"))
    assert np.abs(found.deviation[CONSTANT, 1:]).min() > 3


def test_the_enstrophy_of_a_fluid(tmp_path):
    (tmp_path / "s.yaml").write_text(SPEC, encoding="utf-8")
    plan = study.plan(load(tmp_path / "s.yaml").cases[0], Part("splitting_symmetric"))
    with loop_in_python():
        found = plan.results(finished(plan))
    assert found.is_constant.tolist() == [True, False]
    assert 0 < found.mean_stderr[0, -1] < 1e-13 < 1e-6 < found.mean_stderr[1, -1]
    assert found.variance[0, -1] < 1e-28


def test_a_figure_says_that_a_constant_is_one_and_shows_nothing_of_its_roundings(found):
    looks = {found.about.variant: ("o", "#000000")}
    plots = {
        name: [plot for panel in panels for plot in panel.expand([found], looks)] for name, panels in PANELS.items()
    }
    same, square = plots["mean"][0], plots["mean"][2]
    assert plots["mean"].pop() == "bands of means: 95 % for all times together"
    unseen = [*PANELS["mean"][1].expand([replace(found, mean_stderr=found.mean_stderr / 1e4)], looks)]
    assert unseen == []  # bands that are as thin as their lines
    assert same.text.startswith(r"$\mathrm{E}\,[\mathrm{enstrophy}]$ conserved")
    (constant,) = same.panels
    line = constant.series[0]
    assert (line.y == found.mean[0, 0]).all() and line.low is None and len(constant.series) == 2  # and the reference
    assert np.ptp(square.series[0].y) > 0.01 and square.series[0].low is not None and len(square.series) == 4
    assert not plots["difference"]
    of_square = {
        name: [plot for plot in each if "square" in getattr(plot, "title", "")] for name, each in plots.items()
    }
    for name in ("histogram", "variance", "autocorrelation", "time_correlation", "integral", "spectrum"):
        assert len(of_square[name]) == 1 and not any("enstrophy" in plot.title for plot in plots[name])


def test_no_claim_about_a_constant_is_contradicted_by_rounding(tmp_path):
    claims = "expect={splitting: {mean: 0.4725, quantile: 0.4725, variance: 0, autocorrelation: 1, deviation: 3}}"
    more = "functions={enstrophy: 0.4725*(y1^2+y2^2+y3^2)}", "reference={enstrophy: 0.4725}"
    case = written(tmp_path, *more, "autocorrelation={enstrophy: 1/2}", claims)
    verdicts = {one.claim.quantity: one.verdict for one in judge(case.claims, quantities([results_of(case)]))}
    near = {"mean": CONSISTENT, "quantile": CONSISTENT, "variance": CONSISTENT}
    assert verdicts == near | {"autocorrelation": INCONCLUSIVE, "deviation": CONFIRMED}


def test_of_stationary_paths_spectra_are_shown_first_and_each_mean_once():
    results = StoredResults({"kind": "statistics", "title": ""}, (filled("statistics"),))
    (reading,) = views.readings(results)
    assert [*reading.shown_places] == [(0, 3), (1, 3)]
    text = printed(results)
    assert text.index("structure factor") < text.index("correlations in time") < text.index("mean (95 %)")
    moving = replace(reading, time=None, rounding=None)
    assert len([*moving.shown_places]) == 2 * 4
