"""Curves over a swept parameter: which of many quantities stand for a value."""

import math
from dataclasses import replace

from strong_results import strong_group

from spi.statistics.claims import Quantity, quantity
from spi.statistics.curves import curves
from spi.storage.stored import AT_MOST, CLAIMED_ORDER, Claimed, Description, Swept

ABOUT = Description.of(strong_group("splitting"))


def at(value, **others):
    return replace(ABOUT, case=f"s={value}", swept=Swept(word="s", value=value, owner="main", title="Title"), **others)


def test_the_smallest_step_and_the_largest_casimir_count():
    found = [quantity("bias", at(1.0), bias, h=h) for h, bias in ((0.5, 9.0), (0.25, 1.0), (0.25, -2.0), (0.25, 0.5))]
    (curve,) = curves([*found, quantity("bias", at(2.0), 7.0, h=0.5), quantity("error", at(1.0), 1.0)], ["bias"])
    assert curve.of("value").tolist() == [-2.0, 7.0] and curve.values.tolist() == [1.0, 2.0] and curve.h is None


def test_an_eps_that_is_swept_is_one_curve_and_several_beside_it_are_several():
    swept = [quantity("order", at(eps, eps=eps, variant=f"splitting_eps_{eps:g}"), 1.0) for eps in (0.5, 0.25)]
    (curve,) = curves(swept, ["order"])
    assert (curve.about.variant, curve.about.eps, len(curve.points)) == ("splitting", None, 2)
    both = [
        quantity("order", at(s, eps=eps, variant=f"splitting_eps_{eps:g}"), eps) for s in (1, 2) for eps in (0.5, 0.25)
    ]
    assert [curve.of("value").tolist() for curve in curves(both, ["order"])] == [[0.5, 0.5], [0.25, 0.25]]


def test_what_says_nothing_is_told_apart():
    wide = Quantity("order", at(1.0), 1.0, 0.5, 1.5, claim=CLAIMED_ORDER._replace(widest=0.25))
    lost = quantity("error", at(1.0), math.inf)
    error = quantity("error", at(1.0), 1.0, 2.0, claim=Claimed(AT_MOST))
    found = curves([error, wide, quantity("mean", at(1.0), 1.0, 2.0)], ["mean", "error", "order"])
    assert [(curve.name, curve.poor.tolist()) for curve in found] == [
        ("mean", [False]),
        ("error", [True]),
        ("order", [True]),
    ]
    unknown = quantity("error", at(1.0), math.nan)
    known = [curve.is_known for (curve,) in (curves([one], ["error"]) for one in (lost, unknown))]
    assert curves([lost], ["error"])[0].poor.tolist() == [True] and known == [True, False]
