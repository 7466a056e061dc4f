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

from ...ensemble import Grid, Noise, grid, thread_count
from ...estimators import GROUPS, PARTS, fit_order, group_counts, jackknife_stderr
from ...protocol import REPORT, noise_indices, tosses
from ...rng import LANES, LEVELS
from ...schemes import scheme_row, typical_ns
from ...schemes.asymptotic import AsymptoticPreserving
from ...schemes.splitting import Splitting
from . import exact
from .sums import (
    ROUND,
    add_powers,
    add_reports,
    compile_kernels,
    error_variables,
    expected_order,
    extension,
    means,
    order_variables,
    values_of_blocks,
)

PILOT = 2 * ROUND  #: blocks of each level before the first allocation
SHARES = (1 / 16, 1 / 4, 1.0, 1.0)  #: of the budget, or of 1/target^2, that the allocations have in view
_BASE_SHARE = 0.05  # of all work, for the largest step alone, which no difference needs
_POWERS = 4
_BATCH_SECONDS = 0.5
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
        for j, level in enumerate(p.levels):
            bytes_per_block = 8 * LANES * len(level.grid.doublings) * (len(p.initial) + 4 * len(p.functions))
            most = max(1, int(_BATCH_BYTES / bytes_per_block))
            blocks = min(thread_count(), most)
            while state.blocks[j] < state.targets[j]:
                began = time.perf_counter()
                state = advance_state(p, state, j, min(blocks, int(state.targets[j] - state.blocks[j])))
                yield state
                rate = blocks / (time.perf_counter() - began)
                blocks = int(np.clip(rate * _BATCH_SECONDS, min(thread_count(), most), min(most, 4 * blocks)))
        if state.allocations > 0:
            state = _note_history(p, state)
            yield state
        if state.allocations == len(SHARES):
            return
        targets = np.maximum(state.blocks, allocation(p, state, SHARES[state.allocations]))
        state = state._replace(targets=targets, allocations=state.allocations + 1)
        yield state


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


def _counts(blocks):
    return group_counts(int(blocks) * LANES)


def _estimates(p, state):
    """Mean (levels, F) of the difference, or the value, of each level, and leave-one-out values (groups, levels, F)."""
    functions, control = len(p.functions), slice(2 * len(p.functions), 3 * len(p.functions))
    beta, mean, without = _beta(p, state), [], []
    for j, (sums, blocks) in enumerate(zip(state.sums, state.blocks, strict=True)):
        found, left_out = means(sums[0, :functions], _counts(blocks))
        if p.control:
            of_control, control_left_out = means(sums[0, control], _counts(blocks))
            found = found - beta[j] * (of_control - state.known[j])
            left_out = left_out - beta[j] * (control_left_out - state.known[j])
        mean.append(found)
        without.append(left_out)
    return np.array(mean), np.stack(without, axis=1)


def _powers(p, state):
    """Means of the powers of each quantity, (quantities, powers, levels, F)."""
    totals = state.sums.sum(axis=-1) / (state.blocks * LANES).reshape(-1, 1, 1)
    return np.moveaxis(totals.reshape(*totals.shape[:2], -1, len(p.functions)), 2, 0).swapaxes(1, 2)


def _beta(p, state):
    """cov(Y, Y_0) / var(Y_0), (levels, F); 0 without control."""
    if not p.control:
        return np.zeros((len(p.levels), len(p.functions)))
    y, _, y0, product = _powers(p, state)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.nan_to_num((product[0] - y[0] * y0[0]) / (y0[1] - y0[0] ** 2))


def errors(p, state):
    """Errors (F, S), their leave-one-out values (groups, F, S), in which each level lacks a group, and counts.

    All groups of a level are equally large, so the levels' counts are as good as equal.
    """
    mean, without = (x[..., :-1, :] for x in _estimates(p, state))
    below = np.array([round(np.log2(h / p.reference_step)) for h in p.steps]) - 1  # the last level of each error
    factor = extension(p.steps, p.reference_step, p.reference_order)
    error = np.cumsum(mean, axis=0)[below].T * factor
    without = np.moveaxis(np.cumsum(without, axis=1)[:, below], 1, 2) * factor
    return error, without, np.full(GROUPS, PARTS)


def moments(p, state):
    """Mean and variance of what is averaged, and kurtosis of the difference (value) itself, (3, levels, F)."""
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        y, *others = _powers(p, state)
        m1, m2, m3, m4 = y
        variance = np.maximum(m2 - m1 * m1, 0.0)
        kurtosis = (m4 - 4 * m1 * m3 + 6 * m1**2 * m2 - 3 * m1**4) / variance**2
        if p.control:
            _, y0, product = others
            variance = np.maximum(variance - _beta(p, state) * (product[0] - m1 * y0[0]), 0.0)
        return np.array([_estimates(p, state)[0], variance, kurtosis])


def consistency(p, state):
    """Giles' check |a - b - d| / (3 (sd a + sd b + sd d)), above 1 with probability 0.3 %, (levels - 1, F).

    d is the mean difference of a level, b the mean at its fine step, a that at its coarse step from the level above.
    """
    n = (state.blocks * LANES).reshape(-1, 1)
    mean, variance = moments(p, state)[:2]
    with np.errstate(invalid="ignore", divide="ignore"):
        fine, square = _powers(p, state)[1][:2]
        sd, sd_fine = np.sqrt(variance / n), np.sqrt(np.maximum(square - fine**2, 0.0) / n)
        off = fine[1:] - fine[:-1] - mean[:-1]
        return np.abs(off) / (3.0 * (sd_fine[1:] + sd_fine[:-1] + sd[:-1]))


