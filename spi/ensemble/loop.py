"""The only loop over time and the only parallel loop: many paths, at several step sizes, in one pass.

The same Brownian path drives all step sizes: increments are drawn once, at the reference step h_ref, and an increment
over 2^s h_ref is the sum of its two halves, in this order, first half plus second half.  So every increment is defined
to the last bit by (seed, stream, path, h_ref), whatever else is computed.  Where a scheme needs increments
over sub-steps, those of h_ref are Brownian bridges of the same path, and those of coarser steps are finer increments.
Where one needs Lévy areas, those of coarser steps are made from finer increments and areas as well.
"""

import contextlib
from typing import NamedTuple

import numpy as np
from numba import get_num_threads, prange, set_num_threads

from ..compiler.dispatch import device, kernel
from ..compiler.pointers import in_memory
from ..compiler.records import is_none
from ..compiler.vectors import without_refcount
from ..numerics.rng import LANES, STEPS_PER_DRAW
from .increments import (
    HALVINGS,
    RESCALED,
    NoiseArrays,
    brownian,
    clipped_variance,
    coins_length,
    coins_of_step,
    copy_coins,
    join,
    keep,
    kept_of_steps,
    noise_of_steps,
    reversed_row,
    row_length,
    truncate,
    truncation_bound,
    turn_coins,
    words_length,
)
from .lanes import aligned
from .observer import beginning_at, last_states_only, observe
from .protocol import frozen, large
from .random_states import RandomState, block_states
from .scheme_protocol import (
    REPORT,
    ROW,
    SUMMED,
    advance,
    advance_large,
    memory_size,
    of_arrays,
    substeps,
    use_lanes,
    work_size,
)

#: Wall-clock seconds of a batch, after each of which a study can report and be interrupted.
BATCH_SECONDS = 0.5

#: The values of ``Grid.reversals``: the order in which a path takes its flows.
AS_TOSSED, COINS_TURNED, PAIRS_REVERSED = range(3)


class TimeGrid(NamedTuple):
    """Times of one run, and its paths from large steps to small ones: number l has the step 2^doublings[l] h_ref.

    The last path is the reference, with which others are compared.  Several may have the same step.  One with
    ``reversals[l]`` = COINS_TURNED tosses every coin to the other side; one with PAIRS_REVERSED also makes its steps in
    pairs, the second of a pair before the first, so that with a scheme that is symmetric up to its coins all flows of
    a pair act in reversed order.
    """

    reference_step: float
    reference_steps: int
    doublings: np.ndarray  #: int64, from large to small, the last is 0
    truncate: bool  #: whether increments are clipped as ``truncation_bound`` says, per step size
    bounds: np.ndarray  #: to which they are, over 2^(i - HALVINGS) h_ref, i = 0, 1, ...; 0 where they are not
    stretch: np.ndarray  #: factors of clipped increments, likewise
    coarser: np.ndarray  #: int64: how many paths have at least s doublings, s = 0, ..., most + 1
    reversals: np.ndarray  #: int64: AS_TOSSED, COINS_TURNED or, below the largest step, PAIRS_REVERSED
    by_reference: np.ndarray  #: int64: whether the reference scheme makes this path, if there is one
    reference_scheme: tuple | None = None
    area_terms: int = 0  #: terms of the Fourier series of Lévy areas at the reference step, see ``areas.py``
    first_step: int = 0  #: number of the first reference step; a multiple of STEPS_PER_TOSS and of the largest step
    start: float = 0.0  #: the time of reference step 0, for a model that depends on time
    first_lane: int = 0  #: of the lanes that reports count; that of the path where only one is asked for


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
    """A :class:`TimeGrid`, by default with one step size, and the last path made by the reference scheme.

    `truncate` is UNCLIPPED, CLIPPED or RESCALED, or whether increments are clipped.

    ValueError if `doublings` do not go from large to small until 0.
    """
    doublings = np.array(doublings, np.int64)
    if doublings[-1] or (np.diff(doublings) > 0).any():
        raise ValueError(f"doublings are {doublings.tolist()}; they must go from large to small until 0")
    count = len(doublings)
    reversals = np.array([AS_TOSSED] * count if reversals is None else reversals, np.int64)
    by_reference = np.array([0] * (count - 1) + [1] if by_reference is None else by_reference, np.int64)
    lengths = step * 2.0 ** np.arange(-HALVINGS, doublings[0] + 1)
    left = [clipped_variance(h) if truncate == RESCALED else 1.0 for h in lengths]
    stretch = 1.0 / np.sqrt(left)
    # not in the loop over steps, which would take a logarithm in every step, also where nothing is clipped
    bounds = np.array([truncation_bound(h) if truncate else 0.0 for h in lengths])
    coarser = (doublings >= np.arange(doublings[0] + 2)[:, np.newaxis]).sum(axis=1)
    return TimeGrid(
        step,
        steps,
        doublings,
        bool(truncate),
        bounds,
        stretch,
        coarser,
        reversals,
        by_reference,
        reference_scheme,
        area_terms,
        first_step,
    )


