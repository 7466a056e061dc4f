"""Answers to a wanted accuracy: the choice of levels, its bias, and what comes out beside what is known."""

import itertools
import json
import math
from dataclasses import replace

import numpy as np
import pytest
from helpers import INITIAL, compiled_only
from kills import in_shards, interrupted, numbers
from scipy.stats import beta, t
from states import finished

import spi
from spi import views
from spi.api.specs import of_mapping
from spi.numerics.rng import LANES
from spi.plugins.answers.kinds.answer import allocation as allocating
from spi.plugins.answers.kinds.answer import planner, study
from spi.plugins.answers.kinds.answer.decisions import pilot_of
from spi.plugins.answers.kinds.answer.planner import (
    BIAS_SHARE,
    MeanTerm,
    Measured,
    Spread,
    allocation,
    bound,
    changed,
    choose,
    contradicted,
    sampling_error,
    shares,
)
from spi.plugins.answers.kinds.answer.sets import LEVELS, SetOf
from spi.printing import short
from spi.running.run import load, results_path, run
from spi.statistics.estimators import GROUPS, weights, with_powers
from spi.statistics.tallies import Batch
from spi.storage import INTERVAL

MODEL = {"name": "rigid_body", "inertia": [2, 1, "2/3"], "noise_inertia": [1, 2, 3]}
ASKED = {"initial": list(INITIAL), "final_time": 1}
SPEC = """\
kind: answer
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3]}
initial: [cos(1.1), 0, sin(1.1)]
final_time: 1
functions: {square: y1^2, wave: sin(2*pi*y1)}
accuracy: 2e-2
"""


def measured(constants, order, samples=10**6, variance=1e-4, apart=1.0):
    """Levels whose error is sum_i constants[i] h^(order + i apart), of one function of variance 1."""
    h = 0.5 ** np.arange(LEVELS)
    error = sum(c * h ** (order + i * apart) for i, c in enumerate(constants))
    mean = np.append(0.0, np.diff(error))
    spread = np.append(0.0, variance * 0.25 ** np.arange(1, LEVELS))
    normal = (0 * spread, 3.0 + 0 * spread, spread < 0, spread < 0)  # the third moment, the kurtosis, none equal
    differences = Spread(*(one[:, np.newaxis] for one in (mean, spread, *normal)))
    values = Spread(*(one[:, np.newaxis] for one in (mean, 1.0 + 0 * spread, *normal)))
    paths = np.where((np.arange(LEVELS) > 0) & (np.arange(LEVELS) <= 8), samples, 0.0)
    steps = 2.0 ** np.arange(LEVELS)
    return Measured.of(differences, paths, values, np.append(3e-9 * steps, 1e-9 * steps)), error


def test_shares_make_the_extrapolated_value():
    """R is w_0 P_L + w_1 P_(L-1) + ... however it is told by differences."""
    value = np.random.default_rng(1).standard_normal(LEVELS)
    for exponents in ((), (2.0,), (2.0, 3.0), (2.0, 4.0, 6.0)):
        w = weights(exponents)
        s = shares(w, 1, 7, LEVELS)
        r = [sum(w[i] * value[k - i] for i in range(len(w))) for k in (7, 6)]
        assert value[1] + s[1:] @ np.diff(value) == pytest.approx(r[0])
        differences = np.append(0.0, np.diff(value))[:, np.newaxis]
        known = measured([0.3], 2.0)[0]._replace(mean=differences, stderr=0.0 * differences)
        assert changed(known, w, 7)[0] == pytest.approx(r[0] - r[1])


@pytest.mark.parametrize("levels", [0, 1, 2])
def test_the_bound_holds_the_bias(levels):
    """Of errors a h^2 + b h^3 + c h^4 with known constants, but for the next powers and noise."""
    known, error = measured([0.3, -0.2, 0.1], 2.0)
    exponents = 2.0, 3.0, 4.0, 5.0
    w = weights(exponents[:levels])
    for finest in (levels + 3, 6, 8):
        true = abs(sum(w[i] * error[finest - i] for i in range(len(w))))
        found = float(bound(known, exponents, levels, finest)[0])
        noise = float(changed(known, w, min(finest, 8))[1][0]) / (2.0 ** exponents[levels] - 1.0)
        assert 0.8 * true - 3 * noise <= found <= 3 * true + 6 * noise


