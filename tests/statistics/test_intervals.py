"""Intervals: against binomial probabilities, known quantiles, and the rule of three."""

import math

import numpy as np
import pytest
from scipy import stats

from spi.statistics.intervals import clopper_pearson, student_factor, student_of_paths, zero_share_bound


@pytest.mark.parametrize(("count", "samples"), [(0, 10), (3, 1000), (500, 1000), (10, 10)])
def test_ends_of_shares_have_the_probabilities_that_they_should(count, samples):
    """By the binomial law: so many or more below, so many or fewer above."""
    low, high = clopper_pearson(count, samples)
    assert low == 0 if count == 0 else math.isclose(stats.binom.sf(count - 1, samples, low), 0.025, rel_tol=1e-9)
    assert high == 1 if count == samples else math.isclose(stats.binom.cdf(count, samples, high), 0.025, rel_tol=1e-9)


def test_what_is_no_count_has_no_interval():
    low, high = clopper_pearson([np.nan, 0, 1], [10, 0, 2])
    assert np.isnan(low).tolist() == np.isnan(high).tolist() == [True, True, False]


def test_what_was_never_seen_is_bounded():
    for samples in (1, 64, 10**9):
        assert math.isclose((1 - zero_share_bound(samples)) ** samples, 0.05, rel_tol=1e-6)
    assert zero_share_bound(10**6) * 10**6 == pytest.approx(3, abs=0.005)


def test_the_factor_of_few_groups_is_students():
    assert math.isclose(student_factor(8), 2.364624, abs_tol=1e-6) and math.isclose(
        student_factor(64), 1.998341, abs_tol=1e-6
    )
    assert np.isnan(student_factor(1)) and student_of_paths(64) == student_factor(8) == student_of_paths(64, 8)
    assert student_of_paths(10**6) == student_factor(64) and np.isnan(student_of_paths(7, 8))
