"""Random numbers of a block of paths: the increments of Wiener processes over steps of all sizes, and coins."""

import numpy as np

from .dispatch import inlined, number, unrolled
from .protocol import noise_indices, noises
from .rng import LANES, draw_increments


@inlined
def truncation_bound(h):
    """sqrt(h) A_h with A_h = sqrt(4 |ln h|), the bound for |dW| that the implicit midpoint rule needs."""
    return np.sqrt(h) * np.sqrt(4.0 * abs(np.log(h)))


@unrolled(noise_indices)
def draw_channels(index, model, increments, noise, draw, block, scale, words):
    """Increments of the next STEPS_PER_DRAW steps, one row of `increments` each, for every noise that is on."""
    k = number(index)
    stride, rows = noises(model) * LANES, increments.ravel()[k * LANES :]
    draw_increments(noise.seed, noise.stream, np.uint64(k), draw, block, scale, words, rows, stride)
    return increments


@unrolled(noise_indices)
def keep_first_half(index, model, dW, first):
    k = number(index)
    for lane in range(k * LANES, (k + 1) * LANES):
        first[lane] = dW[lane]
    return dW


@unrolled(noise_indices)
def add_first_half(index, model, dW, first):
    """dW = first half + second half, where dW holds the second."""
    k = number(index)
    for lane in range(k * LANES, (k + 1) * LANES):
        dW[lane] = first[lane] + dW[lane]
    return dW


@unrolled(noise_indices)
def clip(index, model, dW, clipped, bound):
    k = number(index)
    for lane in range(k * LANES, (k + 1) * LANES):
        clipped[lane] = min(max(dW[lane], -bound), bound)
    return dW


@inlined
def flip(coins, side, flipped):
    for lane in range(LANES):
        coins[flipped, lane] = -coins[side, lane]


@inlined
def copy(coins, source, target):
    for lane in range(LANES):
        coins[target, lane] = coins[source, lane]
