"""Noise of a block of paths: the increments of Wiener processes over steps of all sizes, and coins.

They come from a stream of keyed random numbers, from arrays, or from Sobol' points.  A row of increments has those over
a whole step, and behind them, where a scheme needs sub-steps, those over its halves, quarters, ..., see
:func:`first_lane`, and last, where a scheme needs them, Lévy areas, see ``areas.py``.

This file has more than 600 lines because the three kinds of noise fill the same rows.
"""

import functools
import math
from typing import Any, NamedTuple

import numpy as np

from ..compiler.dispatch import INDICES, FieldOf, device, kernel, looped, number, only_where
from ..compiler.records import class_of, field, is_integer, is_none, is_some
from ..numerics.elementary import log
from ..numerics.rng import (
    BRIDGES,
    BROWNIAN,
    COINS,
    LANES,
    MOST_NOISES,
    PARTS,
    STEPS_PER_DRAW,
    STEPS_PER_TOSS,
    UNIFORMS,
    draw_increments,
    draw_uniforms,
    read_coins,
    toss,
)
from ..numerics.sobol import BITS, SCRAMBLES, direction_numbers, net_normals, net_words, scramble
from .areas import NeedsAreas, area_count, area_of, areas_length, channels, copy_areas, draw_areas, join_areas
from .lanes import aligned, over_lanes
from .protocol import area_pairs, noise_indices, noises
from .scheme_protocol import judges, needs_areas, substeps, tosses

# ---------------------------------------------------------------------------------------------------------------------
# Streams of keyed random numbers, and the methods that every noise has whose numbers the loop over time makes itself.
# ---------------------------------------------------------------------------------------------------------------------


def in_one_call(noise, scheme, model, times, first, blocks, end):
    """(grid, noise, first block, end of paths) of the calls of the loop that together make all steps of a grid."""
    return ((times, noise, first, end),)


def as_many_blocks(noise, model, times):
    """Number of blocks whose noise fits into memory: any number, since it is drawn step by step."""
    return 2**62


def itself(noise):
    """A noise of the same type whose numbers are quickly made, for calls that only have kernels compiled."""
    return noise


class RandomStream(NamedTuple):
    """Random numbers of a 64-bit seed and one of the streams of ``spi.numerics.rng``, both as uint64."""

    seed: np.uint64
    stream: np.uint64

    @property
    def keys(self):
        """Stream of which the random numbers of these paths are functions: itself."""
        return self

    for_a_trial, most_blocks, pieces = property(itself), as_many_blocks, in_one_call


def brownian(seed):
    """Increments of the paths of a seed."""
    return RandomStream(np.uint64(seed), np.uint64(BROWNIAN))


# ---------------------------------------------------------------------------------------------------------------------
# Rows of coins in kernels, where a scheme tosses them, and of uniform numbers, where it judges flows.  `layout` is
# Coins, Uniforms, or None: then kernels contain nothing about coins.
# ---------------------------------------------------------------------------------------------------------------------


class Coins(NamedTuple):
    """A scheme tosses coins."""


class Uniforms(NamedTuple):
    """A scheme judges flows: behind the coins stand uniform numbers, one for each noise and one for the drift."""


