"""Random numbers of a block of paths: the increments of Wiener processes over steps of all sizes, and coins.

A row of increments has those over a whole step, and behind them, where a scheme needs sub-steps, those over its
halves, quarters, ..., see :func:`first_lane`, and last, where a scheme needs them, Lévy areas, see ``areas.py``.
"""

import functools
from typing import NamedTuple

import numpy as np

from ..compiler.dispatch import device, method, number
from ..compiler.records import field
from ..numerics.rng import (
    BRIDGES,
    BROWNIAN,
    COINS,
    LANES,
    STEPS_PER_DRAW,
    STEPS_PER_TOSS,
    UNIFORMS,
    draw_increments,
    draw_uniforms,
    read_coins,
    toss,
)
from .areas import areas_length, channels, copy_areas, draw_areas, join_areas
from .lanes import aligned
from .protocol import noises

# ---------------------------------------------------------------------------------------------------------------------
# Streams of keyed random numbers, and the methods that every noise has whose numbers the loop over time makes itself.
# ---------------------------------------------------------------------------------------------------------------------


def in_one_call(noise, scheme, model, times, first, blocks, end):
    """(grid, noise, first block, end of paths) of the calls of the loop that together make all steps of a grid."""
    return ((times, noise, first, end),)


def as_many_blocks(noise, model, times):
    """The number of blocks whose noise fits into memory: any number, since it is drawn step by step."""
    return 2**62


def itself(noise):
    """A noise of the same type whose numbers are quickly made, for calls that only have kernels compiled."""
    return noise


class RandomStream(NamedTuple):
    """The random numbers of a 64-bit seed and one of the streams of ``spi.numerics.rng``, both as uint64."""

    seed: np.uint64
    stream: np.uint64

    @property
    def keys(self):
        """The stream of which the random numbers of these paths are functions: itself."""
        return self

    for_a_trial, most_blocks, pieces = property(itself), as_many_blocks, in_one_call


def brownian(seed):
    """The increments of the paths of a seed."""
    return RandomStream(np.uint64(seed), np.uint64(BROWNIAN))


# ---------------------------------------------------------------------------------------------------------------------
# Rows of coins in kernels, where a scheme tosses them, and of uniform numbers, where it judges flows.  `layout` is one
# of NoCoins, Coins and Uniforms.
# ---------------------------------------------------------------------------------------------------------------------


@method
def coins_length(layout, model):
    """The length of a row of coins, in floats."""


@method
def draw_coins(layout, noise, n, block, bits, coins, row):
    """Put the coins of step n into a row; `bits`, those of STEPS_PER_TOSS steps, stay from one step to the next."""


@method
def copy_coins(layout, coins, source, target):
    """Copy the coins of row `source` to row `target`."""


@method
def turn_coins(layout, coins, source, target):
    """Put the opposite coins of row `source` into row `target`; uniform numbers are copied."""


