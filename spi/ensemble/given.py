"""Noise from arrays or Sobol' points in place of a stream of keyed random numbers, and a stream's noise as arrays."""

import functools
from typing import NamedTuple

import numpy as np

from ..compiler.dispatch import device, kernel, number
from ..compiler.records import class_of
from ..numerics.rng import LANES, PARTS, STEPS_PER_DRAW, STEPS_PER_TOSS, draw_increments
from ..numerics.sobol import BITS, SCRAMBLES, direction_numbers, net_normals, net_words, scramble
from .areas import channels, draw_areas
from .increments import (
    Coins,
    RandomStream,
    as_many_blocks,
    draw_coins,
    draw_steps,
    first_lane,
    in_one_call,
    itself,
    row_length,
    toss_and_read,
)
from .lanes import aligned
from .protocol import area_pairs, noise_indices, noises
from .scheme_protocol import needs_areas, substeps, tosses
from .steppers import kept_of_steps


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
def noise_of_steps(layout, model, rows, noise, draw, block, h, terms, words):
    """Put the noise of the next STEPS_PER_DRAW steps of size h into as many rows of increments."""
    if class_of(noise) is Given:
        return lambda layout, model, rows, noise, draw, block, h, terms, words: copy_steps(
            layout, model, rows, noise, draw, block
        )
    if class_of(noise) is Points:
        return lambda layout, model, rows, noise, draw, block, h, terms, words: place_points(
            layout, model, rows, noise, draw, block, h, terms, words
        )
    return lambda layout, model, rows, noise, draw, block, h, terms, words: draw_steps(
        layout, model, rows, noise, draw, block, h, terms, words
    )


@device(by_type=True)
def coins_of_step(layout, noise, n, block, bits, coins, row):
    """Put the coins of step n into a row; `bits`, where they are drawn, stay from one step to the next."""
    if class_of(noise) is Given:
        return lambda layout, noise, n, block, bits, coins, row: copy_coins_of(noise, n, block, coins[row])
    if class_of(noise) is Points and class_of(layout) is Coins:
        return lambda layout, noise, n, block, bits, coins, row: coins_of_points(noise, n, block, bits, coins[row])
    return lambda layout, noise, n, block, bits, coins, row: draw_coins(layout, noise, n, block, bits, coins, row)


@device(inline=False)
def copy_steps(layout, model, rows, noise, draw, block):
    """Copy the increments and areas of STEPS_PER_DRAW steps; lanes without a path get those of the last one."""
    finest = number(layout.substeps)
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
    """The words of scratch for noise; with points, the normals of a block come behind the words all noises need."""
    if class_of(noise) is Points:
        return lambda noise: STEPS_PER_DRAW * LANES + scratch_of_points(noise)
    return lambda noise: STEPS_PER_DRAW * LANES


@device(inline=False)
def place_points(layout, model, rows, noise, draw, block, h, terms, words):
    """Put the increments of STEPS_PER_DRAW steps of paths along points into `rows`, and keyed areas."""
    finest, count = number(layout.substeps), noise.increments // (len(noise.starts) - 1)
    room = words[STEPS_PER_DRAW * LANES :]
    if draw == 0:
        draw_block(noise, np.int64(block), words, room)
    normals = room.view(np.float64)
    for drawn in range(STEPS_PER_DRAW):
        n, row = (STEPS_PER_DRAW * np.int64(draw) + drawn) * finest, rows[drawn]
        if n + 1 >= len(noise.starts):
            break
        for place, k in enumerate(channels(model)):
            for part in range(finest):
                increments_of_points(noise, n + part, place, count, normals, row[first_lane(model, k, finest, part) :])
        if finest > 1:
            _add_up_substeps(model, row, finest)
    draw_areas(layout.areas, model, rows, noise, draw, block, h, terms, words)


@device
def _add_up_substeps(model, row, finest):
    """Add up the increments over larger sub-steps and over the step from those over the finest ones."""
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
    """Copy the coins of step n, where there are any."""
    if len(noise.coins) > 0:
        for lane in range(LANES):
            coins[lane] = noise.coins[n - noise.first, min(np.int64(block) * LANES + lane, noise.coins.shape[1] - 1)]