def test_the_choice_has_the_least_work_of_those_that_are_exact_enough():
    known, _ = measured([0.3, -0.2, 0.1], 2.0)
    exponents = 2.0, 3.0, 4.0, 5.0
    found = choose(known, exponents, (0, 1, 2, 3), 1e-4)
    assert found.bias <= BIAS_SHARE * 1e-4
    for levels in range(4):
        assert found.work <= choose(known, exponents, (levels,), 1e-4).work
    samples = allocation(known, exponents, found, 1e-4)
    s = shares(weights(exponents[: found.levels]), found.base, found.finest, LEVELS)
    variance = np.concatenate([s**2 * known.variance[:, 0], known.value_variance[:, 0]])
    used = samples > 0
    used[found.finest + 1] = False
    reached = INTERVAL * math.sqrt((variance[used] / samples[used]).sum()) + found.bias
    assert reached == pytest.approx(1e-4, rel=0.02)
    # a tenth of the accuracy takes a hundred times the samples, and finer steps
    finer = choose(known, exponents, (0,), 1e-5)
    coarser = choose(known, exponents, (0,), 1e-4)
    assert finer.finest > coarser.finest and 80 < finer.work / coarser.work < 150


def rarely(seen, samples=1024):
    """What is known of an indicator that hardly any path changes: in a pilot of each level as many values as given."""
    share = np.array(seen, float)[:, np.newaxis] / samples
    equal = share == 0.0
    variance = np.where(equal, 3.0 / samples, share)
    nothing, tails = 0.0 * variance, np.where(equal, np.nan, 1.0 / np.maximum(share, 1e-300))
    there = np.where((np.arange(len(share)) > 0) & (np.arange(len(share)) <= 7), samples, 0.0)
    differences = Spread(share, variance, nothing, tails, equal, equal & False)
    values = Spread(nothing + 1e-3, nothing + 1e-3, nothing, nothing + 3.0, equal & False, equal & False)
    steps = 2.0 ** np.arange(len(share))
    return Measured.of(differences, there, values, np.append(3e-9 * steps, 1e-9 * steps))


def test_where_rare_values_decide_no_more_is_asked_than_matters():
    """One value among n has the kurtosis n, and of none the rule of three knows more the more are sampled."""
    choice, error = planner.Choice(0, 0, 2, 0.0, 0.0), 1e-3 / INTERVAL
    unseen = allocation(rarely([0] * LEVELS), (2.0,), choice, 1e-3)
    assert unseen[3] == pytest.approx(math.sqrt(3.0) / (0.15 * 1e-3))  # not 3 / 1024 / (0.15 * 1e-3)^2
    assert unseen[1:3] == pytest.approx(math.sqrt(3.0) / (error / 4))
    once = rarely([0, 1, 0, 1, *[0] * (LEVELS - 4)], 2**16)
    samples, variance = allocation(once, (2.0,), choice, 1e-3), once.variance[1, 0]
    assert 3 / 2**16 < variance * 1.1 < 1.2 * 3 / 2**16  # no less than where none was seen
    assert samples[1] == pytest.approx(5 * variance / (error / 4) ** 2)  # not 2^17, as its tails would ask for


@compiled_only
def sampled_seconds(state):
    """Seconds of typical speed of all paths."""
    return sum(state.plan.costs[SetOf.of(number)] * tally.paths for number, tally in state.tallies.items())


def test_a_rare_value_makes_no_answer_many_times_dearer():
    """Of 1,024 paths of each level of this pilot one differs, at a small step; the answer took 170 times the usual."""
    rare = "(1 + (y3 - 0.3)/abs(y3 - 0.3))/2"
    model = {"name": "maxwell_bloch", "sigma": [0.7, 0.4]}
    spent = []
    for seed in (11, 12):
        state = answered(model, rare, [1, 0.5, -0.3], 0.3, accuracy=1e-3, seed=seed)
        spent.append(sampled_seconds(state))
    assert spent[1] < 4 * spent[0]


