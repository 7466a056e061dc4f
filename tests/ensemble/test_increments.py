"""Which increments and coins the loop over time uses, and reversed paths."""

import itertools

import numpy as np
import pytest
from ensemble_cases import TWO_NOISES, coins_of, increments_of
from helpers import COMPILED, INITIAL, LANES, RIGID_BODY, SCHEMES, order_2, simulate
from paths_by_hand import draw

from spi.compiler.dispatch import kernel
from spi.ensemble.increments import CLIPPED, RESCALED, UNCLIPPED
from spi.kinds.strong import study as strong
from spi.numerics.rng import BROWNIAN, COINS, STEPS_PER_DRAW, STEPS_PER_TOSS, read_coins, toss
from spi.running.load import load
from spi.storage import Part


@pytest.mark.parametrize("h", [2.0**-10, 0.3])
def test_fine_increments_are_the_normals_of_the_generator(h):
    """Whatever the number of steps, also if it is not a multiple of what one draw gives."""
    steps, blocks, seed = 11, 2, 2**63 + 12345
    draws = -(-steps // STEPS_PER_DRAW)
    (fine,) = increments_of(h=h, steps=steps, blocks=blocks, first_block=3, seed=seed)
    words, normals = np.empty(STEPS_PER_DRAW * LANES, np.uint64), np.empty((draws, STEPS_PER_DRAW * LANES))
    for k, block in itertools.product(range(3), range(blocks)):
        draw(np.uint64(seed), np.uint64(BROWNIAN), np.uint64(k), draws, np.uint64(3 + block), words, normals)
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


def test_at_a_temperature_clipped_increments_have_their_variance():
    """As friction takes it to be: they are divided by the standard deviation of a clipped normal number."""
    options = {"h": 2.0**-4, "steps": 64, "doublings": (0, 1, 2, 3), "blocks": 64}
    clipped, rescaled = increments_of(**options, truncate=CLIPPED), increments_of(**options, truncate=RESCALED)
    z = np.linspace(-12.0, 12.0, 240_001)
    for s, a, b in zip(options["doublings"], clipped, rescaled, strict=True):
        h = options["h"] * 2**s
        bound = np.sqrt(4 * abs(np.log(h)))
        left = np.trapezoid(np.clip(z, -bound, bound) ** 2 * np.exp(-(z**2) / 2), z) / np.sqrt(2 * np.pi)
        np.testing.assert_allclose(b, a / np.sqrt(left), rtol=1e-9)
        assert abs(b.var() / h - 1) < 4 * np.sqrt(2 / b.size)
    assert abs(clipped[3].var() / 0.5 - 1) > 10 * np.sqrt(2 / clipped[3].size)  # negative control


@pytest.mark.parametrize(("temperature", "clipping"), [("inf", CLIPPED), ("1/4", RESCALED)])
def test_what_is_done_to_increments_is_a_matter_of_temperature(temperature, clipping):
    (case,) = load("rigid_body_strong", "quick", [f"temperature={temperature}", "schemes=[midpoint]"]).cases
    assert case.clipping == clipping
    times = strong.plan(case, Part("midpoint")).grid
    assert times.truncate
    assert (times.stretch.max() > 1) == (clipping == RESCALED)
    (unclipped,) = load("rigid_body_strong", "quick", ["truncate_noise=false", "schemes=[splitting]"]).cases
    assert unclipped.clipping == UNCLIPPED


def test_a_noise_that_is_off_is_neither_drawn_nor_changes_the_others():
    options = {"h": 2.0**-5, "steps": 16, "doublings": (0, 2)}
    for all_on, some_on in zip(increments_of(**options), increments_of(TWO_NOISES, **options), strict=True):
        assert np.array_equal(some_on[:, [0, 2]], all_on[:, [0, 2]])
        assert np.all(some_on[:, 1] == 8.0)  # the initial state: never touched


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
