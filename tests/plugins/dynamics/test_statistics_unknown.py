"""Statistics of what is not finite, of few paths, and of what all paths have alike: only what is known is told."""

import io

import numpy as np
import pytest
from helpers import loop_in_python
from scipy import stats
from statistics_cases import results_of, written

import spi
from spi.printing import new_console
from spi.printing.rows import tables_of
from spi.printing.tables import printed, show_items
from spi.statistics.claims import quantities

pytestmark = pytest.mark.filterwarnings("error")


@pytest.fixture
def case_of(tmp_path):
    return lambda *overrides: written(tmp_path, *overrides)


def shown(found):
    """The table as text."""
    text = io.StringIO()
    show_items(new_console(text), printed("", [found]))
    return text.getvalue()


def test_rows_that_are_not_finite_stay_and_say_how_many_paths_are(case_of):
    """Quantiles are those of the finite paths, by hand from the paths of the seed."""
    functions = "functions={l: log(y3 - 0.85), high: {maximum: log(y1)}, none: 1/(y1 - y1), huge: exp(1000*y3), y1: y1}"
    found = results_of(case_of(functions, "samples=200"))
    y = spi.trajectory(
        {"name": "rigid_body", "inertia": [2, 1, "2/3"], "noise_inertia": [1, 2, 3], "sigma": [1, 1, 1]},
        "splitting", initial=["cos(1.1)", 0, "sin(1.1)"], final_time=1, step=2**-4, every=2, samples=200, seed=3,
    ).y.values  # fmt: skip
    with np.errstate(all="ignore"):
        values = np.log(y[:, :, 2] - 0.85)
    share = np.isfinite(values).mean(axis=0)
    assert np.allclose(found.finite[0], share) and 0.2 < share[-1] < 0.9 and (found.finite[4] == 1).all()
    assert np.isnan(found.mean[0, share < 1]).all() and not found.finite[2].any()
    last = values[np.isfinite(values[:, -1]), -1]
    q = found.quantiles
    expected = np.quantile(last, q.level, method="inverted_cdf")
    assert np.abs(q.quantile[0, -1] - expected).max() < 0.1
    assert (q.quantile_low[0, -1] <= expected).all() and (expected <= q.quantile_high[0, -1]).all()
    assert np.isnan(q.quantile[2]).all()
    text, rows = shown(found), next(iter(tables_of([found]).values())).rows
    assert f"{share[-1]:g}" in text and "finite share: of the paths" in text and "quantiles are those" in text
    assert len(rows) == 5 * 9 and rows[8]["finite"] == share[-1] and np.isnan(rows[8]["mean"])
    assert not any(one.function == "l" and one.value == one.value for one in quantities([found]) if one.name == "mean")


@pytest.mark.parametrize("samples", [1, 2, 7])
def test_few_paths_tell_no_errors(case_of, samples):
    found = results_of(case_of(f"samples={samples}", "functions={y1: y1, out: {passage: y1 < 0.4}}"))
    assert np.isnan(found.variance[0]).all() == (samples == 1)
    assert np.isnan(found.mean_stderr[:, 1:]).all() and np.isnan(found.variance_stderr).all()
    assert np.isnan(found.mean_low[0, 1:]).all() and not found.mean_stderr[:, 0].any()  # the initial state is known
    share, left = (
        found.mean[1, -1],
        2 * found.passages.left[1, -1] + 1e-12,
    )  # a sum of probabilities, no whole number of paths
    count = np.clip([np.floor((share - left) * samples), np.ceil((share + left) * samples)], 0, samples).astype(int)
    below, above = (stats.binomtest(int(n), samples).proportion_ci() for n in count)
    assert below.low - left <= found.mean_low[1, -1] <= above.low + left
    assert below.high - left <= found.mean_high[1, -1] <= above.high + left
    assert "± ?" in shown(found) and "fewer than 8 paths" in shown(found)


def test_errors_of_few_groups_have_the_factor_of_student(case_of):
    found = results_of(case_of("samples=64", "functions=y1", "statistics=[mean]"))
    half = stats.t.isf(0.025, 7) * found.mean_stderr[0, -1]
    assert np.allclose([found.mean_low[0, -1], found.mean_high[0, -1]], found.mean[0, -1] + np.array([-half, half]))
    (mean,) = (one for one in quantities([found]) if one.name == "mean")
    assert np.isclose(mean.high - mean.low, 2 * half)


def test_what_all_paths_have_alike_has_no_error_of_zero(case_of):
    """A share by Clopper and Pearson, other values not at all, and what must be so exactly."""
    passages = "never: {passage: y1 > 9}, always: {passage: y1 < 9}"
    found = results_of(case_of(f"functions={{{passages}, flat: abs(y1 - 9)/(9 - y1), one: 2/2, casimir: C1}}"))
    last = found.mean[:, -1]
    assert np.allclose(last, 1 - np.eye(5)[0])
    assert np.allclose(found.mean_high[0, 1:], 1 - 0.025**0.01) and np.allclose(found.mean_low[1, 1:], 0.025**0.01)
    assert (found.mean_stderr[:2, 1:] > 0).all() and not found.mean_stderr[:2, 0].any()
    assert np.isnan(found.mean_stderr[2, 1:]).all() and np.isnan(found.variance_stderr[2, 1:]).all()
    assert not found.mean_stderr[3].any() and (found.mean_stderr[4] < 1e-14).all()
    assert (found.passages.time_stderr[:2] > 0).all()
    assert "all paths have the same value" in shown(found) and "Clopper and Pearson" in shown(found)


def test_without_noise_nothing_is_random(case_of):
    with loop_in_python():
        found = results_of(case_of("model.sigma=[null, null, null]", "functions={y1: y1, out: {passage: y1 > 9}}"))
    assert not found.mean_stderr.any() and (found.mean_low == found.mean_high).all()


def test_what_is_done_about_passages_between_observations_is_said(case_of):
    text = shown(results_of(case_of("functions={out: {passage: y1 < 0.4}}", "every=2")))
    assert "passages between observations (every 0.125) are allowed for;" in text and "out: mean first time" in text


def test_passages_at_some_times_count_all_looks_before(case_of):
    passage = "functions={out: {passage: y1 < 0.4}}", "statistics=[mean]"
    every, some = results_of(case_of(*passage)), results_of(case_of(*passage, "every=1", "times=[1/4, 5/8, 1]"))
    assert some.mean[0].tolist() == every.mean[0, [2, 5, 8]].tolist() and every.passages.density is None
    assert some.passages.between == every.passages.between == 1 / 8
    assert some.passages.time[0] == every.passages.time[0] < 1
