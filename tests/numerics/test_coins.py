"""The coins: their layout and their law."""

import math

import numpy as np
import pytest
from random_cases import BLOCKS, BOUND, COMPILED, SEED, normals, plain_philox

from spi.compiler.dispatch import kernel
from spi.numerics.rng import BROWNIAN, COINS, LANES, LEVELS, STEPS_PER_DRAW, STEPS_PER_TOSS, read_coins, toss


@kernel
def toss_all(seed, stream, draws, blocks, words, out):
    for b in range(blocks.size):
        for d in range(draws.size):
            toss(seed, stream, draws[d], blocks[b], words)
            for step in range(STEPS_PER_TOSS):
                # as in the ensemble: by the number of the step, from the words of the evaluation it falls into
                read_coins(words, np.int64(draws[d]) * STEPS_PER_TOSS + step, out[b, d, step])


def coins(seed=SEED, stream=BROWNIAN + COINS, draws=range(4 if COMPILED else 1), blocks=range(BLOCKS)):
    """Coins as an array [path, step]: the paths of the blocks and the steps of the draws, in that order."""
    draws, blocks = np.array(draws, np.uint64), np.array(blocks, np.uint64)
    out = np.empty((blocks.size, draws.size, STEPS_PER_TOSS, LANES))
    toss_all(np.uint64(seed), np.uint64(stream), draws, blocks, np.empty(STEPS_PER_DRAW * LANES, np.uint64), out)
    return out.transpose(0, 3, 1, 2).reshape(blocks.size * LANES, draws.size * STEPS_PER_TOSS)


@pytest.fixture(scope="module")
def tossed():
    return coins()


