"""Kernels that add up values of paths, and count them in bins."""

import numpy as np

from spi.compiler.dispatch import kernel
from spi.numerics.rng import LANES, PARTS


@kernel
def add_moments(values, first_block, end, sums, left, right, products, times):
    """Add values (blocks, T, F, LANES) and their squares to `sums` (2, T, F, groups), at times[0] <= t < times[1].

    And to `products` (1, T, P, groups) the products of the functions left[p] and right[p].  Lane l of block b is in
    group (b mod G/8) * 8 + l mod 8; paths from number `end` on do not count.
    """
    blocks, _, functions, _ = values.shape
    rounds = sums.shape[3] // PARTS
    for row in range(blocks):
        block = first_block + row
        group = block % rounds * PARTS
        paths = min(LANES, end - block * LANES)
        for t in range(times[0], times[1]):
            for f in range(functions):
                for part in range(PARTS):
                    total, square = sums[0, t, f, group + part], sums[1, t, f, group + part]
                    if paths == LANES:  # a loop of known length, which is unrolled
                        for first in range(0, LANES, PARTS):
                            value = values[row, t, f, first + part]
                            total += value
                            square += value * value
                    else:
                        for lane in range(part, paths, PARTS):
                            value = values[row, t, f, lane]
                            total += value
                            square += value * value
                    sums[0, t, f, group + part], sums[1, t, f, group + part] = total, square
            for p in range(len(left)):
                for lane in range(paths):
                    product = values[row, t, left[p], lane] * values[row, t, right[p], lane]
                    products[0, t, p, group + lane % PARTS] += product


@kernel
def count_values(values, first_block, end, low, inverse_width, counts, times):
    """Count values (blocks, T, F, LANES) in `counts` (T, F, 2 + bins): below all bins, in each, and above all or NaN.

    The first bin of function f at time t begins at low[t, f]; their width is 1 / inverse_width[t, f].  Values of
    further functions are not counted, and those at times[0] <= t < times[1] only.
    """
    functions, bins = counts.shape[1], counts.shape[2] - 2
    for row in range(len(values)):
        paths = min(LANES, end - (first_block + row) * LANES)
        for t in range(times[0], times[1]):
            for f in range(functions):
                begin, scale = low[t, f], inverse_width[t, f]
                for lane in range(paths):
                    place = (values[row, t, f, lane] - begin) * scale
                    if place < 0.0:
                        counts[t, f, 0] += 1
                    elif place < bins:  # false for NaN
                        counts[t, f, 1 + np.int64(place)] += 1
                    else:
                        counts[t, f, bins + 1] += 1


@kernel
def rank_values(values, first_block, end, edges, counts, times):
    """Count values (blocks, T, F, LANES) in `counts` (T, F, E + 1) by the number of `edges` (T, F, E) up to them.

    E is one less than a power of two, and edges ascend.  NaN counts as above all.  Paths from number `end` on do not
    count, nor do values but at times[0] <= t < times[1], nor those of further functions.
    """
    functions, most = counts.shape[1], edges.shape[2]
    place = np.empty(LANES, np.int64)
    for row in range(len(values)):
        paths = min(LANES, end - (first_block + row) * LANES)
        for t in range(times[0], times[1]):
            for f in range(functions):
                place[:] = 0
                step = (most + 1) // 2
                while step > 0:  # all lanes at once: nothing waits for a branch
                    for lane in range(LANES):
                        below = np.int64(not values[row, t, f, lane] < edges[t, f, place[lane] + step - 1])
                        place[lane] += step * below  # so that NaN is above all
                    step //= 2
                for lane in range(paths):
                    counts[t, f, place[lane]] += 1