@kernel
def draw_noise(scheme, model, noise, h, terms, first_step, first_path, given):
    """Fill a :class:`Given` with the noise of a run with steps of size h from `first_step` and `first_path` on."""
    layout = kept_of_steps(None, scheme, model)
    finest = number(layout.substeps)
    steps, paths = given.dW.shape[0] // finest, given.dW.shape[1]
    rows = aligned(STEPS_PER_DRAW * row_length(layout, model)).reshape(STEPS_PER_DRAW, -1)
    coins = aligned(LANES).reshape(1, LANES)
    words, bits = aligned(STEPS_PER_DRAW * LANES).view(np.uint64), aligned(STEPS_PER_DRAW * LANES).view(np.uint64)
    for block in range(first_path // LANES, (first_path + paths - 1) // LANES + 1):
        for n in range(first_step // STEPS_PER_TOSS * STEPS_PER_TOSS, first_step + steps):
            draw_coins(layout.coins, noise, n, np.uint64(block), bits, coins, 0)
            if n < first_step // STEPS_PER_DRAW * STEPS_PER_DRAW:
                continue  # only the coins come in so many at a time
            if n % STEPS_PER_DRAW == 0:
                draw = np.uint64(n // STEPS_PER_DRAW)
                draw_steps(layout, model, rows, noise, draw, np.uint64(block), h, terms, words)
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
    """Fill `coins` (steps, paths) with the coins of a run from `first_step` and `first_path` on."""
    steps, paths = coins.shape
    bits, row = aligned(STEPS_PER_DRAW * LANES).view(np.uint64), aligned(LANES)
    for block in range(first_path // LANES, (first_path + paths - 1) // LANES + 1):
        first = block * LANES - first_path
        for n in range(first_step // STEPS_PER_TOSS * STEPS_PER_TOSS, first_step + steps):
            toss_and_read(noise, n, np.uint64(block), bits, row)
            if n >= first_step:
                for path in range(max(first, 0), min(first + LANES, paths)):
                    coins[n - first_step, path] = row[path - first]


# ---------------------------------------------------------------------------------------------------------------------
# Noise from scrambled Sobol' points in place of a stream of independent numbers: randomised quasi-Monte Carlo.
#
# The increments of a path are a linear function of as many standard normals, each of which has a dimension of its own:
# the normals of all noises that are on come first, noise by noise for each place in the order of :func:`by_bridges`,
# and after them a dimension for the coin of each step, where coins are tossed: its first bit.  Sub-steps are
# nothing but shorter steps, and so have dimensions of their own.  Lévy areas, uniform numbers by which flows are
# judged, and random initial states are the keyed numbers of independent paths.
# ---------------------------------------------------------------------------------------------------------------------

_BITS = 32  # of the number of a point
_FIRST, _0 = np.uint64(BITS - 1), np.uint64(0)


class Points(NamedTuple):
    """The noise of paths that follow scrambled points, block by block as ``spi.numerics.sobol`` says.

    Increment n of each noise is the sum over i from ``starts[n]`` to ``starts[n + 1] - 1`` of ``weights[i]`` times the
    normal number ``columns[i]`` of this noise; there is an odd number of them, of which the last may have the weight 0.
    """

    seed: np.uint64
    stream: np.uint64  #: of the scrambles, and of the keyed numbers
    directions: np.ndarray  #: (dimensions, bits of the number of a point, SCRAMBLES) uint64
    shifts: np.ndarray  #: (dimensions, SCRAMBLES) uint64
    starts: np.ndarray  #: (increments + 1,) int64
    columns: np.ndarray  #: int64
    weights: np.ndarray
    increments: int  #: the number of dimensions of increments; behind them are those of coins

    @property
    def keys(self):
        """The stream of the random numbers that do not come from points."""
        return RandomStream(self.seed, self.stream)

    for_a_trial, most_blocks, pieces = property(itself), as_many_blocks, in_one_call


def by_bridges(count):
    """First W(T), then W in the middle of the interval, of its halves, and so on: a Brownian bridge, breadth first.

    Halving b - a increments into c - a and b - c adds (r/l)^(1/2) z to each of the l of the former and
    -(l/r)^(1/2) z to the r of the latter, over (l + r)^(1/2).
    """
    matrix = np.zeros((count, count))
    matrix[:, 0] = np.sqrt(1.0 / count)
    intervals, column = [(0, count)], 1
    for a, b in intervals:  # which grows
        if b - a > 1:
            c = (a + b + 1) // 2
            left, right = c - a, b - c
            matrix[a:c, column] = np.sqrt(right / (left * (b - a)))
            matrix[c:b, column] = -np.sqrt(left / (right * (b - a)))
            intervals += [(a, c), (c, b)]
            column += 1
    return matrix


def dimensions_of(scheme, reference_scheme, model, steps):
    """(dimensions of the increments of `steps` reference steps, dimensions with the coins)."""
    layout = kept_of_steps(reference_scheme, scheme, model)
    increments = number(layout.substeps) * len(noise_indices(model)) * steps
    return increments, increments + steps * isinstance(layout.coins, Coins)


def points_of(seed, stream, scheme, model, times):
    """The noise :class:`Points` of the paths of a grid of times, 2^38 at most; cached, so do not change it."""
    layout = kept_of_steps(times.reference_scheme, scheme, model)
    finest, steps = number(layout.substeps), times.reference_steps
    dimensions = dimensions_of(scheme, times.reference_scheme, model, steps)
    return _points(seed, stream, *dimensions, finest * steps, times.reference_step / finest)


@functools.lru_cache(maxsize=8)
def _points(seed, stream, increments, dimensions, steps, length):
    directions = np.empty((dimensions, _BITS, SCRAMBLES), np.uint64)
    shifts = np.empty((dimensions, SCRAMBLES), np.uint64)
    scramble(np.uint64(seed), np.uint64(stream), direction_numbers(dimensions, _BITS), directions, shifts)
    matrix = by_bridges(steps) * np.sqrt(length)
    columns = [np.flatnonzero(row) for row in matrix]
    columns = [places if len(places) % 2 else np.append(places, places[0]) for places in columns]
    weights = [row[places] for row, places in zip(matrix, columns, strict=True)]
    for weight, places in zip(weights, columns, strict=True):
        weight[1:][places[1:] == places[0]] = 0.0
    starts = np.cumsum([0, *map(len, columns)])
    series = starts, np.concatenate(columns), np.concatenate(weights)
    return Points(np.uint64(seed), np.uint64(stream), directions, shifts, *series, increments)


# Points in the loop over time.


@device
def scratch_of_points(noise):
    """The number of words that the normals of a block and the scratch for making them take."""
    return noise.increments * (LANES + 4 * PARTS)


@device
def draw_block(noise, block, words, room):
    """Put the normals of all dimensions of a block, LANES for each, at the beginning of `room`."""
    ends, normals = room[noise.increments * LANES :], room.view(np.float64)
    net_normals(noise.directions, noise.shifts, noise.increments, block, words, ends, normals)


@device
def increments_of_points(noise, n, place, count, normals, increment):
    """Increment number n of the noise at `place` of `count`, for the lanes of a block."""
    first = noise.starts[n]
    set_weighted(increment, noise.weights[first], normals[(noise.columns[first] * count + place) * LANES :])
    for i in range(first + 1, noise.starts[n + 1], 2):
        here, there = (noise.columns[i] * count + place) * LANES, (noise.columns[i + 1] * count + place) * LANES
        add_weighted(increment, noise.weights[i], normals[here:], noise.weights[i + 1], normals[there:])


@device
def set_weighted(increment, weight, normals):
    for lane in range(LANES):
        increment[lane] = weight * normals[lane]


@device
def add_weighted(increment, weight, normals, other_weight, others):
    for lane in range(LANES):
        increment[lane] = increment[lane] + weight * normals[lane] + other_weight * others[lane]


@device(inline=False)
def coins_of_points(noise, n, block, words, coins):
    """Put the coins of step n into `coins`."""
    d = noise.increments + n
    net_words(noise.directions[d], noise.shifts[d], np.int64(block), words)
    for lane in range(LANES):
        coins[lane] = 1.0 if (words[lane] >> _FIRST) != _0 else -1.0
