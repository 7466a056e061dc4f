"""Autocorrelations: sums of products by stretches, jackknife groups, and the integrated time."""

import numpy as np
import pytest

from spi.numerics.rng import LANES
from spi.plugins.dynamics.statistics.correlation import (
    Correlation,
    integrated,
    lagged_products,
    lagged_sums,
    of_means,
    resolved_times,
)
from spi.statistics.estimators import GROUPS, by_group, group_counts
from spi.statistics.tallies import Batch


def test_groups_are_those_of_the_jackknife():
    for first, blocks, end in ((0, 1, 3), (0, 3, 3 * LANES - 5), (7, 10, 17 * LANES)):
        number = np.arange(first * LANES, (first + blocks) * LANES).reshape(blocks, LANES)
        found = by_group(np.where(number < end, 1.0, np.nan), Batch(0, first, blocks, end))
        assert found.shape == (GROUPS,)
        np.testing.assert_array_equal(found, group_counts(end) - group_counts(first * LANES))
    values = np.arange(2.0 * LANES * 3).reshape(2, LANES, 3)
    assert by_group(values, Batch(0, 5, 2, 7 * LANES)).sum(axis=-1) == pytest.approx(values.sum(axis=(0, 1)))


def test_products_of_stretches_are_those_of_the_series():
    lags, x = 8, np.random.default_rng(1).standard_normal((5, 24))
    found = np.zeros((5, lags))
    for k in range(3):
        earlier = x[:, (k - 1) * lags : k * lags] if k else np.zeros((5, lags))
        found += lagged_sums(lagged_products(earlier, x[:, k * lags : (k + 1) * lags]))
    wanted = [[one[lag:] @ one[: 24 - lag] for lag in range(lags)] for one in x]
    np.testing.assert_allclose(found, wanted, atol=1e-13)


@pytest.mark.parametrize("a", [0.0, 0.5, 0.9, -0.5])
def test_the_integrated_time_of_an_autoregression(a):
    """(1 + a) / (2 (1 - a)), of its exact covariance and of a series."""
    exact = (1 + a) / (2 * (1 - a))
    lags = 256
    tau, window, closed = integrated(a ** np.arange(lags))
    assert closed and window == max(5, np.ceil(5 * tau)) and tau == pytest.approx(exact, rel=0.07)
    generator, n = np.random.default_rng(2), 2**15
    x, e = np.empty(n), generator.standard_normal(n) * np.sqrt(1 - a * a)
    x[0] = generator.standard_normal()
    for i in range(1, n):
        x[i] = a * x[i - 1] + e[i]
    x -= x.mean()
    covariance = np.array([x[lag:] @ x[: n - lag] / (n - lag) for lag in range(lags)])
    corrected, found = of_means(covariance, n)
    assert abs(found.tau - exact) < 4.5 * exact * np.sqrt(2 * (2 * found.window + 1) / n)
    assert (corrected[0] > covariance[0]) == (found.tau > 0)


def test_a_window_that_is_not_found():
    assert not integrated(0.999 ** np.arange(64)).closed
    assert not integrated(np.full(64, np.nan)).closed


def test_times_below_those_of_independent_values():
    """Few values do not tell them from 1/2, many do: x_t = (e_t - 0.9 e_(t-1)) has tau = 0.1^2 / (2 (1 + 0.9^2))."""
    tau = np.array([0.5 * 0.1**2 / (1 + 0.9**2), -0.3, 0.5, 3.0])
    correlation = Correlation(tau, np.full(4, 5), np.full(4, True))
    few, many = resolved_times(correlation, 16), resolved_times(correlation, 10**7)
    np.testing.assert_array_equal(few.tau, np.maximum(tau, 0))
    np.testing.assert_array_equal(few.least, [0.5, 0.5, 0.5, 3.0])
    np.testing.assert_array_equal(many.least, [tau[0], 0.5, 0.5, 3.0])
    np.testing.assert_allclose(few.stderr, np.sqrt(22 / 16) * np.array([0.5, 0.5, 0.5, 3.0]))