def nested_grid(final_time, reference_step, steps, truncate, reference_scheme, area_terms=0):
    """Grid of a study of errors until `final_time`: `steps`, which go from large to small, and the reference."""
    doublings = [*(round(np.log2(h / reference_step)) for h in steps), 0]
    total = round(final_time / reference_step)
    return grid(reference_step, total, doublings, truncate, reference_scheme=reference_scheme, area_terms=area_terms)


# ---------------------------------------------------------------------------------------------------------------------
# One step by the scheme of a study, or by the scheme that makes its reference, if there is one.
# ---------------------------------------------------------------------------------------------------------------------


@device(by_type=True)
def largest_sizes(reference_scheme, scheme, model):
    """Scratch and memory for either scheme."""
    if is_none(reference_scheme):
        return lambda reference_scheme, scheme, model: (work_size(scheme, model), memory_size(scheme, model))
    return lambda reference_scheme, scheme, model: (
        max(work_size(reference_scheme, model), work_size(scheme, model)),
        max(memory_size(reference_scheme, model), memory_size(scheme, model)),
    )


@device(by_type=True)
def advance_path(reference_scheme, scheme, by_reference, model, h, dW, coins, y, work, report):
    """One step, of at least the lanes in use, by the scheme, or by the reference scheme if there is one."""
    step = advance_large if large(model) else advance
    if is_none(reference_scheme):
        return lambda reference_scheme, scheme, by_reference, model, h, dW, coins, y, work, report: step(
            scheme, model, h, dW, coins, y, work, report
        )

    def either(reference_scheme, scheme, by_reference, model, h, dW, coins, y, work, report):
        if by_reference:
            step(reference_scheme, model, h, dW, coins, y, work, report)
        else:
            step(scheme, model, h, dW, coins, y, work, report)

    return either


# ---------------------------------------------------------------------------------------------------------------------
# The loop.
# ---------------------------------------------------------------------------------------------------------------------


def states_at(initial, scheme, model, times, blocks, noise=None, first=0):
    """States of all lanes of some blocks at y_0, as :func:`integrate` takes them."""
    y = block_states(initial, noise, first, blocks)
    states = np.zeros((blocks, len(times.doublings), y.shape[1] + _memory(times.reference_scheme, scheme, model)))
    states[..., : y.shape[1]] = y[:, np.newaxis]
    return states


def _memory(reference_scheme, scheme, model):
    """Memory of either scheme, in Python: :func:`largest_sizes` would be compiled for this alone."""
    return max(memory_size(each, model) for each in (reference_scheme, scheme) if each is not None)


def paths_of(states, d):
    """(levels, d, paths): the states (blocks, levels, d * LANES or more) of :func:`integrate`, path by path."""
    blocks, levels, _ = states.shape
    return states[..., : d * LANES].reshape(blocks, levels, d, LANES).transpose(1, 2, 0, 3).reshape(levels, d, -1)


