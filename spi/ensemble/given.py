"""Noise that is given in place of a stream of keyed random numbers, and arrays of what a stream has."""

from typing import NamedTuple

import numpy as np

from ..compiler.dispatch import device, kernel, number
from ..compiler.records import class_of
from ..numerics.rng import LANES, STEPS_PER_DRAW, STEPS_PER_TOSS, draw_increments
from .areas import draw_areas
from .coins import Coins, draw_coins, toss_and_read
from .increments import draw_steps, first_lane, row_length
from .lanes import aligned
from .pairs import channels
from .points import Points, coins_of_points, draw_block, increments_of_points, scratch_of_points
from .protocol import area_pairs, noises
from .scheme_protocol import needs_areas, substeps, tosses
from .steppers import kept_of_steps
from .streams import in_one_call


class Given(NamedTuple):
    """The noise of some paths as arrays; of increments over n sub-steps of each step.

    Where a scheme needs no areas or coins their arrays have no steps.
    """

    dW: np.ndarray  #: (n * steps, paths, noises)
    areas: np.ndarray  #: (steps, paths, pairs): Lévy areas of ``protocol.area_pairs``
    coins: np.ndarray  #: (steps, paths) of 1.0 or -1.0
    first: int = 0  #: the number of the first of these steps

    def pieces(self, *arguments):
        """All steps at once."""
        return in_one_call(self, *arguments)


def empty_noise(scheme, model, steps, paths):
    """A :class:`Given` of zeros, with areas and coins where the scheme needs them."""
    pairs = len(area_pairs(model)) if needs_areas(scheme) else 0
    areas = np.zeros((steps, paths, pairs)) if pairs else np.zeros((0, 0, 0))
    coins = np.zeros((steps, paths)) if pairs or tosses(scheme) else np.zeros((0, 0))
    return Given(np.zeros((steps * substeps(scheme), paths, noises(model))), areas, coins, 0)


@device(by_type=True)
def noise_of_steps(kept, model, rows, noise, draw, block, h, terms, words):
    """Put the noise of the next STEPS_PER_DRAW steps of size h into as many rows of increments."""
    if class_of(noise) is Given:
        return lambda kept, model, rows, noise, draw, block, h, terms, words: copy_steps(
            kept, model, rows, noise, draw, block
        )
    if class_of(noise) is Points:
        return lambda kept, model, rows, noise, draw, block, h, terms, words: place_points(
            kept, model, rows, noise, draw, block, h, terms, words
        )
    return lambda kept, model, rows, noise, draw, block, h, terms, words: draw_steps(
        kept, model, rows, noise, draw, block, h, terms, words
    )


@device(by_type=True)
def coins_of_step(kept, noise, n, block, bits, coins, row):
    """Put the coins of step n into a row; `bits`, where they are drawn, are kept from step to step."""
    if class_of(noise) is Given:
        return lambda kept, noise, n, block, bits, coins, row: copy_coins_of(noise, n, block, coins[row])
    if class_of(noise) is Points and class_of(kept) is Coins:
        return lambda kept, noise, n, block, bits, coins, row: coins_of_points(noise, n, block, bits, coins[row])
    return lambda kept, noise, n, block, bits, coins, row: draw_coins(kept, noise, n, block, bits, coins, row)


@device(inline=False)
def copy_steps(kept, model, rows, noise, draw, block):
    """The increments and areas of STEPS_PER_DRAW steps; lanes without a path get those of the last one."""
    finest = number(kept.substeps)
    paths, steps = noise.dW.shape[1], noise.dW.shape[0] // finest
    for drawn in range(STEPS_PER_DRAW):
        n, row = STEPS_PER_DRAW * np.int64(draw) + drawn - noise.first, rows[drawn]
        if n >= steps:
            break
        for lane in range(LANES):
            path = min(np.int64(block) * LANES + lane, paths - 1)
            for k in channels(model):
                for part in range(finest):
                    row[first_lane(model, k, finest, part) + lane] = noise.dW[n * finest + part, path, k]
            if len(noise.areas) > 0:
                for p in range(noise.areas.shape[2]):
                    row[len(row) - (noise.areas.shape[2] - p) * LANES + lane] = noise.areas[n, path, p]
        if finest > 1:
            _add_up_substeps(model, row, finest)


@device(by_type=True)
def words_length(noise):
    """How many words of scratch noise needs; those of points keep the normals of a block behind what all need."""
    if class_of(noise) is Points:
        return lambda noise: STEPS_PER_DRAW * LANES + scratch_of_points(noise)
    return lambda noise: STEPS_PER_DRAW * LANES


@device(inline=False)
def place_points(kept, model, rows, noise, draw, block, h, terms, words):
    """The increments of STEPS_PER_DRAW steps of paths along points, and keyed areas."""
    finest, count = number(kept.substeps), noise.increments // (len(noise.starts) - 1)
    room = words[STEPS_PER_DRAW * LANES :]
    if draw == 0:
        draw_block(noise, np.int64(block), words, room)
    normals = room.view(np.float64)
    for drawn in range(STEPS_PER_DRAW):
        n, row = (STEPS_PER_DRAW * np.int64(draw) + drawn) * finest, rows[drawn]
        if n + 1 >= len(noise.starts):
            break
        for which, k in enumerate(channels(model)):
            for part in range(finest):
                increments_of_points(noise, n + part, which, count, normals, row[first_lane(model, k, finest, part) :])
        if finest > 1:
            _add_up_substeps(model, row, finest)
    draw_areas(kept.areas, model, rows, noise, draw, block, h, terms, words)