def _variance_rate(p, state, f):
    """beta in V_l = O(h^beta), with its interval."""
    functions, beta = len(p.functions), _beta(p, state)[:, f]
    values, leave_out = [], []
    for j, (sums, blocks) in enumerate(zip(state.sums[:-1], state.blocks[:-1], strict=True)):
        m, without = means(sums[:2, f::functions], _counts(blocks))
        values.append(_variance(m, beta[j]))
        leave_out.append(_variance(np.moveaxis(without, 0, -1), beta[j]))
    value, without = np.array(values), np.array(leave_out).T
    h = p.reference_step * 2.0 ** np.arange(1, len(p.levels))
    return fit_order(h, value, without, np.full(GROUPS, PARTS), value > 0)


def _variance(m, beta):
    """The variance of Y - beta Y_0 from means of powers (2, quantities, ...)."""
    variance = m[1, 0] - m[0, 0] ** 2
    if m.shape[1] == 2:
        return variance
    covariance = m[0, 3] - m[0, 0] * m[0, 2]
    return variance - 2 * beta * covariance + beta**2 * (m[1, 2] - m[0, 2] ** 2)


def results(p, state):
    """Coordinates, variables and attributes of the results."""
    error, without, counts = errors(p, state)
    mean, level_without = (x[..., :-1, :] for x in _estimates(p, state))
    moment = moments(p, state)
    coarse = p.reference_step * 2.0 ** np.arange(1, len(p.levels))
    level_stderr = np.sqrt(moment[1] / (state.blocks * LANES).reshape(-1, 1))
    base, base_stderr = moment[0][-1], level_stderr[-1]
    alone = _powers(p, state)[1][:2, -1]
    of_levels = ("function", "level")
    largest = error[:, :1] / extension(p.steps[:1], p.reference_step, p.reference_order)
    differences = error / extension(p.steps, p.reference_step, p.reference_order)
    above = [(coarse > h) & (coarse <= p.steps[0]) for h in p.steps]  # levels between the largest step and this one
    spread = np.array([np.sqrt(base_stderr**2 + (level_stderr[:-1][used] ** 2).sum(axis=0)) for used in above]).T
    rates = [
        fit_order(coarse, np.abs(mean[:, f]), np.abs(level_without[:, :, f]), counts, _clear(mean, level_stderr, f))
        for f in range(len(p.functions))
    ]
    per_sample = state.cpu_seconds / (state.blocks * LANES)
    variables = error_variables(p.steps, error, without, counts) | {
        "expectation": (("function", "h"), base[:, np.newaxis] - largest + differences),
        "expectation_stderr": (("function", "h"), spread),
        "reference": (("function",), base - largest[:, 0]),
        "sd": (("function",), np.sqrt(np.maximum(alone[1] - alone[0] ** 2, 0.0))),
        "level_mean": (of_levels, mean.T),
        "level_variance": (of_levels, moment[1][:-1].T),
        "level_kurtosis": (of_levels, moment[2][:-1].T),
        "level_consistency": (of_levels, consistency(p, state).T),
        "level_samples": (("level",), state.blocks[:-1] * LANES),
        "level_nonfinite": (("level",), state.nonfinite[:-1]),
        "level_seconds": (("level",), per_sample[:-1]),
        "history_error": (("allocation", "function", "h"), state.history[:, 0]),
        "history_error_stderr": (("allocation", "function", "h"), state.history[:, 1]),
        "history_cpu_seconds": (("allocation",), state.history_cpu_seconds),
        **order_variables(rates, "level_mean_rate"),
        **order_variables([_variance_rate(p, state, f) for f in range(len(p.functions))], "level_variance_rate"),
    }
    coordinates = {"h": p.steps, "level": coarse, "allocation": np.arange(1, len(SHARES) + 1)}
    attributes = {
        "samples": int(state.blocks.sum()) * LANES,
        "cpu_seconds": float(state.cpu_seconds.sum()),
        "wall_seconds": state.seconds,
        "ns_per_step": 1e9 * float(state.cpu_seconds.sum() / _steps(p, state)),
        "twins": bool(tosses(p.scheme)),
        "control": "the limit without sampling" if p.control else "",
        "control_bound": state.control_bound,
        "level_cost_rate": _cost_rate(coarse, per_sample[:-1]),
    }
    return coordinates, variables, attributes


def _clear(mean, stderr, f):
    """Levels whose mean difference stands clear of its standard error."""
    return np.abs(mean[:, f]) > 4.0 * stderr[:-1, f]


def _cost_rate(h, seconds):
    """gamma in C_l = O(h^-gamma)."""
    return float(-np.polyfit(np.log(h), np.log(seconds), 1)[0]) if len(h) > 1 else float("nan")


def _steps(p, state):
    return sum(level.steps * int(n) * LANES for level, n in zip(p.levels, state.blocks, strict=True))
