"""The loop over time: which increments it uses, on what they depend, and to which equation the schemes converge.

Statistical bounds come from standard errors over paths; all seeds are fixed.
"""

import itertools
import json
import os
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest
from helpers import (
    COMPILED,
    INITIAL,
    LANES,
    ONE_NOISE,
    RIGID_BODY,
    SCHEMES,
    Coins,
    Increments,
    WithoutCorrection,
    final_states,
    order_2,
    simulate,
    take_steps,
)

from spi.dispatch import kernel
from spi.ensemble import add_reports, report_columns
from spi.protocol import REPORT
from spi.rng import BROWNIAN, COINS, STEPS_PER_DRAW, STEPS_PER_TOSS, draw_normals, read_coins, toss

compiled_only = pytest.mark.skipif(not COMPILED, reason="too many steps without the compiler")

TWO_NOISES = RIGID_BODY._replace(sigma=(1.0, None, 0.5))


def increments_of(model=RIGID_BODY, **options):
    """The increments that a scheme gets: a list of levels, each an array [step, noise, path]."""
    return simulate(Increments(), model, snapshots=0, initial=(7.0, 8.0, 9.0), **options)[0]


def coins_of(**options):
    """The coins that a scheme gets: a list of levels, each an array [step, path]."""
    return [states[:, 0] for states in simulate(Coins(), RIGID_BODY, snapshots=0, **options)[0]]


# --- increments ------------------------------------------------------------------------------------------------------


@kernel
def draw(seed, channel, draws, block, words, normals):
    for n in range(draws):
        draw_normals(seed, np.uint64(BROWNIAN), channel, np.uint64(n), block, words, normals[n])