def plain_coin(seed, stream, path, step):
    """Bit step mod 32 of the word step mod 128 // 32; channel 0 of the stream of coins."""
    counter = (step // 128, (stream + 1) * 2**16, path % 2**32, path // 2**32)
    words = plain_philox(counter, (seed % 2**32, seed // 2**32))
    return 1.0 if (words[step % 128 // 32] >> step % 32) % 2 else -1.0


@pytest.mark.parametrize(
    ("seed", "stream", "draw", "block"),
    [
        (0, 0, 0, 0),
        (SEED, LEVELS + 6, 1234, 17),
        (2**64 - 1, 65534, 2**32 - 1, 2**58 - 1),
        (2**32 + 7, BROWNIAN, 3, 2**26),  # the first block whose paths need more than 32 bits
    ],
)
def test_layout_of_coins(seed, stream, draw, block):
    got = coins(seed, stream + COINS, [draw], [block])
    paths = range(block * LANES, (block + 1) * LANES)
    steps = range(STEPS_PER_TOSS * draw, STEPS_PER_TOSS * (draw + 1))
    assert got.tolist() == [[plain_coin(seed, stream, path, step) for step in steps] for path in paths]


def test_coins_have_not_changed():
    """As for the normals: whoever changes these must raise STREAM_VERSION."""
    got = coins(1, BROWNIAN + COINS, [0], [0])[0, :16]
    assert "".join("+" if c > 0 else "-" for c in got) == "---+--+-++++--++"


def test_coins_do_not_depend_on_their_neighbours():
    blocks, draws = [5, 1, 2**26, 3], [9, 0, 4]
    together = coins(draws=draws, blocks=blocks)
    for b, block in enumerate(blocks):
        for d, draw in enumerate(draws):
            alone = coins(draws=[draw], blocks=[block])
            steps = slice(STEPS_PER_TOSS * d, STEPS_PER_TOSS * (d + 1))
            assert np.array_equal(together[b * LANES : (b + 1) * LANES, steps], alone)


def test_streams_do_not_overlap():
    """A stream of coins lies beside that of its increments, and no two levels share one."""
    levels = [LEVELS + 2 * j for j in range(64)]
    streams = [BROWNIAN, BROWNIAN + COINS, *levels, *(stream + COINS for stream in levels)]
    assert len(set(streams)) == len(streams)


def plain_words(seed, stream, draw, path):
    return plain_philox((draw, stream * 2**16, path % 2**32, path // 2**32), (seed % 2**32, seed // 2**32))


def test_coins_and_normals_come_from_different_words():
    """Were their streams the same, the coins would be the bits of the very words that the normals are made of."""
    normal, coin = (plain_words(SEED, stream, 0, 3) for stream in (BROWNIAN, BROWNIAN + COINS))
    assert not set(normal) & set(coin)
    bits = [1.0 if (word >> place) % 2 else -1.0 for word in coin for place in range(32)]
    assert coins(draws=[0], blocks=[0])[3].tolist() == bits
    bits = [1.0 if (word >> place) % 2 else -1.0 for word in normal for place in range(32)]
    assert coins(stream=BROWNIAN, draws=[0], blocks=[0])[3].tolist() == bits  # negative control
    assert coins(draws=[0], blocks=[0])[3].tolist() != bits


def test_coins_are_fair(tossed):
    """All together, at every step, and on every path: the largest of n deviations, which has 4.5 sigma with n = 1."""
    assert set(np.unique(tossed)) == {-1.0, 1.0}
    assert abs(tossed.mean()) <= BOUND / math.sqrt(tossed.size)
    for axis in (0, 1):
        deviations = tossed.mean(axis=axis) * math.sqrt(tossed.shape[axis])
        assert np.abs(deviations).max() <= 6
        # Their squares have mean 1 and variance 2 - 2/n; a coin that alternates would pass all of the above.
        assert abs(np.mean(deviations**2) - 1) <= BOUND * math.sqrt(2 / deviations.size)


def assert_no_correlation(x, y):
    assert abs(np.mean(x * y)) <= BOUND / math.sqrt(x.size)


@pytest.mark.parametrize("lag", [1, 2, 3, 31, 32, 33, 64, 96, 127])
def test_coins_of_steps_are_independent(tossed, lag):
    assert_no_correlation(tossed[:, lag:], tossed[:, :-lag])


@pytest.mark.parametrize("distance", [1, 2, 3, LANES, 7 * LANES])
def test_coins_of_paths_are_independent(tossed, distance):
    assert_no_correlation(tossed[distance:], tossed[:-distance])


@pytest.mark.parametrize(("first", "second"), [(1, 2), (1, 3), (5, 32), (32, 64)])
def test_coins_of_three_steps_are_independent(tossed, first, second):
    """Which pairs do not tell: each coin could be the product of two others."""
    n = tossed.shape[1] - second
    assert_no_correlation(tossed[:, :n] * tossed[:, first : first + n], tossed[:, second:])


@pytest.mark.parametrize(
    "other",
    [
        {"seed": SEED + 1},
        {"seed": SEED + 2**32},
        {"stream": LEVELS + COINS},
        {"blocks": range(2**26, 2**26 + BLOCKS)},
    ],
    ids=["seed", "high word of the seed", "stream", "high paths"],
)
def test_other_coins_are_independent(tossed, other):
    assert_no_correlation(tossed, coins(**other))


@pytest.mark.parametrize("channel", range(3))
@pytest.mark.parametrize("power", [1, 2, 3])
def test_coins_are_independent_of_the_normals(tossed, channel, power):
    """Of the same step, and of those that one evaluation of the generator gives together with it."""
    values = normals(channel=channel) ** power
    values = values - values.mean()
    n = min(values.shape[1], tossed.shape[1])
    for lag in (0, 1, 2, 3, 4, 8):
        x, y = values[:, lag:n], tossed[:, : n - lag]
        assert abs(np.mean(x * y)) <= BOUND * x.std() / math.sqrt(x.size)
        assert abs(np.mean(values[:, : n - lag] * tossed[:, lag:n])) <= BOUND * x.std() / math.sqrt(x.size)