@device
def toss_and_read(noise, n, block, bits, row):
    """Put the coins of step n into `row`; `bits` are tossed at the first of STEPS_PER_TOSS steps."""
    if n % STEPS_PER_TOSS == 0:
        toss(noise.seed, noise.stream + np.uint64(COINS), np.uint64(n // STEPS_PER_TOSS), block, bits)
    read_coins(bits, n, row)


class NoCoins(NamedTuple):
    """No scheme tosses coins: kernels contain nothing about them."""

    def coins_length(layout, model):
        return LANES

    def draw_coins(layout, noise, n, block, bits, coins, row):
        pass

    def copy_coins(layout, coins, source, target):
        pass

    def turn_coins(layout, coins, source, target):
        pass


class Coins(NamedTuple):
    """A scheme tosses coins."""

    def coins_length(layout, model):
        return LANES

    def draw_coins(layout, noise, n, block, bits, coins, row):
        toss_and_read(noise, n, block, bits, coins[row])

    def copy_coins(layout, coins, source, target):
        for lane in range(LANES):
            coins[target, lane] = coins[source, lane]

    def turn_coins(layout, coins, source, target):
        for lane in range(LANES):
            coins[target, lane] = -coins[source, lane]


class Uniforms(NamedTuple):
    """A scheme judges flows: behind the coins stand uniform numbers, one for each noise and one for the drift."""

    def coins_length(layout, model):
        return (1 + 4 * (noises(model) // 4 + 1)) * LANES

    def draw_coins(layout, noise, n, block, bits, coins, row):
        toss_and_read(noise, n, block, bits, coins[row])
        draw_uniforms(noise.seed, noise.stream + np.uint64(UNIFORMS), n, block, coins[row, LANES:])

    def copy_coins(layout, coins, source, target):
        for i in range(coins.shape[1]):
            coins[target, i] = coins[source, i]

    def turn_coins(layout, coins, source, target):
        for i in range(coins.shape[1]):
            coins[target, i] = -coins[source, i] if i < LANES else coins[source, i]


@device
def truncation_bound(h):
    """sqrt(h) A_h with A_h = sqrt(4 |ln h|), the bound for |dW| that the implicit midpoint rule needs."""
    return np.sqrt(h) * np.sqrt(4.0 * abs(np.log(h)))


@device
def first_lane(model, k, n, part):
    """The place in a row of the increments of noise k over sub-step `part` = 0, ..., n - 1 of n = 1, 2, 4, ..."""
    return ((n - 1 + part) * noises(model) + k) * LANES


@device
def draw_channels(model, increments, noise, draw, block, scale, words, stride):
    """Draw the increments of the next STEPS_PER_DRAW steps, one row of `increments` each, for every noise that is on.

    `stride` is the length of a row.
    """
    rows = increments.ravel()
    for k in channels(model):
        draw_increments(noise.seed, noise.stream, np.uint64(k), draw, block, scale, words, rows[k * LANES :], stride)


@device
def draw_bridges(model, increments, noise, draw, block, scale, words, normals, finest):
    """Draw increments over the halves, quarters, ..., `finest` sub-steps at last, given those over whole steps.

    Lévy's construction: given the increment dW over a time t, that over its first half is dW/2 + sqrt(t)/2 Z with a
    standard normal Z.  Bridge number n + part, of a stream of its own, halves sub-step `part` of n.
    `normals` (STEPS_PER_DRAW * LANES) is scratch.
    """
    for k in channels(model):
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


@device
def keep_first_half(model, dW, first):
    for k in channels(model):
        for lane in range(k * LANES, (k + 1) * LANES):
            first[lane] = dW[lane]


@device
def add_first_half(model, dW, first):
    """dW = first half + second half, where dW holds the second."""
    for k in channels(model):
        for lane in range(k * LANES, (k + 1) * LANES):
            dW[lane] = first[lane] + dW[lane]


@device
def join_halves(model, dW, first, finest):
    """The sub-steps of a step from those of its halves, of which dW holds the second: half as many of each half.

    Increments over the whole step stay those of the second half; :func:`add_first_half` comes after.
    """
    for k in channels(model):
        n = finest
        while n > 1:
            for part in range(n // 2):
                source = first_lane(model, k, n // 2, part)
                early, late = first_lane(model, k, n, part), first_lane(model, k, n, n // 2 + part)
                for lane in range(LANES):
                    dW[late + lane] = dW[source + lane]
                    dW[early + lane] = first[source + lane]
            n = n // 2


@device
def turn_around(model, dW, turned, finest):
    """The increments of the path run through backwards: sub-steps in reversed order."""
    for k in channels(model):
        n = 1
        while n <= finest:
            for part in range(n):
                source, target = first_lane(model, k, n, part), first_lane(model, k, n, n - 1 - part)
                for lane in range(LANES):
                    turned[target + lane] = dW[source + lane]
            n = 2 * n


@device
def clip(model, dW, clipped, bound):
    for k in channels(model):
        for lane in range(k * LANES, (k + 1) * LANES):
            clipped[lane] = min(max(dW[lane], -bound), bound)


@device
def clip_substeps(model, dW, clipped, h, finest):
    """Clip the increments over sub-steps, each by the bound for its own length."""
    for k in channels(model):
        n = 2
        while n <= finest:
            bound = truncation_bound(h / n)
            for part in range(n):
                begin = first_lane(model, k, n, part)
                for lane in range(begin, begin + LANES):
                    clipped[lane] = min(max(dW[lane], -bound), bound)
            n = 2 * n


# Rows of increments in the loop over time.  Where no scheme needs sub-steps, which is so for nearly all, kernels
# contain nothing about them; likewise for areas.


class Kept(NamedTuple):
    """The parts of a row besides the increments over the step, a constant of compiled code."""

    substeps: NamedTuple  #: one of INDICES: the number of sub-steps into which it is resolved
    areas: NamedTuple  #: ``areas.Areas`` or ``areas.NoAreas``
    coins: NamedTuple  #: NoCoins, Coins or Uniforms


@device
def row_length(layout, model):
    """The length in floats of a row: increments of a block over a step and its sub-steps, and areas."""
    return (2 * number(layout.substeps) - 1) * noises(model) * LANES + areas_length(layout.areas, model)


def _unless_one(plain):
    """Decorator: `plain` takes the place of ``body(layout, ...)`` where there are no sub-steps, without a branch."""

    def decorate(body):
        @device(by_type=True)
        @functools.wraps(body)
        def chosen(layout, *arguments):
            return plain if number(field(layout, "substeps")) == 1 else body

        return chosen

    return decorate


def _draw_steps(layout, model, increments, noise, draw, block, h, terms, words):
    draw_channels(model, increments, noise, draw, block, np.sqrt(h), words, row_length(layout, model))
    draw_areas(layout.areas, model, increments, noise, draw, block, h, terms, words)


@_unless_one(_draw_steps)
def draw_steps(layout, model, increments, noise, draw, block, h, terms, words):
    """Draw increments of the next STEPS_PER_DRAW steps of size h and of their sub-steps, and areas of `terms` terms."""
    draw_channels(model, increments, noise, draw, block, np.sqrt(h), words, row_length(layout, model))
    draw_areas(layout.areas, model, increments, noise, draw, block, h, terms, words)
    normals = aligned(STEPS_PER_DRAW * LANES)
    draw_bridges(model, increments, noise, draw, block, np.sqrt(h), words, normals, number(layout.substeps))


def _keep(layout, model, dW, first):
    keep_first_half(model, dW, first)
    copy_areas(layout.areas, model, dW, first)


@_unless_one(_keep)
def keep(layout, model, dW, first):
    """Store a step as the first half of a larger one."""
    first[:] = dW


def _join(layout, model, dW, first):
    join_areas(layout.areas, model, dW, first)
    add_first_half(model, dW, first)


@_unless_one(_join)
def join(layout, model, dW, first):
    """Put the step of which `dW` holds the second half and `first` the first into `dW`."""
    join_areas(layout.areas, model, dW, first)
    join_halves(model, dW, first, number(layout.substeps))
    add_first_half(model, dW, first)


def _same_row(layout, model, dW, row, turned):
    return row


@_unless_one(_same_row)
def reversed_row(layout, model, dW, row, turned):
    """The number of a row with the increments of `row`, those of sub-steps in reversed order: `turned`."""
    turn_around(model, dW[row], dW[turned], number(layout.substeps))
    return turned


def _truncate(layout, model, dW, clipped, h):
    clip(model, dW, clipped, truncation_bound(h))
    copy_areas(layout.areas, model, dW, clipped)


@_unless_one(_truncate)
def truncate(layout, model, dW, clipped, h):
    """Put the clipped increments of a step of size h into `clipped`, which may be `dW`; areas stay as they are."""
    clip(model, dW, clipped, truncation_bound(h))
    copy_areas(layout.areas, model, dW, clipped)
    clip_substeps(model, dW, clipped, h, number(layout.substeps))
