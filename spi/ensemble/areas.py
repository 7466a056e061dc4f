"""Lévy areas of pairs of Wiener processes over a step, which travel with the increments.

The area of W_k and W_l over a step from t to t + h is

    A_kl = 1/2 integral (W_k(s) - W_k(t)) dW_l(s) - 1/2 integral (W_l(s) - W_l(t)) dW_k(s),

and the iterated Stratonovich integral of dW_k, then dW_l, is J_kl = dW_k dW_l / 2 + A_kl.  Over two steps, first and
second, Chen's relation adds them up:

    A_kl = A_kl' + A_kl'' + (dW_k' dW_l'' - dW_l' dW_k'') / 2.

At the reference step they are 0, as for the piecewise linear path through the increments, or drawn together with the
increments, see :func:`draw_fourier_areas`.

In a row of increments the areas of ``protocol.area_pairs`` are the last floats, LANES of each pair.
"""

import functools
import itertools
import math
from typing import NamedTuple

import numpy as np

from ..compiler.dispatch import device, looped, only_where, trait
from ..compiler.records import is_none, is_some
from ..compiler.vectors import without_refcount
from ..numerics.rng import AREAS, LANES, STEPS_PER_DRAW, draw_increments
from .lanes import aligned, over_lanes
from .protocol import area_pairs, large, noise_indices, noises
from .scheme_protocol import needs_areas

# ---------------------------------------------------------------------------------------------------------------------
# The pairs of noises whose Lévy areas a model has, and the groups in which such pairs connect the noises.
# ---------------------------------------------------------------------------------------------------------------------


def area_indices(model):
    """Numbers of the pairs, from 0."""
    return tuple(range(len(area_pairs(model))))


@trait
def area_count(model):
    """Number of pairs."""
    return len(area_pairs(model))


@trait
def area_channels(model):
    """(k, l, k, l, ...) of all pairs."""
    return tuple(k for pair in area_pairs(model) for k in pair)


def _groups(model):
    """{noise: the set of noises connected with it by pairs of :func:`area_pairs`, itself among them}."""
    groups = {k: {k} for pair in area_pairs(model) for k in pair}
    for k, j in area_pairs(model):
        joined = groups[k] | groups[j]
        groups |= dict.fromkeys(joined, joined)
    return groups


def connected_noises(model):
    """Largest number of noises that are connected by pairs of :func:`area_pairs`, 0 if there are none."""
    return max(map(len, _groups(model).values()), default=0)


def all_pairs(model):
    """Whether any two connected noises are a pair themselves, as where none or all of a group commute."""
    return sum(len(group) - 1 for group in _groups(model).values()) == 2 * len(area_pairs(model))


@trait
def group_channels(model):
    """The first noise of the group of each noise, itself where it has no pair."""
    groups = _groups(model)
    return tuple(min(groups.get(k, {k})) for k in range(noises(model)))


@device(by_type=True)
def channels(model):
    """Noises that are on, for a loop."""
    if large(model):
        return lambda model: range(noises(model))
    on = noise_indices(model)
    if on == tuple(range(len(on))):  # all of them, or none: Numba has no loop over an empty tuple
        count = len(on)
        return lambda model: range(count)
    return lambda model: on


#: Drawn areas: from a series with an error of at most TOLERANCE, or Gaussian with the right covariances only.
HOW = ("exact", "gaussian")
#: In the place of a number of terms: areas that are Gaussian, given the increments.
GAUSSIAN = -1
#: The largest root mean square error of a drawn area, in units of h^(3/2).  An error of this size, independent from
#: step to step, adds 2 % to the strong error of ``munthe_kaas_areas`` for the rigid body with three noises, see
#: docs/areas.md.
TOLERANCE = 0.1
_DISTANCE = 5.7e-4  # see ``area_distance``


def area_distance(terms, connected):
    """Distance of drawn areas over a step from the true ones, in units of h, given the increments.

    In the mean square over the pairs, by the best coupling: the quadratic Wasserstein distance.  For two and three
    noises it is below 5.7e-4 m^(3/2) / n^3, by its values for n = 1 to 12 (tests/ensemble/test_area_law.py); for more,
    this is above its leading term, and taken from n = m / 8 on.  It is never above sqrt(m) / (sqrt(12) pi n), the bound
    of Mrongowius and Rößler for a series with the weights 1/r.
    """
    bound = math.sqrt(connected) / (math.sqrt(12.0) * math.pi * terms)
    return min(bound, _DISTANCE * connected**1.5 / terms**3) if terms >= connected / 8.0 else bound


def fourier_terms(model, schemes, drawn, used=None, areas="exact"):
    """Number of terms n of the areas of steps of size `drawn`, for steps of size `used`, by default the same.

    The areas over `used` are sums of used / drawn independent ones, with an error of at most TOLERANCE used^(3/2) in
    the root mean square.  0 if none of the schemes needs areas; GAUSSIAN where `areas`, one of :data:`HOW`, is
    "gaussian".  The random numbers have room for :func:`most_terms` terms, which the specs check.
    """
    used = drawn if used is None else used
    if not area_pairs(model) or not any(needs_areas(scheme) for scheme in schemes if scheme is not None):
        return 0
    if areas == "gaussian":
        return GAUSSIAN
    connected, allowed = connected_noises(model), TOLERANCE * used / math.sqrt(drawn)
    return next(n for n in itertools.count(1) if area_distance(n, connected) <= allowed)


