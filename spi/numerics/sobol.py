"""Sobol' points, scrambled (Joe and Kuo, SIAM J. Sci. Comput. 30, 2008; Matoušek, J. Complexity 14, 1998).

Coordinate d of point i is the xor of the direction numbers v_dj over the bits j that are set in i, a binary fraction of
BITS bits.  A scramble is a random linear one with a digital shift: each v_dj is multiplied by a lower triangular matrix
of random bits, with ones on the diagonal, and to the points a random fraction is added bit by bit.  Every scrambled
point is uniform on the cube, 2^k consecutive ones have the balance of the unscrambled ones, and means of smooth
functions over them have nearly the variance n^-3.  The scrambles are functions of (seed, stream, scramble, dimension).

There are SCRAMBLES scrambles, as many as there are jackknife groups of paths, and each is such a group: lane l of
block b has scramble (b mod 8) * 8 + l mod 8, and of it point (b // 8) * 8 + l // 8.  So statistics of groups,
above all standard errors, hold for these points as they do for independent paths.
"""

import functools

import numpy as np

from ..compiler.dispatch import device, intrinsic, kernel
from ..compiler.instructions import xor_strips
from .elementary import from_bits
from .quantile import central_quantile, tail_quantile
from .rng import LANES, PARTS, philox

#: The number of independent scrambles.
SCRAMBLES = 64
#: The largest number of dimensions; more would cost more memory than they are worth.
MOST_DIMENSIONS = 4096
#: The fewest paths: the first eight points of each scramble.
LEAST_PATHS = SCRAMBLES * LANES // PARTS
BITS = 52

_BLOCKS = SCRAMBLES // PARTS  # after which all scrambles have had points
_POINTS = LANES // PARTS  # of a scramble in a block, 2^_OWN
_OWN = 3
_ALL = np.uint64(2**BITS - 1)
_ONE = np.int64(0x3FF0000000000000)
_EIGHTH = np.uint64(BITS - _OWN)  # shifted by so many bits a fraction is the number of its eighth of the interval
_PLACE, _7 = np.uint64(BITS), np.uint64(_POINTS - 1)
_LOW, _32, _0, _1 = np.uint64(0xFFFFFFFF), np.uint64(32), np.uint64(0), np.uint64(1)


@functools.cache
def direction_numbers(dimensions, count):
    """The first `count` <= BITS direction numbers of each dimension, (dimensions, count) uint64, cached."""
    from scipy.stats.qmc import Sobol  # takes a while

    return np.array(Sobol(dimensions, scramble=False, bits=BITS)._sv[:, :count], np.uint64)


