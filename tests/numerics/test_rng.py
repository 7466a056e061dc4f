"""The random numbers and the coins: known answers, their layout and their law."""

import math

import numba
import numpy as np
import pytest
from scipy import stats

from spi.compiler.dispatch import kernel
from spi.numerics import rng
from spi.numerics.rng import (
    AREAS,
    BRIDGES,
    BROWNIAN,
    COINS,
    DIFFERENCES,
    DRIVERS,
    INITIAL,
    LANES,
    LEVELS,
    PATH_SETS,
    POINTS,
    SITES,
    STEPS_PER_DRAW,
    STEPS_PER_TOSS,
    STREAM_VERSION,
    TANGENTS,
    UNIFORMS,
    draw_increments,
    normal_pair,
    philox,
    read_coins,
    toss,
)

COMPILED = not numba.config.DISABLE_JIT
BLOCKS = 128 if COMPILED else 8
DRAWS = 64 if COMPILED else 4  # four steps each
BOUND = 4.5
SEED = 20240229


@kernel
def fill(seed, stream, channel, draws, blocks, words, out):
    for b in range(blocks.size):
        for d in range(draws.size):
            draw_increments(seed, stream, channel, draws[d], blocks[b], 1.0, words, out[b, d], LANES)


def normals(seed=SEED, stream=BROWNIAN, channel=0, draws=range(DRAWS), blocks=range(BLOCKS)):
    """Standard normals as an array [path, step]: the paths of the blocks and the steps of the draws, in that order."""
    draws, blocks = np.array(draws, np.uint64), np.array(blocks, np.uint64)
    out = np.empty((blocks.size, draws.size, STEPS_PER_DRAW * LANES))
    words = np.empty(STEPS_PER_DRAW * LANES, np.uint64)
    fill(np.uint64(seed), np.uint64(stream), np.uint64(channel), draws, blocks, words, out)
    by_step = out.reshape(blocks.size, draws.size * STEPS_PER_DRAW, LANES)
    return by_step.transpose(0, 2, 1).reshape(blocks.size * LANES, draws.size * STEPS_PER_DRAW)


def plain_philox(counter, key):
    c, k = list(counter), list(key)
    for _ in range(10):
        low, high = 0xD2511F53 * c[0], 0xCD9E8D57 * c[2]
        c = [(high >> 32) ^ c[1] ^ k[0], high % 2**32, (low >> 32) ^ c[3] ^ k[1], low % 2**32]
        k = [(k[0] + 0x9E3779B9) % 2**32, (k[1] + 0xBB67AE85) % 2**32]
    return c


UNLIKELY = 2 * stats.norm.sf(BOUND)


@kernel
def philox_of(counters, keys, words):
    for i in range(counters.shape[0]):
        c, k = counters[i], keys[i]
        words[i, 0], words[i, 1], words[i, 2], words[i, 3] = philox(c[0], c[1], c[2], c[3], k[0], k[1])


@kernel
def normal_pairs(radius_words, angle_words, first, second):
    for i in range(radius_words.size):
        first[i], second[i] = normal_pair(radius_words[i], angle_words[i])


@pytest.fixture(scope="module")
def sample():
    return normals()


def plain_normal_pair(radius_word, angle_word):
    """The angle: 30 bits place it within pi/4 of the first axis, bit 30 exchanges the axes, bit 31 turns by pi."""
    radius = math.sqrt(-2 * math.log((radius_word + 0.5) / 2**32))
    angle = ((angle_word % 2**30 + 0.5) / 2**30 - 0.5) * math.pi / 2
    first, second = radius * math.cos(angle), radius * math.sin(angle)
    if angle_word >> 31:
        first, second = -first, -second
    return (second, first) if (angle_word >> 30) % 2 else (first, second)