@device
def _add_up_substeps(model, row, finest):
    """The increments over larger sub-steps and over the step from those over the finest ones."""
    size = finest // 2
    while size > 0:
        for part in range(size):
            for k in channels(model):
                whole, half = first_lane(model, k, size, part), first_lane(model, k, 2 * size, 2 * part)
                other = first_lane(model, k, 2 * size, 2 * part + 1)
                for lane in range(LANES):
                    row[whole + lane] = row[half + lane] + row[other + lane]
        size = size // 2


@device(inline=False)
def copy_coins_of(noise, n, block, coins):
    """The coins of step n, where there are any."""
    if len(noise.coins) > 0:
        for lane in range(LANES):
            coins[lane] = noise.coins[n - noise.first, min(np.int64(block) * LANES + lane, noise.coins.shape[1] - 1)]


@kernel
def draw_noise(scheme, model, noise, h, terms, first_step, first_path, given):
    """Fill a :class:`Given` with what a run with steps of size h draws from `first_step` and `first_path` on."""
    kept = kept_of_steps(None, scheme, model)
    finest = number(kept.substeps)
    steps, paths = given.dW.shape[0] // finest, given.dW.shape[1]
    rows = aligned(STEPS_PER_DRAW * row_length(kept, model)).reshape(STEPS_PER_DRAW, -1)
    coins = aligned(LANES).reshape(1, LANES)
    words, bits = aligned(STEPS_PER_DRAW * LANES).view(np.uint64), aligned(STEPS_PER_DRAW * LANES).view(np.uint64)
    for block in range(first_path // LANES, (first_path + paths - 1) // LANES + 1):
        for n in range(first_step // STEPS_PER_TOSS * STEPS_PER_TOSS, first_step + steps):
            draw_coins(kept.coins, noise, n, np.uint64(block), bits, coins, 0)
            if n < first_step // STEPS_PER_DRAW * STEPS_PER_DRAW:
                continue  # only the coins come in so many at a time
            if n % STEPS_PER_DRAW == 0:
                draw = np.uint64(n // STEPS_PER_DRAW)
                draw_steps(kept, model, rows, noise, draw, np.uint64(block), h, terms, words)
            if n >= first_step:
                first = block * LANES - first_path
                _copy_out(model, rows[n % STEPS_PER_DRAW], coins[0], finest, n - first_step, first, given)


@device(inline=False)
def _copy_out(model, row, coins, finest, n, first, given):
    """Copy the noise of a step of a block, whose first path is number `first` of the arrays, into these."""
    for path in range(max(first, 0), min(first + LANES, given.dW.shape[1])):
        lane = path - first
        for k in channels(model):
            for part in range(finest):
                given.dW[n * finest + part, path, k] = row[first_lane(model, k, finest, part) + lane]
        if len(given.areas) > 0:
            pairs = given.areas.shape[2]
            for p in range(pairs):
                given.areas[n, path, p] = row[len(row) - (pairs - p) * LANES + lane]
        if len(given.coins) > 0:
            given.coins[n, path] = coins[lane]


@kernel
def draw_paths(noise, h, first_step, first_path, dW):
    """Fill `dW` (steps, paths, noises) with the increments of a run from `first_step` and `first_path` on."""
    steps, paths, noises = dW.shape
    rows, words = aligned(STEPS_PER_DRAW * LANES), aligned(STEPS_PER_DRAW * LANES).view(np.uint64)
    for block in range(first_path // LANES, (first_path + paths - 1) // LANES + 1):
        first = block * LANES - first_path
        for draw in range(first_step // STEPS_PER_DRAW, (first_step + steps - 1) // STEPS_PER_DRAW + 1):
            begin = draw * STEPS_PER_DRAW - first_step
            for k in range(noises):
                where = np.uint64(k), np.uint64(draw), np.uint64(block)
                draw_increments(noise.seed, noise.stream, *where, np.sqrt(h), words, rows, LANES)
                for n in range(max(begin, 0), min(begin + STEPS_PER_DRAW, steps)):
                    for path in range(max(first, 0), min(first + LANES, paths)):
                        dW[n, path, k] = rows[(n - begin) * LANES + path - first]


@kernel
def draw_all_coins(noise, first_step, first_path, coins):
    """Fill `coins` (steps, paths) with those of a run from `first_step` and `first_path` on."""
    steps, paths = coins.shape
    bits, row = aligned(STEPS_PER_DRAW * LANES).view(np.uint64), aligned(LANES)
    for block in range(first_path // LANES, (first_path + paths - 1) // LANES + 1):
        first = block * LANES - first_path
        for n in range(first_step // STEPS_PER_TOSS * STEPS_PER_TOSS, first_step + steps):
            toss_and_read(noise, n, np.uint64(block), bits, row)
            if n >= first_step:
                for path in range(max(first, 0), min(first + LANES, paths)):
                    coins[n - first_step, path] = row[path - first]