@device(by_type=True)
def coins_length(layout, model):
    """Length of a row of coins, in floats."""
    if class_of(layout) is Uniforms:
        return lambda layout, model: (1 + 4 * (noises(model) // 4 + 1)) * LANES
    return lambda layout, model: LANES


@device
def toss_and_read(layout, noise, n, block, bits, coins, row):
    """Put the coins of step n into a row; `bits` are tossed at the first of STEPS_PER_TOSS steps and then stay."""
    if n % STEPS_PER_TOSS == 0:
        toss(noise.seed, noise.stream + np.uint64(COINS), np.uint64(n // STEPS_PER_TOSS), block, bits)
    read_coins(bits, n, coins[row])


@device
def toss_and_draw(layout, noise, n, block, bits, coins, row):
    """Put also the uniform numbers of step n into a row."""
    toss_and_read(layout, noise, n, block, bits, coins, row)
    draw_uniforms(noise.seed, noise.stream + np.uint64(UNIFORMS), n, block, coins[row, LANES:])


@only_where(is_some)
def copy_coins(layout, coins, source, target):
    """Copy the coins of row `source` to row `target`."""
    for i in range(coins.shape[1]):
        coins[target, i] = coins[source, i]


@only_where(is_some)
def turn_coins(layout, coins, source, target):
    """Put the opposite coins of row `source` into row `target`; uniform numbers are copied."""
    for i in range(coins.shape[1]):
        coins[target, i] = -coins[source, i] if i < LANES else coins[source, i]


# ---------------------------------------------------------------------------------------------------------------------
# Rows of increments in the loop over time.  Where no scheme needs sub-steps, which is so for nearly all, kernels
# contain nothing about them; likewise for areas.
# ---------------------------------------------------------------------------------------------------------------------


class Kept(NamedTuple):
    """Parts of a row besides the increments over the step, a constant of compiled code."""

    substeps: Any  #: into which it is resolved: one of INDICES, or a number of compositions as data
    areas: Any  #: ``areas.Areas``, None without
    coins: Any  #: Coins or Uniforms, None without


@device(by_type=True)
def kept_of_steps(reference_scheme, scheme, model):
    """:class:`Kept` of the rows that serve the scheme and the one that makes the reference, if there is one."""
    schemes = [each for each in (reference_scheme, scheme) if not is_none(each)]
    areas = bool(area_pairs(model)) and any(map(needs_areas, schemes))
    coins = Coins() if areas or any(map(tosses, schemes)) else None
    coins = Uniforms() if any(map(judges, schemes)) else coins
    if any(isinstance(class_of(each).substeps, FieldOf) for each in schemes if hasattr(class_of(each), "substeps")):
        areas = NeedsAreas() if areas else None
        return lambda reference_scheme, scheme, model: Kept(most_substeps(reference_scheme, scheme), areas, coins)
    layout = Kept(INDICES[max(map(substeps, schemes))](), NeedsAreas() if areas else None, coins)
    return lambda reference_scheme, scheme, model: layout


@device(by_type=True)
def most_substeps(reference_scheme, scheme):
    """Number of sub-steps that serves both schemes, known when the kernel runs."""
    if is_none(reference_scheme):
        return lambda reference_scheme, scheme: substeps(scheme)
    return lambda reference_scheme, scheme: max(substeps(reference_scheme), substeps(scheme))


@device
def row_length(layout, model):
    """Length in floats of a row: increments of a block over a step and its sub-steps, and areas."""
    return (2 * number(layout.substeps) - 1) * noises(model) * LANES + areas_length(layout.areas, model)


def is_divided(layout):
    """Whether steps are, or may be, resolved into sub-steps."""
    finest = field(layout, "substeps")
    return is_integer(finest) or number(finest) > 1


@device
def truncation_bound(h):
    """sqrt(h) A_h with A_h = sqrt(4 |ln h|), the bound for |dW| that the implicit midpoint rule needs."""
    return np.sqrt(h) * np.sqrt(4.0 * abs(log(h)))


#: What becomes of increments: as they are; clipped; or at a temperature, where friction belongs to their variance,
#: clipped and divided by the standard deviation of a clipped one of variance 1.
UNCLIPPED, CLIPPED, RESCALED = range(3)
HALVINGS = 6  #: of a step, of which no scheme has more sub-steps than 64


def clipped_variance(h):
    """Variance that a standard normal number has left where it is clipped to [-a, a], a = A_h; 0 from h = 1 on.

    Rounded to 40 bits, so that last digits of the library's functions do not matter.
    """
    a = math.sqrt(4.0 * abs(math.log(min(h, 1.0))))
    density, beyond = math.exp(-0.5 * a * a) / math.sqrt(2.0 * math.pi), 0.5 * math.erfc(a / math.sqrt(2.0))
    return round(2.0**40 * (1.0 - 2.0 * (a * density + (1.0 - a * a) * beyond))) * 2.0**-40


@device
def node(model, j):
    """Place in a row of the increments over sub-step number j: the step itself, its halves, quarters, ..., in turn.

    Sub-step `part` of n has the number j = n - 1 + part, and the halves 2 j + 1 and 2 j + 2.
    """
    return j * noises(model) * LANES


@device
def first_lane(model, k, n, part):
    """Place in a row of the increments of noise k over sub-step `part` = 0, ..., n - 1 of n = 1, 2, 4, ..."""
    return node(model, n - 1 + part) + k * LANES


@device
def nodes(layout):
    """Number of the sub-steps of all sizes."""
    return 2 * number(layout.substeps) - 1


@device
def halvings(j):
    """By how many halvings of a step its sub-step number j comes about."""
    i = 0
    while 2 << i <= j + 1:
        i += 1
    return i


# Loops over the lanes n of the increments over a sub-step, of the noises that are on, of all, or of one.  They get
# places in a row, since a slice of it takes as long as the loop.
_over_noises = functools.partial(looped, ("for k in channels(model)", "for n in range(k * LANES, (k + 1) * LANES)"))


@looped(("for n in range(noises(model) * LANES)",), "turned[to + n] = dW[at + n]")
def move(model, dW, at, turned, to): ...
@_over_noises("dW[late + n] = dW[at + n]", "dW[early + n] = first[at + n]")
def join_nodes(model, dW, first, at, early, late): ...
@_over_noises("dW[n] = first[n] + dW[n]")
def add(model, first, dW): ...
@_over_noises("row[whole + n] = row[half + n] + row[other + n]")
def add_halves_of(model, row, whole, half, other): ...
@over_lanes("row[half + n] = 0.5 * row[whole + n] + bridge[n]", "row[other + n] = row[whole + n] - row[half + n]")
def halve(row, whole, half, other, bridge): ...
@_over_noises("clipped[at + n] = stretch * min(max(dW[at + n], -bound), bound)")
def clip(model, dW, at, bound, stretch, clipped): ...


@only_where(is_divided)
def draw_bridges(layout, model, increments, noise, draw, block, scale, words):
    """Draw increments over the halves, quarters, ..., the finest sub-steps at last, given those over whole steps.

    Lévy's construction: given the increment dW over a time t, that over its first half is dW/2 + sqrt(t)/2 Z with a
    standard normal Z.  Bridge number j + 1, of a stream of its own, halves sub-step number j.
    """
    normals, stream = aligned(STEPS_PER_DRAW * LANES), noise.stream + np.uint64(BRIDGES)
    for j in range(nodes(layout) // 2):
        deviation = 0.5 * scale / np.sqrt(1 << halvings(j))
        for k in channels(model):
            channel = np.uint64((j + 1) * MOST_NOISES + k)
            draw_increments(noise.seed, stream, channel, draw, block, deviation, words, normals, LANES)
            whole, half, other = node(model, j), node(model, 2 * j + 1), node(model, 2 * j + 2)
            for step in range(STEPS_PER_DRAW):
                halve(increments[step, k * LANES :], whole, half, other, normals[step * LANES :])


@device
def draw_steps(layout, model, increments, noise, draw, block, h, terms, words):
    """Draw increments of the next STEPS_PER_DRAW steps of size h and of their sub-steps, and areas of `terms` terms."""
    for k in channels(model):
        channel, rows = np.uint64(k), increments.ravel()[k * LANES :]
        draw_increments(noise.seed, noise.stream, channel, draw, block, np.sqrt(h), words, rows, increments.shape[1])
    draw_areas(layout.areas, model, increments, noise, draw, block, h, terms, words)
    draw_bridges(layout, model, increments, noise, draw, block, np.sqrt(h), words)


@device
def keep(layout, model, dW, first):
    """Store a step as the first half of a larger one."""
    for n in range(len(dW)):  # an assignment of slices takes half a second to compile
        first[n] = dW[n]


@device
def join(layout, model, dW, first):
    """Put the step of which `dW` holds the second half and `first` the first into `dW`."""
    join_areas(layout.areas, model, dW, first)
    join_halves(layout, model, dW, first)
    add(model, first, dW)


@only_where(is_divided)
def join_halves(layout, model, dW, first):
    """The sub-steps of a step are those of its halves, half as many of each."""
    for j in range(nodes(layout) // 2 - 1, -1, -1):
        n = 1 << halvings(j)
        join_nodes(model, dW, first, node(model, j), node(model, j + n), node(model, j + 2 * n))


@device(by_type=True)
def reversed_row(layout, model, dW, row, turned):
    """Number of a row with the increments of `row`, those of sub-steps in reversed order: `turned`."""
    return _reversed_row if is_divided(layout) else (lambda layout, model, dW, row, turned: row)


@device(inline=False)  # most steps do without, and go 5 % slower where its code stands among theirs
def _reversed_row(layout, model, dW, row, turned):
    source, target = dW[row], dW[turned]
    for j in range(nodes(layout)):
        n = 1 << halvings(j)
        move(model, source, node(model, j), target, node(model, 3 * (n - 1) - j))
    return turned


@device
def truncate(layout, model, dW, clipped, bounds, stretch):
    """Put the clipped increments of a step of size h into `clipped`, which may be `dW`; areas stay as they are.

    Those over 2^-i h are clipped to +-``bounds[HALVINGS - i]`` and then multiplied by ``stretch[HALVINGS - i]``.
    """
    for j in range(nodes(layout)):
        i = HALVINGS - halvings(j)
        clip(model, dW, node(model, j), bounds[i], stretch[i], clipped)
    copy_areas(layout.areas, model, dW, clipped)


# ---------------------------------------------------------------------------------------------------------------------
# Noise from arrays, and a stream's noise as arrays.
# ---------------------------------------------------------------------------------------------------------------------


class NoiseArrays(NamedTuple):
    """Noise of some paths as arrays; of increments over n sub-steps of each step.

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
    """A :class:`NoiseArrays` of zeros, with areas and coins where the scheme needs them."""
    pairs = len(area_pairs(model)) if needs_areas(scheme) else 0
    areas = np.zeros((steps, paths, pairs)) if pairs else np.zeros((0, 0, 0))
    coins = np.zeros((steps, paths)) if pairs or tosses(scheme) else np.zeros((0, 0))
    return NoiseArrays(np.zeros((steps * substeps(scheme), paths, noises(model))), areas, coins, 0)


@device(by_type=True)
def noise_of_steps(layout, model, rows, noise, draw, block, h, terms, words):
    """Put the noise of the next STEPS_PER_DRAW steps of size h into as many rows of increments."""
    return {NoiseArrays: copy_steps, Points: place_points}.get(class_of(noise), draw_steps)


@device(by_type=True)
def coins_of_step(layout, noise, n, block, bits, coins, row):
    """Put the coins of step n into a row; `bits`, where they are drawn, stay from one step to the next."""
    if class_of(noise) is NoiseArrays:
        return copy_coins_of
    if class_of(layout) is Coins:
        return coins_of_points if class_of(noise) is Points else toss_and_read
    return None if is_none(layout) else toss_and_draw


@device
def put_lanes(row, first, values):
    """Put the lanes of a row where they belong in `values`, of which lane 0 is path number `first`."""
    for path in range(max(first, 0), min(first + LANES, len(values))):
        values[path] = row[path - first]


@device(inline=False)
def copy_steps(layout, model, rows, noise, draw, block, h, terms, words):
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
        add_halves(layout, model, row)


@device(by_type=True)
def words_length(noise):
    """Words of scratch for noise; with points, there are also the normals of a block and what makes them."""
    if class_of(noise) is Points:
        return lambda noise: STEPS_PER_DRAW * LANES + noise.increments * (LANES + 4 * PARTS)
    return lambda noise: STEPS_PER_DRAW * LANES


@device(inline=False)
def place_points(layout, model, rows, noise, draw, block, h, terms, words):
    """Put the increments of STEPS_PER_DRAW steps of paths along points into `rows`, and keyed areas."""
    finest, count = number(layout.substeps), noise.increments // (len(noise.starts) - 1)
    room, size = words[STEPS_PER_DRAW * LANES :], noise.increments * LANES
    normals = room.view(np.float64)  # of all dimensions, LANES for each
    if draw == 0:
        net_normals(noise.directions, noise.shifts, noise.increments, np.int64(block), words, room[size:], normals)
    for drawn in range(STEPS_PER_DRAW):
        n, row = (STEPS_PER_DRAW * np.int64(draw) + drawn) * finest, rows[drawn]
        if n + 1 >= len(noise.starts):
            break
        for place, k in enumerate(channels(model)):
            for part in range(finest):
                increments_of_points(noise, n + part, place, count, normals, row[first_lane(model, k, finest, part) :])
        add_halves(layout, model, row)
    draw_areas(layout.areas, model, rows, noise, draw, block, h, terms, words)


@only_where(is_divided)
def add_halves(layout, model, row):
    """Add up the increments over larger sub-steps and over the step from those over the finest ones."""
    for j in range(nodes(layout) // 2 - 1, -1, -1):
        add_halves_of(model, row, node(model, j), node(model, 2 * j + 1), node(model, 2 * j + 2))


@device(inline=False)
def copy_coins_of(layout, noise, n, block, bits, coins, row):
    """Copy the coins of step n, where there are any."""
    if len(noise.coins) > 0:
        for lane in range(LANES):
            path = min(np.int64(block) * LANES + lane, noise.coins.shape[1] - 1)
            coins[row, lane] = noise.coins[n - noise.first, path]


@kernel
def draw_noise(scheme, model, noise, h, terms, first_step, first_path, given):
    """Fill `given`, :class:`NoiseArrays`, with the noise of steps of size h from `first_step` and `first_path` on."""
    layout = kept_of_steps(None, scheme, model)
    finest = number(layout.substeps)
    steps, paths = given.dW.shape[0] // finest, given.dW.shape[1]
    rows = aligned(STEPS_PER_DRAW * row_length(layout, model)).reshape(STEPS_PER_DRAW, -1)
    words = aligned(STEPS_PER_DRAW * LANES).view(np.uint64)
    for block in range(first_path // LANES, (first_path + paths - 1) // LANES + 1):
        first = block * LANES - first_path
        for draw in range(first_step // STEPS_PER_DRAW, (first_step + steps - 1) // STEPS_PER_DRAW + 1):
            draw_steps(layout, model, rows, noise, np.uint64(draw), np.uint64(block), h, terms, words)
            begin = draw * STEPS_PER_DRAW - first_step
            for n in range(max(begin, 0), min(begin + STEPS_PER_DRAW, steps)):
                _copy_out(model, rows[n - begin], finest, n, first, given)
    if len(given.coins) > 0:
        draw_all_coins(noise, first_step, first_path, given.coins)


@device(inline=False)
def _copy_out(model, row, finest, n, first, given):
    """Copy the increments and areas of step n of a block into arrays, of which lane 0 is path number `first`."""
    for part in range(finest):
        for k in channels(model):
            put_lanes(row[first_lane(model, k, finest, part) :], first, given.dW[n * finest + part, :, k])
    if len(given.areas) > 0:
        for p in range(area_count(model)):
            put_lanes(area_of(model, row, p), first, given.areas[n, :, p])


@kernel
def draw_paths(noise, h, first_step, first_path, dW):
    """Fill `dW` (steps, paths, noises) with the increments of a run from `first_step` and `first_path` on."""
    steps, paths, noises = dW.shape
    rows, words = aligned(STEPS_PER_DRAW * LANES), aligned(STEPS_PER_DRAW * LANES).view(np.uint64)
    for block in range(first_path // LANES, (first_path + paths - 1) // LANES + 1):
        for draw in range(first_step // STEPS_PER_DRAW, (first_step + steps - 1) // STEPS_PER_DRAW + 1):
            begin = draw * STEPS_PER_DRAW - first_step
            for k in range(noises):
                where = np.uint64(k), np.uint64(draw), np.uint64(block)
                draw_increments(noise.seed, noise.stream, *where, np.sqrt(h), words, rows, LANES)
                for n in range(max(begin, 0), min(begin + STEPS_PER_DRAW, steps)):
                    put_lanes(rows[(n - begin) * LANES :], block * LANES - first_path, dW[n, :, k])


@kernel
def draw_all_coins(noise, first_step, first_path, coins):
    """Fill `coins` (steps, paths) with the coins of a run from `first_step` and `first_path` on."""
    steps, paths = coins.shape
    bits, row = aligned(STEPS_PER_DRAW * LANES).view(np.uint64), aligned(LANES).reshape(1, LANES)
    for block in range(first_path // LANES, (first_path + paths - 1) // LANES + 1):
        for n in range(first_step // STEPS_PER_TOSS * STEPS_PER_TOSS, first_step + steps):
            toss_and_read(None, noise, n, np.uint64(block), bits, row, 0)
            if n >= first_step:
                put_lanes(row[0], block * LANES - first_path, coins[n - first_step])


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
    """Noise of paths that follow scrambled points, block by block as ``spi.numerics.sobol`` says.

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
        """Stream of the random numbers that do not come from points."""
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
    """Noise :class:`Points` of the paths of a grid of times, 2^38 at most; cached, so do not change it."""
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
def increments_of_points(noise, n, place, count, normals, increment):
    """Increment number n of the noise at `place` of `count`, for the lanes of a block."""
    first = noise.starts[n]
    set_weighted(increment, noise.weights[first], normals[(noise.columns[first] * count + place) * LANES :])
    for i in range(first + 1, noise.starts[n + 1], 2):
        here, there = (noise.columns[i] * count + place) * LANES, (noise.columns[i + 1] * count + place) * LANES
        add_weighted(increment, noise.weights[i], normals[here:], noise.weights[i + 1], normals[there:])


@over_lanes("increment[n] = weight * normals[n]")
def set_weighted(increment, weight, normals): ...
@over_lanes("increment[n] = increment[n] + weight * normals[n] + other_weight * others[n]")
def add_weighted(increment, weight, normals, other_weight, others): ...


@device(inline=False)
def coins_of_points(layout, noise, n, block, bits, coins, row):
    """Put the coins of step n into a row."""
    d = noise.increments + n
    if d >= len(noise.directions):  # no scheme tosses them, see `tosses`
        return
    net_words(noise.directions[d], noise.shifts[d], np.int64(block), bits)
    for lane in range(LANES):
        coins[row, lane] = 1.0 if (bits[lane] >> _FIRST) != _0 else -1.0