def test_points_come_in_powers_of_two():
    """The differences share what these leave, so that the variance wanted is reached; those that are there are free."""
    known, _ = measured([0.3, -0.2, 0.1], 2.0)
    found = choose(known, (2.0, 3.0, 4.0, 5.0), (0,), 1e-4)
    plain = allocation(known, (2.0,), found, 1e-4)
    for there in (2**15, 2**40):
        points = known._replace(along=np.full(LEVELS, there))
        samples = allocation(points, (2.0,), found, 1e-4)
        number = samples[LEVELS + found.base]
        assert math.log2(number) % 1 == 0 and number >= there
        s = shares(weights(()), found.base, found.finest, LEVELS)
        used = (s != 0) & (samples[:LEVELS] > 0)
        variance = 1.0 / number + (s**2 * known.variance[:, 0])[used] @ (1.0 / samples[:LEVELS][used])
        assert found.bias + INTERVAL * math.sqrt(variance) == pytest.approx(1e-4, rel=0.02)
    assert samples[found.base + 1] < plain[found.base + 1]  # where the points take nothing of the variance


def test_an_order_that_is_not_that_of_theory_is_found():
    exponents = 2.0, 3.0, 4.0, 5.0
    rough, _ = measured([0.1], 1.0)
    assert contradicted(rough, exponents, 0, 1e-5) == pytest.approx(1.0, abs=0.05)
    smooth, _ = measured([0.3, -0.1], 2.0)
    assert contradicted(smooth, exponents, 0, 1e-5) is None
    assert contradicted(rough, exponents, 0, 10.0) is None  # where it does not matter


@compiled_only
def test_the_truth_lies_within_the_interval():
    """Sampled against the solution without sampling, at two accuracies, with the check by one step finer."""
    functions = {"square": "y1^2", "wave": "sin(2*pi*y1)"}
    exact = spi.answer(MODEL, functions, **ASKED, accuracy=1e-4)
    assert exact.chosen is None and exact.reached and (exact.half <= 1e-4).all()
    for accuracy, seed in ((2e-2, 1), (6e-3, 2)):
        found = spi.answer(MODEL, functions, **ASKED, accuracy=accuracy, seed=seed, sampling=True)
        assert found.reached and (found.half <= accuracy).all() and found.chosen.passed
        assert (np.abs(found.value - exact.value) <= 1.5 * found.half).all()
        assert found.chosen.scheme == "splitting_order2"
        assert (found.bias <= 0.35 * found.half.max()).all() and found.warnings == ()
        assert (found.sampling >= INTERVAL * found.stderr).all()
        assert found.half == pytest.approx(found.bias + INTERVAL * found.stderr, rel=0.1)
        np.testing.assert_allclose(found.chosen.levels.share[-1], 0.0)  # of the check
        assert "95 %" in str(found) and "checked at" in str(found) and "next digit" in str(found)


@compiled_only
def test_a_bias_that_is_too_large_is_noticed_by_the_check(monkeypatch):
    """Where the planner is told that there is no bias, one step finer says otherwise, and it goes on."""
    ask = {**ASKED, "accuracy": 6e-3, "sampling": True, "extrapolate": [0], "seed": 3}
    honest = spi.answer(MODEL, "sin(2*pi*y1)", **ask)
    allocated, calls = study.AnswerPlan._allocated, []

    def blind(p, state, extra, stage):
        calls.append(stage)
        found = allocated(p, state, extra, stage)
        return found._replace(base=0, finest=1, wanted=np.maximum(found.wanted, pilot_of(0, len(found.wanted))))

    monkeypatch.setattr(study.AnswerPlan, "_allocated", blind)
    found = spi.answer(MODEL, "sin(2*pi*y1)", **ask)
    assert calls and found.chosen.smallest_step < 0.5 and found.chosen.passed
    assert abs(found.value[0] - honest.value[0]) < 2 * (found.half[0] + honest.half[0])


@compiled_only
def test_tails_and_orders_that_are_not_those_of_theory_are_said(monkeypatch):
    ask = {**ASKED, "accuracy": 6e-2, "sampling": True}
    monkeypatch.setattr(study, "HEAVY_TAILS", 5.0)
    found = spi.answer(MODEL, "tanh(400*(y1 - 1/4))", **ask)
    (told,) = found.warnings
    assert told.startswith("heavy tails: the kurtosis of a level is ")
    monkeypatch.setattr(planner, "contradicted", lambda *what: 0.75)
    found = spi.answer(MODEL, "tanh(400*(y1 - 1/4))", **ask)
    assert found.warnings[0].startswith("the order found is 0.75, not 2 as assumed")
    assert (found.chosen.extrapolated, found.chosen.order) == (0, 0.75)


