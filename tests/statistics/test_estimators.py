"""Means, standard errors and orders, against formulas, brute force and repetition; all seeds are fixed."""

import math

import numpy as np
import pytest

from spi.statistics.estimators import (
    GROUPS,
    RESOLVED,
    Order,
    fit_order,
    group_counts,
    is_resolved,
    jackknife_stderr,
    root_mean_square,
    samples_needed,
)

H = 2.0 ** -np.arange(3, 9)
REFERENCE = 2.0**-11


def in_groups(values):
    """Sums over groups (path p in group p mod GROUPS) and counts, by hand."""
    sums = np.zeros((GROUPS, *values.shape[1:]))
    for path, value in enumerate(values):
        sums[path % GROUPS] += value
    return sums, np.bincount(np.arange(len(values)) % GROUPS, minlength=GROUPS)


def mean_and_without(sums, counts):
    """The mean and its leave-one-out values, for groups that all have paths."""
    rest = (counts.sum() - counts).reshape(-1, *[1] * (sums.ndim - 1))
    return sums.sum(axis=0) / counts.sum(), (sums.sum(axis=0) - sums) / rest


@pytest.mark.parametrize("samples", [0, 1, 7, 63, 64, 65, 500, 511, 512, 513, 4096, 10**15])
def test_group_counts_sum_up_and_grow_by_one_path_at_a_time(samples):
    counts = group_counts(samples)
    assert counts.shape == (GROUPS,)
    assert counts.sum() == samples
    assert counts.min() >= 0
    more = group_counts(samples + 1) - counts
    assert sorted(more) == [0] * (GROUPS - 1) + [1]


@pytest.mark.parametrize("samples", [2, 5, 64, 100, 500])
def test_root_mean_square_leaves_out_one_group_at_a_time(samples):
    squares = np.random.default_rng(1).standard_normal((samples, 3)) ** 2
    sums, counts = in_groups(squares)
    value, without = root_mean_square(sums, counts)
    assert np.allclose(value, np.sqrt(squares.mean(axis=0)), rtol=1e-14)
    groups = np.arange(samples) % GROUPS
    brute = [np.sqrt(squares[groups != g].mean(axis=0)) for g in range(min(samples, GROUPS))]
    assert without.shape == (len(brute), 3)
    assert np.allclose(without, brute, rtol=1e-12)


def test_root_mean_square_of_one_sample_has_no_leave_one_out_value():
    sums, counts = in_groups(np.array([[9.0, 4.0]]))
    value, without = root_mean_square(sums, counts)
    assert value.tolist() == [3.0, 2.0]
    assert without.shape == (1, 2)
    assert np.isnan(without).all()


def test_root_mean_square_of_infinities():
    squares = np.ones((200, 2))
    squares[70, 1] = np.inf
    value, without = root_mean_square(*in_groups(squares))
    assert value.tolist() == [1.0, np.inf]
    assert np.allclose(without[:, 0], 1.0, rtol=1e-14)
    assert not is_resolved(value, jackknife_stderr(value, without, in_groups(squares)[1]))[1]


@pytest.mark.parametrize("per_group", [1, 5])
def test_jackknife_of_a_mean_over_equal_groups_is_the_textbook_value(per_group):
    values = np.random.default_rng(2).exponential(size=GROUPS * per_group)
    sums, counts = in_groups(values)
    mean, without = mean_and_without(sums, counts)
    textbook = (sums / per_group).std(ddof=1) / math.sqrt(GROUPS)
    assert math.isclose(jackknife_stderr(mean, without, counts), textbook, rel_tol=1e-12)


def is_one(ratios):
    """Whether the mean is 1 within four of its standard errors."""
    return abs(ratios.mean() - 1) < 4 * ratios.std() / math.sqrt(ratios.size)


@pytest.mark.parametrize(
    "counts",
    [in_groups(np.ones(500))[1], in_groups(np.ones(65))[1], np.arange(64) % 16 + 1],
    ids=["500", "65", "1 to 16 in a group"],
)
def test_jackknife_of_a_mean_over_unequal_groups_is_unbiased(counts):
    """The mean of the squared standard errors is the variance of the mean, here 1 / samples, by repetition."""
    assert len(set(counts)) > 1
    sums = np.random.default_rng(3).standard_normal((GROUPS, 4000)) * np.sqrt(counts).reshape(-1, 1)
    mean, without = mean_and_without(sums, counts)
    assert is_one(mean**2 * counts.sum())
    assert is_one(jackknife_stderr(mean, without, counts) ** 2 * counts.sum())


@pytest.mark.parametrize("samples", [300, 500])
def test_standard_error_of_a_root_mean_square_is_the_spread_of_repetitions(samples):
    repetitions = 2000
    squares = np.random.default_rng(4).standard_normal((samples, repetitions)) ** 2
    sums, counts = in_groups(squares)
    value, without = root_mean_square(sums, counts)
    estimated, spread = jackknife_stderr(value, without, counts), value.std(ddof=1)
    assert abs(np.sqrt((estimated**2).mean()) / spread - 1) < 4 / math.sqrt(2 * repetitions)


