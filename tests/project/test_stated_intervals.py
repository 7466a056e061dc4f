"""The exact values of the benchmark of intervals, what it counts, and its small form."""

import importlib
import itertools
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom, multivariate_normal, norm

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
intervals = importlib.import_module("intervals")


def test_moments_of_the_scheme_are_those_over_all_increments():
    """Moments of a linear scheme depend on two moments of the increments only, which +-sqrt(h) have as well."""
    reference, ratio, start = 0.25, 2, intervals.START
    h, eye, errors, means = ratio * reference, np.eye(3), [], []
    for signs in itertools.product((-1.0, 1.0), repeat=4 * ratio // 2):
        dW = np.sqrt(reference) * np.array(signs).reshape(ratio, 2)
        fine = start
        for kicks in dW:
            fine = (eye + reference * intervals.ITO + np.tensordot(kicks, intervals.C, 1)) @ fine
        coarse = (eye + h * intervals.ITO + np.tensordot(dW.sum(axis=0), intervals.C, 1)) @ start
        errors.append(np.sum((fine - coarse) ** 2))
        means.append((coarse, np.outer(coarse, coarse)))
    assert np.isclose(intervals.strong_error(h, reference, h), np.sqrt(np.mean(errors)), rtol=1e-12)
    for exact, found in zip(intervals.euler_maruyama(h, h), zip(*means, strict=True), strict=True):
        assert np.allclose(exact, np.mean(found, axis=0), rtol=1e-12)


def test_paths_that_stay_at_two_looks_are_those_of_the_normal_law_of_both():
    edge, mean = np.full(2, np.pi / 2), 0.5 * np.array([1, 2])
    both = multivariate_normal.cdf(edge, mean, [[1, 1], [1, 2]], lower_limit=-edge)
    assert np.allclose(intervals.staying(2, 1.0, 0.5)[1:], [intervals.staying(1, 1.0, 0.5)[1], both], atol=1e-7)
    assert np.isclose(
        intervals.staying(1, 1.0, 0.5)[1], norm.cdf(np.pi / 2 - 0.5) - norm.cdf(-np.pi / 2 - 0.5), atol=1e-12
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", intervals.rows())
def test_intervals_hold(name):
    """Of 40 seeds, of which 95 % would be 38, at least 33: fewer come of one right interval in a thousand."""
    for label, (held, stated, _) in intervals.tally(intervals.rows()[name](), range(1, 41)).items():
        assert binom.cdf(round(held / stated * 40), 40, 0.95) > 1e-3, (label, held, stated)
