"""What is read from stored weak errors, and what the readings of a case tell together."""

import math
from dataclasses import replace

import numpy as np
import pytest
from weak_results import LIMIT, TEXTS, H, at_eps, by_differences, weak, weak_group

from spi import storage
from spi.kinds.weak.results import WeakErrors, agreement, comparable_sweeps, largest_over_eps, sweeps
from spi.report import views
from spi.statistics.estimators import GROUPS
from spi.storage.records import Order

EPS = (1e-2, 1e-3, 1e-4)


@pytest.fixture
def three():
    return [
        WeakErrors.of(weak_group("splitting", name, prefixes=name == "plain"))
        for name in ("plain", "multilevel", "kolmogorov")
    ]


def test_shapes_and_what_each_estimator_has(three):
    for reading in three:
        assert reading.functions == ("phi", "square") and reading.formulas == TEXTS
        for values in (reading.error, reading.half, reading.expectation, reading.expectation_half, reading.resolved):
            assert values.shape == (2, len(H))
        assert reading.resolved.dtype == bool and reading.orders == (Order(1.0, 0.98, 1.02, 5),) * 2
        assert (reading.about.case, reading.about.variant, reading.about.eps) == ("main", "splitting", None)
    plain, multilevel, exact = three
    assert (plain.unsampled, multilevel.unsampled, exact.sampled, exact.stages) == (None,) * 4
    assert plain.levels is None and exact.levels is None and plain.nonfinite[0] == 3 and multilevel.nonfinite is None
    np.testing.assert_array_equal(plain.half, 1.96 * plain.sampled.error_stderr)
    np.testing.assert_array_equal(exact.half, exact.unsampled.error_bound)
    np.testing.assert_array_equal(exact.unsampled.limit, LIMIT)
    assert exact.unsampled.noted["degree"] == 40


def test_stages_and_levels(three):
    plain, multilevel, _ = three
    assert plain.prefixes is plain.stages and plain.stages.samples.tolist() == [10**4, 10**5, 10**6]
    assert multilevel.prefixes is None and multilevel.stages.cpu_seconds.tolist() == [0.25, 1.0, 4.0]
    # of the errors 0.5 h +- stderr those that are four standard errors of 1e-3, 3e-4 and 1e-4
    assert plain.stages.resolved.shape == (3, 2, len(H))
    assert plain.stages.resolved[:, 0].sum(axis=1).tolist() == [5, 6, 6]
    levels = multilevel.levels
    assert levels.mean.shape == levels.consistency.shape == (2, 7) and levels.seconds.shape == (7,)
    assert levels.variance_rate == (Order(2.0, 1.9, 2.1, 7),) * 2
    assert not levels.antithetic and levels.cost_rate == 0.95 and multilevel.differences is None


def test_differences():
    reading = WeakErrors.of(by_differences())
    found = reading.differences
    assert found.scheme == "splitting_order2" and reading.levels.antithetic
    assert found.mean.shape == found.consistency.shape == (2, len(H)) and found.seconds.shape == (len(H),)
    assert found.variance_rate == (Order(1.0, 0.9, 1.1, 6),) * 2


@pytest.mark.parametrize(("eps", "limit"), [(None, False), (0.0, False), (0.03, True), (0.04, False), (1e-9, True)])
def test_whether_the_reference_shows_a_limit(eps, limit):
    group = weak_group("splitting", "multilevel", **({} if eps is None else {"eps": eps}))  # h_ref = 0.031^2
    assert WeakErrors.of(group).reference_shows_limit is limit


def test_agreement(three):
    plain, multilevel, exact = three
    found = agreement(plain, three)
    np.testing.assert_allclose(found.deviation, [[1, -1, 1, -1, 1, -1]] * 2, rtol=1e-4)
    np.testing.assert_allclose(found.share, 1e-4 / np.abs(exact.error))
    assert agreement(exact, three) is None and agreement(plain, [plain, multilevel]) is None
    other = replace(exact, about=replace(exact.about, variant="splitting_order2"))
    assert agreement(plain, [plain, other]) is None
    one = replace(exact, functions=("square",), error=exact.error[1:], h=exact.h * 2)
    one = replace(one, unsampled=replace(one.unsampled, error_bound=one.unsampled.error_bound[1:]))
    found = agreement(plain, [plain, one])
    assert np.isnan(found.deviation[0]).all() and np.isnan(found.deviation[1]).tolist() == [False] * 5 + [True]


def test_sweeps_over_eps():
    readings = [
        WeakErrors.of(at_eps("ap_splitting", eps, factor=factor))
        for eps, factor in zip(EPS[::-1], (1, 2, 3), strict=True)
    ]
    single = WeakErrors.of(at_eps("multiscale_euler", 0.1))
    found = sweeps([*readings, single, WeakErrors.of(weak_group("splitting", "multilevel", functions=1))])
    assert {key: [one.about.eps for one in members] for key, members in found.items()} == {
        ("ap_splitting", "multilevel"): list(EPS),
        ("multiscale_euler", "multilevel"): [0.1],
    }
    ((key, members),) = comparable_sweeps([*readings, single]).items()
    top = largest_over_eps(members, 0)
    assert key == ("ap_splitting", "multilevel") and top.which.tolist() == [0] * len(H)
    np.testing.assert_allclose(top.value, 3 * 0.5 * H)
    assert members[0].sampled.error_without.shape == (GROUPS, 1, len(H))
    shorter = [replace(readings[0], h=H * 2), *readings[1:]]
    assert comparable_sweeps(shorter) == {} and comparable_sweeps(readings[:1]) == {}


def test_a_file_gives_the_same_readings(tmp_path):
    groups = [at_eps("ap_splitting", 0.1, panels=("errors", "eps")), weak_group("splitting", "plain", prefixes=True)]
    storage.write(tmp_path / "w.h5", weak(*groups))
    back = views.readings(storage.read(tmp_path / "w.h5"))
    for reading, group in zip(back, groups, strict=True):
        assert repr(reading) == repr(WeakErrors.of(group))
    assert back[0].panels == ("errors", "eps") and back[1].panels == ("errors",)
    assert (back[0].about.scheme, back[0].about.eps, back[0].about.variant) == (
        "ap_splitting",
        0.1,
        "ap_splitting_eps_0.1",
    )


def test_records_name_the_scheme_and_its_eps():
    records = views.rows(weak(at_eps("ap_splitting", 0.1), weak_group("splitting", "multilevel", functions=1)))
    assert {(record["scheme"], record.get("eps")) for record in records} == {("ap_splitting", 0.1), ("splitting", None)}
    assert list(records[0])[:4] == ["case", "scheme", "eps", "estimator"]


def test_what_is_missing_is_said():
    group = weak_group("splitting", "multilevel")
    group.variables.pop("sd")
    group.attributes.pop("expected_order")
    reading = WeakErrors.of(group)
    assert reading.sampled.sd is None and reading.expected_order is None
    exact = weak_group("splitting", "kolmogorov")
    exact.attributes["notes"] = "{"
    assert WeakErrors.of(exact).unsampled.noted == {}
    group.attributes.pop("scheme")
    with pytest.raises(KeyError):
        WeakErrors.of(group)
    assert math.isfinite(reading.cpu_seconds)
