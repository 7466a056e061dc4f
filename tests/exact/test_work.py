"""Reports of work without paths: from a clock that the test turns, and by all who do such work."""

import math
import time

import numpy as np
import pytest

from spi.exact import expectations, work
from spi.exact.work import counted, expected, reporting_to
from spi.models import MaxwellBloch, RigidBody
from spi.schemes import SCHEMES
from spi.schemes.stages import compositions


class Clock:
    """A clock that stands still, or goes on with what is counted."""

    def __init__(self, monkeypatch):
        self.now = 0.0
        monkeypatch.setattr(work, "_clock", lambda: self.now)

    def count(self, seconds, takes):
        self.now += takes
        counted(seconds)


def shares(reports):
    """In per cent."""
    return [round(100 * one.share) for one in reports if one]


def test_reports_come_with_the_clock_and_say_what_is_left(monkeypatch):
    clock, reports = Clock(monkeypatch), []
    with reporting_to(reports.append), work.work("solving", 10.0):
        assert shares(reports) == [0] and math.isnan(reports[0].left)
        clock.count(0.1, work.PAUSE)  # too little to tell a speed
        clock.count(0.9, work.PAUSE / 2)
        assert shares(reports) == [0, 1] and math.isnan(reports[1].left)
        clock.count(1.5, work.PAUSE / 2)  # 2.5 of 10 in two pauses
        assert reports[-1].left == pytest.approx(6 * work.PAUSE) and reports[-1].so_far == "solving 25%"
    assert reports[-1] is None


def test_a_whole_takes_what_it_takes_and_may_have_parts(monkeypatch):
    clock, reports = Clock(monkeypatch), []
    with reporting_to(reports.append), work.work("solving", 10.0):
        with work.work("part of it", 1.0):
            clock.count(4.0, 1.0)
        clock.count(16.0, 1.0)  # more than was predicted
        expected(20.0)
        clock.count(0.0, 1.0)
    assert shares(reports) == [0, 40, 98, 50] and {one.title for one in reports if one} == {"solving"}


def test_what_cannot_be_predicted_has_no_share_and_what_was_done_counts(monkeypatch):
    clock, reports = Clock(monkeypatch), []
    with reporting_to(reports.append):
        with work.work("solving", math.inf):
            clock.count(0.0, 1.0)
        with work.work("solving", 5.0, 5.0):
            clock.count(2.5, 1.0)
    assert [one.so_far for one in reports if one] == [*["solving"] * 2, "solving 50%", "solving 75%"]


def test_nobody_is_told_after_the_block_nor_after_an_error():
    reports = []
    with pytest.raises(KeyboardInterrupt), reporting_to(reports.append), work.work("solving", 1.0):
        raise KeyboardInterrupt
    number = len(reports)
    with work.work("solving", 1.0):
        counted(1.0)
    assert len(reports) == number and reports[-1] is None
    with reporting_to(reports.append), work.work("solving", 2.0):
        assert reports[number].done == 0.0


CYLINDER = MaxwellBloch(sigma=(0.5, 0.5)), (0.3, 0.5, -0.3)
SPHERE = RigidBody((2.0, 1.0, 2 / 3), (1.0, 2.0, 3.0), (1.0, 1.0, 1.0)), (math.cos(1.1), 0.0, math.sin(1.1))


def smooth(y):
    """A function with parts in all classes."""
    return (1 + y[0]) * (1 + y[1]) * (1 + y[2])


def scheme_errors(model, initial):
    rows = compositions(SCHEMES["splitting"].composition, model)
    found = expectations.expectations(model, rows, initial, 0.5, [0.25, 0.125, 0.0625], [smooth], 1e-6)
    return found.value, found.limit


def refinements(model, initial):
    refiner = expectations.refiner(model, initial, 0.5, [smooth], 1e-6)
    with work.work("solving", sum(refiner.costs(refiner.effort)[:3])):
        return [refiner.refine(number)[0] for number in range(3)]


def means(model, initial):
    return expectations.exact_expectations(model, initial, np.array([0.25, 0.5]), [smooth], 1e-6)


@pytest.mark.parametrize(
    ("asked", "question"),
    [
        *((one, question) for one in (scheme_errors, refinements) for question in (CYLINDER, SPHERE)),
        (means, SPHERE),
    ],
)
def test_solvers_tell_how_far_they_are(monkeypatch, asked, question):
    alone, reports = asked(*question), []
    monkeypatch.setattr(work, "PAUSE", 0.0)
    with reporting_to(reports.append):
        found = asked(*question)
    np.testing.assert_array_equal(found[0], alone[0])  # and telling changes nothing
    done = [one.done for one in reports[:-1]]
    assert reports[-1] is None and len(done) > 20 and (np.diff(done) >= 0).all()
    assert all(0 <= one.share < 1 for one in reports[:-1])
    # Neither is most of it counted only when it is over, nor in one piece.
    assert reports[-2].share > 0.2 and np.diff(done).max() < 0.8 * done[-1]


@pytest.mark.parametrize("question", [CYLINDER, SPHERE])
def test_solvers_stop_at_once(monkeypatch, question):
    def stop(now):
        if now and now.done > 0:
            raise KeyboardInterrupt

    monkeypatch.setattr(work, "PAUSE", 0.0)
    with pytest.raises(KeyboardInterrupt), reporting_to(stop):
        scheme_errors(*question)


@pytest.mark.slow
def test_predicted_seconds_are_those_taken_up_to_the_speed_of_the_machine():
    """Of refinements with few and many steps, with kinks and without, of one class and of four."""
    from phis import functions_of

    asked = [
        (MaxwellBloch(sigma=(0.7, 0.4)), (1.0, 0.5, -0.3), 3.0, ["y3^2"], 1e-3),
        (MaxwellBloch(sigma=(0.7, 0.4)), (1.0, 0.5, -0.3), 3.0, ["abs(y3 - 0.3)"], 1e-9),
        (MaxwellBloch(sigma=(1.0, 0.0)), (1.0, 2.0, 3.0), 1.0, ["y1"], 1e-9),
        (SPHERE[0], (0.48, 0.6, 0.64), 1.0, ["y2^2"], 1e-6),
        (SPHERE[0], (0.48, 0.6, 0.64), 3.0, ["abs(y3 - 0.2)", "exp(y1)"], 1e-6),
    ]
    ratios = []
    for model, initial, final_time, texts, accuracy in asked:
        refiner = expectations.refiner(model, initial, final_time, functions_of(texts, 3), accuracy)
        *_, effort = refiner.refine(2)
        began = time.process_time()
        refiner.refine(3)
        ratios.append((time.process_time() - began) / refiner.costs(effort)[3])
    assert max(ratios) / min(ratios) < 3.0, ratios
