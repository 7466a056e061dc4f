"""Random numbers that are a function of (seed, stream, path, step): Philox4x32-10 (Salmon et al., SC 2011).

Key = the 64-bit seed.  Counter = (step // 4, stream and channel, path low, path high).  One evaluation gives four
words and these, by Box and Muller's method, the normals of four consecutive steps of one channel (one Wiener process).
So a path does not depend on threads, on chunks, on how many paths or steps are computed, or on which other channels
are in use; a noise that is off costs nothing.
"""

import numpy as np

from ..compiler.dispatch import device
from .elementary import expm1, log_normal, sin_versine_small, whole_float

#: Stored in every result; to be raised whenever the same seed would give other numbers.
STREAM_VERSION = 7

#: The registry of streams: no two uses of random numbers share one.
BROWNIAN = 0  # increments of the Wiener processes, channel = process
# added to the stream of the increments, for other numbers of the same paths:
COINS = 1  # coins
BRIDGES = 2**15  # Brownian bridges, channel = 2^12 * number of the bridge + process
AREAS = 2**14  # Fourier coefficients of Lévy areas, channels as in spi.ensemble.areas
INITIAL = 2**13  # random initial states
DRIVERS = 2**12  # and up to 2 more: further numbers of drivers that are no Brownian motion
TANGENTS = 2**12 + 2**11  # the first tangent vectors along paths
SITES = 2**15 + 2**14  # turns, normal and uniform numbers of the sites of one large lattice, channel = site of a part
UNIFORMS = 2**11  # uniform numbers, channel = 4 * (number // 4) + step mod 4
# streams of increments and of points, all below what is added to them, each with its coins behind it:
LEVELS = 16  # increments of level number j of a multilevel estimator: LEVELS + 2 j, j < 64
POINTS = 1536  # scrambles of quasi-random points, and keyed numbers beside them
DIFFERENCES = 1024  # increments of its differences between two schemes at the step 2^j h_ref: DIFFERENCES + 2 j, j < 64
#: Of a kind with independent path sets: increments of set number j < 68 of scheme number i: PATH_SETS[i] + 2 j.
PATH_SETS = (512, 648, 784, 144, 280, 1152, 1288, 1540, 1676, 1812)

#: The largest number of Wiener processes of paths, so that their channels and those of bridges are apart.
MOST_NOISES = 4096

#: Paths are computed in blocks of this many, always whole: path p is lane p % LANES of block p // LANES.
LANES = 64
#: The number of parts of the lanes, lane mod PARTS, with separate sums over paths.
PARTS = 8
#: Steps whose normals come from one evaluation of the generator.
STEPS_PER_DRAW = 4
#: Steps whose coins come from one evaluation.
STEPS_PER_TOSS = 128

_M0, _M1 = np.uint64(0xD2511F53), np.uint64(0xCD9E8D57)
_W0, _W1 = np.uint64(0x9E3779B9), np.uint64(0xBB67AE85)
_LOW = np.uint64(0xFFFFFFFF)
_32 = np.uint64(32)
_ANGLE = np.pi * 2.0**-31  # a quarter turn over 2^30


@device
def philox(c0, c1, c2, c3, k0, k1):
    """Philox4x32-10: four 32-bit words from a counter and a key, all carried in uint64."""
    for _ in range(10):
        p0 = _M0 * c0
        p1 = _M1 * c2
        c0, c1, c2, c3 = (p1 >> _32) ^ c1 ^ k0, p1 & _LOW, (p0 >> _32) ^ c3 ^ k1, p0 & _LOW
        k0 = (k0 + _W0) & _LOW
        k1 = (k1 + _W1) & _LOW
    return c0, c1, c2, c3


@device
def words_of(seed, stream, channel, draw, block, lane):
    """Four words of a lane of a block; all but the lane are uint64."""
    c2 = ((block << np.uint64(6)) & _LOW) + np.uint64(lane)
    return philox(draw, (stream << np.uint64(16)) | channel, c2, block >> np.uint64(26), seed & _LOW, seed >> _32)


