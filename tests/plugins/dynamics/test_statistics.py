"""Statistics over time: by hand, against exact laws of a rotation about one axis, with the same bits however made."""

import math
import re

import numpy as np
import pytest
from helpers import INITIAL, compiled_only
from scipy import stats
from scipy.integrate import quad
from statistics_cases import AXIS, results_of, staying, study_of, watched, written
from weak_cases import stderr_by_hand

import spi
from spi.numerics.rng import LANES
from spi.plugins.dynamics.kinds.statistics.estimates import PathMoments, simultaneous
from spi.plugins.dynamics.kinds.statistics.results import Statistics
from spi.running import shipped
from spi.running.run import load
from spi.specs import SpecError
from spi.statistics.claims import quantities
from spi.statistics.estimators import by_group
from spi.statistics.tallies import Batch


@pytest.fixture
def case_of(tmp_path):
    return lambda *overrides: written(tmp_path, *overrides)


def test_statistics_are_those_of_the_paths(case_of):
    """Of every function by hand, from the paths that `spi.trajectory` gives."""
    case = case_of(
        "autocorrelation={square: 1/2, area: 1}", "density={of: [square, lowest], times: [1/2, 1], cells: 10}"
    )
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
    }
    assert found.functions == (*by_hand, "out") and found.t.tolist() == paths.t.values.tolist()
    values = np.array(list(by_hand.values()), float)  # (F, paths, T)
    assert np.allclose(found.mean[:7], values.mean(axis=1), atol=1e-13)
    assert (found.mean[7] >= np.maximum.accumulate(y[0] < 0.4, axis=1).mean(axis=0)).all()  # also between two looks
    assert np.allclose(found.variance[:7], values.var(axis=1, ddof=1), rtol=1e-9, atol=1e-13)
    for t in range(len(found.t)):
        assert np.allclose(found.covariance[:7, :7, t], np.cov(values[:, :, t]), rtol=1e-9, atol=1e-13)
    assert np.allclose(found.mean_stderr[:7, -1], [stderr_by_hand(of_one[:, -1]) for of_one in values], atol=1e-13)
    spread = np.cov(values[0, :, 4:], values[0, :, [4] * 5].T, rowvar=False)
    assert np.allclose(found.autocorrelation[0, 4:], spread[:5, 5] / spread[5, 5], rtol=1e-9)
    assert np.isnan(found.autocorrelation[0, :4]).all() and np.isnan(found.autocorrelation[1]).all()
    assert found.autocorrelation[5, -1] == 1 and found.since[[0, 5]].tolist() == [0.5, 1.0]
    check_map_by_hand(found.density_map, values[0][:, [4, 8]], values[4][:, [4, 8]])
    last, q = values[0, :, -1], found.quantiles
    assert (q.quantile_low[0, -1] <= np.quantile(last, q.level)).all()
    assert (np.quantile(last, q.level) <= q.quantile_high[0, -1]).all()
    assert np.abs(q.quantile[0, -1] - np.quantile(last, q.level, method="inverted_cdf")).max() < 0.05
    h = found.histogram
    total = (h.density * h.bin_width[..., np.newaxis]).sum(axis=-1)[:7] + h.outside[:7]
    assert np.isnan(total[2, 1:]).all()  # C1 is constant
    assert np.allclose(np.delete(total, 2, axis=0), 1)
    edges = h.bin_low[0, -1] + h.bin_width[0, -1] * np.arange(65)
    assert np.allclose(h.density[0, -1], np.histogram(last, edges, density=False)[0] / 100 / h.bin_width[0, -1])


def check_map_by_hand(found, one, other):
    for m, t in enumerate((0.5, 1.0)):
        edges = [found.low[m, side] + found.width[m, side] * np.arange(11) for side in (0, 1)]
        counts = np.histogram2d(one[:, m], other[:, m], edges)[0]
        area = found.width[m].prod()
        share = found.density[m] * area
        assert found.t[m] == t and np.allclose(share, counts / 100) and counts.sum() == 100 and not found.outside[m]
        assert np.allclose((found.stderr[m] * area)[share > 0], np.sqrt(share * (1 - share) / 100)[share > 0])
        assert np.allclose((found.stderr[m] * area)[share == 0], (1 - 0.05**0.01) / stats.t.isf(0.025, 15))


