"""The only loop over time and the only parallel loop: many paths, at several step sizes, in one pass.

The same Brownian path drives all step sizes: increments are drawn once, at the reference step h_ref, and an increment
over 2^s h_ref is the sum of its two halves, in this order, first half plus second half.  So every increment is defined
to the last bit by (seed, stream, path, h_ref), whatever else is computed.  Where a scheme needs increments
over sub-steps, those of h_ref are Brownian bridges of the same path, and those of coarser steps are finer increments.
Where one needs Lévy areas, those of coarser steps are made from finer increments and areas as well.
"""

import contextlib
import time
from typing import NamedTuple

import numpy as np
from numba import get_num_threads, prange, set_num_threads, types
from numba.extending import overload

from ..compiler.dispatch import INLINED, device, kernel
from ..numerics.rng import BROWNIAN, COINS, LANES, STEPS_PER_DRAW, STEPS_PER_TOSS, read_coins, toss
from .increments import copy, draw_steps, flip, join, keep, reversed_row, row_length, truncate
from .lanes import store_lane
from .protocol import REPORT, SUMMED, dimension, observe
from .steppers import advance_path, kept_of_steps, largest_sizes, tosses_any

#: How often a study that runs in batches can report, and be interrupted.
BATCH_SECONDS = 0.5

#: The values of ``Grid.reversals``: what a path does with the order of its flows.
AS_TOSSED, COINS_TURNED, PAIRS_REVERSED = range(3)


class Grid(NamedTuple):
    """The times of one run, and its paths: number 0 is the reference, number l has the step 2^doublings[l] h_ref.

    Several may have the same step.  One with ``reversals[l]`` = COINS_TURNED tosses every coin to the other side; one
    with PAIRS_REVERSED also makes its steps in pairs, the second of a pair before the first, so that with a scheme that
    is symmetric up to its coins all flows of a pair act in reversed order.
    """

    reference_step: float
    reference_steps: int
    doublings: np.ndarray  #: int64, increasing, doublings[0] = 0
    truncate: bool  #: whether increments are clipped as ``truncation_bound`` says, per step size
    reversals: np.ndarray  #: int64: AS_TOSSED, COINS_TURNED or, below the largest step, PAIRS_REVERSED
    by_reference: np.ndarray  #: int64: whether the reference scheme makes this path, if there is one
    reference_scheme: tuple | None = None
    area_terms: int = 0  #: terms of the Fourier series of Lévy areas at the reference step, see ``areas.py``
    first_step: int = 0  #: number of the first reference step; a multiple of STEPS_PER_TOSS and of the largest step


def grid(
    step,
    steps,
    doublings=(0,),
    truncate=False,
    reversals=None,
    reference_scheme=None,
    by_reference=None,
    area_terms=0,
    first_step=0,
):
    """A :class:`Grid`, by default with one step size, and path number 0 made by the reference scheme."""
    doublings = np.array(doublings, np.int64)
    count = len(doublings)
    reversals = np.array([AS_TOSSED] * count if reversals is None else reversals, np.int64)
    by_reference = np.array([1] + [0] * (count - 1) if by_reference is None else by_reference, np.int64)
    return Grid(step, steps, doublings, truncate, reversals, by_reference, reference_scheme, area_terms, first_step)


def nested_grid(final_time, reference_step, steps, truncate, reference_scheme, area_terms=0):
    """The grid of a study of errors until `final_time`: the reference and `steps`, which go from large to small."""
    doublings = [0, *(round(np.log2(h / reference_step)) for h in reversed(steps))]
    total = round(final_time / reference_step)
    return grid(reference_step, total, doublings, truncate, reference_scheme=reference_scheme, area_terms=area_terms)


def steps_of(times):
    """(levels,) how many steps each step size of a grid takes."""
    return times.reference_steps >> times.doublings


def step_sizes_of(times):
    """(levels,) the step sizes of a grid."""
    return times.reference_step * 2.0**times.doublings