def most_terms(model):
    """Largest n for which the channels of the coefficients, 0 to (2 n + 1) m - 1, are below those of the tails."""
    return (TAILS // max(noises(model), 1) - 1) // 2


# Areas in rows of increments, in the loop over time.  `areas` is None where no scheme needs any, or all noises commute:
# then kernels contain nothing about them.


class NeedsAreas(NamedTuple):
    """A scheme needs the areas."""


@device(by_type=True)
def areas_length(areas, model):
    """Length of the areas of a block, in floats."""
    return (lambda areas, model: 0) if is_none(areas) else (lambda areas, model: area_count(model) * LANES)


@only_where(is_some)
def draw_areas(areas, model, increments, noise, draw, block, h, terms, words):
    """Draw the areas of the next STEPS_PER_DRAW steps, of size h, one row of `increments` each; 0 without `terms`."""
    if terms != 0:
        draw_fourier_areas(model, increments, noise, draw, block, h, terms, words)
    else:
        increments[:STEPS_PER_DRAW, increments.shape[1] - area_count(model) * LANES :] = 0.0


@only_where(is_some)
def join_areas(areas, model, dW, first):
    """Put the areas of the step of which `dW` holds the second half and `first` the first into `dW`."""
    pairs = area_channels(model)
    for p in range(area_count(model)):
        i, j = pairs[2 * p] * LANES, pairs[2 * p + 1] * LANES
        add_up(area_of(model, dW, p), area_of(model, first, p), first[i:], dW[j:], first[j:], dW[i:])


@over_lanes("late[n] = early[n] + late[n] + 0.5 * (a[n] * b[n] - c[n] * d[n])")
def add_up(late, early, a, b, c, d):
    """Chen's relation."""


@only_where(is_some)
@looped(("for n in range(len(dW) - area_count(model) * LANES, len(dW))",), "copied[n] = dW[n]")
def copy_areas(areas, model, dW, copied):
    """Copy the areas of `dW` to `copied`."""


@device
def area_of(model, dW, p):
    """Lanes of pair p; an index from the end of `dW` would be tested for its sign in each lane."""
    return dW[len(dW) - (area_count(model) - p) * LANES :]


# ---------------------------------------------------------------------------------------------------------------------
# Drawing Lévy areas, given the increments: a Fourier series with a Gaussian tail.
#
# Given W = dW / sqrt(h) and independent standard normals X_kr, Y_kr, M_k, G_kl, the areas are
#
#     A_kl = h / (2 pi) (sum_{r <= n} w_r (X_kr (Y_lr - sqrt(2) W_l) - X_lr (Y_kr - sqrt(2) W_k))
#                        + sqrt(2 R) (W_k M_l - W_l M_k + G_kl)),          R = pi^2 / 6 - sum_{r <= n} w_r^2,
#
# in law if w_r = 1 / r and n tends to infinity.  The tail has the variances and covariances of the terms left out,
# given W (Wiktorsson, Annals of Applied Probability 11, 2001; Mrongowius and Rößler, Stochastic Analysis and
# Applications 40, 2022).  The weight of the last term is not 1 / n but w_n^4 = sum_{r >= n} 1 / r^4: as the cumulants
# of order j of a term are those of the first one times w_r^j, whatever W is, all moments of areas and increments up to
# the fifth order in the areas are then right.  Without terms the areas are Gaussian, with the right variances and
# covariances.
#
# The tail needs no M where noises that are connected by pairs are all pairs: its covariance is that of G along W and
# 1 + |W|^2 times that across, hence W_k M_l - W_l M_k + G_kl is as G_kl + (W_k q_l - W_l q_k) / (1 + sqrt(1 + |W|^2))
# with q_l = sum_k W_k G_kl, and W its part of the noises that are connected.
# ---------------------------------------------------------------------------------------------------------------------

TAILS = 2**15  # the channel of G of the first pair; the others, below, belong to one process each

_SIZE = STEPS_PER_DRAW * LANES


@device(inline=False)
def draw_fourier_areas(model, increments, noise, draw, block, h, terms, words):
    """Put the areas of STEPS_PER_DRAW steps into as many rows of `increments`, by the series above."""
    pairs, m, count = area_channels(model), noises(model), area_count(model)
    owned = aligned((3 * m + 2 * count) * _SIZE).reshape(-1, _SIZE)
    scratch = without_refcount(owned)  # which is in use below
    w, x, y = scratch[:m], scratch[m : 2 * m], scratch[2 * m : 3 * m]  # w is sqrt(2) dW / sqrt(h)
    area, g = scratch[3 * m : 3 * m + count], scratch[3 * m + count :]
    for k in channels(model):
        for step in range(STEPS_PER_DRAW):
            set_scaled(w[k, step * LANES :], np.sqrt(2.0 / h), increments[step, k * LANES :])
    for p in range(count):
        clear(area[p])
    squares, fourths = np.pi**2 / 6.0, np.pi**4 / 90.0  # sums of 1/s^2 and 1/s^4 over s >= r, but for the squares used
    for r in range(1, terms + 1):
        weight = 1.0 / r if r < terms else np.sqrt(np.sqrt(fourths))
        for k in channels(model):
            draw_coefficients(noise, (2 * r - 1) * m + k, draw, block, words, x[k])
            draw_coefficients(noise, 2 * r * m + k, draw, block, words, y[k])
            add_scaled_to(y[k], -1.0, w[k])
        for p in range(count):
            i, j = pairs[2 * p], pairs[2 * p + 1]
            add_turned(area[p], weight, x[i], y[j], x[j], y[i])
        squares, fourths = squares - weight * weight, fourths - 1.0 / r**4
    add_tails(model, noise, draw, block, np.sqrt(2.0 * squares), words, w, x, y, area, g)
    drawn, begin = owned[3 * m :], increments.shape[1] - count * LANES
    for p in range(count):
        for step in range(STEPS_PER_DRAW):
            of_step = drawn[p, step * LANES : (step + 1) * LANES]
            set_scaled(increments[step, begin + p * LANES :], h / (2.0 * np.pi), of_step)


@device(by_type=True)
def add_tails(model, noise, draw, block, deviation, words, w, x, y, area, g):
    """Add to each area `deviation` times a normal number with the covariances of W_k M_l - W_l M_k + G_kl, given W."""
    return _add_tails_of_groups if all_pairs(model) else _add_tails_of_pairs


def _add_tails_of_groups(model, noise, draw, block, deviation, words, w, x, y, area, g):
    """Where q_k = sum_l W_l G_lk, with G_kl = -G_lk, is x_k, and the factor of a group is y_k of its first noise k."""
    pairs, first = area_channels(model), group_channels(model)
    for k in channels(model):
        clear(x[k])
        clear(y[k])
    for k in channels(model):
        add_square(y[first[k]], w[k])
    for k in channels(model):
        if first[k] == k:
            set_factor(y[k])
    for p in range(area_count(model)):
        i, j = pairs[2 * p], pairs[2 * p + 1]
        draw_coefficients(noise, TAILS + p, draw, block, words, g[p])
        add_pair(x[i], x[j], w[i], w[j], g[p])
    for p in range(area_count(model)):
        i, j = pairs[2 * p], pairs[2 * p + 1]
        add_stretched(area[p], deviation, g[p], w[i], w[j], x[i], x[j], y[first[i]])


def _add_tails_of_pairs(model, noise, draw, block, deviation, words, w, x, y, area, g):
    pairs = area_channels(model)
    for k in channels(model):
        draw_coefficients(noise, k, draw, block, words, x[k])
    for p in range(area_count(model)):
        i, j = pairs[2 * p], pairs[2 * p + 1]
        add_turned(area[p], np.sqrt(0.5) * deviation, w[i], x[j], w[j], x[i])
        draw_coefficients(noise, TAILS + p, draw, block, words, g[p])
        add_scaled_to(area[p], deviation, g[p])


@device(inline=False)
def draw_coefficients(noise, channel, draw, block, words, normals):
    """Standard normals of one channel of the stream of the areas."""
    stream = noise.stream + np.uint64(AREAS)
    draw_increments(noise.seed, stream, np.uint64(channel), draw, block, 1.0, words, normals, LANES)


# Each is a loop over the n of the lanes of STEPS_PER_DRAW steps, or of one step.
_over_steps = functools.partial(looped, ("for n in range(_SIZE)",), inline=False)


@_over_steps("a[n] = 0.0")
def clear(a): ...
@over_lanes("b[n] = factor * a[n]", inline=False)
def set_scaled(b, factor, a): ...
@_over_steps("b[n] += factor * a[n]")
def add_scaled_to(b, factor, a): ...
@_over_steps("area[n] += factor * (a[n] * b[n] - c[n] * d[n])")
def add_turned(area, factor, a, b, c, d): ...
@_over_steps("total[n] += w[n] * w[n]")
def add_square(total, w): ...
@_over_steps("y[n] = 0.5 / (1.0 + np.sqrt(1.0 + 0.5 * y[n]))")
def set_factor(y):
    """1 / (2 (1 + sqrt(1 + |W|^2))) in the place of 2 |W|^2."""


@_over_steps("q_i[n] -= w_j[n] * g[n]", "q_j[n] += w_i[n] * g[n]")
def add_pair(q_i, q_j, w_i, w_j, g):
    """Add the terms of the pair (i, j) to q_i and q_j, times sqrt(2)."""


@_over_steps("area[n] += deviation * (g[n] + factor[n] * (w_i[n] * q_j[n] - w_j[n] * q_i[n]))")
def add_stretched(area, deviation, g, w_i, w_j, q_i, q_j, factor):
    """area += deviation (G_ij + 2 factor (W_i q_j - W_j q_i)), with w = sqrt(2) W and likewise q."""
