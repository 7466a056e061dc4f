"""Multilevel differences: E phi(y_h) - E phi(y_{h/2}) level by level (Giles, Operations Research 56, 2008), added up.

Level j compares the steps 2^(j+1) h_ref and 2^j h_ref on common paths, with random numbers of its own; the last level
is E phi at the largest step.  The error at step h is the sum of the differences of all levels below it.

A scheme that tosses a coin for the order of its flows is symmetric up to this coin, and each path gets a **reversed
twin**: within each coarse step the twin of the fine path makes all its flows in reversed order (the two increments
exchanged, the coins turned), the twin of the coarse path turns its coin.  All four are paths of the scheme; in the
difference of the two means the commutators, hence the Lévy areas, cancel to leading order, and the variance of a level
falls from O(h) to O(h^2).

An asymptotic-preserving scheme has a **control**: its limit, the splitting scheme, on the same paths.  Where its
expectations are known without sampling, Y - beta (Y_0 - E Y_0) is averaged in place of Y, with the beta of least
variance.
"""

import time
from typing import NamedTuple

import numpy as np

from ...ensemble import Grid, Noise, add_reports, grid, in_batches
from ...estimators import GROUPS, jackknife_stderr
from ...protocol import REPORT, noise_indices, tosses
from ...rng import LANES, LEVELS
from ...schemes import scheme_row, typical_ns
from ...schemes.asymptotic import AsymptoticPreserving
from ...schemes.splitting import Splitting
from . import exact
from .levels import errors, moments
from .levels import results as results  # the study asks this module for them
from .sums import (
    ROUND,
    add_powers,
    compile_kernels,
    expected_order,
    values_of_blocks,
)

PILOT = 2 * ROUND  #: blocks of each level before the first allocation
SHARES = (1 / 16, 1 / 4, 1.0, 1.0)  #: of the budget, or of 1/target^2, that the allocations have in view
_BASE_SHARE = 0.05  # of all work, for the largest step alone, which no difference needs
_POWERS = 4
_BATCH_BYTES = 64e6


class Level(NamedTuple):
    """The paths of one sample of a level, a row of weights for each quantity that is averaged."""

    grid: Grid
    noise: Noise
    weights: np.ndarray  #: (2 or 3, paths): coarse - fine, fine, and coarse - fine of the control; the last level
    # has phi (with twin), phi (without) and phi of the control
    steps: int  #: of all paths of a sample


class Plan(NamedTuple):
    """A case turned into what the ensemble needs."""

    scheme: NamedTuple
    model: NamedTuple
    initial: tuple
    functions: tuple
    levels: tuple  #: of Level
    seconds_per_block: np.ndarray  #: (levels,) of one thread at typical speed
    standard_error: float  #: the target, or 0
    seconds: float  #: the budget, or inf
    reference_step: float
    steps: np.ndarray  #: (S,) step sizes from large to small
    reference_order: float | None
    control: exact.Plan | None  #: what gives the expectations of the control, at the steps of all levels


class State(NamedTuple):
    """What is known so far; enough to go on from."""

    seconds: float  #: wall clock
    allocations: int  #: how many have been made
    blocks: np.ndarray  #: (levels,) done
    targets: np.ndarray  #: (levels,) of the current allocation
    sums: np.ndarray  #: (levels, powers, quantities * F, GROUPS); with control: Y, fine, Y_0, Y Y_0
    known: np.ndarray  #: (levels, F) expectations of the control, NaN until they are
    control_bound: float  #: the largest estimate of their numerical error
    nonfinite: np.ndarray  #: (levels,)
    reports: np.ndarray  #: (levels, columns)
    cpu_seconds: np.ndarray  #: (levels,)
    history: np.ndarray  #: (allocations, 2, F, S) error and standard error when the allocation was fulfilled
    history_cpu_seconds: np.ndarray  #: (allocations,)


def plan(case, scheme, eps=None):
    """The plan for one scheme of a case."""
    row = scheme_row(scheme, eps)
    count = round(np.log2(max(case.steps) / case.reference_step))
    control = _control(case, row.record, count)
    setup = _Setup(case, tosses(row.record), row.record._replace(eps=0.0) if control else None)
    levels = tuple(_level(setup, j) for j in range(count)) + (_base(setup, count),)
    ns = typical_ns(scheme, case.model)
    return Plan(
        row.record,
        case.model,
        case.initial,
        case.expressions,
        levels,
        np.array([1e-9 * ns * level.steps * LANES for level in levels]),
        case.standard_error or 0.0,
        case.seconds or np.inf,
        case.reference_step,
        np.array(case.steps),
        expected_order(case, row),
        control,
    )