@compiled_only
def test_what_is_not_finite_and_what_time_does_not_allow_is_said():
    """Where phi has no finite values no number of paths is enough: a few will do to say so."""
    found = spi.answer(MODEL, "exp(10^4*(1 + y1^2))", **ASKED, accuracy=1.0, sampling=True)
    assert not found.reached and found.warnings[-1] == "not finite: phi; paths diverged"
    assert found.chosen.samples < 2000
    found = spi.answer(MODEL, "y1^2", **ASKED, accuracy=1e-7, sampling=True, seconds=0.01)
    assert found.aim > 1e-5 and found.half[0] <= found.aim and any("raise seconds" in line for line in found.warnings)


@compiled_only
def test_shards_interruptions_and_repetitions_give_the_same_bits(tmp_path):
    spec = tmp_path / "asked.yaml"
    spec.write_text(f"{SPEC}sampling: true\n", encoding="utf-8")
    experiment = load(spec)
    ways = {"straight": run, "again": run, "interrupted": interrupted, "in shards": in_shards}
    first, *others = (numbers(way(experiment, tmp_path / name)) for name, way in ways.items())
    assert first and all(one == first for one in others)
    results = spi.storage.read(results_path(experiment, tmp_path / "straight"))
    rows = views.rows(results)
    assert [row["function"] for row in rows] == ["square", "wave"] and json.dumps(rows) and views.figure(results).axes


@compiled_only
def test_a_scheme_for_another_equation_is_caught_by_another_scheme(monkeypatch):
    """Which one step finer of the same scheme cannot see: here the other one has noise that is a tenth weaker."""
    ask = {
        **ASKED,
        "accuracy": 3e-3,
        "sampling": True,
        "reference_scheme": "splitting",
        "schemes": ["splitting_order2"],
    }
    found = spi.answer(MODEL, "y1^2", **ask)
    assert found.reached and found.compared.agrees and "and by splitting" in str(found) and not found.warnings
    assert abs(found.compared.difference[0]) > 2 * abs(found.compared.left[0])  # the biases of both at that step
    honest = study.AnswerPlan.reference.func

    def weaker(plan):
        model = plan.model._replace(sigma=tuple(0.9 * s for s in plan.model.sigma))
        return replace(honest(plan), case=plan.case.model_copy(update={"model": model}))

    monkeypatch.setattr(study.AnswerPlan, "reference", property(weaker))
    wrong = spi.answer(MODEL, "y1^2", **ask)
    assert not wrong.reached and not wrong.compared.agrees and wrong.value == found.value
    assert wrong.warnings[-1].startswith("splitting_order2 and splitting have other limits, ")


@compiled_only
def test_steps_and_samples_may_be_fixed():
    ask = {**ASKED, "sampling": True, "extrapolate": [0], "seed": 5}
    found = spi.answer(MODEL, "y1^2", **ask, accuracy=1e-3, steps=["1/2", "1/4"], samples=4096)
    assert (found.chosen.largest_step, found.chosen.smallest_step) == (0.5, 0.25)
    assert found.chosen.samples <= 4096 and found.aim > 1e-3
    free = spi.answer(MODEL, "y1^2", **ask, accuracy=4e-3)
    assert abs(found.value[0] - free.value[0]) < 1.5 * (found.half[0] + free.half[0])
    biased = spi.answer(MODEL, "sin(2*pi*y1)", **ask, accuracy=5e-3, steps=["1/2", "1/4"])
    assert biased.warnings[-1].endswith("because of the bias of the smallest step")
    assert biased.bias[0] > biased.sampling[0]


