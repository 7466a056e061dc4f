"""The weak study: against sums written out in NumPy, against expectations without sampling, and what it is sold for.

The oracles take final states from the ensemble, which has tests of its own, and do everything else anew.  All seeds are
fixed; statistical bounds are 4 standard errors.
"""

import functools
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers import BY_HAND, COMPILED, LANES, final_states
from states import batches_of, begun, check_going_on, finished, ignore, resumed, same_numbers, snapshots, taken

from spi import engine, ensemble, storage
from spi import run as runner
from spi.ensemble import AS_TOSSED, COINS_TURNED, PAIRS_REVERSED
from spi.estimators import GROUPS, group_counts, is_resolved
from spi.kinds.state import State
from spi.kinds.weak import study as weak
from spi.kinds.weak.study import estimates, multilevel
from spi.kinds.weak.study.sums import ROUND
from spi.kolmogorov import expectations
from spi.records import Part
from spi.rng import LEVELS
from spi.run import load
from spi.schemes import SCHEMES
from spi.schemes.rows import compositions

SPEC = Path(__file__).with_name("weak.yaml")
SPLITTINGS = tuple(BY_HAND)
#: The test functions by hand; for both systems, so that little is compiled.
FUNCTIONS = {"phi": lambda y: np.sin(2 * np.pi * y).sum(axis=0), "square": lambda y: y[0] ** 2}
SYSTEMS = {
    "rigid_body": (),
    "maxwell_bloch": ("model={name: maxwell_bloch, sigma: [0.5, 0.5]}", "initial=[1, -0.5, 0.8]"),
}

compiled_only = pytest.mark.skipif(not COMPILED, reason="too many steps without the compiler")


def case_of(*overrides, system="rigid_body"):
    """Steps and reference are few and coarse unless given."""
    return load(SPEC, overrides=[*SYSTEMS[system], *overrides]).cases[0]


def plan_of(case, scheme, estimator):
    return weak.plan(case, Part(scheme, estimator))


def results_of(case, scheme, estimator):
    """(variables by name, attributes) of a whole study."""
    p = plan_of(case, scheme, estimator)
    group = p.group(finished(p))
    assert (group.estimator, group.variant) == (estimator, scheme)
    assert list(group.coordinates["h"]) == list(case.steps)
    return group.arrays, group.attributes


def stderr_by_hand(values):
    """Of the mean over paths in their order, by leaving out one group of paths at a time and averaging anew."""
    n = len(values)
    groups = np.array([np.argmax(group_counts(p + 1) - group_counts(p)) for p in range(n)])
    terms, sizes = [], [(groups == g).sum() for g in range(GROUPS) if (groups == g).any()]
    without = [values[groups != g].mean() for g in range(GROUPS) if (groups == g).any()]
    pseudo = [n / m * values.mean() - (n / m - 1) * w for m, w in zip(sizes, without, strict=True)]
    centre = sum(m / n * p for m, p in zip(sizes, pseudo, strict=True))
    terms = [(p - centre) ** 2 / (n / m - 1) for m, p in zip(sizes, pseudo, strict=True)]
    return math.sqrt(np.mean(terms))


def extended(case, scheme, h):
    """By how much a difference to the reference is less than an error, (1 - (h_ref / h)^p)."""
    return 1 - (case.reference_step / h) ** SCHEMES[scheme].weak_order


def has_order(found, order):
    return np.all((found["order_low"] <= order) & (order <= found["order_high"]))


# --- plain -----------------------------------------------------------------------------------------------------------