def _control(case, record, count):
    """The plan for the limit's expectations, if the scheme has a limit of which they are known."""
    known = getattr(type(case.model), "surface", None) and not case.truncate_noise
    if not (known and isinstance(record, AsymptoticPreserving)):
        return None
    steps = case.reference_step * 2.0 ** np.arange(count, -1, -1)
    return exact.plan_of(case, Splitting(record.stages), steps)


class _Setup(NamedTuple):
    """What all levels share."""

    case: NamedTuple
    twins: bool
    limit: tuple | None  #: the scheme that is the control


def _level(setup, j):
    case = setup.case
    fine = case.reference_step * 2.0**j
    steps = round(case.final_time / fine)
    if setup.twins:
        shape = {"doublings": [0, 0, 1, 1], "reversals": [0, 2, 0, 1]}
        weights = [[-0.5, -0.5, 0.5, 0.5], [0.5, 0.5, 0.0, 0.0]]
    elif setup.limit:
        shape = {"doublings": [0, 0, 1, 1], "by_reference": [0, 1, 0, 1]}
        weights = [[-1.0, 0.0, 1.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 1.0]]
    else:
        shape, weights = {"doublings": [0, 1]}, [[-1.0, 1.0], [1.0, 0.0]]
    return _sampled(setup, j, fine, steps, shape, weights)


def _base(setup, j):
    step = setup.case.reference_step * 2.0**j
    steps = round(setup.case.final_time / step)
    if setup.twins:
        shape, weights = {"doublings": [0, 0], "reversals": [0, 1]}, [[0.5, 0.5], [1.0, 0.0]]
    elif setup.limit:
        shape = {"doublings": [0, 0], "by_reference": [0, 1]}
        weights = [[1.0, 0.0], [1.0, 0.0], [0.0, 1.0]]
    else:
        shape, weights = {"doublings": [0]}, [[1.0], [1.0]]
    return _sampled(setup, j, step, steps, shape, weights)


def _sampled(setup, j, step, steps, shape, weights):
    times = grid(step, steps, truncate=setup.case.truncate_noise, reference_scheme=setup.limit, **shape)
    return Level(times, _noise(setup.case, j), np.array(weights), int((steps >> times.doublings).sum()))


def _noise(case, j):
    return Noise(np.uint64(case.seed), np.uint64(LEVELS + 2 * j))


def cost(case, scheme, eps=None):
    """Steps of paths, seconds of one thread at typical speed (NaN if there is no budget), and bytes of memory."""
    p = plan(case, scheme, eps)
    steps = np.array([level.steps * LANES for level in p.levels])
    seconds = PILOT * p.seconds_per_block.sum() + p.seconds if p.seconds < np.inf else np.nan
    return seconds * steps.sum() / p.seconds_per_block.sum(), seconds, int(_BATCH_BYTES)


def start(p):
    """The state before the pilot."""
    levels, functions, allocations = len(p.levels), len(p.functions), len(SHARES)
    quantities = 4 if p.control else 2
    return State(
        *(0.0, 0, np.zeros(levels, np.int64), np.full(levels, PILOT)),
        np.zeros((levels, _POWERS, quantities * functions, GROUPS)),
        *(np.full((levels, functions), np.nan if p.control else 0.0), 0.0),
        np.zeros(levels, np.int64),
        np.zeros((levels, len(REPORT))),
        np.zeros(levels),
        np.zeros((allocations, 2, functions, len(p.steps))),
        np.zeros(allocations),
    )