@pytest.mark.parametrize("samples", [0, 1])
def test_fewer_than_two_groups_have_no_standard_error(samples):
    counts = group_counts(samples)
    assert np.isnan(jackknife_stderr(np.ones(4), np.ones((samples, 4)), counts)).all()
    assert np.isnan(jackknife_stderr(1.0, np.ones(samples), counts))


def test_what_counts_as_resolved():
    value = np.array([1.0, 1.0, 0.0, np.inf, 1.0, 1.0, np.nan])
    stderr = np.array([1 / RESOLVED, 1.01 / RESOLVED, 0.0, 0.0, np.nan, np.inf, 0.1])
    assert is_resolved(value, stderr).tolist() == [True, False, False, False, False, False, False]


def test_samples_needed_would_just_resolve():
    """Standard errors fall like the root of the number of samples."""
    value, stderr, samples = 0.02, 0.03, 100
    needed = samples_needed(value, stderr, samples)
    assert math.isclose(needed, 100 * (4 * 1.5) ** 2)
    then = stderr * math.sqrt(samples / needed)
    assert is_resolved(value, then * 0.999)
    assert not is_resolved(value, then * 1.001)
    assert not np.isfinite(samples_needed(np.array([0.0, np.nan, np.inf]), np.array([1.0, 1.0, np.inf]), 10)).any()


FACTORS = np.array([[0.9], [1.1], [1.0]])  # leave-one-out values that have a common factor leave the slope as it is


@pytest.mark.parametrize(("p", "reference"), [(0.5, 0.0), (1.0, 0.0), (1.7, 0.0), (0.5, REFERENCE)])
def test_fit_recovers_a_power_of_the_step(p, reference):
    """For p = 1/2 also where the values are distances from a reference of the same scheme."""
    value = 0.3 * (H - reference) ** p
    use = np.full(H.shape, True)
    fit = fit_order(H, value, value * FACTORS, np.array([4, 4, 3]), use, reference)
    assert fit.points == len(H)
    for slope in (fit.order, fit.low, fit.high):
        assert math.isclose(slope, p, rel_tol=1e-9)
    if reference:  # negative control: a fit that does not know of the reference sees another slope
        assert fit_order(H, value, value * FACTORS, np.array([4, 4, 3]), use).order > p * 1.002


@pytest.mark.parametrize(
    ("p", "value"),
    [
        (0.5, (H - REFERENCE) ** 0.5),  # independent of it
        (1.0, (H**2 - REFERENCE**2) ** 0.5),
        (1.0, H - REFERENCE),  # proportional to it, path by path
        (1.7, (H**3.4 - REFERENCE**3.4) ** 0.5),
    ],
)
def test_interval_covers_what_the_error_of_the_reference_may_be(p, value):
    fit = fit_order(H, value, value * FACTORS, np.array([4, 4, 3]), np.full(H.shape, True), REFERENCE)
    assert fit.low - 1e-6 < p < fit.high + 1e-6
    assert fit.high - fit.low < 0.2


def test_points_that_are_not_used_do_not_matter():
    value = 0.3 * (H - REFERENCE) ** 0.5
    without = np.tile(value, (4, 1)) * np.random.default_rng(6).uniform(0.9, 1.1, (4, len(H)))
    use = np.array([False, True, True, True, False, True])
    odd, odd_without = value.copy(), without.copy()
    odd[[0, 4]], odd_without[:, [0, 4]] = [np.inf, 0.0], np.nan
    counts = np.array([2, 2, 2, 2])
    fit = fit_order(H, odd, odd_without, counts, use, REFERENCE)
    assert fit == fit_order(H[use], value[use], without[:, use], counts, np.full(4, True), REFERENCE)
    assert fit.points == 4
    assert fit.low < fit.order < fit.high


@pytest.mark.parametrize("points", [0, 1, 2])
def test_fewer_than_three_points_have_no_order(points):
    use = np.arange(len(H)) < points
    fit = fit_order(H, H, np.tile(H, (4, 1)), np.full(4, 2), use, REFERENCE)
    assert isinstance(fit, Order)
    assert fit.points == points
    assert np.isnan([fit.order, fit.low, fit.high]).all()


@pytest.mark.parametrize("samples", [500, 40])
def test_intervals_of_orders_contain_the_order_as_often_as_they_say(samples):
    """The errors at all step sizes share their paths, as in a strong study: correlated, and far from normal."""
    p, repetitions, generator = 0.5, 400, np.random.default_rng(7)
    inside = 0
    for _ in range(repetitions):
        common, own = generator.standard_normal((samples, 1)), generator.standard_normal((samples, len(H)))
        # lognormal with mean 1
        squares = 0.09 * (H - REFERENCE) ** (2 * p) * np.exp(0.6 * common + 0.6 * own - 0.36)
        sums, counts = in_groups(squares)
        value, without = root_mean_square(sums, counts)
        fit = fit_order(H, value, without, counts, np.full(H.shape, True), REFERENCE)
        inside += fit.low <= p <= fit.high
    # 0.95 +- 4 binomial standard errors of 0.011, and half a percent of bias, as errors are far from normal
    assert 0.90 < inside / repetitions < 0.985
