"""How Lévy areas are drawn, given the increments: a Fourier series with a Gaussian tail.

Given W = dW / sqrt(h) and independent standard normals X_kr, Y_kr, M_k, G_kl, the areas are

    A_kl = h / (2 pi) (sum_{r <= n} w_r (X_kr (Y_lr - sqrt(2) W_l) - X_lr (Y_kr - sqrt(2) W_k))
                       + sqrt(2 R) (W_k M_l - W_l M_k + G_kl)),          R = pi^2 / 6 - sum_{r <= n} w_r^2,

in law if w_r = 1 / r and n tends to infinity.  The tail has the variances and covariances of what is left out, given W
(Wiktorsson, Annals of Applied Probability 11, 2001; Mrongowius and Rößler, Stochastic Analysis and Applications 40,
2022).  The weight of the last term is not 1 / n but w_n^4 = sum_{r >= n} 1 / r^4: as the cumulants of order j of a term
are those of the first one times w_r^j, whatever W is, all moments of areas and increments up to the fifth order in the
areas are then right.  Without terms the areas are Gaussian, with the right variances and covariances.

The tail needs no M where noises that are connected by pairs are all pairs: its covariance is that of G along W and
1 + |W|^2 times that across, hence W_k M_l - W_l M_k + G_kl is as G_kl + (W_k q_l - W_l q_k) / (1 + sqrt(1 + |W|^2))
with q_l = sum_k W_k G_kl, and W its part of the noises that are connected.
"""

import numpy as np

from ..compiler.dispatch import device
from ..compiler.vectors import without_refcount
from ..numerics.rng import AREAS, LANES, STEPS_PER_DRAW, draw_increments
from .lanes import aligned
from .pairs import all_pairs, area_channels, area_count, channels, group_channels
from .protocol import noises

TAILS = 2**15  # the channel of G of the first pair; the others, below, belong to one process each

_SIZE = STEPS_PER_DRAW * LANES


@device(inline=False)
def draw_fourier_areas(model, increments, noise, draw, block, h, terms, words):
    """Put the areas of STEPS_PER_DRAW steps into as many rows of `increments`, as the head of this file says."""
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
            subtract(y[k], w[k])
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


@device(inline=False)
def clear(a):
    for n in range(_SIZE):
        a[n] = 0.0


@device(inline=False)
def set_scaled(b, factor, a):
    """b = factor a, for the lanes of a step."""
    for lane in range(LANES):
        b[lane] = factor * a[lane]


@device(inline=False)
def add_scaled_to(b, factor, a):
    """b += factor a."""
    for n in range(_SIZE):
        b[n] += factor * a[n]


@device(inline=False)
def subtract(y, w):
    for n in range(_SIZE):
        y[n] -= w[n]


@device(inline=False)
def add_turned(area, factor, a, b, c, d):
    """area += factor (a b - c d)."""
    for n in range(_SIZE):
        area[n] += factor * (a[n] * b[n] - c[n] * d[n])


@device(inline=False)
def add_square(total, w):
    for n in range(_SIZE):
        total[n] += w[n] * w[n]


@device(inline=False)
def set_factor(y):
    """1 / (2 (1 + sqrt(1 + |W|^2))) in the place of 2 |W|^2."""
    for n in range(_SIZE):
        y[n] = 0.5 / (1.0 + np.sqrt(1.0 + 0.5 * y[n]))


@device(inline=False)
def add_pair(q_i, q_j, w_i, w_j, g):
    """What the pair of i and j adds to q_i and q_j, times sqrt(2)."""
    for n in range(_SIZE):
        q_i[n] -= w_j[n] * g[n]
        q_j[n] += w_i[n] * g[n]


@device(inline=False)
def add_stretched(area, deviation, g, w_i, w_j, q_i, q_j, factor):
    """area += deviation (G_ij + 2 factor (W_i q_j - W_j q_i)), with w = sqrt(2) W and likewise q."""
    for n in range(_SIZE):
        area[n] += deviation * (g[n] + factor[n] * (w_i[n] * q_j[n] - w_j[n] * q_i[n]))