def test_results_are_written_and_read_and_judged(case_of):
    case = case_of("reference={length: 1 + 0*t}", "functions={length: C1, square: y1^2}")
    found = results_of(case)
    again = Statistics.of(found.group())
    assert np.array_equal(again.mean, found.mean) and again.histogram is not None
    assert np.array_equal(again.reference, found.reference, equal_nan=True)
    told = {(one.name, one.function): one for one in quantities([again])}
    of_values = {(name, f) for name in ("mean", "variance") for f in case.functions}
    known = {(name, "length") for name in ("difference", "deviation")} | {("nonfinite", "")}
    assert told.keys() == of_values | known | {("quantile", name) for name in case.quantile_names}
    median = told["quantile", "square, 0.5-quantile"]
    assert median.low < median.value == again.quantiles.quantile[1, -1, 1] < median.high
    assert told["mean", "square"].value == found.mean[1, -1]
    assert told["difference", "length"].value == found.mean[0, -1] - 1


def test_chosen_times_are_those_of_every(case_of):
    every, chosen = case_of(), case_of("every=1", "times=[1, 1/2]")
    one, other = results_of(every), results_of(chosen)
    assert chosen.stride == 8 and other.t.tolist() == [0.5, 1.0]
    kept = [i for i, name in enumerate(one.functions) if name in ("square", "energy", "first")]
    assert np.allclose(one.mean[kept][:, [4, 8]], other.mean[kept], atol=1e-14)


def test_a_band_holds_all_means_at_once():
    """For one mean it is 2.00 standard errors, for 16 independent ones the quantile of the largest of 16."""
    rng = np.random.default_rng(2)
    without = rng.standard_normal((64, 1, 16))
    alone = simultaneous(without[..., :1])
    several = simultaneous(without)
    same = simultaneous(np.repeat(without[..., :1], 16, axis=-1))
    assert np.allclose([alone[0], same[0]], stats.t.isf(0.025, 63), atol=0.06)
    assert math.isclose(several[0], stats.norm.isf(0.5 * (1 - 0.95 ** (1 / 16))), abs_tol=0.15)


@compiled_only
def test_the_laws_of_a_rotation_about_one_axis(case_of):
    """Its angle is normal: the mean, the histogram, quantiles and autocorrelation of y_1, and the map of its sphere."""
    about = f"model={AXIS}", "initial=[1, 0, 1]", "samples=40000", "final_time=2", "every=1", "step=2^-5"
    known = "reference={y1: exp(-t/2), square: (1 + exp(-2*t))/2}"
    further = "autocorrelation={y1: 1/2}", "density={of: sphere, times: [1/2, 2], cells: 12}"
    found = results_of(case_of(*about, "functions={y1: y1, square: y1^2}", known, *further))
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
    assert chi_squared(counts, expected) > 1e-3
    q = found.quantiles
    assert (below(q.quantile_low[0, -1]) <= q.level).all() and (q.level <= below(q.quantile_high[0, -1])).all()
    s, t = 0.5, found.t[16:]
    together = (np.exp(-(t - s) / 2) + np.exp(-(t + 3 * s) / 2)) / 2 - np.exp(-(s + t) / 2)
    off = found.autocorrelation[0, 16:] - together / ((1 + math.exp(-2 * s)) / 2 - math.exp(-s))
    assert np.abs(off[1:] / found.autocorrelation_stderr[0, 17:]).max() < 4 and found.autocorrelation[0, 16] == 1
    check_wrapped(found.density_map, found.samples)


