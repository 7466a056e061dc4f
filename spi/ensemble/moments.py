"""Values along many paths: Hamiltonians, sums over jackknife groups, counts in bins."""

import numpy as np

from ..compiler.dispatch import kernel
from ..numerics.rng import LANES, PARTS
from .lanes import load_lane
from .protocol import hamiltonian


@kernel
def energies(model, states, energy):
    """H of the states (blocks, times, d * LANES) of blocks, in `energy` (blocks, times, LANES)."""
    for row in range(states.shape[0]):
        for t in range(states.shape[1]):
            for lane in range(LANES):
                energy[row, t, lane] = hamiltonian(model, load_lane(model, states[row, t], lane))


@kernel
def add_moments(values, first_block, end, sums, one, other, products, times):
    """Add values (blocks, T, F, LANES) and their squares to `sums` (2, T, F, groups), at times[0] <= t < times[1].

    And to `products` (1, T, P, groups) the products of the functions one[p] and other[p].  Lane l of block b is in
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
            for p in range(len(one)):
                for lane in range(paths):
                    product = values[row, t, one[p], lane] * values[row, t, other[p], lane]
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