@kernel
def scramble(seed, stream, numbers, directions, shifts):
    """Scramble direction numbers (dimensions, count): `directions` (dimensions, count, SCRAMBLES), and the shifts.

    `seed` and `stream` are uint64; all columns of a matrix come from the counters (column // 2, stream, dimension,
    scramble), the shift from the column after them.
    """
    dimensions, count = numbers.shape
    columns = np.empty(BITS + 2, np.uint64)
    for d in range(dimensions):
        for s in range(SCRAMBLES):
            for c in range(0, BITS + 2, 2):
                place = np.uint64(c // 2), stream << np.uint64(16), np.uint64(d), np.uint64(s)
                w = philox(*place, seed & _LOW, seed >> _32)
                columns[c], columns[c + 1] = (w[0] << _32) | w[1], (w[2] << _32) | w[3]
            shifts[d, s] = columns[BITS] & _ALL
            for c in range(BITS):
                lead = _1 << np.uint64(BITS - 1 - c)
                columns[c] = (columns[c] & (lead - _1)) | lead
            for j in range(count):
                word = _0
                for c in range(j + 1):  # the last bit of v_j is that of column j
                    if (numbers[d, j] >> np.uint64(BITS - 1 - c)) & _1 != _0:
                        word ^= columns[c]
                directions[d, j, s] = word


def xor_parts(target, t, a, i, b, j):
    """target[t + r] = a[i + r] ^ b[j + r] for r = 0, ..., PARTS - 1."""
    for r in range(PARTS):
        target[t + r] = a[i + r] ^ b[j + r]


@intrinsic(xor_parts)
def _(target, t, a, i, b, j):
    return xor_strips(PARTS, target, t, a, i, b, j)


@device
def net_words(directions, shifts, block, words):
    """One coordinate of the points of the lanes of a block, as binary fractions, in `words` (at least LANES uint64).

    `directions` (count, SCRAMBLES) and `shifts` (SCRAMBLES,) are those of the dimension.
    """
    first, index = block % _BLOCKS * PARTS, block // _BLOCKS
    xor_parts(words, 0, shifts, first, directions[0], first)  # and the surplus is removed by the next line
    xor_parts(words, 0, words, 0, directions[0], first)
    j = _OWN
    while index > 0:
        if index & 1:
            xor_parts(words, 0, words, 0, directions[j], first)
        j, index = j + 1, index >> 1
    for j in range(_OWN):
        size = PARTS << j
        for begin in range(0, size, PARTS):
            xor_parts(words, size + begin, words, begin, directions[j], first)


@device
def central_normals(words, scratch, normals, ends):
    """Standard normals of the LANES fractions `words`, but those of the ends of the interval.

    Of eight consecutive points of a scramble exactly one lies in each eighth of the interval, so that of each scramble
    one lane has less than 1/8, and one more than 7/8.  These fractions go to `ends` (2 PARTS), with their lanes before
    them, those above 7/8 counted from 1; all others lie where a polynomial will do.
    """
    low, high = scratch[:LANES], scratch[LANES : 2 * LANES]
    for lane in range(LANES):
        eighth, place = words[lane] >> _EIGHTH, np.uint64(lane) << _PLACE
        low[lane] = (words[lane] | place) & np.uint64(-np.int64(_1 >> eighth))  # all bits where eighth is 0
        high[lane] = (words[lane] ^ _ALL | place) & np.uint64(-np.int64((_1 << eighth) >> _7))
        normals[lane] = central_quantile((_fraction(words[lane]) - 0.5) + 2.0**-53)
    xor_parts(ends, 0, low, 0, low, PARTS)
    xor_parts(ends, PARTS, high, 0, high, PARTS)
    for begin in range(2 * PARTS, LANES, PARTS):  # all but one are 0
        xor_parts(ends, 0, ends, 0, low, begin)
        xor_parts(ends, PARTS, ends, PARTS, high, begin)


@device(inline=False)
def net_normals(directions, shifts, count, block, words, ends, normals):
    """Standard normals of the first `count` coordinates of the points of the lanes of a block, LANES of each.

    Scratch are `words` (at least 3 LANES uint64) and `ends` (4 PARTS uint64 for each coordinate).
    """
    for d in range(count):
        net_words(directions[d], shifts[d], block, words)
        central_normals(words, words[LANES:], normals[d * LANES :], ends[d * 2 * PARTS :])
    values = ends[count * 2 * PARTS :].view(np.float64)
    for i in range(count * 2 * PARTS):
        values[i] = tail_quantile(_fraction(ends[i] & _ALL) + 2.0**-53)
    for d in range(count):
        of_ends, of_lanes = ends[d * 2 * PARTS :], normals[d * LANES :]
        of_values = values[d * 2 * PARTS :]
        for r in range(PARTS):
            of_lanes[np.int64(of_ends[r] >> _PLACE)] = of_values[r]
            of_lanes[np.int64(of_ends[PARTS + r] >> _PLACE)] = -of_values[PARTS + r]


@device
def _fraction(word):
    """A binary fraction of BITS bits as a float in [0, 1); the points lie in the middle, 2^-53 above it."""
    return from_bits(np.int64(word) | _ONE) - 1.0
