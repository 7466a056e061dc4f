"""Solve or sample: which is chosen follows from predicted seconds, which no clock decides."""

import itertools
import math
from types import SimpleNamespace

import numpy as np
import pytest

from spi.plugins.answers.kinds.answer import study
from spi.plugins.answers.kinds.answer.decisions import Decisions, SolveOrSample, Stage
from spi.plugins.answers.kinds.answer.sets import LEVELS, SETS, Role, SetOf, all_sets, no_samples
from spi.plugins.answers.kinds.answer.solving import SURE, why
from spi.printing import short

TRUTH = 0.5


class Refiner:
    """Refinement k has the error 0.1 falls^k and takes first growth^k seconds of typical speed."""

    known, effort = None, 1.0

    def __init__(self, first, growth, falls, rough=1.4**-2, takes=1.0):
        self.seconds, self.falls, self.rough = [first * growth**k for k in range(9)], falls, np.array([rough])
        self.takes = takes

    def costs(self, effort):
        return [effort * seconds for seconds in self.seconds]

    def refine(self, number):
        return np.array([TRUTH + 0.1 * self.falls**number]), np.zeros(1), self.takes


def decided(monkeypatch, refiner, per_sample, accuracy, seconds=1e30):
    """(the decisions at the end, all seconds of typical speed), where sampling takes per_sample / accuracy^2."""
    monkeypatch.setattr(study.AnswerPlan, "refining", refiner)
    monkeypatch.setattr(study.AnswerPlan, "solvable", True)
    plan = study.AnswerPlan(case=SimpleNamespace(accuracy=accuracy, seconds=seconds), part=None)
    extra = Decisions.initial(1, 1, False)
    sampling = per_sample / accuracy**2
    aim = accuracy * max(1.0, math.sqrt(sampling / seconds))

    def after_pilot(plan, state):
        return state.extra._replace(stage=Stage.WHOLE, work=sampling, aim=aim)

    monkeypatch.setattr(study.AnswerPlan, "_after_pilot", after_pilot)
    while extra.stage != Stage.DONE and not (extra.way == SolveOrSample.SAMPLING and extra.stage == Stage.WHOLE):
        assert extra.stage == Stage.PILOT
        extra = plan.next_allocation(SimpleNamespace(extra=extra))
    solved = refiner.takes * sum(refiner.seconds[: len(extra.refined)])
    return extra, solved + (sampling if extra.way == SolveOrSample.SAMPLING else 0.0)


@pytest.mark.parametrize("growth", [1.5, 3.0, 10.0])
def test_a_smaller_accuracy_never_takes_less_than_a_tenth(monkeypatch, growth):
    accuracies = 10.0 ** -np.arange(1, 9)
    ways = set()
    for falls, first, per_sample in itertools.product((0.05, 0.3, 0.7, 0.95), (1e-3, 1.0, 100.0), (1e-8, 1e-5, 1e-2)):
        refiner = Refiner(first, growth, falls)
        found = [decided(monkeypatch, refiner, per_sample, accuracy) for accuracy in accuracies]
        takes = np.array([one[1] for one in found])
        assert (takes[1:] >= 0.1 * np.maximum.accumulate(takes)[:-1]).all(), (falls, first, per_sample, takes)
        ways |= {extra.way for extra, _ in found}
    assert ways == {SolveOrSample.SOLVING, SolveOrSample.SAMPLING}


@pytest.mark.parametrize(
    ("first", "per_sample", "solves"),
    [(1e-3, 1e-5, True), (100.0, 1e-8, False), (100.0, 1.0, True), (1.0, 1e-9, False), (30.0, 1e-4, False)],
)
def test_the_cheaper_is_chosen_and_both_are_said(monkeypatch, first, per_sample, solves):
    accuracy = 1e-3
    refiner = Refiner(first, 3.0, 0.1)
    extra, takes = decided(monkeypatch, refiner, per_sample, accuracy)
    assert (extra.way == SolveOrSample.SOLVING) == solves
    needed = sum(refiner.seconds[:4])  # of which an error of 1e-3 at a kink can be told
    sampling = per_sample / accuracy**2
    assert takes <= 1.5 * min(needed, sampling) or takes <= 1.5 * SURE + sampling
    said = why(extra, accuracy)
    solving_seconds, sampling_seconds = (short(x, ".2g") for x in (extra.solving_seconds, extra.sampling_seconds))
    assert said.startswith(f"predicted seconds of typical speed to 0.001: solving {solving_seconds}, sampling ")
    if math.isnan(extra.sampling_seconds):
        assert said.endswith("not looked at, as solving was to take less than 3") and takes <= SURE
    else:
        assert said.endswith(f", sampling {sampling_seconds}")
        assert extra.sampling_seconds == sampling
    if solves:
        solution, _ = study.AnswerPlan(case=SimpleNamespace(accuracy=accuracy), part=None).prospect(extra)
        assert abs(solution.value[0] - TRUTH) <= solution.bound[0] <= accuracy


