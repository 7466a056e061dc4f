"""Scrambled Sobol' points against SciPy's, and what scrambling must keep and must change."""

import numpy as np
from scipy.special import ndtri
from scipy.stats.qmc import Sobol

from spi.compiler.dispatch import kernel
from spi.ensemble.lanes import aligned
from spi.numerics.rng import LANES
from spi.numerics.sobol import BITS, SCRAMBLES, direction_numbers, net_normals, net_words, scramble

POINTS = 64  # of a scramble
BLOCKS = POINTS * SCRAMBLES // LANES


@kernel
def words_of(directions, shifts, blocks, found):
    for block in range(blocks):
        net_words(directions, shifts, block, found[block])


@kernel
def normals_of(directions, shifts, block, words, ends, normals):
    net_normals(directions, shifts, len(shifts), block, words, ends, normals)


def by_scramble(lanes):
    """(SCRAMBLES, points) of (blocks, LANES)."""
    return lanes.reshape(-1, 8, 8, 8).transpose(1, 3, 0, 2).reshape(SCRAMBLES, -1)


def unscrambled(numbers, directions, shifts):
    directions[...], shifts[...] = numbers[..., np.newaxis], 0


def points_of(numbers, fill, *which):
    """(dimensions, SCRAMBLES, POINTS): binary fractions."""
    directions = np.empty((*numbers.shape, SCRAMBLES), np.uint64)
    shifts, found = np.empty((len(numbers), SCRAMBLES), np.uint64), np.zeros((BLOCKS, LANES), np.uint64)
    fill(*which, numbers, directions, shifts)
    each = []
    for d in range(len(numbers)):
        words_of(directions[d], shifts[d], BLOCKS, found)
        each.append(by_scramble(found).copy())
    return np.array(each)


def scrambled(numbers, seed=1, stream=4096):
    return points_of(numbers, scramble, np.uint64(seed), np.uint64(stream))


def test_without_scrambling_the_points_are_those_of_scipy():
    which = [0, 1, 2, 17, 500, 1023, 4095]
    found = points_of(direction_numbers(4096, 32)[which], unscrambled)[:, 0]
    expected = Sobol(4096, scramble=False, bits=BITS).random(POINTS)[:, which]
    i = np.arange(POINTS)
    assert np.array_equal(found[:, i ^ i >> 1].T * 2.0**-BITS, expected)  # SciPy goes through Gray's code


def cells(points, *bits):
    """How many different cells there are among points, of 2^-b in each dimension."""
    number = np.zeros(points.shape[1:], np.uint64)
    for one, b in zip(points, bits, strict=True):
        number = (number << np.uint64(b)) + (one >> np.uint64(BITS - b))
    return np.array([len(set(row)) for row in number.tolist()])


def test_scrambled_points_are_nets_as_the_others_are():
    points = scrambled(direction_numbers(6, 32))
    for d in range(6):
        assert np.all(cells(points[d : d + 1], 6) == POINTS)
    for bits in range(7):  # the first two dimensions are the best
        assert np.all(cells(points[:2], bits, 6 - bits) == POINTS)
    control = points[:2].copy()
    control[1] = np.random.default_rng(1).permuted(control[1], axis=-1)
    assert np.all(cells(control, 3, 3) < POINTS)


def test_scrambles_are_independent_and_uniform():
    points = scrambled(direction_numbers(4, 32)).astype(float) * 2.0**-BITS
    assert len(np.unique(points)) == points.size
    assert np.all(np.abs(points.mean(axis=(1, 2)) - 0.5) < 4 * 12**-0.5 / (POINTS**1.5 * SCRAMBLES**0.5))
    first = points[..., 0]  # one point of each scramble is as good as independent
    assert np.abs(np.corrcoef(first) - np.eye(4)).max() < 4 / SCRAMBLES**0.5
    assert not np.isin(scrambled(direction_numbers(4, 32), 2).astype(float) * 2.0**-BITS, points).any()
    assert not np.isin(scrambled(direction_numbers(4, 32), 1, 4098).astype(float) * 2.0**-BITS, points).any()


def test_normals_are_quantiles_of_the_points():
    numbers = direction_numbers(5, 32)
    directions, shifts = np.empty((5, 32, SCRAMBLES), np.uint64), np.empty((5, SCRAMBLES), np.uint64)
    scramble(np.uint64(3), np.uint64(4096), numbers, directions, shifts)
    words, found = np.zeros((1234 + 1, LANES), np.uint64), aligned(5 * LANES)
    for block in (0, 7, 1234):
        room = aligned(3 * LANES).view(np.uint64), aligned(5 * 64).view(np.uint64)
        normals_of(directions, shifts, block, *room, found)
        for d in range(5):
            words_of(directions[d], shifts[d], block + 1, words)
            expected = ndtri((words[block].astype(float) + 0.5) * 2.0**-BITS)
            np.testing.assert_allclose(found[d * LANES : (d + 1) * LANES], expected, rtol=1e-11, atol=1e-12)
