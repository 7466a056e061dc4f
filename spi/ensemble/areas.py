"""Lévy areas of pairs of Wiener processes over a step, which travel with the increments.

The area of W_k and W_l over a step from t to t + h is

    A_kl = 1/2 integral (W_k(s) - W_k(t)) dW_l(s) - 1/2 integral (W_l(s) - W_l(t)) dW_k(s),

and the iterated Stratonovich integral of dW_k, then dW_l, is J_kl = dW_k dW_l / 2 + A_kl.  Over two steps, first and
second, Chen's relation adds them up:

    A_kl = A_kl' + A_kl'' + (dW_k' dW_l'' - dW_l' dW_k'') / 2.

At the reference step they are 0, which is so for the piecewise linear path through the increments, or drawn together
with the increments: Fourier series with a Gaussian tail (Wiktorsson, Annals of Applied Probability 11, 2001; Mrongowius
and Rößler, Stochastic Analysis and Applications 40, 2022).  Given W = dW / sqrt(h) and independent standard normals
X_kr, Y_kr, M_k, G_kl,

    A_kl = h / (2 pi) (sum_{r <= n} (X_kr (Y_lr - sqrt(2) W_l) - X_lr (Y_kr - sqrt(2) W_k)) / r
                       + sqrt(2 R) (W_k M_l - W_l M_k + G_kl)),          R = sum_{r > n} 1 / r^2.

The tail has the variances and covariances of what is left out, given W.  In the mean square, the best coupling of the
drawn area to the true one is no farther away than sqrt(m) h / (sqrt(12) pi n), where m is the number of noises that are
connected, by pairs that do not commute: areas of noises that are not are independent, given W.

In a row of increments the areas of ``protocol.area_pairs`` are the last floats, LANES of each pair.
"""

import math
from typing import NamedTuple

import numpy as np

from ..compiler.dispatch import device, method, number, trait, unrolled
from ..numerics.rng import AREAS, LANES, STEPS_PER_DRAW, draw_increments
from .lanes import aligned
from .protocol import area_pairs, large, noise_indices, noises
from .scheme_protocol import needs_areas

#: By which multiple of h^(3/2) a drawn area may be off in the mean square.  So much, drawn anew in each step, adds 8 %
#: to the strong error of ``splitting_areas`` for the rigid body with three noises, see docs/areas.md.
TOLERANCE = 0.5
_TAILS = 2**15  # the channel of G of the first pair; the others, below, belong to one process each

_SIZE = STEPS_PER_DRAW * LANES


def area_indices(model):
    """The numbers of the pairs, from 0."""
    return tuple(range(len(area_pairs(model))))


@trait
def area_count(model):
    """How many pairs there are."""
    return len(area_pairs(model))


@trait
def area_channels(model):
    """(k, l, k, l, ...) of all pairs."""
    return tuple(k for pair in area_pairs(model) for k in pair)


def connected_noises(model):
    """The largest number of noises that are connected by pairs of :func:`area_pairs`, 0 if there are none."""
    groups = {k: {k} for pair in area_pairs(model) for k in pair}
    for k, j in area_pairs(model):
        joined = groups[k] | groups[j]
        groups |= dict.fromkeys(joined, joined)
    return max(map(len, groups.values()), default=0)


@device(by_type=True)
def channels(model):
    """The noises that are on, for a loop."""
    if large(model):
        return lambda model: range(noises(model))
    on = noise_indices(model)
    if on == tuple(range(len(on))):  # all of them, or none: Numba has no loop over an empty tuple
        count = len(on)
        return lambda model: range(count)
    return lambda model: on


def fourier_terms(model, schemes, drawn, used=None):
    """With how many terms n the areas of steps of size `drawn` are drawn for steps of size `used`, by default the same.

    The areas over `used` are sums of used / drawn independent ones, and together they are off by no more than
    TOLERANCE used^(3/2) in the mean square.  0 if none of the schemes needs areas.  The random numbers have room for
    :func:`most_terms`, which the specs see to.
    """
    used = drawn if used is None else used
    if not area_pairs(model) or not any(needs_areas(scheme) for scheme in schemes if scheme is not None):
        return 0
    bound = math.sqrt(connected_noises(model) * drawn) / (math.sqrt(12.0) * math.pi * TOLERANCE * used)
    return max(1, math.ceil(bound - 1e-9))


