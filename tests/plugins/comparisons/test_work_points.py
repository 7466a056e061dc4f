"""Work points from errors and times: the time for an error, and the cheapest scheme."""

import math

import numpy as np
import pytest
from work_results import H

from spi.plugins.comparisons.kinds.work_precision.results import (
    WorkCurve,
    WorkPoint,
    cheapest,
    interval_of_median,
    is_undecided,
    time_factor,
    work_for,
)


def curve(error, h=H, half=None, resolved=None, seconds=None, spread=1.0):
    """A curve; without ``seconds`` a step takes 1 s."""
    error = np.asarray(error, float)
    half = np.zeros(len(error)) if half is None else half
    resolved = np.isfinite(error) if resolved is None else np.asarray(resolved)
    seconds = 1.0 / h if seconds is None else seconds
    return WorkCurve(h, error, half, resolved, seconds, seconds / spread, seconds * spread)


@pytest.mark.parametrize("order", [0.5, 1.0, 2.0])
@pytest.mark.parametrize("target", [0.0317, 0.01, 2.5e-3])
def test_power_laws_are_met_exactly(order, target):
    error = 0.8 * H**order
    target = target if error[-1] < target < error[0] else math.sqrt(error[0] * error[1])
    point = work_for(target, curve(error, seconds=3.0 / H))
    assert point.h == pytest.approx((target / 0.8) ** (1 / order), rel=1e-12)
    assert point.seconds == pytest.approx(3.0 / point.h, rel=1e-12)
    assert point.low == pytest.approx(point.seconds) == point.high and not point.at_most


def test_ends_of_what_was_run():
    error = 0.5 * H
    assert work_for(0.99 * error[-1], curve(error)) is None
    last = work_for(error[-1], curve(error))
    assert last.h == pytest.approx(H[-1]) and not last.at_most
    for target in (error[0], 100.0):
        assert work_for(target, curve(error, spread=1.1)) == (8.0, 8.0 / 1.1, 8.0 * 1.1, 0.125, True)
    assert work_for(0.0, curve(error)) is None and work_for(0.01, curve(np.full(9, np.nan))) is None


def test_the_order_of_the_steps_does_not_matter():
    given = curve(0.5 * H**1.3, half=0.01 * H)
    turned = WorkCurve(*(values[::-1] for values in given))
    assert work_for(0.01, given) == work_for(0.01, turned)


def test_luck_is_not_rewarded():
    """An error that is small by chance at a large step, as one that crosses zero."""
    error = 0.5 * H
    error[1] = 1e-4
    point = work_for(0.02, curve(error))
    assert point.h == pytest.approx(0.125 * 2 ** -(math.log(0.0625 / 0.02) / math.log(4)))  # as if it were 2^-6
    error[3] = 0.03  # the last above the target, so it is one of the neighbours
    point = work_for(0.02, curve(error))
    assert H[4] < point.h < H[3]


def test_points_that_are_not_resolved():
    error = np.array([0.4, 0.2, 0.1, 0.05])
    h, half = H[:4], np.full(4, 0.05)
    point = work_for(0.141, curve(error, h, half, [True, True, False, True]))
    assert math.log(0.2 / 0.141) / math.log(0.2 / 0.05) == pytest.approx(math.log(h[1] / point.h) / math.log(4))
    assert work_for(0.07, curve(error, h, half, [True, True, True, False])) is None
    # the interval at the second step includes the target, so that the first one is the neighbour
    assert h[2] < work_for(0.19, curve(error, h, half, [True, False, True, True])).h < h[0]
    # the whole interval lies above it, so that nothing larger than the third step is known to do
    missed = curve([0.05, 0.4, 0.1, 0.05], h, half, [True, False, True, True])
    assert work_for(0.15, missed) == (32.0, 32.0, 32.0, h[2], True)


def test_an_error_whose_interval_lies_below_the_target_reaches_it():
    """It counts with the upper end of its interval, so that no luck is rewarded, and the time is an upper bound."""
    half = np.array([0.01, 1.2e-5])
    found = curve([0.4, 4.4e-5], H[:2], half, [True, False])
    known = work_for(1e-4, curve([0.4, 5.6e-5], H[:2], half, [True, True]))
    assert work_for(1e-4, found) == known._replace(at_most=True) and not known.at_most
    assert time_factor(known, work_for(1e-4, found)).low == 0.0
    assert work_for(5e-5, found) is None and is_undecided(5e-5, found)  # it may have this error, or not
    assert work_for(3e-5, found) is None and not is_undecided(3e-5, found) and not is_undecided(1e-4, found)
    assert not is_undecided(5e-5, found._replace(resolved=np.array([True, True])))