def test_where_neither_reaches_it_the_better_is_the_answer(monkeypatch):
    """Refinements end at an error of 0.08, and sampling may take 100 seconds."""
    refiner = Refiner(4.0, 1.2, 0.99)
    refiner.seconds = refiner.seconds[:5]
    for per_sample, way in ((1e-3, SolveOrSample.SAMPLING), (1e4, SolveOrSample.SOLVING)):
        extra, _ = decided(monkeypatch, refiner, per_sample, 1e-3, 100.0)
        assert extra.way == way
    assert "does not reach it" in why(extra, 1e-3)


@pytest.mark.parametrize("seconds", [10.0, 100.0])
@pytest.mark.parametrize("growth", [1.5, 3.0])
def test_a_smaller_accuracy_never_gives_a_wider_interval(monkeypatch, growth, seconds):
    """Where the seconds allow neither way to reach it, the way that reached the larger one goes on, or the better."""
    accuracies, unreached = 10.0 ** -np.arange(1, 5, 0.25), 0
    for falls, first, per_sample in itertools.product((0.05, 0.3, 0.7), (0.1, 1.0, 5.0), (1e-8, 1e-5, 1e-2)):
        refiner, halves = Refiner(first, growth, falls), []
        for accuracy in accuracies:
            extra, _ = decided(monkeypatch, refiner, per_sample, accuracy, seconds)
            plan = study.AnswerPlan(case=SimpleNamespace(accuracy=accuracy), part=None)
            bound = float(plan.prospect(extra)[0].bound.max())
            halves.append(min(bound, extra.aim if extra.way == SolveOrSample.SAMPLING else np.inf))
        best = np.minimum.accumulate(np.maximum(halves, accuracies))
        assert (np.array(halves[1:]) <= 1.001 * best[:-1]).all(), (falls, first, per_sample, halves)
        unreached += int((np.array(halves) > accuracies).sum())
    assert unreached > 20


def test_of_two_intervals_the_narrower_is_given(monkeypatch):
    """The samples may have more tails than the pilot knew; not where they reach the accuracy."""
    monkeypatch.setattr(study.AnswerPlan, "refining", refiner := Refiner(1.0, 3.0, 0.1))
    plan = study.AnswerPlan(case=SimpleNamespace(accuracy=1e-3), part=None)
    none, values = Decisions.initial(1, 1, False), np.array([refiner.refine(k)[0] for k in range(4)])
    extra = none._replace(refined=values, uncertain=0.0 * values, efforts=np.ones(4))
    bound = float(plan.prospect(extra)[0].bound.max())
    for half, solved in ((0.5 * bound, False), (2.0 * bound, True), (np.inf, True), (np.nan, True)):
        outcome = SimpleNamespace(half=np.array([half]))
        assert plan._is_better_solved(extra, outcome) == (solved and not half <= 1e-3), half
        assert not plan._is_better_solved(none, outcome)


@pytest.mark.parametrize("takes", [0.2, 1.0, 2.0])
@pytest.mark.parametrize("seconds", [2.0, 20.0, 200.0])
def test_seconds_hold_for_what_is_solved_and_what_it_leaves_for_samples(monkeypatch, takes, seconds):
    """Refinements take more or less than usual, which the first one tells."""
    refiner = Refiner(0.1, 1.7, 0.95, takes=takes)
    extra, _ = decided(monkeypatch, refiner, 1e6, 1e-9, seconds)
    solved = takes * sum(refiner.seconds[: len(extra.refined)])
    assert 0.2 * seconds < solved <= seconds or len(extra.refined) == len(refiner.seconds)
    plan = study.AnswerPlan(case=SimpleNamespace(seconds=seconds), part=None)
    assert plan.solved_seconds(extra) == pytest.approx(solved)  # not what is usual
    assert plan.seconds_left(extra) == pytest.approx(max(seconds - solved, 0.02 * seconds))


def test_numbers_and_streams_of_path_sets_stay():
    """They decide random numbers and the keys of stored sums; arrays of samples are laid out like the numbers."""
    sets = all_sets(3)
    assert [path_set.number for path_set in sets] == list(range(3 * SETS))
    wanted = no_samples(3)
    for path_set in sets:
        wanted[path_set] = path_set.number
    assert wanted.shape == (3, len(Role), LEVELS) and np.array_equal(wanted.ravel(), np.arange(3 * SETS))
    examples = [SetOf(0, Role.DIFFERENCES, 1), SetOf(1, Role.VALUES, 0), SetOf(2, Role.POINTS, 3)]
    examples.append(SetOf(0, Role.REFERENCE, 16))
    assert [path_set.number for path_set in examples] == [1, 85, 173, 67]
    assert [path_set.stream for path_set in examples] == [514, 682, 858, 646]
