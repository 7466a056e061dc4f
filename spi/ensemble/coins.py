"""What kernels do with rows of coins, where a scheme tosses them, and of uniform numbers, where it judges flows."""

from typing import NamedTuple

import numpy as np

from ..compiler.dispatch import device, method
from ..numerics.rng import COINS, LANES, STEPS_PER_TOSS, UNIFORMS, draw_uniforms, read_coins, toss
from .protocol import noises


@method
def coins_length(kept, model):
    """How many floats a row of coins is."""


@method
def draw_coins(kept, noise, n, block, bits, coins, row):
    """The coins of step n in a row; `bits`, those of STEPS_PER_TOSS steps, are kept from step to step."""


@method
def copy_coins(kept, coins, source, target):
    """The coins of one row in another."""


@method
def turn_coins(kept, coins, source, target):
    """Those on the other side."""


@device
def toss_and_read(noise, n, block, bits, row):
    """The coins of step n in `row`; `bits` are tossed at the first of STEPS_PER_TOSS steps."""
    if n % STEPS_PER_TOSS == 0:
        toss(noise.seed, noise.stream + np.uint64(COINS), np.uint64(n // STEPS_PER_TOSS), block, bits)
    read_coins(bits, n, row)


class NoCoins(NamedTuple):
    """No scheme tosses: kernels contain nothing about coins."""

    def coins_length(kept, model):
        return LANES

    def draw_coins(kept, noise, n, block, bits, coins, row):
        pass

    def copy_coins(kept, coins, source, target):
        pass

    def turn_coins(kept, coins, source, target):
        pass


class Coins(NamedTuple):
    """A scheme tosses."""

    def coins_length(kept, model):
        return LANES

    def draw_coins(kept, noise, n, block, bits, coins, row):
        toss_and_read(noise, n, block, bits, coins[row])

    def copy_coins(kept, coins, source, target):
        for lane in range(LANES):
            coins[target, lane] = coins[source, lane]

    def turn_coins(kept, coins, source, target):
        for lane in range(LANES):
            coins[target, lane] = -coins[source, lane]


class Uniforms(NamedTuple):
    """A scheme judges flows: behind the coins stand uniform numbers, one for each noise and one for the drift."""

    def coins_length(kept, model):
        return (1 + 4 * (noises(model) // 4 + 1)) * LANES

    def draw_coins(kept, noise, n, block, bits, coins, row):
        toss_and_read(noise, n, block, bits, coins[row])
        draw_uniforms(noise.seed, noise.stream + np.uint64(UNIFORMS), n, block, coins[row, LANES:])

    def copy_coins(kept, coins, source, target):
        for i in range(coins.shape[1]):
            coins[target, i] = coins[source, i]

    def turn_coins(kept, coins, source, target):
        for i in range(coins.shape[1]):
            coins[target, i] = -coins[source, i] if i < LANES else coins[source, i]