@pytest.mark.parametrize("bad", [np.inf, np.nan])
def test_lost_paths_are_no_neighbours(bad):
    error = np.array([0.01, bad, 0.05, 0.02])
    point = work_for(0.06, curve(error, H[:4], resolved=[True, False, True, True]))
    assert point.h == H[2] and point.at_most
    assert work_for(0.06, curve(error[[0, 2, 3, 1]], H[:4])) is None
    large = curve([0.01, 1e200, 0.05], H[:3], np.array([0.001, np.inf, 0.001]), [True, False, True])
    assert work_for(0.06, large).h == H[2]


def test_interval_of_a_work_point():
    """(k e)^2 + t^2 in logarithms, at a quarter of the way between two points."""
    half = np.array([0.04, 0.01])
    found = curve([0.2, 0.1], H[:2], half, seconds=np.array([1.0, 8.0]))
    target = 0.2 / 2**0.25
    point = work_for(target, found)
    e = 0.75 * (0.04 / 0.2) + 0.25 * (0.01 / 0.1)
    assert point.seconds == pytest.approx(8**0.25)
    assert math.log(point.high / point.seconds) == pytest.approx(3 * e) == math.log(point.seconds / point.low)
    found = found._replace(low=np.array([0.9, 8.0]), high=np.array([1.2, 8.8]))
    point = work_for(target, found)
    down, up = 0.75 * math.log(1 / 0.9), 0.75 * math.log(1.2) + 0.25 * math.log(1.1)
    assert math.log(point.seconds / point.low) == pytest.approx(math.hypot(3 * e, down))
    assert math.log(point.high / point.seconds) == pytest.approx(math.hypot(3 * e, up))


@pytest.mark.parametrize(("shared", "least", "most"), [(True, 0.935, 0.985), (False, 0.97, 1.0)])
def test_coverage(shared, least, most):
    """95 % where errors and times of all steps are wrong by a common factor, more where they are independent."""
    rng = np.random.default_rng(5)
    order, target, covered, runs = 0.5, 0.03, 0, 1000
    exact = 1.0 / (target / 0.8) ** (1 / order)
    for _ in range(runs):
        z = rng.standard_normal(1 if shared else 9)
        repeats = np.exp(0.2 * rng.standard_normal((15, 1 if shared else 9)))
        low, middle, high = np.quantile(repeats, [0.25, 0.5, 0.75], axis=0) / H
        error = 0.8 * H**order * (1 + 0.05 * z)
        ends = interval_of_median(middle, low, high, 15)
        point = work_for(target, WorkCurve(H, error, 1.96 * 0.05 * error, H > 0, middle, *ends))
        covered += point.low <= exact <= point.high
    assert least <= covered / runs <= most


def test_interval_of_a_median():
    rng = np.random.default_rng(1)
    for repeats, least, most in ((5, 0.87, 0.93), (9, 0.92, 0.97), (15, 0.94, 0.98), (101, 0.99, 1.01)):
        low, middle, high = np.quantile(np.exp(0.1 * rng.standard_normal((4000, repeats))), [0.25, 0.5, 0.75], axis=1)
        low, high = interval_of_median(middle, low, high, repeats)
        assert least < np.mean((low <= 1) & (high >= 1)) < most
    assert interval_of_median(2.0, 1.0, 3.0, 1000) == (1.0, 3.0)


def point(seconds, spread=1.1, at_most=False):
    return WorkPoint(seconds, seconds / spread, seconds * spread, 0.1, at_most)


def test_cheapest():
    best, factors = cheapest({"a": point(6.0), "b": point(2.0), "c": None, "d": point(2.2)})
    assert best == "b" and list(factors) == ["d", "a"]
    assert factors["d"].tie and not factors["a"].tie
    assert factors["a"].value == 3.0
    assert math.log(factors["a"].high / 3) == pytest.approx(math.hypot(*[math.log(1.1)] * 2))
    assert math.log(3 / factors["a"].low) == pytest.approx(math.hypot(*[math.log(1.1)] * 2))
    assert cheapest({"a": None}) == (None, {}) and cheapest({"a": point(1.0), "b": None}) == ("a", {})


def test_factors_use_the_ends_that_face_each_other():
    one, other = WorkPoint(1.0, 0.1, 1.2, 0.1), WorkPoint(2.0, 1.8, 40.0, 0.1)
    factor = time_factor(one, other)
    assert math.log(2 / factor.low) == pytest.approx(math.hypot(math.log(1.2), math.log(2 / 1.8)))
    assert math.log(factor.high / 2) == pytest.approx(math.hypot(math.log(10), math.log(20)))


def test_upper_bounds_decide_nothing():
    assert time_factor(point(1.0), point(5.0, at_most=True))[1:] == (0.0, pytest.approx(5 * 1.1 ** math.sqrt(2)))
    surely = time_factor(point(1.0, at_most=True), point(5.0))
    assert surely.high == math.inf and surely.low > 4 and not surely.tie
    assert time_factor(point(1.0, at_most=True), point(5.0, at_most=True)).tie