@device(inline=False)
def integrate_block(scheme, model, states, grid, noise, observer, report, block, row, paths):
    """Integrate one block of LANES paths over all steps and step sizes; see :func:`integrate`."""
    scheme, model, grid, observer, report = without_refcount((scheme, model, grid, observer, report))
    last, coarser, reference = grid.doublings[0], grid.coarser, len(grid.doublings) - 1
    layout = kept_of_steps(grid.reference_scheme, scheme, model)
    # rows of increments: of the steps drawn together, first halves of steps of size 2^s h_ref, changed ones
    first, changed = STEPS_PER_DRAW, STEPS_PER_DRAW + last + 1
    # rows of coins: of first halves, of the step at hand, and those on the other side
    here, flipped = last + 1, last + 2
    owned = (
        aligned(states.size).reshape(states.shape),  # because another block's row may share a line of the cache
        aligned((changed + 1) * row_length(layout, model)).reshape(changed + 1, -1),
        aligned((flipped + 1) * coins_length(layout.coins, model)).reshape(flipped + 1, -1),
        aligned(largest_sizes(grid.reference_scheme, scheme, model)[0]),
        aligned(words_length(noise)).view(np.uint64),
        aligned(STEPS_PER_DRAW * LANES).view(np.uint64),
        aligned(len(report) * ROW).reshape(-1, ROW),
    )
    copy_rows(states, owned[0], states.shape[1])
    copy_rows(report, owned[6], report.shape[1])
    y, dW, coins, work, words, bits, reports = without_refcount(owned)  # which is in use until the last lines
    for level in range(len(reports)):
        use_lanes(reports[level], grid.first_lane, paths)

    for n in range(grid.first_step, grid.first_step + grid.reference_steps):
        if n % STEPS_PER_DRAW == 0:
            draw = np.uint64(n // STEPS_PER_DRAW)
            noise_of_steps(
                layout, model, dW, noise, draw, np.uint64(block), grid.reference_step, grid.area_terms, words
            )
        coins_of_step(layout.coins, noise, n, np.uint64(block), bits, coins, here)
        drawn = n % STEPS_PER_DRAW
        # these belong to a step of size 2^s h_ref that ends here; where that is a second half, go on with the whole
        s, h = 0, grid.reference_step
        while True:
            second_half = (n >> s) & 1
            for level in range(coarser[s] - 1, coarser[s + 1] - 1, -1):  # of the smallest steps the reference first
                reversal = grid.reversals[level]
                if reversal == PAIRS_REVERSED and not second_half:
                    continue
                for turn in range(2 if reversal == PAIRS_REVERSED else 1):
                    increments, side = (drawn, here) if turn == 0 else (first + s, s)
                    begin = grid.start + (n + 1 - steps_before(reversal, turn) * (1 << s)) * grid.reference_step
                    if reversal != AS_TOSSED:
                        turn_coins(layout.coins, coins, side, flipped)
                        side = flipped
                        increments = reversed_row(layout, model, dW, increments, changed)
                    if grid.truncate:
                        truncate(layout, model, dW[increments], dW[changed], grid.bounds[s:], grid.stretch[s:])
                        increments = changed
                    advance_path(
                        grid.reference_scheme,
                        scheme,
                        grid.by_reference[level],
                        frozen(model, begin, h),
                        h,
                        dW[increments],
                        coins[side],
                        y[level],
                        work,
                        reports[level],
                    )
                observe(observer, model, row, paths, level, (n + 1) >> s, y[level], y[reference])
            if s == last or not second_half:
                break
            join(layout, model, dW[drawn], dW[first + s])
            copy_coins(layout.coins, coins, s, here)  # the coin of a step is that of its first half
            s, h = s + 1, 2.0 * h
        if s < last:
            keep(layout, model, dW[drawn], dW[first + s])
            copy_coins(layout.coins, coins, here, s)
    copy_rows(owned[0], states, states.shape[1])
    copy_rows(owned[6], report, report.shape[1])


@device
def steps_before(reversal, turn):
    """Steps from the beginning of a step to the end of those at hand: of a pair, first 2 and then 1."""
    return 2 - turn if reversal == PAIRS_REVERSED else 1


@device
def copy_rows(source, target, columns):
    for level in range(source.shape[0]):
        for i in range(columns):
            target[level, i] = source[level, i]


@kernel(parallel=True)
def integrate(scheme, model, states, grid, noise, observer, report, first_block, samples):
    """Move the states of some blocks of paths on, from block `first_block` on; paths from number `samples` on are idle.

    `states` (blocks, step sizes, dimension * LANES + memory) are those at the beginning, :func:`states_at` y_0 or after
    `grid.first_step` steps, and then those at the end.  They, `observer` (an :class:`~spi.ensemble.observer.Observer`)
    and `report` (blocks, step sizes, len(REPORT)) have a row per block, so that nothing depends on threads; they are
    added up outside, in the order of blocks.
    """
    records = [
        (scheme, in_memory(model), grid, noise, observer)
    ]  # Numba's prange cannot take nested tuples, but a list
    for row in prange(len(states)):
        row = np.int64(row)
        block = first_block + row
        paths = min(LANES, samples - block * LANES)
        scheme, model, grid, noise, observer = records[0]
        integrate_block(scheme, model, states[row], grid, noise, observer, report[row], block, row, paths)


def arguments_of(*run):
    """Arguments of :func:`integrate` for some blocks from y_0 on, or from such states as it left.

    `run` is scheme, model, initial, times, noise, first block, blocks, end of paths, and perhaps an observer.  With a
    noise that is given as arrays they are those of the first of several calls.
    """
    return next(_calls(*run))


def for_kernels(scheme, model, states, times):
    """The first arguments of :func:`integrate`: with the records of schemes that serve states that are arrays."""
    if not large(model):
        return scheme, model, states, times
    reference = None if times.reference_scheme is None else of_arrays(times.reference_scheme, model)
    return of_arrays(scheme, model), model, states, times._replace(reference_scheme=reference)


def _calls(scheme, model, initial, times, noise, first, blocks, end, observer=None):
    """Yield the arguments of one call of :func:`integrate` after the other, on the same states and the same report."""
    given = not isinstance(initial, RandomState) and np.ndim(initial) > 1
    states = np.array(initial, float) if given else states_at(initial, scheme, model, times, blocks, noise, first)
    observer = last_states_only(times) if observer is None else beginning_at(observer, model, initial, states)
    report = empty_report(blocks, len(times.doublings))
    for piece, given, begin, last in noise.pieces(scheme, model, times, first, blocks, end):
        yield *for_kernels(scheme, model, states, piece), given, observer, report, begin, last


def integrated(*run):
    """(last states, report) of :func:`integrate` for the arguments of :func:`arguments_of`."""
    for arguments in _calls(*run):
        integrate(*arguments)
    return arguments[2], arguments[6]


def one_step(scheme, model, h, states, first=0, start=0.0):
    """Each of some states (n, d) after one step of size h, with the noise of paths of seed 0 from block `first` on.

    The step begins at the time `start`, for a model that depends on time.
    """
    blocks = -(-len(states) // LANES)
    padded = np.resize(states, (blocks * LANES, states.shape[1]))
    y = padded.reshape(blocks, LANES, -1).transpose(0, 2, 1).reshape(blocks, -1)
    times = grid(h, 1)._replace(start=float(start))
    begun = np.zeros((blocks, 1, y.shape[1] + memory_size(scheme, model)))
    begun[:, 0, : y.shape[1]] = y
    ends, _ = integrated(scheme, model, begun, times, brownian(0), first, blocks, first * LANES + len(padded))
    return paths_of(ends, states.shape[1])[0].T[: len(states)]


def thread_count():
    """Number of threads that :func:`integrate` uses; OSError if Numba has no library to start them."""
    try:
        return get_num_threads()
    except ValueError as error:
        why = " ".join(str(error).split())
        raise OSError(f"Numba cannot start threads ({why}); unset NUMBA_THREADING_LAYER") from error


def use_threads(threads):
    """Let :func:`integrate` use this many threads; ValueError if there are not that many."""
    set_num_threads(threads)


@contextlib.contextmanager
def limited_threads(most):
    """Within the block :func:`integrate` uses at most `most` threads."""
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
    """Report `total` (levels, columns) after those of some blocks."""
    added = total + reports.sum(axis=0)
    added[:, SUMMED:] = np.maximum(total, reports.max(axis=0, initial=0.0))[:, SUMMED:]
    return added


# ---------------------------------------------------------------------------------------------------------------------
# Steps of many paths from compiled code: a function that a user's own program, compiled by Numba, can call.
# ---------------------------------------------------------------------------------------------------------------------


@kernel
def move(records, y, dW, areas, coins):
    """Move states `y` (paths, d) on in place, along the noise of a :class:`~.increments.Given`, on one thread.

    `records` = (scheme, model, grid, observer), the grid being that of one step.
    """
    scheme, told, grid, observer = records
    model = in_memory(told)
    paths, d = y.shape
    steps = len(dW) // substeps(scheme)
    times = TimeGrid(grid.reference_step, steps, *grid[2:])
    states, report = aligned(d * LANES).reshape(1, -1), np.zeros((1, len(REPORT)))
    noise = NoiseArrays(dW, areas, coins, 0)
    for block in range(-(-paths // LANES)):
        first = block * LANES
        for lane in range(LANES):
            for i in range(d):
                states[0, i * LANES + lane] = y[min(first + lane, paths - 1), i]
        integrate_block(scheme, model, states, times, noise, observer, report, block, 0, min(LANES, paths - first))
        for lane in range(min(LANES, paths - first)):
            for i in range(d):
                y[first + lane, i] = states[0, i * LANES + lane]