def advance_state(p, state, j, blocks):
    """The state after the next `blocks` blocks of level j; the same bits however they are divided into calls."""
    began, cpu_began = time.perf_counter(), time.process_time()
    level, first = p.levels[j], int(state.blocks[j])
    values, reports = values_of_blocks(p, level.grid, level.noise, first, blocks, (first + blocks) * LANES)
    lost = ~np.isfinite(values).all(axis=(1, 2))
    with np.errstate(invalid="ignore", over="ignore"):
        quantities = sum(w[:, np.newaxis, np.newaxis] * values[:, i, np.newaxis] for i, w in enumerate(level.weights.T))
    if p.control:
        product = quantities[:, :1] * quantities[:, 2:]
        quantities = np.concatenate([quantities, product], axis=1)
    sums, report = state.sums.copy(), state.reports.copy()
    add_powers(quantities.reshape(blocks, -1, LANES), first, (first + blocks) * LANES, sums[j])
    report[j] = add_reports(report[j : j + 1], reports.reshape(-1, 1, reports.shape[-1]))[0]
    one = np.arange(len(p.levels)) == j
    return state._replace(
        seconds=state.seconds + time.perf_counter() - began,
        blocks=state.blocks + blocks * one,
        sums=sums,
        nonfinite=state.nonfinite + lost.sum() * one,
        reports=report,
        cpu_seconds=state.cpu_seconds + (time.process_time() - cpu_began) * one,
    )


def batches(p, state):
    """Fulfil all allocations; yields the state after each batch of about half a second."""
    compile_kernels(p, p.levels[0].grid, p.levels[0].noise)
    if np.isnan(state.known).any():
        state = _with_known(p, state)
        yield state
    while True:
        for j in range(len(p.levels)):
            for state in _level_batches(p, state, j):  # noqa: B020, the state moves on
                yield state
        if state.allocations > 0:
            state = _note_history(p, state)
            yield state
        if state.allocations == len(SHARES):
            return
        targets = np.maximum(state.blocks, allocation(p, state, SHARES[state.allocations]))
        state = state._replace(targets=targets, allocations=state.allocations + 1)
        yield state


def _level_batches(p, state, j):
    bytes_per_block = 8 * LANES * len(p.levels[j].grid.doublings) * (len(p.initial) + 4 * len(p.functions))
    most = max(1, int(_BATCH_BYTES / bytes_per_block))
    return in_batches(
        state,
        lambda state, blocks: advance_state(p, state, j, blocks),
        lambda state: int(state.targets[j] - state.blocks[j]),
        most,
    )


def _with_known(p, state):
    """The state with the expectations of the control, from the finest level to the last."""
    began, cpu_began = time.perf_counter(), time.process_time()
    *_, found = exact.batches(p.control, exact.start(p.control))
    known = np.concatenate([(found.error[:, :-1] - found.error[:, 1:]).T[::-1], found.value[:, :1].T])
    cpu = state.cpu_seconds.copy()
    cpu[-1] += time.process_time() - cpu_began
    seconds = state.seconds + time.perf_counter() - began
    return state._replace(seconds=seconds, cpu_seconds=cpu, known=known, control_bound=float(found.error_bound.max()))


def allocation(p, state, share):
    """Blocks of each level, a multiple of ROUND: N_l proportional to (V_l / C_l)^(1/2), least work for the variance.

    As many as `share` of the budget allows, or `share` of what the target asks for, if that is less.  V_l is the
    largest over the test functions; a level whose values are not finite gets no more.
    """
    with np.errstate(invalid="ignore"):
        variance = np.nan_to_num(moments(p, state)[1].max(axis=1), nan=0.0, posinf=0.0)
    cost = p.seconds_per_block / LANES
    root = np.sqrt(variance * cost)[:-1]
    samples = np.zeros(len(p.levels))
    if root.sum() > 0 and noise_indices(p.model):  # without noise one path is all, whatever rounding says
        work = share * min(
            p.seconds * (1.0 - _BASE_SHARE), root.sum() ** 2 / p.standard_error**2 if p.standard_error else np.inf
        )
        samples[:-1] = work / root.sum() * np.sqrt(variance[:-1] / cost[:-1])
        samples[-1] = work * _BASE_SHARE / cost[-1]
    return np.ceil(samples / (ROUND * LANES)).astype(np.int64) * ROUND


def _note_history(p, state):
    error, without, counts = errors(p, state)
    history, seconds = state.history.copy(), state.history_cpu_seconds.copy()
    history[state.allocations - 1] = error, jackknife_stderr(error, without, counts)
    seconds[state.allocations - 1] = state.cpu_seconds.sum()
    return state._replace(history=history, history_cpu_seconds=seconds)


def progress(p, state):
    """Work done and work allocated, in seconds of typical speed, and the standard error at the largest step."""
    done, total = (float(blocks @ p.seconds_per_block) for blocks in (state.blocks, state.targets))
    if state.blocks.min() < ROUND:
        return done, total, float("nan")
    error, without, counts = errors(p, state)
    return done, total, float(jackknife_stderr(error, without, counts)[0, 0])
