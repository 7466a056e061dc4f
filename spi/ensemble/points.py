"""Noise from scrambled Sobol' points in place of a stream of independent numbers: randomised quasi-Monte Carlo.

The increments of a path are a linear function of as many standard normals, each of which has a dimension of its own:
the normals of all noises that are on come first, noise by noise for each place in the order of :data:`CONSTRUCTIONS`,
and after them a dimension for the coin of each step, where coins are tossed: its first bit.  Sub-steps are nothing but
shorter steps, and so have dimensions of their own.  Lévy areas, uniform numbers by which flows are judged, and random
initial states are the keyed numbers of independent paths.
"""

import functools
from typing import NamedTuple

import numpy as np

from ..compiler.dispatch import device, number
from ..numerics.arrays import Cosine, of_array
from ..numerics.rng import LANES, PARTS
from ..numerics.sobol import BITS, SCRAMBLES, direction_numbers, net_normals, net_words, scramble
from .coins import Coins
from .protocol import noise_indices
from .steppers import kept_of_steps
from .streams import RandomStream, as_many_blocks, in_one_call, itself

_BITS = 32  # of the number of a point
_FIRST, _0 = np.uint64(BITS - 1), np.uint64(0)


class Points(NamedTuple):
    """The noise of paths that follow scrambled points, block by block as ``spi.numerics.sobol`` says.

    Increment n of each noise is the sum over i from ``starts[n]`` to ``starts[n + 1] - 1`` of ``weights[i]`` times the
    normal number ``columns[i]`` of this noise; there is an odd number of them, of which the last may have the weight 0.
    """

    seed: np.uint64
    stream: np.uint64  #: of the scrambles, and of what is keyed
    directions: np.ndarray  #: (dimensions, bits of the number of a point, SCRAMBLES) uint64
    shifts: np.ndarray  #: (dimensions, SCRAMBLES) uint64
    starts: np.ndarray  #: (increments + 1,) int64
    columns: np.ndarray  #: int64
    weights: np.ndarray
    increments: int  #: how many dimensions are those of increments; behind them are those of coins

    @property
    def keys(self):
        """Of what the random numbers that are no points are functions."""
        return RandomStream(self.seed, self.stream)

    for_a_trial, most_blocks, pieces = property(itself), as_many_blocks, in_one_call


def by_steps(count):
    """Each increment has its own normal number, in the order of time: the matrix (increments, normals) is 1."""
    return np.eye(count)


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


def by_principal_components(count):
    """The normals in the order of their share in the variance of the path W(1), ..., W(n).

    The eigenvectors of the covariances min(i, j) have the components sin((2 k - 1) i pi / (2 n + 1)), and differences
    of these are increments: 2 (2 n + 1)^(-1/2) cos((2 k - 1)(2 i - 1) pi / (4 n + 2)).
    """
    odd = 2 * np.arange(count) + 1
    angles = np.multiply.outer(odd, odd) % (8 * count + 4) * (np.pi / (4 * count + 2))
    return of_array(Cosine(), angles) * (2.0 / np.sqrt(2 * count + 1))


#: How the increments of a path are made of its normals, by their names in a spec.
CONSTRUCTIONS = {"bridge": by_bridges, "principal": by_principal_components, "steps": by_steps}


def dimensions_of(scheme, reference_scheme, model, steps):
    """How many dimensions the increments of so many reference steps have, and how many with the coins."""
    kept = kept_of_steps(reference_scheme, scheme, model)
    increments = number(kept.substeps) * len(noise_indices(model)) * steps
    return increments, increments + steps * isinstance(kept.coins, Coins)


def points_of(seed, stream, scheme, model, times, construction="bridge"):
    """The noise :class:`Points` of the paths of a grid of times, 2^38 at most; shared, so do not write there."""
    kept = kept_of_steps(times.reference_scheme, scheme, model)
    finest, steps = number(kept.substeps), times.reference_steps
    dimensions = dimensions_of(scheme, times.reference_scheme, model, steps)
    return _points(seed, stream, *dimensions, finest * steps, times.reference_step / finest, construction)


@functools.lru_cache(maxsize=8)
def _points(seed, stream, increments, dimensions, steps, length, construction):
    directions = np.empty((dimensions, _BITS, SCRAMBLES), np.uint64)
    shifts = np.empty((dimensions, SCRAMBLES), np.uint64)
    scramble(np.uint64(seed), np.uint64(stream), direction_numbers(dimensions, _BITS), directions, shifts)
    matrix = CONSTRUCTIONS[construction](steps) * np.sqrt(length)
    columns = [np.flatnonzero(row) for row in matrix]
    columns = [one if len(one) % 2 else np.append(one, one[0]) for one in columns]
    weights = [row[one] for row, one in zip(matrix, columns, strict=True)]
    for one, places in zip(weights, columns, strict=True):
        one[1:][places[1:] == places[0]] = 0.0
    starts = np.cumsum([0, *map(len, columns)])
    series = starts, np.concatenate(columns), np.concatenate(weights)
    return Points(np.uint64(seed), np.uint64(stream), directions, shifts, *series, increments)


# What the loop over time does with them.


@device
def scratch_of_points(noise):
    """How many words the normals of a block take, and what making them needs."""
    return noise.increments * (LANES + 4 * PARTS)


@device
def draw_block(noise, block, words, room):
    """The normals of all dimensions of a block, LANES for each, at the beginning of `room`."""
    ends, normals = room[noise.increments * LANES :], room.view(np.float64)
    net_normals(noise.directions, noise.shifts, noise.increments, block, words, ends, normals)


@device
def increments_of_points(noise, n, which, count, normals, increment):
    """Increment number n of the noise at place `which` of `count`, for the lanes of a block."""
    first = noise.starts[n]
    set_weighted(increment, noise.weights[first], normals[(noise.columns[first] * count + which) * LANES :])
    for i in range(first + 1, noise.starts[n + 1], 2):
        one, other = (noise.columns[i] * count + which) * LANES, (noise.columns[i + 1] * count + which) * LANES
        add_weighted(increment, noise.weights[i], normals[one:], noise.weights[i + 1], normals[other:])


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
    """The coins of step n."""
    d = noise.increments + n
    net_words(noise.directions[d], noise.shifts[d], np.int64(block), words)
    for lane in range(LANES):
        coins[lane] = 1.0 if (words[lane] >> _FIRST) != _0 else -1.0
