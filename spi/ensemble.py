"""The only loop over time and the only parallel loop: many paths, at several step sizes, in one pass.

The same Brownian path drives all step sizes: increments are drawn once, at the reference step h_ref, and an increment
over 2^s h_ref is the sum of its two halves, in this order, first half plus second half.  So every increment is defined
to the last bit by (seed, stream, path, h_ref), whatever else is computed.
"""

from typing import NamedTuple

import numpy as np
from numba import get_num_threads, prange, set_num_threads, types
from numba.extending import overload

from .dispatch import INLINED, inlined, kernel, number, parallel_kernel, unrolled
from .lanes import store
from .protocol import REPORT, advance, dimension, noise_indices, noises, observe, work_size
from .rng import LANES, STEPS_PER_DRAW, draw_increments


class Grid(NamedTuple):
    """The times of one run: step size number 0 is the reference, number l > 0 is 2^doublings[l] h_ref."""

    reference_step: float
    reference_steps: int
    doublings: np.ndarray  #: int64, strictly increasing, doublings[0] = 0
    truncate: bool  #: whether increments are clipped as :func:`truncation_bound` says, per step size
    reference_scheme: tuple | None = None  #: of step size number 0, if it is not the scheme itself


class Noise(NamedTuple):
    """Which random numbers: the 64-bit seed and one of the streams of ``spi.rng``, as uint64."""

    seed: np.uint64
    stream: np.uint64


@inlined
def truncation_bound(h):
    """sqrt(h) A_h with A_h = sqrt(4 |ln h|), the bound for |dW| that the implicit midpoint rule needs."""
    return np.sqrt(h) * np.sqrt(4.0 * abs(np.log(h)))


@unrolled(noise_indices)
def draw_channels(index, model, increments, noise, draw, block, scale, words):
    """Increments of the next STEPS_PER_DRAW steps, one row of `increments` each, for every noise that is on."""
    k = number(index)
    stride = noises(model) * LANES
    draw_increments(noise.seed, noise.stream, np.uint64(k), draw, block, scale, words, increments[k * LANES :], stride)
    return increments


@unrolled(noise_indices)
def keep_first_half(index, model, dW, first):
    k = number(index)
    for lane in range(k * LANES, (k + 1) * LANES):
        first[lane] = dW[lane]
    return dW


@unrolled(noise_indices)
def add_first_half(index, model, dW, first):
    """dW = first half + second half, where dW holds the second."""
    k = number(index)
    for lane in range(k * LANES, (k + 1) * LANES):
        dW[lane] = first[lane] + dW[lane]
    return dW


@unrolled(noise_indices)
def clip(index, model, dW, clipped, bound):
    k = number(index)
    for lane in range(k * LANES, (k + 1) * LANES):
        clipped[lane] = min(max(dW[lane], -bound), bound)
    return dW


def largest_work(reference_scheme, scheme, model):
    """Scratch for either scheme."""
    return max(work_size(s, model) for s in (reference_scheme, scheme) if s is not None)


@overload(largest_work, jit_options=INLINED)
def _(reference_scheme, scheme, model):
    if reference_scheme == types.none:
        return lambda reference_scheme, scheme, model: work_size(scheme, model)
    return lambda reference_scheme, scheme, model: max(work_size(reference_scheme, model), work_size(scheme, model))


def advance_level(reference_scheme, scheme, level, model, h, dW, y, work, report):
    """One step of the scheme, or at level 0 of the reference scheme if there is one."""
    stepper = scheme if reference_scheme is None or level > 0 else reference_scheme
    advance(stepper, model, h, dW, y, work, report)


@overload(advance_level, jit_options=INLINED)
def _(reference_scheme, scheme, level, model, h, dW, y, work, report):
    if reference_scheme == types.none:
        return lambda reference_scheme, scheme, level, model, h, dW, y, work, report: advance(
            scheme, model, h, dW, y, work, report
        )

    def either(reference_scheme, scheme, level, model, h, dW, y, work, report):
        if level == 0:
            advance(reference_scheme, model, h, dW, y, work, report)
        else:
            advance(scheme, model, h, dW, y, work, report)

    return either


@kernel
def integrate_block(scheme, model, initial, grid, noise, observer, report, block, row, paths):
    """Integrate one block of LANES paths over all steps and step sizes; see :func:`integrate`."""
    last = grid.doublings[-1]
    levels = len(grid.doublings)
    y = np.empty((levels, dimension(model) * LANES))
    for level in range(levels):
        for lane in range(LANES):
            store(y[level], lane, initial)
    level_of = np.full(last + 1, -1)
    for level in range(levels):
        level_of[grid.doublings[level]] = level
    width = noises(model) * LANES
    drawn, words = np.empty(STEPS_PER_DRAW * width), np.empty(STEPS_PER_DRAW * LANES, np.uint64)
    clipped, first_halves = np.empty(width), np.empty((last + 1, width))
    work = np.empty(largest_work(grid.reference_scheme, scheme, model))
    scale = np.sqrt(grid.reference_step)

    for n in range(grid.reference_steps):
        if n % STEPS_PER_DRAW == 0:
            draw_channels(model, drawn, noise, np.uint64(n // STEPS_PER_DRAW), np.uint64(block), scale, words)
        row_drawn = n % STEPS_PER_DRAW
        dW = drawn[row_drawn * width : (row_drawn + 1) * width]
        # dW belongs to a step of size 2^s h_ref that ends here; where that is a second half, go on with the whole
        s = 0
        while True:
            level = level_of[s]
            if level >= 0:
                h = grid.reference_step * 2.0**s
                increments = dW
                if grid.truncate:
                    clip(model, dW, clipped, truncation_bound(h))
                    increments = clipped
                advance_level(grid.reference_scheme, scheme, level, model, h, increments, y[level], work, report[level])
                observe(observer, model, row, paths, level, (n + 1) >> s, y[level], y[0])
            if s == last or (n >> s) & 1 == 0:
                break
            add_first_half(model, dW, first_halves[s])
            s += 1
        if s < last:
            keep_first_half(model, dW, first_halves[s])


@parallel_kernel
def integrate(scheme, model, initial, grid, noise, observer, report, first_block, blocks, samples):
    """Integrate the paths of `blocks` blocks, from block `first_block` on; paths from number `samples` on are idle.

    `observer` and `report` (shape blocks x step sizes x len(REPORT)) have one row per block, so that nothing depends
    on threads; to be added up outside, in the order of blocks.
    """
    records = [(scheme, model, initial, grid, noise, observer)]  # Numba's prange cannot take nested tuples, but a list
    for row in prange(blocks):
        row = np.int64(row)
        block = first_block + row
        paths = min(LANES, samples - block * LANES)
        scheme, model, initial, grid, noise, observer = records[0]
        integrate_block(scheme, model, initial, grid, noise, observer, report[row], block, row, paths)


def thread_count():
    """How many threads :func:`integrate` uses."""
    return get_num_threads()


def use_threads(threads):
    """Let :func:`integrate` use this many threads; ValueError if there are not that many."""
    set_num_threads(threads)


def empty_report(blocks, levels):
    """A report for :func:`integrate` to add to."""
    return np.zeros((blocks, levels, len(REPORT)))