@pytest.mark.slow
@compiled_only
def test_points_take_the_place_of_paths_where_there_is_more_to_do(monkeypatch):
    """The largest step follows scrambled points: fewer of them, and the truth within the interval."""
    functions = {"wave": "sin(2*pi*y1)"}
    exact = spi.answer(MODEL, functions, **ASKED, accuracy=1e-4)
    ask = {**ASKED, "accuracy": 4e-3, "sampling": True, "schemes": ["splitting_order2"], "seed": 4}
    paths = spi.answer(MODEL, functions, **ask)
    monkeypatch.setattr(allocating, "QUASI_WORTH", 0.0)
    monkeypatch.setattr(allocating, "QUASI_PILOT_SAMPLES", 2**12)
    points = spi.answer(MODEL, functions, **ask)
    assert points.chosen.points and not paths.chosen.points and "quasi-random points" in str(points)
    assert points.reached and points.chosen.samples < paths.chosen.samples / 2
    assert points.chosen.samples & (points.chosen.samples - 1) == 0
    assert abs(points.value[0] - exact.value[0]) < 1.5 * points.half[0]


WIENER = {"variables": ["q", "p"], "bracket": {"q p": 1}, "hamiltonian": "p", "noises": ["q"], "sigma": [1]}
PARAMETRIC = {**WIENER, "hamiltonian": "(p^2 + q^2)/2", "noises": ["q^2/2"]}
FROM_0 = {"initial": [0, 0], "final_time": 1}  # where p(1) = -W(1)


def sums_of(values):
    """The sums of powers over samples (F, paths), as a plan keeps them."""
    powers = np.zeros((4, len(values), GROUPS))
    blocks = values.reshape(len(values), -1, LANES).transpose(1, 0, 2)
    return with_powers(powers, blocks, Batch.of_first(len(blocks)))


def test_equal_values_have_the_bound_of_the_rule_of_three():
    """Times the range of the function; of one that is not known nothing is; one hit of many is none of these."""
    paths = 8 * LANES
    one = np.zeros((4, paths))
    one[1, 77], one[3] = 1.0, np.pi
    found = Spread.of(sums_of(one), paths, np.array([1.0, 1.0, np.inf, 0.0]))
    assert found.equal.tolist() == [True, False, True, False] and found.unknown.tolist() == [False, False, True, False]
    assert found.variance == pytest.approx([1 - 0.05 ** (1 / paths), one[1].var(), 0.0, 0.0], rel=0.02)
    stderr, half, _ = sampling_error([MeanTerm(1.0, found, paths)])
    assert half[0] > 3 / paths and half[1] == pytest.approx(clopper_end(1, paths), rel=0.3) and half[3] == 0.0
    assert half[1] > 2 * INTERVAL * stderr[1]


def clopper_end(count, paths):
    """From the mean to the upper end of Clopper and Pearson's interval."""
    return float(beta.ppf(0.975, count + 1, paths - count)) - count / paths


@pytest.mark.parametrize(("count", "off"), [(2, 0.05), (4, 0.05), (16, 0.05), (64, 0.03), (400, 0.02)])
def test_intervals_of_rare_events_end_where_those_of_shares_do(count, off):
    paths = 64 * LANES
    values = np.zeros((1, paths))
    values[0, np.random.default_rng(count).choice(paths, count, replace=False)] = 1.0
    _, half, _ = sampling_error([MeanTerm(1.0, Spread.of(sums_of(values), paths, np.ones(1)), paths)])
    assert half[0] == pytest.approx(clopper_end(count, paths), rel=off)


