"""What the tests of the random numbers share: kernels that draw, and bounds."""

import numba
import numpy as np

from spi.compiler.dispatch import kernel
from spi.numerics.rng import BROWNIAN, LANES, STEPS_PER_DRAW, draw_normals

COMPILED = not numba.config.DISABLE_JIT
BLOCKS = 128 if COMPILED else 8
DRAWS = 64 if COMPILED else 4  # four steps each
BOUND = 4.5
SEED = 20240229


@kernel
def fill(seed, stream, channel, draws, blocks, words, out):
    for b in range(blocks.size):
        for d in range(draws.size):
            draw_normals(seed, stream, channel, draws[d], blocks[b], words, out[b, d])


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
