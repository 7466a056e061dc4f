"""What is read from stored weak errors, and what the readings of a case tell together."""

from dataclasses import replace

import numpy as np
import pytest
from weak_results import H, at_eps, weak_group

from spi.kinds.weak.results import WeakErrors, agreement, comparable_sweeps, largest_over_eps, sweeps
from spi.statistics.estimators import GROUPS

EPS = (1e-2, 1e-3, 1e-4)


@pytest.fixture
def three():
    return [
        WeakErrors.of(weak_group("splitting", name, prefixes=name == "plain"))
        for name in ("plain", "multilevel", "kolmogorov")
    ]


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