def test_intervals_of_symmetric_means_are_those_of_student():
    """As many degrees of freedom as the spread of a variance has; with many samples 1.96 standard errors."""
    paths = 8 * LANES
    values = np.tile([[1.0, -1.0, 2.0, -2.0]], paths // 4)
    spread = Spread.of(sums_of(values), paths, np.array([np.inf]))
    stderr, half, _ = sampling_error([MeanTerm(1.0, spread, paths)])
    tails = np.mean(values**4) / np.mean(values**2) ** 2
    assert half[0] / stderr[0] == pytest.approx(t.ppf(0.975, 2 * paths / (tails - 1)), rel=1e-6)


@compiled_only
@pytest.mark.slow
def test_rare_events_are_seen_and_their_intervals_hold():
    """P(W(1) > 3.09) = 1.0008e-3, of which pilots see nothing: 40 seeds, of which at least 35 of 40 hold at 95 %."""
    truth, held = 0.5 * math.erfc(3.09 / math.sqrt(2)), 0
    for seed in range(1, 41):
        found = spi.answer(WIENER, "(1 + (p - 3.09)/abs(p - 3.09))/2", **FROM_0, accuracy=1e-4, seed=seed)
        assert found.reached and found.stderr[0] > 0 and 0 < found.half[0] <= 1e-4 and not found.warnings
        held += abs(found.value[0] - truth) <= found.half[0]
    assert held >= 35


@compiled_only
@pytest.mark.slow
def test_what_was_never_seen_is_bounded_or_not_resolved():
    never = spi.answer(WIENER, "(1 + (p - 9)/abs(p - 9))/2", **FROM_0, accuracy=1e-4)
    assert never.reached and never.value[0] == 0.0 and 1e-6 < never.half[0] <= 1e-4
    unknown = spi.answer(WIENER, "(p - 9 + abs(p - 9))/2", **FROM_0, accuracy=1e-4)
    assert not unknown.reached and np.isinf(unknown.half[0]) and unknown.warnings[-1].startswith("not resolved: phi; ")
    assert "not resolved" in str(unknown) and "±" not in str(unknown).splitlines()[0]
    exact = spi.answer(WIENER, "p^2", **FROM_0, accuracy=1e-2)  # all levels are exact, and their differences 0
    assert exact.reached and abs(exact.value[0] - 1) < 1.5 * exact.half[0]
    lost = spi.answer(WIENER, "log(p)", **FROM_0, accuracy=1e-3)
    assert "not finite" in str(lost).splitlines()[0] and len(lost.warnings) == 1


@compiled_only
@pytest.mark.slow
def test_seconds_are_kept_whatever_the_tails_are():
    """Parametric noise: pilots know a hundredth of the variance of q^2 p^2, which in the end few paths have."""
    for seed, final_time in itertools.product((1, 2, 3), (1, 4)):
        state = answered(PARAMETRIC, "q^2*p^2", [1, 0], final_time, seconds=0.3, seed=seed)
        spent = sampled_seconds(state)
        assert 0.1 < spent <= 1.5 * 0.3
        found = state.plan.results(state)
        if final_time == 4:
            assert np.isinf(found.half[0]) and not found.reached
            assert found.warnings[-1].startswith("not resolved: phi; a few samples have nearly all of the variance")
            continue
        half = short(found.half[0])
        assert found.warnings[0].startswith(f"the interval is {half} to each side: accuracy 0.0001 would take more")
        assert found.aim == found.half[0]


def answered(model, function, initial, final_time, **keys):
    """The final state of a question."""
    data = {"kind": "answer", "model": model, "functions": function, "accuracy": 1e-4, "sampling": True, **keys}
    (case,) = of_mapping({**data, "initial": initial, "final_time": final_time}, "answer").cases
    return finished(study.plan(case, study.parts(case)[0]))


@compiled_only
@pytest.mark.slow
@pytest.mark.filterwarnings("error")
def test_without_noise_there_are_no_warnings_of_numpy():
    """All paths are the same: nothing is sampled but the bias, and a Casimir function has rounding errors."""
    still = {**MODEL, "sigma": [0.0, 0.0, 0.0]}
    functions = {"first": "y1", "casimir": "y1^2 + y2^2 + y3^2"}
    found = spi.answer(still, functions, **ASKED, accuracy=1e-4, sampling=True, schemes=["splitting_symmetric"])
    assert found.reached and (found.half > 0).all() and found.stderr[0] == 0.0 and not found.warnings


@compiled_only
def test_python_functions_are_answered_like_formulas():
    """Sampled, since their ranges are not known; the same paths, and the same interval."""
    ask = {**ASKED, "accuracy": 2e-2, "progress": False}
    formula = spi.answer(MODEL, "y1^2", **ask, sampling=True)
    found = spi.answer(MODEL, {"mine": lambda y: y[0] ** 2, "theirs": "y2"}, **ask)
    assert found.value[0] == pytest.approx(formula.value[0], abs=1.5 * formula.half[0]) and found.reached
    alone = spi.answer(MODEL, lambda y: y[0] ** 2, **ask)
    assert (alone.value, alone.half) == (formula.value, formula.half) and "E phi at t = 1: " in str(alone)
    assert "E mine at" in str(found) and "E theirs = E y2 at" in str(found)
    with pytest.raises(ValueError, match=r"the function phi returned shape \(3, (\d+)\) for \1 paths; one each"):
        spi.answer(MODEL, lambda y: y, **ask)