def plain_normal(seed, stream, channel, path, step):
    counter = (step // 4, stream * 2**16 + channel, path % 2**32, path // 2**32)
    words = plain_philox(counter, (seed % 2**32, seed // 2**32))
    pair = plain_normal_pair(words[step % 2], words[2 + step % 2])
    return pair[step % 4 // 2]


KNOWN = [
    ((0,) * 4, (0,) * 2, (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)),
    ((0xFFFFFFFF,) * 4, (0xFFFFFFFF,) * 2, (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD)),
    (
        (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344),
        (0xA4093822, 0x299F31D0),
        (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1),
    ),
]


def test_known_answers_of_random123():
    counters, keys, expected = (np.array(column, np.uint64) for column in zip(*KNOWN, strict=True))
    words = np.empty_like(expected)
    philox_of(counters, keys, words)
    assert np.array_equal(words, expected)
    for counter, key, answer in KNOWN:
        assert tuple(plain_philox(counter, key)) == answer


@pytest.mark.parametrize(
    ("seed", "stream", "channel", "draw", "block"),
    [
        (0, 0, 0, 0, 0),
        (SEED, BROWNIAN, 2, 12345, 17),
        (2**64 - 1, 65535, 65535, 2**32 - 1, 2**58 - 1),  # the far end of everything
        (7, 1, 0, 1, 2**26 - 1),  # the last block whose paths fit in 32 bits
        (2**32 + 7, 0, 1, 3, 2**26),  # and the first beyond
    ],
)
def test_layout(seed, stream, channel, draw, block):
    got = normals(seed, stream, channel, [draw], [block])
    expected = [
        [plain_normal(seed, stream, channel, block * LANES + lane, 4 * draw + r) for r in range(STEPS_PER_DRAW)]
        for lane in range(LANES)
    ]
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-14)


def test_streams_have_not_changed():
    """Whoever changes these numbers must raise STREAM_VERSION: old results could not be reproduced any more."""
    assert STREAM_VERSION == 7
    got = normals(1, BROWNIAN, 0, [0], [0])[0]
    np.testing.assert_allclose(
        got, [-0.4675612109038287, -0.40414676238422886, 0.11777869238261014, -0.24337868579542107], rtol=0, atol=1e-14
    )


def test_normal_pair_at_the_ends_of_the_words():
    words = [0, 1, 2**29 - 1, 2**29, 2**30 - 1, 2**30, 2**31 - 1, 2**31, 2**32 - 1]
    radius_words, angle_words = (a.ravel().astype(np.uint64) for a in np.meshgrid(words, words))
    first, second = np.empty(radius_words.size), np.empty(radius_words.size)
    normal_pairs(radius_words, angle_words, first, second)
    expected = [plain_normal_pair(int(r), int(a)) for r, a in zip(radius_words, angle_words, strict=True)]
    np.testing.assert_allclose(np.stack([first, second], axis=1), expected, rtol=0, atol=1e-14)
    assert math.isclose(np.max(np.abs(first)), math.sqrt(66 * math.log(2)), rel_tol=1e-12)  # 6.76, the largest there is
    assert np.all(np.hypot(first, second) > 0)


def test_paths_do_not_depend_on_their_neighbours():
    blocks, draws = [5, 1, 2**26, 3], [9, 0, 4]
    together = normals(draws=draws, blocks=blocks)
    for b, block in enumerate(blocks):
        for d, draw in enumerate(draws):
            alone = normals(draws=[draw], blocks=[block])
            assert np.array_equal(together[b * LANES : (b + 1) * LANES, 4 * d : 4 * (d + 1)], alone)


def test_everything_that_names_a_normal_changes_it():
    reference = normals(draws=[0], blocks=[0])
    others = [
        normals(seed=SEED + 1, draws=[0], blocks=[0]),
        normals(seed=SEED + 2**32, draws=[0], blocks=[0]),
        normals(stream=BROWNIAN + 1, draws=[0], blocks=[0]),
        normals(channel=1, draws=[0], blocks=[0]),
        normals(draws=[1], blocks=[0]),
        normals(draws=[0], blocks=[1]),
        normals(draws=[0], blocks=[2**26]),
        normals(draws=[0], blocks=[2**26 + 1]),
    ]
    values = np.concatenate([reference, *others]).ravel()
    assert np.unique(values).size == values.size


@pytest.mark.parametrize("power", range(1, 7))
def test_moments(sample, power):
    def moment(k):
        return math.prod(range(k - 1, 0, -2)) if k % 2 == 0 else 0

    standard_error = math.sqrt((moment(2 * power) - moment(power) ** 2) / sample.size)
    assert abs(np.mean(sample**power) - moment(power)) <= BOUND * standard_error


def test_kolmogorov_smirnov(sample):
    assert stats.kstest(sample.ravel(), "norm").pvalue > 0.01


@pytest.mark.parametrize("sigmas", [1.0, 2.0, 3.0, 4.0, 4.5])
@pytest.mark.parametrize("side", [-1, 1])
def test_tails(sample, sigmas, side):
    count, law = np.count_nonzero(side * sample > sigmas), stats.binom(sample.size, stats.norm.sf(sigmas))
    assert law.ppf(UNLIKELY / 2) <= count <= law.isf(UNLIKELY / 2)


def assert_uncorrelated(x, y):
    """Also of the squares and the absolute values: pairs from one radius would be uncorrelated but not independent."""
    for f in (lambda t: t, lambda t: t * t, np.abs):
        correlation = np.corrcoef(f(x).ravel(), f(y).ravel())[0, 1]
        assert abs(correlation) <= BOUND / math.sqrt(x.size)


@pytest.mark.parametrize("lag", [1, 2, 3, 4, 5])
def test_steps_are_independent(sample, lag):
    assert_uncorrelated(sample[:, lag:], sample[:, :-lag])


@pytest.mark.parametrize("distance", [1, 2, LANES])
def test_paths_are_independent(sample, distance):
    assert_uncorrelated(sample[distance:], sample[:-distance])


def test_sums_of_steps_are_normal(sample):
    """What coarse increments are made of: dependence that pairwise correlations miss shows in the variance of sums."""
    sums = sample.reshape(-1, 2**4).sum(axis=1) / 4.0
    assert stats.kstest(sums, "norm").pvalue > 0.01
    assert abs(np.mean(sums**2) - 1.0) <= BOUND * math.sqrt(2 / sums.size)
    assert abs(np.mean(sums**4) - 3.0) <= BOUND * math.sqrt(96 / sums.size)


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
    """All streams of the registry: those of increments, and what is added to each of them."""
    others = {"STREAM_VERSION", "MOST_NOISES", "LANES", "PARTS", "STEPS_PER_DRAW", "STEPS_PER_TOSS"}
    of_increments = {"BROWNIAN", "LEVELS", "DIFFERENCES", "PATH_SETS", "POINTS"}
    added = {"COINS", "BRIDGES", "AREAS", "INITIAL", "UNIFORMS", "DRIVERS", "TANGENTS"}
    registry = {name for name in vars(rng) if name.isupper() and not name.startswith("_")}
    assert registry == others | of_increments | added | {"SITES"}  # a new one has its place below, too
    from spi.plugins.answers.kinds.answer.sets import SETS, all_sets

    of_answers = {path_set.stream for path_set in all_sets(len(PATH_SETS))}
    of_levels, of_differences = ({first + 2 * j for j in range(64)} for first in (LEVELS, DIFFERENCES))
    increments = [BROWNIAN, *of_levels, *of_differences, *of_answers, POINTS]
    assert len(of_answers) == SETS * len(PATH_SETS) and len(set(increments)) == len(increments) == 1 + 128 + 680 + 1
    used = (0, COINS, BRIDGES, AREAS, INITIAL, UNIFORMS, DRIVERS + 1, DRIVERS + 2, TANGENTS)
    streams = [SITES, *(stream + use for stream in increments for use in used)]
    assert len(set(streams)) == len(streams) and max(streams) < 2**16
    overlapping = [*of_levels, *of_differences, *(512 + 2 * j for j in range(4 * SETS))]  # as four schemes were
    assert len(set(overlapping)) < len(overlapping)


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