@pytest.mark.parametrize("h", [2.0**-10, 0.3])
def test_fine_increments_are_the_normals_of_the_generator(h):
    """Whatever the number of steps, also if it is no multiple of what one draw gives."""
    steps, blocks, seed = 11, 2, 2**63 + 12345
    draws = -(-steps // STEPS_PER_DRAW)
    (fine,) = increments_of(h=h, steps=steps, blocks=blocks, first_block=3, seed=seed)
    words, normals = np.empty(STEPS_PER_DRAW * LANES, np.uint64), np.empty((draws, STEPS_PER_DRAW * LANES))
    for k, block in itertools.product(range(3), range(blocks)):
        draw(np.uint64(seed), np.uint64(k), draws, np.uint64(3 + block), words, normals)
        expected = np.sqrt(h) * normals.reshape(-1, LANES)[:steps]
        found = fine[:, k, block * LANES : (block + 1) * LANES]
        assert np.all(np.abs(found - expected) <= 1e-15 * np.sqrt(h))
        assert np.array_equal(found, expected) or h == 0.3  # the factor 2^-5 causes no rounding, wherever it enters


def halves_added(fine, doublings):
    """First half plus second half, again and again."""
    for _ in range(doublings):
        fine = fine[0::2] + fine[1::2]
    return fine


def test_coarse_increments_are_sums_of_halves():
    doublings = (0, 1, 2, 4, 5)  # 3 is left out: its increments are needed, its step is not taken
    levels = increments_of(h=2.0**-7, steps=64, doublings=doublings, blocks=2)
    for s, increments in zip(doublings, levels, strict=True):
        assert np.array_equal(increments, halves_added(levels[0], s))
    # Negative control: bitwise equality does tell this order of summation from another one.
    assert not np.array_equal(levels[3], levels[0].reshape(4, 16, 3, -1).cumsum(axis=1)[:, -1])
    variance = levels[0].var() / 2.0**-7
    assert abs(variance - 1) < 4 * np.sqrt(2 / levels[0].size)


def test_truncation_clips_the_sum_of_untruncated_increments():
    """Near h = 1 the bound A_h = sqrt(4 |ln h|) is small, and 0 at h = 1."""
    doublings, h = (0, 1, 2, 3, 4), 2.0**-4
    options = {"h": h, "steps": 64, "doublings": doublings, "blocks": 2}
    plain, clipped = increments_of(**options), increments_of(**options, truncate=True)
    for s, a, b in zip(doublings, plain, clipped, strict=True):
        step = h * 2**s
        bound = np.sqrt(step) * np.sqrt(4 * abs(np.log(step)))
        inside = np.abs(a) < bound
        assert np.array_equal(b[inside], a[inside])
        np.testing.assert_allclose(b[~inside], np.sign(a[~inside]) * bound, rtol=1e-15)
    assert 0.05 < np.mean(clipped[3] != plain[3]) < 0.15  # P(|N| > 1.665) = 0.096
    assert np.all(clipped[4] == 0.0)
    # Negative control: truncating the fine increments first would give something else.
    assert not np.array_equal(clipped[3], halves_added(clipped[0], 3))


def test_a_noise_that_is_off_is_neither_drawn_nor_changes_the_others():
    options = {"h": 2.0**-5, "steps": 16, "doublings": (0, 2)}
    for all_on, some_on in zip(increments_of(**options), increments_of(TWO_NOISES, **options), strict=True):
        assert np.array_equal(some_on[:, [0, 2]], all_on[:, [0, 2]])
        assert np.all(some_on[:, 1] == 8.0)  # the initial state: never touched


def test_noises_paths_and_seeds_are_different():
    options = {"h": 1.0, "steps": 512 if COMPILED else 32, "blocks": 1}
    (one,), (other,) = increments_of(**options, seed=1), increments_of(**options, seed=2)
    columns = np.concatenate([one, other], axis=1).reshape(one.shape[0], -1)
    correlations = np.corrcoef(columns.T)[np.triu_indices(columns.shape[1], 1)]
    assert np.abs(correlations).max() < 6 / np.sqrt(one.shape[0])  # of 73536 pairs


# --- coins -----------------------------------------------------------------------------------------------------------


@kernel
def draw_coins(seed, steps, block, words, coins):
    for n in range(steps):
        if n % STEPS_PER_TOSS == 0:
            toss(seed, np.uint64(BROWNIAN + COINS), np.uint64(n // STEPS_PER_TOSS), block, words)
        read_coins(words, n, coins[n])


def test_coins_are_those_of_the_generator_and_a_coarse_step_has_that_of_its_first_half():
    """Also beyond the 128 steps that one evaluation of the generator is good for."""
    steps, doublings, seed = 160, (0, 1, 3, 4), 2**40 + 3
    levels = coins_of(h=2.0**-7, steps=steps, doublings=doublings, blocks=2, first_block=5, seed=seed)
    expected, words = np.empty((2, steps, LANES)), np.empty(STEPS_PER_DRAW * LANES, np.uint64)
    for block in range(2):
        draw_coins(np.uint64(seed), steps, np.uint64(5 + block), words, expected[block])
    expected = np.concatenate(expected, axis=1)
    for s, coins in zip(doublings, levels, strict=True):
        assert np.array_equal(coins, expected[:: 2**s])
        assert abs(coins.mean()) < 4 / np.sqrt(coins.size)
    assert not np.array_equal(levels[1], expected[1::2])  # negative control: that of the second half is another


def test_turned_coins_are_those_of_the_other_side():
    plain, turned = coins_of(h=2.0**-5, steps=8, doublings=(0, 0), reversals=(0, 1))
    assert np.array_equal(turned, -plain)


REVERSED = {"doublings": (0, 0, 1, 1, 2, 2, 2), "reversals": (0, 2, 2, 1, 0, 1, 0)}


@pytest.mark.parametrize("truncate", [False, True])
def test_reversed_paths_are_what_a_plain_loop_makes_of_the_increments_and_coins(truncate):
    """The order-2 step by the printed formulas, for every path and level; truncated at h = 1/4 some increments are."""
    h, steps, lanes = 2.0**-4, 8, range(0, LANES, 1 if COMPILED else 16)
    found = simulate(SCHEMES["splitting_order2"].record, h=h, steps=steps, truncate=truncate, **REVERSED)[0][:, 0]
    distinct = {"h": h, "steps": steps, "doublings": (0, 1, 2)}
    increments, coins = increments_of(truncate=truncate, **distinct), coins_of(**distinct)
    if truncate:
        assert not np.array_equal(increments[2], increments_of(**distinct)[2])
    wrong_coins, wrong_order = 0.0, 0.0
    for level, (s, reversal) in enumerate(zip(*REVERSED.values(), strict=True)):
        in_order = list(range(steps >> s))
        in_pairs = [n for pair in range(0, len(in_order), 2) for n in (pair + 1, pair)] if reversal == 2 else in_order
        side = -1 if reversal else 1

        def path(lane, order, side, s=s):
            y = INITIAL
            for n in order:
                y = order_2(RIGID_BODY, h * 2**s, increments[s][n, :, lane], side * coins[s][n, lane], y)
            return np.array(y)

        for lane in lanes:
            y = found[level, :, lane]
            assert np.linalg.norm(y - path(lane, in_pairs, side)) < 1e-13
            wrong_coins = max(wrong_coins, np.linalg.norm(y - path(lane, in_pairs, -side)))
            if reversal == 2:
                wrong_order = max(wrong_order, np.linalg.norm(y - path(lane, in_order, side)))
    assert wrong_coins > 0.03 and wrong_order > 0.03  # negative controls: both matter


def test_final_states_are_the_states_at_the_end():
    options = {"h": 2.0**-4, "steps": 8, "blocks": 2, "first_block": 1, **REVERSED}
    expected, _ = simulate(SCHEMES["splitting"].record, samples=3 * LANES, **options)  # by another observer
    assert np.array_equal(final_states(SCHEMES["splitting"].record, **options), expected[:, 0])


@compiled_only
def test_reversed_paths_have_the_law_of_the_scheme():
    """Means of y_i, y_i^2 and y_i y_j over 2^18 paths; the difference of two steps shows how sharp that is."""
    paths = {"doublings": (0, 0, 1, 1), "reversals": (0, 2, 0, 1)}
    fine, twin, coarse, turned = final_states(SCHEMES["splitting_order2"].record, h=0.25, steps=4, blocks=4096, **paths)

    def moments(y):
        return np.concatenate([y, y**2, y * np.roll(y, 1, axis=0)])

    def standard_errors(a, b):
        """By how many standard errors the moments of two sets of paths differ."""
        d = moments(a) - moments(b)
        return np.abs(d.mean(axis=1)) / d.std(axis=1, ddof=1) * np.sqrt(d.shape[1])

    assert standard_errors(fine, twin).max() < 4
    assert standard_errors(coarse, turned).max() < 4
    assert not np.array_equal(fine, twin) and not np.array_equal(coarse, turned)
    assert standard_errors(fine, coarse).max() > 20
    # Together the two cancel what is odd in the coins: the mean of a pair is nearer to that of the coarse pair.
    assert np.std(fine + twin - coarse - turned) < 0.7 * np.sqrt(2) * np.std(fine - coarse)


# --- what results do not depend on -----------------------------------------------------------------------------------

SMALL = {"h": 2.0**-6, "steps": 64 if COMPILED else 8, "truncate": True}
DOUBLINGS = (0, 1, 3)


@pytest.mark.parametrize("name", SCHEMES)
def test_states_follow_from_the_increments(name):
    """The ensemble adds nothing: each level is the scheme, applied to the increments of that level."""
    scheme = SCHEMES[name].record
    states, report = simulate(scheme, doublings=DOUBLINGS, **SMALL)
    initial = np.repeat(np.reshape(INITIAL, (3, 1)), LANES, axis=1)
    coins = coins_of(doublings=DOUBLINGS, **SMALL)
    for level, dW in enumerate(increments_of(doublings=DOUBLINGS, **SMALL)):
        h = SMALL["h"] * 2 ** DOUBLINGS[level]
        expected, expected_report = take_steps(scheme, RIGID_BODY, h, dW, initial, coins[level])
        np.testing.assert_allclose(states[level, 0], expected, rtol=0, atol=1e-14)
        assert report[0, level, 0] == expected_report[0] == (len(dW) * LANES if name == "midpoint" else 0)


@pytest.mark.parametrize("name", SCHEMES)
def test_reference_alone_gives_the_same_bits(name):
    together, _ = simulate(SCHEMES[name].record, doublings=DOUBLINGS, **SMALL)
    alone, _ = simulate(SCHEMES[name].record, **SMALL)
    assert np.array_equal(alone[0], together[0])
    some, _ = simulate(SCHEMES[name].record, doublings=DOUBLINGS[::2], **SMALL)
    assert np.array_equal(some, together[::2])


@compiled_only
@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="one thread only")
@pytest.mark.parametrize("name", SCHEMES)
def test_threads_do_not_matter(name):
    before = numba.get_num_threads()
    results = []
    try:
        for threads in (1, 2):
            numba.set_num_threads(threads)
            results.append(simulate(SCHEMES[name].record, doublings=DOUBLINGS, blocks=7, **SMALL))
    finally:
        numba.set_num_threads(before)
    (one, one_report), (two, two_report) = results
    assert np.array_equal(one, two)
    assert np.array_equal(one_report, two_report)
    assert len(np.unique(one[0, 0, 0])) == 7 * LANES


@pytest.mark.parametrize("name", SCHEMES)
def test_grouping_of_blocks_does_not_matter(name):
    whole, report = simulate(SCHEMES[name].record, doublings=DOUBLINGS, blocks=3, **SMALL)
    parts = [
        simulate(SCHEMES[name].record, doublings=DOUBLINGS, first_block=a, blocks=n, **SMALL)
        for a, n in ((0, 1), (1, 2))
    ]
    assert np.array_equal(np.concatenate([states for states, _ in parts], axis=-1), whole)
    assert np.array_equal(np.concatenate([part for _, part in parts]), report)


def test_paths_far_away_are_reached():
    """Path numbers beyond 32 bits: the first 10^6 samples of 10^11 are the same, the last are others."""
    scheme, far = SCHEMES["euler_maruyama"].record, 2**32
    near, _ = simulate(scheme, **SMALL)
    states, _ = simulate(scheme, first_block=far // LANES, **SMALL)
    assert np.all(np.isfinite(states)) and not np.any(np.isin(states, near))


@pytest.mark.parametrize("samples", [1, 64, 65, 127, 128])
def test_paths_do_not_depend_on_the_number_of_samples(samples):
    scheme = SCHEMES["splitting"].record
    everything, _ = simulate(scheme, blocks=2, samples=2 * LANES, **SMALL)
    states, _ = simulate(scheme, blocks=-(-samples // LANES), samples=samples, **SMALL)
    assert np.array_equal(states[..., :samples], everything[..., :samples])
    assert np.all(np.isnan(states[..., samples:]))  # an observer is told which lanes count


# --- the slow twin ---------------------------------------------------------------------------------------------------

TWIN = {"h": 2.0**-5, "steps": 12, "doublings": (0, 2), "snapshots": 3, "truncate": True, "first_block": 2}
TWIN |= {"initial": (1.2, -0.6, 1.5)}  # so that angles at h = 1/8 exceed pi/4
WATCHED_TWIN = TWIN | {"samples": 3 * LANES}  # by the observer that other tests of increments and coins use
REVERSED_TWIN = TWIN | {"doublings": (0, 0, 1, 1), "reversals": (0, 2, 0, 1)}
PROGRAM = """
import json, sys
import helpers
import test_ensemble as t
assert not helpers.COMPILED
results = {}
for name in t.SCHEMES:
    states, report = helpers.simulate(t.SCHEMES[name].record, **t.TWIN)
    results[name] = states.tolist(), report.tolist()
results["two_noises"] = [helpers.simulate(t.Increments(), t.TWO_NOISES, **t.WATCHED_TWIN)[0].tolist(), None]
results["coins"] = [helpers.simulate(t.Coins(), **t.WATCHED_TWIN)[0].tolist(), None]
results["reversed"] = [helpers.simulate(t.SCHEMES["splitting_order2"].record, **t.REVERSED_TWIN)[0].tolist(), None]
json.dump(results, sys.stdout)
"""


@compiled_only
def test_compiled_equals_uncompiled():
    """The same Python code without the compiler is the oracle of the kernels; fused operations round differently."""
    tests = Path(__file__).parent
    path = os.pathsep.join([str(tests), str(tests.parent), os.environ.get("PYTHONPATH", "")])
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": path}
    answer = subprocess.run(
        [sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, check=False, timeout=300
    )
    assert answer.returncode == 0, answer.stderr
    slow = json.loads(answer.stdout)
    for name, row in SCHEMES.items():
        fast, report = simulate(row.record, **TWIN)
        slow_states, slow_report = (np.array(part) for part in slow[name])
        lengths = np.linalg.norm(slow_states, axis=2)
        assert np.all(np.linalg.norm(fast - slow_states, axis=2) <= 1e-13 * lengths)
        np.testing.assert_allclose(report[..., 4], slow_report[..., 4], rtol=1e-12)
        assert report[..., 4].any() == (row.composition is not None)
        if name == "midpoint":
            assert np.array_equal(report[..., :3], slow_report[..., :3])
            assert np.all(np.abs(report[..., 3] - slow_report[..., 3]) < 1e-14)
    fast, _ = simulate(Increments(), TWO_NOISES, **WATCHED_TWIN)
    np.testing.assert_allclose(fast, slow["two_noises"][0], rtol=1e-14, atol=1e-16)
    assert np.array_equal(simulate(Coins(), **WATCHED_TWIN)[0][:, :, 0], np.array(slow["coins"][0])[:, :, 0])
    fast, _ = simulate(SCHEMES["splitting_order2"].record, **REVERSED_TWIN)
    np.testing.assert_allclose(fast, slow["reversed"][0], rtol=0, atol=1e-13)


# --- the right limit -------------------------------------------------------------------------------------------------

PATHS = 512
LEVELS = tuple(range(7))  # h = 2^-10, ..., 2^-4


def root_mean_square(differences):
    """Of the lengths of differences [level, component, path]: values [level] and their relative standard errors."""
    squares = (differences**2).sum(axis=1)
    values = np.sqrt(squares.mean(axis=1))
    return values, 0.5 * squares.std(axis=1, ddof=1) / np.sqrt(squares.shape[1]) / values**2


def slope(differences, steps):
    """The order with its standard error by the jackknife over 16 groups of paths."""
    x = np.log2(steps)

    def fit(d):
        return np.polyfit(x, np.log2(root_mean_square(d)[0]), 1)[0]

    groups = np.array_split(np.arange(differences.shape[-1]), 16)
    left_out = np.array([fit(np.delete(differences, group, axis=-1)) for group in groups])
    return fit(differences), np.sqrt(15 / 16 * ((left_out - left_out.mean()) ** 2).sum())


@pytest.fixture(scope="module")
def at_time_one():
    """name -> states at T = 1, an array [level, component, path], all driven by the same truncated Brownian paths."""
    options = {"h": 2.0**-10, "steps": 2**10, "doublings": LEVELS, "blocks": PATHS // LANES, "truncate": True}
    schemes = {name: row.record for name, row in SCHEMES.items()}
    schemes["wrong"] = WithoutCorrection()
    return {name: simulate(scheme, **options)[0][:, 0] for name, scheme in schemes.items()}


STEP_SIZES = 2.0 ** (np.array(LEVELS) - 10)


@compiled_only
@pytest.mark.parametrize(("a", "b"), list(itertools.combinations(SCHEMES, 2)))
def test_schemes_approach_each_other(at_time_one, a, b):
    """The distance of two schemes falls with the smaller of their orders.

    The two splittings differ by one flow of the deterministic part at either end only, hence by O(h).
    """
    differences = at_time_one[a] - at_time_one[b]
    distances, errors = root_mean_square(differences)
    order, error = slope(differences, STEP_SIZES)
    expected = 1.0 if {a, b} == {"splitting", "splitting_drift_first"} else 0.5
    assert error < 0.02
    assert abs(order - expected) < 4 * error + 0.01
    assert np.all(np.diff(distances) > 0)
    # At h = 2^-10 far below the distance, 0.115, to the wrong equation of the next test.
    assert np.all(distances * (1 - 4 * errors) < 0.4 * STEP_SIZES**expected)


@compiled_only
@pytest.mark.parametrize("name", SCHEMES)
def test_a_scheme_for_another_equation_is_caught(at_time_one, name):
    """Negative control: Euler-Maruyama without the Itô correction converges, but elsewhere."""
    differences = at_time_one["wrong"] - at_time_one[name]
    distances, errors = root_mean_square(differences)
    order, _ = slope(differences[:4], STEP_SIZES[:4])
    assert distances[0] * (1 - 4 * errors[0]) > 0.1
    assert abs(order) < 0.03
    itself, _ = root_mean_square(np.diff(at_time_one["wrong"], axis=0))
    assert np.all(np.diff(itself) > 0) and itself[0] < 0.01


@compiled_only
@pytest.mark.parametrize(
    ("name", "model", "expected"),
    [
        ("splitting", ONE_NOISE, 1.0),
        ("splitting", RIGID_BODY, 0.5),
        ("euler_maruyama_renormalised", RIGID_BODY, 0.5),
    ],
)
def test_strong_orders(name, model, expected):
    """Against its own reference 16 times finer than the finest step: splitting has order 1 with one noise."""
    row = SCHEMES[name]
    assert expected == (row.strong_order_commuting if model is ONE_NOISE else row.strong_order)
    states, _ = simulate(
        row.record, model, h=2.0**-13, steps=2**13, doublings=(0, 4, 5, 6, 7, 8), blocks=PATHS // LANES
    )
    differences = states[1:, 0] - states[0, 0]
    order, error = slope(differences, 2.0 ** (np.arange(4.0, 9.0) - 13))
    assert error < 0.03
    # The reference has an error of its own, which lifts the slope by less than 0.03.
    assert abs(order - expected) < 4 * error + 0.03


# --- memory ----------------------------------------------------------------------------------------------------------


@compiled_only
def test_memory_does_not_grow_with_steps():
    """10^6 steps of 64 paths would need 1.5 GB for their increments or states alone."""
    resource = pytest.importorskip("resource")  # not on every system

    def peak():
        unit = 1 if sys.platform == "darwin" else 1024
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit

    simulate(SCHEMES["euler_maruyama"].record, h=2.0**-20, steps=8, doublings=(0, 1))
    before = peak()
    simulate(SCHEMES["euler_maruyama"].record, h=2.0**-20, steps=2**20, doublings=(0, 1))
    assert peak() - before < 20e6


def test_reports_have_one_row_per_block_and_level():
    _, report = simulate(SCHEMES["midpoint"].record, doublings=DOUBLINGS, blocks=2, **SMALL)
    assert report.shape == (2, len(DOUBLINGS), len(REPORT))
    solves = [(SMALL["steps"] >> s) * LANES for s in DOUBLINGS]
    assert np.array_equal(report[..., 0], [solves, solves])
    assert np.all(report[..., 2] == 0)
    assert np.all((report[..., 3] > 0) & (report[..., 3] < 1e-13))
    _, report = simulate(SCHEMES["splitting"].record, doublings=DOUBLINGS, blocks=2, **SMALL)
    assert not np.any(report[..., :4])  # nothing to solve


def test_reports_are_added_up():
    """Numbers are summed, largest values are not; and what there is of them has names."""
    total, one, two = (np.random.default_rng(n).uniform(1.0, 2.0, (2, len(REPORT))) for n in range(3))
    added = add_reports(total, np.array([one, two]))
    np.testing.assert_allclose(added[:, :3], (total + one + two)[:, :3], rtol=1e-15)
    assert np.array_equal(added[:, 3:], np.max([total, one, two], axis=0)[:, 3:])
    assert np.array_equal(add_reports(total, np.empty((0, 2, len(REPORT)))), total)
    columns = report_columns(added)
    assert tuple(columns) == REPORT
    assert all(np.array_equal(columns[name], added[:, i]) for i, name in enumerate(REPORT))
    assert tuple(report_columns(added * [0, 0, 0, 0, 1])) == ("largest_angle",)
    assert tuple(report_columns(added * [1, 1, 1, 1, 0])) == REPORT[:4]
    assert report_columns(0 * added) == {}