def most_terms(model):
    """The largest n for which the channels of the coefficients, 0 to (2 n + 1) m - 1, are below those of the tails."""
    return (_TAILS // max(noises(model), 1) - 1) // 2


# What the loop over time does with the areas in rows of increments.


@method
def areas_length(kept, model):
    """How many floats the areas of a block are."""


@method
def draw_areas(kept, model, increments, noise, draw, block, h, terms, words):
    """Areas of the next STEPS_PER_DRAW steps, of size h, one row of `increments` each; 0 without `terms`."""


@method
def join_areas(kept, model, dW, first):
    """The areas of the step of which `dW` holds the second half and `first` the first, in `dW`."""


@method
def copy_areas(kept, model, dW, copied):
    """Those of `dW` in `copied`."""


class NoAreas(NamedTuple):
    """No scheme needs areas, or all noises commute: kernels contain nothing about them."""

    def areas_length(kept, model):
        return 0

    def draw_areas(kept, model, increments, noise, draw, block, h, terms, words):
        pass

    def join_areas(kept, model, dW, first):
        pass

    def copy_areas(kept, model, dW, copied):
        pass


class Areas(NamedTuple):
    """A scheme needs the areas."""

    def areas_length(kept, model):
        return area_count(model) * LANES

    def draw_areas(kept, model, increments, noise, draw, block, h, terms, words):
        begin = increments.shape[1] - area_count(model) * LANES
        increments[:STEPS_PER_DRAW, begin:] = 0.0
        if terms > 0:
            add_fourier_areas(model, increments, noise, draw, block, h, terms, words)

    def join_areas(kept, model, dW, first):
        join_area(model, dW, first)

    def copy_areas(kept, model, dW, copied):
        copy_area(model, dW, copied)


@unrolled(area_indices)
def join_area(index, model, dW, first):
    p = number(index)
    i, j = area_channels(model)[2 * p] * LANES, area_channels(model)[2 * p + 1] * LANES
    place = len(dW) - (area_count(model) - p) * LANES
    for lane in range(LANES):
        turned = first[i + lane] * dW[j + lane] - first[j + lane] * dW[i + lane]
        dW[place + lane] = first[place + lane] + dW[place + lane] + 0.5 * turned
    return dW


@unrolled(area_indices)
def copy_area(index, model, dW, copied):
    place = len(dW) - (area_count(model) - number(index)) * LANES
    for lane in range(LANES):
        copied[place + lane] = dW[place + lane]
    return dW


@device(inline=False)
def add_fourier_areas(model, increments, noise, draw, block, h, terms, words):
    """Add to the areas of STEPS_PER_DRAW steps what the head of this file says."""
    pairs, m = area_channels(model), noises(model)
    x, y = aligned(m * _SIZE).reshape(m, _SIZE), aligned(m * _SIZE).reshape(m, _SIZE)
    w = aligned(m * _SIZE).reshape(m, _SIZE)  # sqrt(2) dW / sqrt(h)
    area, g = aligned(area_count(model) * _SIZE).reshape(-1, _SIZE), aligned(_SIZE)
    area[:] = 0.0
    for k in channels(model):
        for step in range(STEPS_PER_DRAW):
            for lane in range(LANES):
                w[k, step * LANES + lane] = np.sqrt(2.0 / h) * increments[step, k * LANES + lane]
    rest = np.pi * np.pi / 6.0
    for r in range(1, terms + 1):
        for k in channels(model):
            draw_coefficients(noise, (2 * r - 1) * m + k, draw, block, words, x[k])
            draw_coefficients(noise, 2 * r * m + k, draw, block, words, y[k])
            subtract(y[k], w[k])
        for p in range(area_count(model)):
            i, j = pairs[2 * p], pairs[2 * p + 1]
            add_turned(area[p], 1.0 / r, x[i], y[j], x[j], y[i])
        rest -= 1.0 / (r * r)
    for k in channels(model):
        draw_coefficients(noise, k, draw, block, words, x[k])
    for p in range(area_count(model)):
        i, j = pairs[2 * p], pairs[2 * p + 1]
        add_turned(area[p], np.sqrt(rest), w[i], x[j], w[j], x[i])
        draw_coefficients(noise, _TAILS + p, draw, block, words, g)
        place = increments.shape[1] - (area_count(model) - p) * LANES
        for step in range(STEPS_PER_DRAW):
            for lane in range(LANES):
                total = area[p, step * LANES + lane] + np.sqrt(2.0 * rest) * g[step * LANES + lane]
                increments[step, place + lane] += h / (2.0 * np.pi) * total


@device(inline=False)
def draw_coefficients(noise, channel, draw, block, words, normals):
    """Standard normals of one channel of the stream of the areas."""
    stream = noise.stream + np.uint64(AREAS)
    draw_increments(noise.seed, stream, np.uint64(channel), draw, block, 1.0, words, normals, LANES)


@device(inline=False)
def subtract(y, w):
    for i in range(_SIZE):
        y[i] -= w[i]


@device(inline=False)
def add_turned(area, factor, a, b, c, d):
    """area += factor (a b - c d)."""
    for i in range(_SIZE):
        area[i] += factor * (a[i] * b[i] - c[i] * d[i])