@pytest.mark.parametrize("samples", [300, 2**14])
def test_kurtosis_from_the_error_of_the_variance(samples):
    """Of values beside their own kurtosis: of normal and exponential laws, and of one where one value is nearly all."""
    random = np.random.default_rng(5)
    each = [
        random.standard_normal(samples),
        3 + random.exponential(size=samples),
        np.exp(8 * random.standard_normal(samples)),
    ]
    paths = np.zeros((-(-samples // LANES) * LANES, 1, 3))
    paths[:samples, 0] = np.transpose(each)
    blocks = paths.reshape(-1, LANES, 1, 3)
    batch = Batch(0, 0, len(blocks), samples)
    sums = np.array([by_group(blocks**power, batch) for power in (1, 2)])
    found = PathMoments.of(sums, sums[:1], samples).kurtosis(3)[:, 0]
    known = stats.kurtosis(each, axis=1, fisher=False)
    np.testing.assert_allclose(found[:2], known[:2], rtol=0.5)
    assert found[2] == pytest.approx(known[2], rel=0.1) and found[2] > 0.3 * samples


@compiled_only
def test_few_paths_that_carry_a_variance_are_told(case_of):
    """(1 + y2)^2 / (1 - y2)^2 has no variance, since y2 = sin W(t) may be 1; y2 and its square are told nothing of."""
    about = f"model={AXIS}", "initial=[1, 0, 1]", "samples=1024", "step=2^-3", "statistics=[mean]"
    found = results_of(case_of(*about, "functions={y2: y2, square: y2^2, odds: ((1 + y2)/(1 - y2))^2, one: C1}"))
    (line,) = [line for line in found.remarks() if "heavy" in line]
    assert re.fullmatch(r" *odds at \d of 4 times: heavy tails: few samples carry the variance, .*", line)
    assert np.isnan(found.kurtosis[3]).all() and np.isnan(found.kurtosis[:, 0]).all()
    assert found.kurtosis[0, 1:].min() > 1 and found.kurtosis[:2, 1:].max() < 16


def chi_squared(counts, expected):
    """The p-value of counts, in cells of which more than five are expected."""
    large = expected > 5
    return stats.chisquare(counts[large], expected[large] * counts[large].sum() / expected[large].sum()).pvalue


def check_wrapped(found, samples):
    """All paths are at one height, and their longitudes have the wrapped normal law at each time, and no other."""
    edges = found.low[0, 1] + found.width[0, 1] * np.arange(25)
    turns = 2 * math.pi * np.arange(-4, 5)[:, np.newaxis]
    laws = [np.diff(stats.norm.cdf((edges + turns) / math.sqrt(t)).sum(axis=0)) * samples for t in (0.5, 2)]
    counts = found.density * found.width.prod(axis=1)[:, np.newaxis, np.newaxis] * samples
    rows = np.flatnonzero(counts.any(axis=(0, 2)))
    assert rows.tolist() == [10] and not found.outside.any()  # y_3 / |y| = 0.71, of 12 rows from -1 to 1
    for m, n in np.ndindex(2, 2):
        assert (chi_squared(counts[m, 10], laws[n]) > 1e-3) == (m == n)
    share = counts / samples
    error = found.density * np.sqrt((1 - share) / np.maximum(share, 1e-9) / samples)
    assert np.allclose(found.stderr[share > 0], error[share > 0]) and (found.stderr > 0).all()


def test_predicted_times_include_what_is_observed(case_of):
    """Each quantity adds to the time that is said, in proportion to paths and times."""
    plain = study_of(case_of("functions={y1: y1}", "statistics=[mean]", "samples=64000")).cost().seconds
    more = {
        "functions={y1: y1, out: {passage: y1 < 0.4}}": 0.5,
        "functions={y1: y1, H: H}": 0.01,
        "statistics=[mean, quantiles, histogram]": 0.05,
        "time_correlations={until: 1/2}": 0.3,
    }
    for override, least in more.items():
        given = "functions={y1: y1}", "statistics=[mean]", "samples=64000", override
        said = study_of(case_of(*given)).cost().seconds
        assert said > (1 + least) * plain, override
    twice = study_of(case_of("functions={y1: y1}", "statistics=[mean]", "samples=128000")).cost().seconds
    assert twice == pytest.approx(2 * plain)


@compiled_only
@pytest.mark.parametrize("drift", [0.0, 1.0])
def test_first_passages_of_an_angle(case_of, drift):
    """Of drift t + W(t) out of (-pi/2, pi/2), at 16 looks, as if it were watched all the time."""
    inertia = f"[1e12, 1e12, {1 / drift if drift else 1e12}]"
    about = f"model={AXIS.replace('[1e12, 1e12, 1e12]', inertia)}", "initial=[1, 0, 1]", "samples=40000", "step=2^-3"
    functions = "functions={turned: {passage: y1 < 0}}", "statistics=[mean, histogram]", "bins=8"
    found = results_of(case_of(*about, *functions, "final_time=2", "every=1"))
    inside, passages = np.append(1, watched(found.t[1:], drift)), found.passages
    left = passages.left[0]
    assert (np.abs(found.mean[0] + inside - 1) <= 4.5 * found.mean_stderr[0] + left).all() and passages.between == 2**-3
    assert (found.mean_low[0] < 1 - inside + 1e-9)[-4:].all() and (1 - inside < found.mean_high[0])[-4:].all()
    time = quad(lambda t: watched([t], drift)[0], 1e-9, 2)[0]
    assert abs(passages.time[0] - time) < passages.time_half[0] < 0.05 and passages.time_stderr[0] < 0.01
    assert passages.from_t.tolist() == [0, *passages.until_t[:-1]] and np.allclose(np.diff(passages.until_t), 0.25)
    density = -np.diff(inside[::2]) / 0.25
    assert (np.abs(passages.density[0] - density) < 4 * passages.density_stderr[0] + 0.03).all() and density.max() > 0.3
    at_looks = staying(16, 2**-3, drift)  # the control: what is seen is later
    assert at_looks[-1] - inside[-1] > 9 * found.mean_stderr[0, -1] + left[-1]
    assert at_looks[:-1].sum() * 2**-3 - time > 3 * passages.time_half[0]


@pytest.mark.slow
@compiled_only
def test_moments_of_maxwell_bloch_that_close(case_of):
    """y_1 less its drift, the integral of y_2, is a martingale: Var y_1 + Var I - 2 Cov(y_1, I) = E of the integral of
    (sigma_3 y_2)^2 by Itô's isometry, and E y_1 = y_1(0) + E I."""
    functions = "functions={y1: y1, drift: {integral: y2}, square: {integral: y2^2}}"
    about = "initial=[0.2, 0.1, 1]", "samples=40000", "step=2^-8", "every=4", "statistics=[mean, variance, covariance]"
    found = results_of(case_of("model={name: maxwell_bloch, sigma: [1, 1]}", *about, functions))
    (y1, drift, square), error = found.mean, found.mean_stderr
    assert (np.abs(y1 - 0.2 - drift) < 4 * np.hypot(error[0], error[1]) + 2**-8).all()
    spread = found.covariance[0, 0] + found.covariance[1, 1] - 2 * found.covariance[0, 1]
    assert np.allclose(spread[8:], square[8:], rtol=0.03) and square[-1] > 0.05
    louder = results_of(case_of("model={name: maxwell_bloch, sigma: [1, 1.1]}", *about, functions))
    spread = louder.covariance[0, 0] + louder.covariance[1, 1] - 2 * louder.covariance[0, 1]
    assert np.allclose(spread[8:], 1.21 * louder.mean[2, 8:], rtol=0.03)


def test_a_mistake_beside_a_key_named_as_the_kind_is_told_where_it_is(tmp_path):
    """Which class of a union pydantic tried is named by the kind, as is the key `statistics`."""
    text = (shipped.folder() / "rigid_body_statistics.yaml").read_text().replace("final_time: 4", "final_time: four")
    (tmp_path / "spec.yaml").write_text(text)
    with pytest.raises(SpecError, match="final_time: is 'four'"):
        load(tmp_path / "spec.yaml")