def values_by_hand(case, scheme, seed=None):
    """h -> the values of each test function at the final time, an array [function, path]; h_ref included."""
    doublings = [0, *(round(math.log2(h / case.reference_step)) for h in reversed(case.steps))]
    y = final_states(
        SCHEMES[scheme].record,
        case.model,
        h=case.reference_step,
        steps=round(case.final_time / case.reference_step),
        doublings=doublings,
        truncate=case.truncate_noise,
        blocks=-(-case.samples // LANES),
        seed=case.seed if seed is None else seed,
        initial=case.initial,
    )
    sizes = [case.reference_step * 2**s for s in doublings]
    with np.errstate(all="ignore"):
        values = [np.array([f(states) for f in FUNCTIONS.values()]) for states in y[..., : case.samples]]
    return dict(zip(sizes, values, strict=True))


@pytest.mark.parametrize("samples", [200, 511] if COMPILED else [70])
@pytest.mark.parametrize("scheme", ["splitting", "splitting_order2"])
def test_plain_is_what_plain_numpy_finds(scheme, samples):
    case = case_of(f"samples={samples}", "seed=11")
    found, attributes = results_of(case, scheme, "plain")
    values = values_by_hand(case, scheme)
    reference = values[case.reference_step]
    np.testing.assert_allclose(found["reference"], reference.mean(axis=1), rtol=1e-12)
    for i, h in enumerate(case.steps):
        errors = (values[h] - reference) / extended(case, scheme, h)
        for f in range(len(FUNCTIONS)):
            assert math.isclose(found["error"][f, i], errors[f].mean(), rel_tol=1e-10)
            assert math.isclose(found["error_stderr"][f, i], stderr_by_hand(errors[f]), rel_tol=1e-8)
            assert math.isclose(found["expectation"][f, i], values[h][f].mean(), rel_tol=1e-10)
            assert math.isclose(found["expectation_stderr"][f, i], stderr_by_hand(values[h][f]), rel_tol=1e-8)
            # with what the number of groups leaves to chance
            textbook = errors[f].std(ddof=1) / math.sqrt(samples)
            assert abs(found["error_stderr"][f, i] / textbook - 1) < 0.5
    assert np.array_equal(found["resolved"], np.abs(found["error"]) >= 4 * found["error_stderr"])
    assert not found["nonfinite"].any() and attributes["reference_nonfinite"] == 0
    assert attributes["samples"] == samples
    assert attributes["functions"][1] == "y1^2"
    assert attributes["expected_order"] == SCHEMES[scheme].weak_order


@pytest.mark.parametrize("scheme", ["splitting", "splitting_order2"])
def test_plain_does_not_depend_on_batches_or_interruptions(scheme):
    """Prefixes within, at the beginning and at the end of blocks and of calls."""
    samples, prefixes = (600, "[1, 64, 100, 128, 300, 600]") if COMPILED else (130, "[1, 64, 100, 128]")
    p = plan_of(case_of(f"samples={samples}", f"prefixes={prefixes}"), scheme, "plain")
    whole = finished(p, p.blocks)
    for blocks in (1, 2, 4, None):
        assert same_numbers(finished(p, blocks), whole)
    assert len(check_going_on(p)) == 1 + p.blocks


def test_results_for_the_first_samples_are_those_of_a_shorter_run():
    samples, prefixes = (600, (64, 100, 512, 600)) if COMPILED else (130, (64, 100))
    case = case_of(f"samples={samples}", f"prefixes={list(prefixes)}")
    found, _ = results_of(case, "splitting_order2", "plain")
    for i, n in enumerate(prefixes):
        few, _ = results_of(case.model_copy(update={"samples": n, "prefixes": None}), "splitting_order2", "plain")
        assert np.array_equal(found["prefix_error"][i], few["error"])
        assert np.array_equal(found["prefix_error_stderr"][i], few["error_stderr"])
    assert np.all(np.diff(found["prefix_cpu_seconds"]) >= 0)


@compiled_only
def test_common_paths_resolve_errors_that_independent_paths_do_not():
    """Negative control for the coupling: the same number of samples, the reference with random numbers of its own."""
    case = case_of("steps=2^-5 .. 2^-7", "reference_step=2^-9", "samples=16384")
    common, _ = results_of(case, "splitting", "plain")
    other, _ = results_of(case.model_copy(update={"seed": 2}), "splitting", "plain")
    assert common["resolved"].all()
    assert has_order(common, 1)
    independent = common["expectation"] - other["reference"][:, np.newaxis]
    values = values_by_hand(case, "splitting", seed=2)[case.reference_step]
    stderr = np.hypot(common["expectation_stderr"], values.std(axis=1, keepdims=True) / math.sqrt(case.samples))
    assert not is_resolved(np.abs(independent), stderr).any()
    assert np.all(np.abs(independent - common["error"]) < 4 * stderr + 0.2 * np.abs(common["error"]))
    gain = stderr / common["error_stderr"]
    assert np.all(np.diff(gain, axis=1) > 0) and gain.min() > 4  # the smaller h, the more


# --- multilevel ------------------------------------------------------------------------------------------------------


def after_blocks(p, blocks, calls=1):
    """The state of multilevel after so many blocks of each level, at least in so many calls for each."""
    state = State(p)
    state.more = state.more._replace(targets=np.broadcast_to(blocks, len(p.levels)))
    with batches_of(-(-np.max(blocks) // calls)):
        engine.advance_stage_here([state], ignore, engine.everything)
    assert not state.missing()
    return state


def levels_after(p, blocks):
    """The sums over the levels then."""
    return multilevel.snapshot(p, after_blocks(p, blocks))


TWINS = AS_TOSSED, PAIRS_REVERSED, AS_TOSSED, COINS_TURNED


def levels_by_hand(case, scheme, blocks):
    """[(coarse - fine, fine) for each level]; at the largest step the value, and that of ordinary paths alone.

    Arrays [function, path]; with twins.
    """
    record, twins, levels = SCHEMES[scheme].record, scheme == "splitting_order2", []
    count = round(math.log2(max(case.steps) / case.reference_step))
    for j in range(count + 1):
        h = case.reference_step * 2**j
        doublings, reversals = ((0, 0, 1, 1), TWINS) if twins else ((0, 1), (AS_TOSSED,) * 2)
        if j == count:
            doublings, reversals = ((0, 0), (AS_TOSSED, COINS_TURNED)) if twins else ((0,), (AS_TOSSED,))
        y = final_states(
            record,
            case.model,
            h=h,
            steps=round(case.final_time / h),
            doublings=doublings,
            reversals=reversals,
            blocks=blocks[j],
            seed=case.seed,
            stream=LEVELS + 2 * j,
            initial=case.initial,
        )
        values = np.array([[f(states) for f in FUNCTIONS.values()] for states in y])
        if j == count:
            return levels, values.mean(axis=0), values[0]
        fine, coarse = values[: len(values) // 2].mean(axis=0), values[len(values) // 2 :].mean(axis=0)
        levels.append((coarse - fine, fine))
    raise AssertionError


@pytest.mark.parametrize("scheme", ["splitting", "splitting_order2"])
def test_multilevel_is_what_plain_numpy_finds(scheme):
    """Different numbers of samples on the levels."""
    case = case_of("seed=7") if COMPILED else case_of("seed=7", "steps=[2^-1, 2^-2]", "reference_step=2^-3")
    blocks = [ROUND * n for n in ((3, 1, 2, 1) if COMPILED else (1, 1, 1))]
    p = plan_of(case, scheme, "multilevel")
    state = after_blocks(p, blocks)
    group = p.group(state)
    coordinates, found, attributes = group.coordinates, group.arrays, group.attributes
    levels, base, alone = levels_by_hand(case, scheme, blocks)
    differences = [d for d, _ in levels]
    assert attributes["twins"] == (scheme == "splitting_order2")
    assert attributes["samples"] == sum(blocks) * LANES
    assert list(coordinates["level"]) == [case.reference_step * 2**j for j in range(1, len(blocks))]
    assert found["level_samples"].tolist() == [LANES * n for n in blocks[:-1]]
    for f in range(len(FUNCTIONS)):
        for j, d in enumerate(differences):
            centred = d[f] - d[f].mean()
            assert math.isclose(found["level_mean"][f, j], d[f].mean(), rel_tol=1e-9)
            assert math.isclose(found["level_variance"][f, j], d[f].var(), rel_tol=1e-9)
            kurtosis = (centred**4).mean() / (centred**2).mean() ** 2
            assert math.isclose(found["level_kurtosis"][f, j], kurtosis, rel_tol=1e-7)
        for i, h in enumerate(case.steps):
            below = round(math.log2(h / case.reference_step))
            of_level = [d[f] / extended(case, scheme, h) for d in differences[:below]]
            error = sum(d.mean() for d in of_level)
            assert math.isclose(found["error"][f, i], error, rel_tol=1e-9)
            textbook = math.sqrt(sum(d.var() / d.size for d in of_level))
            assert abs(found["error_stderr"][f, i] / textbook - 1) < 0.5
            up = sum(d[f].mean() for d in differences[below:])
            assert math.isclose(found["expectation"][f, i], base[f].mean() - up, rel_tol=1e-9)
            spread = base[f].var() / base[f].size + sum(d[f].var() / d[f].size for d in differences[below:])
            assert math.isclose(found["expectation_stderr"][f, i], math.sqrt(spread), rel_tol=1e-9)
        reference = base[f].mean() - sum(d[f].mean() for d in differences)
        assert math.isclose(found["reference"][f], reference, rel_tol=1e-9)
        assert math.isclose(found["sd"][f], alone[f].std(), rel_tol=1e-9)  # what plain sampling would have to beat
    # Giles' check: the mean at a step, once as the coarse and once as the fine step of a level
    for j, (d, fine) in enumerate(levels):
        above = levels[j + 1][1] if j + 1 < len(levels) else alone
        for f in range(len(FUNCTIONS)):
            sd = sum(x[f].std() / math.sqrt(x[f].size) for x in (d, fine, above))
            expected = abs(above[f].mean() - fine[f].mean() - d[f].mean()) / (3 * sd)
            assert math.isclose(found["level_consistency"][f, j], expected, rel_tol=1e-6)
            assert expected < 1.5
    assert not found["level_nonfinite"].any()


def test_standard_errors_of_multilevel_leave_out_groups():
    """Exactly: with as many paths on all levels an error is a mean over samples of sums of differences."""
    case = case_of("seed=5", *([] if COMPILED else ["steps=[2^-1, 2^-2]", "reference_step=2^-3"]))
    p = plan_of(case, "splitting", "multilevel")
    blocks = [ROUND] * len(p.levels)
    error, without, counts = estimates.errors(p, levels_after(p, blocks))
    found = p.group(after_blocks(p, blocks)).arrays["error_stderr"]
    assert without.shape == (GROUPS, *error.shape) and len(set(counts)) == 1
    levels, *_ = levels_by_hand(case, "splitting", blocks)
    for i, h in enumerate(case.steps):
        below = round(math.log2(h / case.reference_step))
        for f in range(len(FUNCTIONS)):
            sums = sum(d[f] for d, _ in levels[:below]) / extended(case, "splitting", h)
            assert math.isclose(error[f, i], sums.mean(), rel_tol=1e-9)
            assert math.isclose(found[f, i], stderr_by_hand(sums), rel_tol=1e-8)


@pytest.mark.parametrize("scheme", ["splitting", "splitting_order2"])
def test_multilevel_does_not_depend_on_batches(scheme):
    case = case_of(*([] if COMPILED else ["steps=[2^-1]", "reference_step=2^-2"]))
    p = plan_of(case, scheme, "multilevel")
    blocks = 12 if COMPILED else 3
    whole = after_blocks(p, blocks)
    for calls in (2, 3, blocks):
        assert same_numbers(after_blocks(p, blocks, calls), whole)
    sums = multilevel.snapshot(p, whole).sums
    assert len(np.unique(np.round(sums[:, 0, 0, 0], 12))) > len(p.levels)  # random numbers of their own


@compiled_only
def test_multilevel_goes_on_from_every_state():
    """Also from one just after an allocation, or before."""
    p = plan_of(case_of("seconds=0.01"), "splitting_order2", "multilevel")
    whole, found = finished(p, 2), snapshots(p, 2)
    assert whole.more.allocations == len(multilevel.SHARES)
    assert np.all(multilevel.snapshot(p, whole).blocks == whole.more.targets)
    assert len({tuple(plain["more"]["targets"]) for plain in found}) >= 3
    fulfilled = [plain for plain in found if not taken(p, plain).missing()]
    assert len(fulfilled) >= len(multilevel.SHARES)
    for plain in found[:: max(1, len(found) // 12)] + fulfilled:
        assert same_numbers(resumed(p, plain, 2), whole)
    assert not same_numbers(found[-2], whole)
    assert same_numbers(finished(p), whole)


@compiled_only
@pytest.mark.parametrize("wish", ["seconds=0.5", "standard_error=0.0005"])
@pytest.mark.parametrize("scheme", ["splitting", "splitting_order2"])
def test_allocation_is_the_least_work_for_the_variance(scheme, wish):
    """N_l proportional to (V_l / C_l)^(1/2), within the budget or until the standard error is what was asked for."""
    case = case_of("steps=2^-2 .. 2^-5", "reference_step=2^-7", "seconds=null", wish)
    p = plan_of(case, scheme, "multilevel")
    pilot = levels_after(p, 2 * ROUND)
    variance = estimates.moments(p, pilot).variance.max(axis=1)[:-1]
    cost = np.array([level.steps for level in p.levels])[:-1]
    for share in (0.5, 1.0):
        blocks = multilevel.allocation(p, pilot, share)
        assert np.all(blocks % ROUND == 0)
        ratio = blocks[:-1] / np.sqrt(variance / cost)
        # rounded up to whole rounds
        assert np.all(np.abs(ratio / ratio[np.argmax(blocks[:-1])] - 1) < 1.01 * ROUND / (blocks[:-1] - ROUND) + 0.01)
        assert blocks[0] > 4 * ROUND or blocks[-2] > 4 * ROUND  # so that this says something
        work = blocks @ p.seconds_per_block
        rounding = ROUND * p.seconds_per_block.sum()
        if "seconds" in wish:
            assert share * 0.5 * 0.9 < work <= share * 0.5 + rounding
        else:
            hoped = math.sqrt((variance / (blocks[:-1] * LANES)).sum())
            assert 0.8 * 0.0005 < hoped * math.sqrt(share) <= 0.0005 * 1.001
    levels = multilevel.snapshot(p, finished(p))
    assert np.all(levels.blocks >= 2 * ROUND)
    found, _ = results_of(case, scheme, "multilevel")
    stderr = found["error_stderr"][:, 0].max()
    if "seconds" in wish:
        spent, pilot_work = levels.blocks @ p.seconds_per_block, 2 * ROUND * p.seconds_per_block.sum()
        assert 0.5 * 0.8 < spent < 0.5 * 1.1 + pilot_work + rounding
    else:
        # the jackknife over 64 groups knows a standard error to 9 %
        assert 0.7 * 0.0005 < stderr * extended(case, scheme, case.steps[0]) < 1.3 * 0.0005
    history = found["history_error_stderr"][:, :, 0].max(axis=1)
    assert history[-1] == stderr
    assert np.all(np.diff(history[:-1]) < 0)
    assert np.all(np.diff(found["history_cpu_seconds"]) >= 0)


# --- what the twins are for ------------------------------------------------------------------------------------------

RATES = {
    "rigid_body": ["steps=2^-3 .. 2^-9", "reference_step=2^-10"],
    # with weak noise only small steps show it, since the error of the drift alone has variance O(h^2)
    "maxwell_bloch": ["final_time=0.25", "steps=2^-4 .. 2^-10", "reference_step=2^-11"],
    "maxwell_bloch_weak_noise": [
        "model.sigma=[0.1, 0.1]",
        "initial=[1, 2, 3]",
        "final_time=0.25",
        "steps=2^-6 .. 2^-12",
        "reference_step=2^-13",
    ],
}


def variance_rates(system, scheme, reversals=None):
    """The rate for each function and its interval from the study, and from the four finest levels by hand."""
    p = plan_of(case_of(*RATES[system], system=system.removesuffix("_weak_noise")), scheme, "multilevel")
    if reversals is not None:
        differences = [level._replace(grid=level.grid._replace(reversals=np.array(reversals))) for level in p.levels]
        p = replace(p, levels=(*differences[:-1], p.levels[-1]))
    found = p.group(after_blocks(p, 64)).arrays
    rates = [found[name] for name in ("level_variance_rate", "level_variance_rate_low", "level_variance_rate_high")]
    logarithms = np.log2(found["level_variance"][:, :4])
    return (*rates, np.polyfit(np.arange(4), logarithms.T, 1)[0])


@compiled_only
@pytest.mark.parametrize("system", RATES)
@pytest.mark.parametrize(
    ("scheme", "reversals", "expected"),
    [
        ("splitting", None, 1),
        ("splitting_order2", None, 2),
        # Negative controls: no twins; and twins with their coins turned but the increments left in their order.
        ("splitting_order2", (AS_TOSSED,) * 4, 1),
        ("splitting_order2", (AS_TOSSED, COINS_TURNED) * 2, 1),
    ],
    ids=["splitting", "twins", "no twins", "coins turned only"],
)
def test_the_variance_of_a_level_falls_with_the_square_of_the_step_with_twins_and_else_linearly(
    system, scheme, reversals, expected
):
    rate, low, high, finest = variance_rates(system, scheme, reversals)
    bend = 0.25 if (system, scheme) == ("maxwell_bloch_weak_noise", "splitting") else 0.1
    assert np.all(np.abs(finest - expected) < bend)
    assert np.all((low - bend < expected) & (expected < high + bend))
    assert np.all(np.abs(rate - expected) < 2 * bend)
    assert np.all(low > 1.5) if expected == 2 else np.all(high < 1.5)


# --- the estimators agree --------------------------------------------------------------------------------------------

COARSE = ["steps=2^-2 .. 2^-4", "reference_step=2^-5"]


@functools.cache
def exact(system, scheme, reverse=False):
    """Without sampling: (values and their errors, arrays [function, h] from 2^-2 to 2^-5; the limits)."""
    case = case_of(*COARSE, system=system)
    words = compositions(SCHEMES[scheme].composition, case.model)
    if reverse:
        words = tuple((probability, flows[::-1]) for probability, flows in words)
    steps = [*case.steps, case.reference_step]
    found = expectations(case.model, words, case.initial, 1.0, steps, list(FUNCTIONS.values()), accuracy=1e-4)
    assert found.value_bound.max() < 2e-4
    return found.value, found.value_bound, found.limit


def deviations(found, stderr, value, error):
    """By how many standard errors estimates are off, the largest."""
    return (np.abs(found - value) / np.hypot(stderr, error)).max()


@compiled_only
@pytest.mark.parametrize("scheme", SPLITTINGS)
@pytest.mark.parametrize("system", SYSTEMS)
def test_the_three_estimators_agree(system, scheme):
    """Differences to the reference, differences between levels, expectations; and for no other scheme."""
    case = case_of(*COARSE, "samples=131072", "seconds=0.3", system=system)
    in_plain, _ = results_of(case, scheme, "plain")
    levels, _ = results_of(case, scheme, "multilevel")
    factor = np.array([extended(case, scheme, h) for h in case.steps])
    level_stderr = np.sqrt(levels["level_variance"] / levels["level_samples"])

    def largest_deviations(value, error):
        differences, both = value[:, :-1] - value[:, -1:], error[:, :-1] + error[:, -1:]
        between = (value[:, :-1] - value[:, 1:])[:, ::-1]
        return [
            deviations(in_plain["error"] * factor, in_plain["error_stderr"] * factor, differences, both),
            deviations(levels["error"] * factor, levels["error_stderr"] * factor, differences, both),
            deviations(levels["level_mean"], level_stderr, between, both),
            deviations(in_plain["expectation"], in_plain["expectation_stderr"], value[:, :-1], error[:, :-1]),
            deviations(levels["expectation"], levels["expectation_stderr"], value[:, :-1], error[:, :-1]),
        ]

    right = largest_deviations(*exact(system, scheme)[:2])
    assert max(right) < 4
    others = [(other, False) for other in SPLITTINGS if other != scheme]
    if scheme == "splitting":
        others.append((scheme, True))  # the same flows in reversed order
    for other in others:
        wrong = largest_deviations(*exact(system, *other[:1], reverse=other[1])[:2])
        assert min(wrong[:3]) > 10
        assert min(wrong[3:]) > 6
    # What the reference lacks is extrapolated by the order of the scheme, best at the smallest step.
    value, _, limit = exact(system, scheme)
    lacking = np.abs(value[:, -1] - limit)
    off = np.abs(levels["error"][:, -1] - (value[:, -2] - limit))
    assert np.all(off < 4 * np.hypot(levels["error_stderr"][:, -1], 1e-4) + 0.5 * lacking)


# --- orders ----------------------------------------------------------------------------------------------------------


@compiled_only
@pytest.mark.parametrize(("scheme", "order", "other"), [("splitting", 1, 2), ("splitting_order2", 2, 1)])
def test_orders_by_multilevel(scheme, order, other):
    """Of phi and y1^2, with noise as strong as the drift."""
    steps = (
        ["steps=2^-4 .. 2^-7", "reference_step=2^-9"] if order == 1 else ["steps=2^-1 .. 2^-4", "reference_step=2^-6"]
    )
    found, attributes = results_of(case_of(*steps, f"seconds={2 * order}"), scheme, "multilevel")
    assert found["resolved"].all() and (found["order_points"] == 4).all()
    assert has_order(found, order)
    assert not np.any((found["order_low"] <= other) & (other <= found["order_high"]))
    assert np.all(found["order_high"] - found["order_low"] < 0.6)
    assert attributes["expected_order"] == order


@pytest.mark.parametrize(("scheme", "order", "other"), [("splitting", 1, 2), ("splitting_order2", 2, 1)])
def test_orders_without_sampling(scheme, order, other):
    case = case_of("steps=2^-3 .. 2^-7", "reference_step=2^-8", "functions=y1^2")
    found, attributes = results_of(case, scheme, "kolmogorov")
    assert found["resolved"].all()
    # Nothing is left to chance, so the interval says how straight the line is, not how near its slope to the order.
    assert abs(found["order"][0] - order) < 0.05
    assert found["order_high"][0] - found["order_low"][0] < 0.2
    assert not found["order_low"][0] <= other <= found["order_high"][0]
    assert attributes["estimator"] == "kolmogorov"
    model, words = case.model, compositions(SCHEMES[scheme].composition, case.model)
    direct = expectations(model, words, case.initial, 1.0, case.steps, [FUNCTIONS["square"]])
    assert np.array_equal(found["error"], direct.weak_error)
    assert np.array_equal(found["expectation"], direct.value)
    assert np.array_equal(found["limit"], direct.limit)


# --- no noise --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("scheme", ["splitting", "splitting_order2"])
def test_without_noise_nothing_is_left_to_chance(scheme):
    """The error is that of the deterministic scheme, here by the printed formulas."""
    steps = ["steps=2^-2 .. 2^-5", "reference_step=2^-7"] if COMPILED else ["steps=[2^-1]", "reference_step=2^-2"]
    case = case_of("model.sigma=[0, 0, 0]", *steps, "seconds=0.01", "samples=100")
    if COMPILED:
        levels, _ = results_of(case, scheme, "multilevel")
    else:
        p = plan_of(case, scheme, "multilevel")
        levels = p.group(after_blocks(p, ROUND)).arrays
    in_plain, _ = results_of(case, scheme, "plain")
    assert levels["level_variance"].max() < 1e-17
    still = case.model._replace(sigma=(0.0, 0.0, 0.0))

    def values(h):
        y = case.initial
        for _ in range(round(case.final_time / h)):
            y = BY_HAND[scheme](still, h, (0.0, 0.0, 0.0), 1, y)
        return np.array([f(np.array(y)) for f in FUNCTIONS.values()])

    for i, h in enumerate(case.steps):
        expected = (values(h) - values(case.reference_step)) / extended(case, scheme, h)
        for found in (levels, in_plain):
            assert np.all(np.abs(found["error"][:, i] - expected) < 1e-12)
            assert np.all(found["error_stderr"][:, i] < 1e-12)
            assert np.all(found["resolved"][:, i])
    if COMPILED:
        for found in (levels, in_plain):
            assert np.all(np.abs(found["order"] - SCHEMES[scheme].weak_order) < 0.15)


# --- paths that leave the finite numbers -----------------------------------------------------------------------------

BLOW_UP = [
    "schemes=[euler_maruyama]",
    "model.sigma=[0.05, 0.05, 0.05]",
    "initial=[1.5*cos(1.1), 0, 1.5*sin(1.1)]",
    "final_time=14",
    "steps=[1, 2^-5, 2^-6, 2^-7]",
    "reference_step=2^-8",
    "samples=256",
]


@compiled_only
@pytest.mark.filterwarnings("error")
def test_plain_counts_paths_that_blow_up():
    case = case_of(*BLOW_UP)
    found, attributes = results_of(case, "euler_maruyama", "plain")
    values = values_by_hand(case, "euler_maruyama")
    lost = [int((~np.isfinite(values[h])).any(axis=0).sum()) for h in case.steps]
    assert 0 < lost[0] < case.samples and lost[1:] == [0, 0, 0]
    assert found["nonfinite"].tolist() == lost
    assert attributes["reference_nonfinite"] == 0
    assert not found["resolved"][:, 0].any()
    assert not np.isfinite(found["error"][:, 0]).any()
    assert not np.isfinite(found["error_stderr"][:, 0]).any()
    assert np.isfinite(found["error"][:, 1:]).all() and np.isfinite(found["error_stderr"][:, 1:]).all()
    assert np.all(found["order_points"] <= 3)


@compiled_only
@pytest.mark.filterwarnings("error")
def test_plain_reports_a_reference_that_blows_up():
    case = case_of(*BLOW_UP, "model.sigma=[60, 60, 60]", "final_time=1", "steps=[2^-5, 2^-6]", "samples=100")
    found, attributes = results_of(case, "euler_maruyama", "plain")
    values = values_by_hand(case, "euler_maruyama")[case.reference_step]
    assert attributes["reference_nonfinite"] == (~np.isfinite(values)).any(axis=0).sum() > 0
    assert not found["resolved"].any()
    assert np.isnan(found["order"]).all() and (found["order_points"] == 0).all()


@compiled_only
@pytest.mark.filterwarnings("error")
def test_multilevel_counts_paths_that_blow_up_and_gives_their_level_no_more():
    case = case_of(*BLOW_UP, "seconds=0.5")
    found, _ = results_of(case, "euler_maruyama", "multilevel")
    lost = found["level_nonfinite"]
    assert 0 < lost[-1] < found["level_samples"][-1]
    assert lost[0] == 0
    assert not found["resolved"][:, 0].any()
    assert not np.isfinite(found["error"][:, 0]).any()
    assert np.isfinite(found["error"][:, 1:]).all() and np.isfinite(found["error_stderr"][:, 1:]).all()
    assert found["level_samples"][-1] == 2 * ROUND * LANES
    assert found["level_samples"][:-1].max() > 2 * ROUND * LANES


# --- through the one path from a spec to a file ----------------------------------------------------------------------

PARTS = [
    Part(scheme, estimator) for scheme in ("splitting", "splitting_order2") for estimator in ("plain", "multilevel")
]
TIMES = ("cpu_seconds", "seconds", "ns_per_step", "level_cost_rate", "threads")


def experiment():
    keys = ["estimators=[plain, multilevel]", "samples=1000", "prefixes=[100, 1000]", "seconds=0.01"]
    return load(SPEC, overrides=["schemes=[splitting, splitting_order2]", *keys])


def numbers(path):
    """Everything in a results file that must repeat."""
    groups = {}
    for group in storage.read(path).groups:
        attributes = {k: v for k, v in group.attributes.items() if not k.endswith(TIMES)}
        arrays = {k: v.tolist() for k, (_, v) in group.variables.items() if not k.endswith(TIMES)}
        groups[Part(group.variant, group.estimator)] = repr((arrays, attributes))
    return groups


class Reports(list):
    """Keeps what is reported; interrupts at a report, given by its number, of a part, given by its number."""

    def __init__(self, number=None, after=None):
        self.number, self.after = number, after

    def __call__(self, progress):
        self.append(progress)
        if progress.number == self.number and len(self.of(self.number)) == self.after:
            raise KeyboardInterrupt

    def of(self, number):
        return [progress for progress in self if progress.number == number]


@compiled_only
def test_a_run_writes_all_parts_and_goes_on_from_wherever_it_is_stopped(tmp_path, monkeypatch):
    reports = Reports()
    path = runner.run(experiment(), tmp_path / "whole", watch=runner.Watch(reports))
    whole = numbers(path)
    assert list(whole) == PARTS
    for number, part in enumerate(PARTS):
        own = reports.of(number)
        assert {(r.part, r.parts) for r in own} == {(part.name, 4)}
        assert own[0].done == 0 and np.isnan(own[0].stderr)
        assert own[-1].done == own[-1].total and own[-1].stderr > 0
    monkeypatch.setattr(ensemble, "BATCH_SECONDS", 0.0)
    reached = {}
    for stop in [(0, 2), (0, 3), (1, 2), (1, 9), (1, 20), (2, 1), (3, 15)]:
        reports = Reports(*stop)
        with pytest.raises(runner.Stopped):
            runner.run(experiment(), tmp_path / "often", watch=runner.Watch(reports))
        for number in range(stop[0] + 1):
            own = reports.of(number)
            assert own[0].done == reached.get(number, 0)  # nothing is lost and nothing done again
            reached[number] = own[-1].done
    path = runner.run(experiment(), tmp_path / "often")
    assert numbers(path) == whole


def test_cost_is_known_before_and_progress_on_the_way():
    case = case_of("samples=150")
    steps, seconds, _ = plan_of(case, "splitting", "plain").cost()
    per_path = sum(round(1 / h) for h in (case.reference_step, *case.steps))
    assert steps == 3 * LANES * per_path  # blocks are computed whole
    assert 1e-9 < seconds / steps < 1e-7
    assert weak.parts(case) == [Part(scheme, "multilevel") for scheme in SPLITTINGS]
    assert math.isnan(weak.plan(case_of("seconds=null", "standard_error=1"), PARTS[1]).cost().seconds)
    steps, seconds, _ = plan_of(case_of("seconds=3"), "splitting_order2", "multilevel").cost()
    assert 3 <= seconds < 3.1 and 1e-9 < seconds / steps < 1e-7
    p = plan_of(case, "splitting", "plain")
    assert p.progress(State(p))[:2] == (0, 150)
    assert p.progress(begun(p, 2))[:2] == (128, 150)
    done = finished(p)
    assert p.progress(done)[:2] == (150, 150)
    stderr = p.group(done).variables["error_stderr"][1][0, 0]
    assert math.isclose(p.progress(done)[2], stderr, rel_tol=1e-12)