def shortest(times):
    """The grid with so few steps that each step size takes at least one."""
    return times._replace(reference_steps=1 << int(times.doublings[-1]))


class RandomStream(NamedTuple):
    """Which random numbers: the 64-bit seed and one of the streams of ``spi.numerics.rng``, as uint64."""

    seed: np.uint64
    stream: np.uint64


def brownian(seed):
    """The increments of the paths of a seed."""
    return RandomStream(np.uint64(seed), np.uint64(BROWNIAN))


def begin(model, initial, row, y):
    """Put the initial state, one for all lanes or the row of this block, into `y`."""
    if isinstance(initial, tuple) or initial.ndim == 1:
        for lane in range(LANES):
            store_lane(y, lane, initial)
    else:
        y[:] = initial[row]


@overload(begin, jit_options=INLINED)
def _(model, initial, row, y):
    if isinstance(initial, types.BaseTuple) or initial.ndim == 1:

        def one_for_all(model, initial, row, y):
            for lane in range(LANES):
                store_lane(y, lane, initial)

        return one_for_all

    def row_of_block(model, initial, row, y):
        for i in range(len(y)):
            y[i] = initial[row, i]

    return row_of_block


@device(inline=False)
def integrate_block(scheme, model, initial, grid, noise, observer, report, block, row, paths):
    """Integrate one block of LANES paths over all steps and step sizes; see :func:`integrate`."""
    last = grid.doublings[-1]
    levels = len(grid.doublings)
    scratch, memory = largest_sizes(grid.reference_scheme, scheme, model)
    y = np.zeros((levels, dimension(model) * LANES + memory))
    for level in range(levels):
        begin(model, initial, row, y[level])
    first_level = np.searchsorted(grid.doublings, np.arange(last + 2))
    kept = kept_of_steps(grid.reference_scheme, scheme, model)
    words, bits = np.empty(STEPS_PER_DRAW * LANES, np.uint64), np.empty(STEPS_PER_DRAW * LANES, np.uint64)
    # rows of increments: of the steps drawn together, first halves of steps of size 2^s h_ref, changed ones
    first, changed = STEPS_PER_DRAW, STEPS_PER_DRAW + last + 1
    dW = np.empty((changed + 1, row_length(kept, model)))
    # rows of coins: of first halves, of the step at hand, and those on the other side
    here, flipped = last + 1, last + 2
    coins = np.empty((flipped + 1, LANES))
    work = np.empty(scratch)

    for n in range(grid.first_step, grid.first_step + grid.reference_steps):
        if n % STEPS_PER_DRAW == 0:
            draw = np.uint64(n // STEPS_PER_DRAW)
            draw_steps(kept, model, dW, noise, draw, np.uint64(block), grid.reference_step, grid.area_terms, words)
        if tosses_any(grid.reference_scheme, scheme, model):
            if n % STEPS_PER_TOSS == 0:
                toss(
                    noise.seed, noise.stream + np.uint64(COINS), np.uint64(n // STEPS_PER_TOSS), np.uint64(block), bits
                )
            read_coins(bits, n, coins[here])
        drawn = n % STEPS_PER_DRAW
        # these belong to a step of size 2^s h_ref that ends here; where that is a second half, go on with the whole
        s = 0
        while True:
            second_half = (n >> s) & 1
            for level in range(first_level[s], first_level[s + 1]):
                h = grid.reference_step * 2.0**s
                reversal = grid.reversals[level]
                if reversal == PAIRS_REVERSED and not second_half:
                    continue
                for turn in range(2 if reversal == PAIRS_REVERSED else 1):
                    increments, side = (drawn, here) if turn == 0 else (first + s, s)
                    if reversal != AS_TOSSED:
                        flip(coins, side, flipped)
                        side = flipped
                        increments = reversed_row(kept, model, dW, increments, changed)
                    if grid.truncate:
                        truncate(kept, model, dW[increments], dW[changed], h)
                        increments = changed
                    advance_path(
                        grid.reference_scheme,
                        scheme,
                        grid.by_reference[level],
                        model,
                        paths,
                        h,
                        dW[increments],
                        coins[side],
                        y[level],
                        work,
                        report[level],
                    )
                observe(observer, model, row, paths, level, (n + 1) >> s, y[level], y[0])
            if s == last or not second_half:
                break
            join(kept, model, dW[drawn], dW[first + s])
            if tosses_any(grid.reference_scheme, scheme, model):
                copy(coins, s, here)  # the coin of a step is that of its first half
            s += 1
        if s < last:
            keep(kept, model, dW[drawn], dW[first + s])
            if tosses_any(grid.reference_scheme, scheme, model):
                copy(coins, here, s)


@kernel(parallel=True)
def integrate(scheme, model, initial, grid, noise, observer, report, first_block, blocks, samples):
    """Integrate the paths of `blocks` blocks, from block `first_block` on; paths from number `samples` on are idle.

    `initial` is a state, a tuple or of a large model an array, or states to go on from after `grid.first_step` steps:
    an array (blocks, dimension * LANES + memory) as :class:`FinalStates` keeps them.  `observer` and `report` (shape
    blocks x step sizes x len(REPORT)) have one row per block, so that nothing depends on threads; to be added up
    outside, in the order of blocks.
    """
    records = [(scheme, model, initial, grid, noise, observer)]  # Numba's prange cannot take nested tuples, but a list
    for row in prange(blocks):
        row = np.int64(row)
        block = first_block + row
        paths = min(LANES, samples - block * LANES)
        scheme, model, initial, grid, noise, observer = records[0]
        integrate_block(scheme, model, initial, grid, noise, observer, report[row], block, row, paths)


class FinalStates(NamedTuple):
    """An observer that keeps the last states of each block."""

    y: np.ndarray  #: (blocks, levels, dimension * LANES), or with room for the memory of a scheme
    steps: np.ndarray  #: (levels,) int64, the number of the last step of each level

    def observe(observer, model, row, paths, level, n, y, reference):
        if n == observer.steps[level]:
            for i in range(observer.y.shape[2]):
                observer.y[row, level, i] = y[i]


def in_batches(state, advance, left, most):
    """Move a state on with ``advance(state, blocks)`` until no blocks are ``left(state)``; yields it after each batch.

    A batch has at most `most` blocks and takes about BATCH_SECONDS, the first one a block per thread.
    """
    least = min(thread_count(), most)
    blocks = least
    while left(state) > 0:
        began = time.perf_counter()
        state = advance(state, min(blocks, left(state)))
        yield state
        rate = blocks / (time.perf_counter() - began)
        blocks = int(np.clip(rate * BATCH_SECONDS, least, min(most, 4 * blocks)))


def thread_count():
    """How many threads :func:`integrate` uses."""
    return get_num_threads()


def use_threads(threads):
    """Let :func:`integrate` use this many threads; ValueError if there are not that many."""
    set_num_threads(threads)


@contextlib.contextmanager
def limited_threads(most):
    """Within it :func:`integrate` uses at most so many threads."""
    before = thread_count()
    use_threads(min(before, most))
    try:
        yield
    finally:
        use_threads(before)


def empty_report(blocks, levels):
    """A report for :func:`integrate` to add to."""
    return np.zeros((blocks, levels, len(REPORT)))


def add_reports(total, reports):
    """The report `total` (levels, columns) after those of some blocks."""
    added = total + reports.sum(axis=0)
    added[:, SUMMED:] = np.maximum(total, reports.max(axis=0, initial=0.0))[:, SUMMED:]
    return added


def report_columns(report):
    """What there is in a report (..., columns), by name: of solvers if there was one, of angles if any was large."""
    solver, angle = REPORT[:-1], REPORT[-1]
    columns = {name: report[..., i] for i, name in enumerate(solver)} if report[..., 0].any() else {}
    return columns | ({angle: report[..., -1]} if report[..., -1].any() else {})