@device
def uniform(word):
    """Number (word + 1/2) / 2^32 of (0, 1) of a 32-bit word."""
    return whole_float(np.int64(word)) * 2.0**-32 + 2.0**-33


@device
def accepts(uniform_number, log_ratio):
    """Whether something of the probability min(1, exp(log_ratio)) happens; False for NaN."""
    return uniform_number - 1.0 < expm1(log_ratio)


@device
def normal_pair(radius_word, angle_word, scale=1.0):
    """Two independent normals of standard deviation `scale` from two 32-bit words (Box and Muller).

    The radius is scale sqrt(-2 ln u), u = (word + 1/2) / 2^32, hence at most 6.76 scale.  The angle lies within pi/4 of
    the first axis by 30 bits of its word; one more bit exchanges the two coordinates and one changes both signs.
    """
    return on_circle(scale * np.sqrt(-2.0 * log_normal(uniform(radius_word))), angle_word)


@device
def on_circle(radius, word):
    """Point of a circle, of either sign of its radius, at the angle of a 32-bit word."""
    word = np.int64(word)
    radius = -radius if (word & 0x80000000) != 0 else radius
    s, v = sin_versine_small((whole_float(word & 0x3FFFFFFF) - 536870911.5) * _ANGLE)
    c = radius - radius * v
    s = radius * s
    swap = (word & 0x40000000) != 0
    return (s if swap else c), (c if swap else s)


@device
def draw_increments(seed, stream, channel, draw, block, scale, words, increments, stride):
    """Increments of the steps 4 draw, ..., 4 draw + 3 of one channel, for the LANES paths of a block.

    `increments` receives step 4 draw + r of lane l, `scale` times a standard normal, at [r * stride + l]; `words`
    (4 * LANES uint64) is scratch.  `seed`, `stream`, `channel`, `draw` and `block` are uint64.
    """
    draw_words(seed, stream, channel, draw, block, words)
    for half in range(2):
        first, second = increments[half * stride :], increments[(half + 2) * stride :]
        for lane in range(LANES):
            pair = normal_pair(words[half * LANES + lane], words[(half + 2) * LANES + lane], scale)
            first[lane], second[lane] = pair


@device
def draw_words(seed, stream, channel, draw, block, words):
    """Four words of the LANES paths of a block, word r of lane l at [r * LANES + l]."""
    for lane in range(LANES):
        w = words_of(seed, stream, channel, draw, block, lane)
        words[lane], words[LANES + lane], words[2 * LANES + lane], words[3 * LANES + lane] = w


@device
def toss(seed, stream, draw, block, words):
    """Bits behind the coins of the steps 128 draw, ..., 128 draw + 127, in `words` (4 * LANES uint64)."""
    draw_words(seed, stream, np.uint64(0), draw, block, words)


@device
def draw_uniforms(seed, stream, step, block, uniforms):
    """Uniform numbers of (0, 1) of one step for the paths of a block, number i of lane l at [i * LANES + l].

    There are as many as there is room for, a multiple of 4; each has 32 bits, (word + 1/2) / 2^32.
    """
    for first in range(0, len(uniforms) // LANES, 4):
        channel, rows = np.uint64(first + step % 4), uniforms[first * LANES :]
        for lane in range(LANES):
            w0, w1, w2, w3 = words_of(seed, stream, channel, np.uint64(step // 4), block, lane)
            rows[lane] = uniform(w0)
            rows[LANES + lane] = uniform(w1)
            rows[2 * LANES + lane] = uniform(w2)
            rows[3 * LANES + lane] = uniform(w3)


@device
def read_coins(words, step, coins):
    """Coins of one step, 1.0 or -1.0 for each lane, from the bits of :func:`toss`."""
    row = step % STEPS_PER_TOSS // 32 * LANES
    place = np.uint64(step % 32)
    for lane in range(LANES):
        coins[lane] = 1.0 if (words[row + lane] >> place) & np.uint64(1) != 0 else -1.0
