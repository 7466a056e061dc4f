"""Orders of errors whose standard errors differ and of which only the resolved ones are used; all seeds are fixed."""

import math

import numpy as np
import pytest

from spi.statistics import estimators
from spi.statistics.estimators import GROUPS, RESOLVED, fit_order, is_resolved, jackknife_stderr

H = 2.0 ** -np.arange(3, 9)


def sampled_errors(generator, shared, stderr, count):
    """Errors 0.3 h of `count` data sets and their leave-one-out values, as multilevel finds them.

    `shared` says whether they are sums of levels, of which the smaller steps have the finest; otherwise each is
    independent of the others.  Standard errors are equal, or those of sums.
    """
    own = 8 * stderr * generator.standard_normal((count, GROUPS, 2 * len(H) if shared else len(H)))
    if shared:
        own = np.cumsum(own, axis=-1)[..., : -len(H) - 1 : -1] / math.sqrt(2 * len(H))
    values = 0.3 * H + own
    return values.mean(axis=1), (values.sum(axis=1, keepdims=True) - values) / (GROUPS - 1)


def covering(generator, shared, stderr):
    """Of 400 data sets: how often the interval of the order contains 1, where one is stated, and how often it is."""
    counts, inside, stated = np.full(GROUPS, 8), 0, 0
    for value, without in zip(*sampled_errors(generator, shared, stderr, 400), strict=True):
        spread = jackknife_stderr(value, without, counts)
        use = is_resolved(np.abs(value), spread)
        fit = fit_order(H, np.abs(value), np.abs(without), counts, use, stderr=spread)
        stated += math.isfinite(fit.order)
        inside += fit.low <= 1 <= fit.high
    return inside / stated, stated / 400


@pytest.mark.parametrize("shared", [False, True])
@pytest.mark.parametrize("stderr", [3e-5, 3e-4])
def test_intervals_of_orders_cover_with_weights_and_after_selection(shared, stderr):
    """All steps are resolved but perhaps the finest, or four of six: selection makes finer errors seem larger."""
    often, stated = covering(np.random.default_rng(8), shared, stderr)
    assert stated == 1.0
    assert often > 0.92  # 0.95 less three binomial standard errors


def test_what_selection_adds_to_a_value_is_taken_away(monkeypatch):
    """Of data sets that are kept where the last of four values, whose mean is just resolved, is resolved."""
    generator, counts, all_of_them = np.random.default_rng(9), np.full(GROUPS, 8), np.full(4, True)
    h, stderr = 2.0 ** -np.arange(4), np.full(4, 1 / 32)
    values = h + stderr * generator.standard_normal((1000, 4))
    kept = values[values[:, 3] >= RESOLVED * stderr[3]]

    def bias():
        fits = (fit_order(h, v, np.tile(v, (GROUPS, 1)), counts, all_of_them, stderr=stderr) for v in kept)
        return np.mean([fit.order for fit in fits]) - 1

    right = bias()
    monkeypatch.setattr(estimators, "RESOLVED", -100.0)  # negative control: as if every value were resolved
    assert bias() < -0.03 and abs(right) < 0.4 * abs(bias())


def test_a_point_that_is_known_better_has_more_weight():
    value = H.copy()
    value[-1] *= 1.5
    spread = np.where(H[-1] == H, 0.2, 0.01) * value
    counts, without = np.full(4, 2), np.tile(value, (4, 1))
    weighted = fit_order(H, value, without, counts, np.full(H.shape, True), stderr=spread)
    plain = fit_order(H, value, without, counts, np.full(H.shape, True))
    assert abs(weighted.order - 1) < 0.1 * abs(plain.order - 1)
    equal = fit_order(H, value, without, counts, np.full(H.shape, True), stderr=1e-9 * value)
    assert math.isclose(equal.order, plain.order, rel_tol=1e-6)
