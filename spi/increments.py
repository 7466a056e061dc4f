"""Random numbers of a block of paths: the increments of Wiener processes over steps of all sizes, and coins.

A row of increments has those over a whole step, and behind them, where a scheme asks for sub-steps, those over its
halves, quarters, ..., see :func:`first_lane`.
"""

import functools

import numpy as np
from numba.extending import overload

from .dispatch import INDICES, INLINED, class_of, inlined, number, unrolled
from .protocol import noise_indices, noises
from .rng import BRIDGES, LANES, STEPS_PER_DRAW, draw_increments


@inlined
def truncation_bound(h):
    """sqrt(h) A_h with A_h = sqrt(4 |ln h|), the bound for |dW| that the implicit midpoint rule needs."""
    return np.sqrt(h) * np.sqrt(4.0 * abs(np.log(h)))


@inlined
def first_lane(model, k, n, part):
    """Where in a row the increments of noise k over sub-step `part` = 0, ..., n - 1 of n = 1, 2, 4, ... begin."""
    return ((n - 1 + part) * noises(model) + k) * LANES


@unrolled(noise_indices)
def draw_channels(index, model, increments, noise, draw, block, scale, words, stride):
    """Increments of the next STEPS_PER_DRAW steps, one row of `increments` each, for every noise that is on.

    `stride` is the length of a row.
    """
    k = number(index)
    rows = increments.ravel()[k * LANES :]
    draw_increments(noise.seed, noise.stream, np.uint64(k), draw, block, scale, words, rows, stride)
    return increments


@unrolled(noise_indices)
def draw_bridges(index, model, increments, noise, draw, block, scale, words, normals, finest):
    """Increments over the halves, quarters, ... of those steps, `finest` sub-steps at last, given those of the steps.

    Lévy's construction: given the increment dW over a time t, that over its first half is dW/2 + sqrt(t)/2 Z with a
    standard normal Z.  Bridge number n + part, of a stream of its own, halves sub-step `part` of n.
    `normals` (STEPS_PER_DRAW * LANES) is scratch.
    """
    k = number(index)
    stream = noise.stream + np.uint64(BRIDGES)
    n = 1
    while n < finest:
        deviation = 0.5 * scale / np.sqrt(n)
        for part in range(n):
            channel = np.uint64((n + part) * 4096 + k)
            draw_increments(noise.seed, stream, channel, draw, block, deviation, words, normals, LANES)
            whole, half = first_lane(model, k, n, part), first_lane(model, k, 2 * n, 2 * part)
            other = first_lane(model, k, 2 * n, 2 * part + 1)
            for step in range(STEPS_PER_DRAW):
                row, bridge = increments[step], normals[step * LANES :]
                for lane in range(LANES):
                    row[half + lane] = 0.5 * row[whole + lane] + bridge[lane]
                    row[other + lane] = row[whole + lane] - row[half + lane]
        n = 2 * n
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
def join_halves(index, model, dW, first, finest):
    """The sub-steps of a step from those of its halves, where dW holds the second: half as many of each half.

    Increments over the whole step stay those of the second half; :func:`add_first_half` comes after.
    """
    k = number(index)
    n = finest
    while n > 1:
        for part in range(n // 2):
            source = first_lane(model, k, n // 2, part)
            early, late = first_lane(model, k, n, part), first_lane(model, k, n, n // 2 + part)
            for lane in range(LANES):
                dW[late + lane] = dW[source + lane]
                dW[early + lane] = first[source + lane]
        n = n // 2
    return dW


@unrolled(noise_indices)
def turn_around(index, model, dW, turned, finest):
    """The increments of the path run through backwards: sub-steps in reversed order."""
    k = number(index)
    n = 1
    while n <= finest:
        for part in range(n):
            source, target = first_lane(model, k, n, part), first_lane(model, k, n, n - 1 - part)
            for lane in range(LANES):
                turned[target + lane] = dW[source + lane]
        n = 2 * n
    return dW


@unrolled(noise_indices)
def clip(index, model, dW, clipped, bound):
    k = number(index)
    for lane in range(k * LANES, (k + 1) * LANES):
        clipped[lane] = min(max(dW[lane], -bound), bound)
    return dW


@unrolled(noise_indices)
def clip_substeps(index, model, dW, clipped, h, finest):
    """Clip the increments over sub-steps, each by the bound for its own length."""
    k = number(index)
    n = 2
    while n <= finest:
        bound = truncation_bound(h / n)
        for part in range(n):
            begin = first_lane(model, k, n, part)
            for lane in range(begin, begin + LANES):
                clipped[lane] = min(max(dW[lane], -bound), bound)
        n = 2 * n
    return dW


# What the loop over time does with rows of increments; `finest` is one of INDICES, and where it stands for 1, which is
# so for nearly all schemes, there are no sub-steps and kernels contain nothing about them.


@inlined
def row_length(finest, model):
    """How many floats the increments of a block over a step and its sub-steps are."""
    return (2 * number(finest) - 1) * noises(model) * LANES


def _unless_one(plain):
    """Decorator: `plain` takes the place of ``body(finest, ...)`` where `finest` stands for 1, without a branch."""

    def decorate(body):
        @functools.wraps(body)
        def f(finest, *arguments):
            return (plain if number(finest) == 1 else body)(finest, *arguments)

        @overload(f, jit_options=INLINED, strict=False)
        def f_while_compiling(finest, *types_of_arguments):
            return plain if INDICES.index(class_of(finest)) == 1 else body

        return f

    return decorate


def _draw_steps(finest, model, increments, noise, draw, block, scale, words):
    draw_channels(model, increments, noise, draw, block, scale, words, row_length(finest, model))


@_unless_one(_draw_steps)
def draw_steps(finest, model, increments, noise, draw, block, scale, words):
    """Increments of the next STEPS_PER_DRAW steps and of their sub-steps, of which there are `finest` at last."""
    draw_channels(model, increments, noise, draw, block, scale, words, row_length(finest, model))
    normals = np.empty(STEPS_PER_DRAW * LANES)
    draw_bridges(model, increments, noise, draw, block, scale, words, normals, number(finest))


def _keep(finest, model, dW, first):
    keep_first_half(model, dW, first)


@_unless_one(_keep)
def keep(finest, model, dW, first):
    """Keep a step as the first half of a larger one."""
    first[:] = dW


def _join(finest, model, dW, first):
    add_first_half(model, dW, first)


@_unless_one(_join)
def join(finest, model, dW, first):
    """The step of which `dW` holds the second half and `first` the first, in `dW`."""
    join_halves(model, dW, first, number(finest))
    add_first_half(model, dW, first)


def _same_row(finest, model, dW, row, turned):
    return row


@_unless_one(_same_row)
def reversed_row(finest, model, dW, row, turned):
    """The number of the row with the increments of `row`, those of sub-steps in reversed order: `turned`."""
    turn_around(model, dW[row], dW[turned], number(finest))
    return turned


def _truncate(finest, model, dW, clipped, h):
    clip(model, dW, clipped, truncation_bound(h))


@_unless_one(_truncate)
def truncate(finest, model, dW, clipped, h):
    """The increments of a step of size h with their bounds, in `clipped`, which may be `dW`."""
    clip(model, dW, clipped, truncation_bound(h))
    clip_substeps(model, dW, clipped, h, number(finest))


@inlined
def flip(coins, side, flipped):
    for lane in range(LANES):
        coins[flipped, lane] = -coins[side, lane]


@inlined
def copy(coins, source, target):
    for lane in range(LANES):
        coins[target, lane] = coins[source, lane]
