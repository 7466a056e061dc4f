"""The random numbers: known answers, their layout and their law."""

import math

import numpy as np
import pytest
from random_cases import BLOCKS, BOUND, COMPILED, SEED, normals, plain_philox
from scipy import stats

from spi.compiler.dispatch import kernel
from spi.numerics.rng import BROWNIAN, LANES, STEPS_PER_DRAW, STREAM_VERSION, normal_pair, philox

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
    assert STREAM_VERSION == 5
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


def test_sample_is_large_enough(sample):
    assert sample.size == (2**21 if COMPILED else 2**13)


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


@pytest.mark.parametrize("row", range(STEPS_PER_DRAW))
def test_steps_of_one_draw_are_independent(sample, row):
    for other in range(row):
        assert_uncorrelated(sample[:, row::STEPS_PER_DRAW], sample[:, other::STEPS_PER_DRAW])


@pytest.mark.parametrize("distance", [1, 2, LANES])
def test_paths_are_independent(sample, distance):
    assert_uncorrelated(sample[distance:], sample[:-distance])


@pytest.mark.parametrize(
    "other",
    [
        {"channel": 1},
        {"channel": 2},
        {"stream": BROWNIAN + 1},
        {"seed": SEED + 1},
        {"seed": SEED + 2**32},
        {"blocks": range(2**26, 2**26 + BLOCKS)},
    ],
    ids=["channel 1", "channel 2", "stream", "seed", "high word of the seed", "high paths"],
)
def test_others_are_independent(sample, other):
    assert_uncorrelated(sample, normals(**other))


def test_sums_of_steps_are_normal(sample):
    """What coarse increments are made of: dependence that pairwise correlations miss shows in the variance of sums."""
    sums = sample.reshape(-1, 2**4).sum(axis=1) / 4.0
    assert stats.kstest(sums, "norm").pvalue > 0.01
    assert abs(np.mean(sums**2) - 1.0) <= BOUND * math.sqrt(2 / sums.size)
    assert abs(np.mean(sums**4) - 3.0) <= BOUND * math.sqrt(96 / sums.size)
