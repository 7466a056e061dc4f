"""Plain Monte Carlo, as in the paper: E phi(y_h) - E phi(y_ref) on common Brownian paths.

Any number of paths; only sums over groups of them are kept.  Results for the first so many paths come from the same
run.
"""

import time
from functools import partial
from typing import NamedTuple

import numpy as np

from ...ensemble import Grid, Noise, add_reports, brownian, in_batches, nested_grid
from ...estimators import GROUPS, group_counts, jackknife_stderr
from ...protocol import REPORT
from ...rng import LANES
from ...schemes import reference_record, scheme_row, typical_ns
from .sums import (
    add_powers,
    compile_kernels,
    error_variables,
    expected_order,
    extension,
    means,
    values_of_blocks,
)

_BATCH_BYTES = 64e6


class Plan(NamedTuple):
    """A case turned into what the ensemble needs."""

    scheme: NamedTuple
    model: NamedTuple
    initial: tuple
    grid: Grid
    noise: Noise
    functions: tuple
    samples: int
    prefixes: tuple
    reference_order: float | None  #: by which the reference's own error is extrapolated

    @property
    def blocks(self):
        return -(-self.samples // LANES)


class State(NamedTuple):
    """What is known after the blocks 0, ..., blocks - 1; enough to go on from."""

    blocks: int
    seconds: float  #: wall clock
    cpu_seconds: float
    values: np.ndarray  #: (2, levels * F, GROUPS) sums of phi at each level, and of its square
    differences: np.ndarray  #: (1, levels * F, GROUPS) sums of phi at the level minus phi at the reference
    nonfinite: np.ndarray  #: (levels,)
    report: np.ndarray  #: (levels, columns)
    prefix_differences: np.ndarray  #: (prefixes, 1, levels * F, GROUPS)
    prefix_cpu_seconds: np.ndarray  #: (prefixes,)


def plan(case, scheme, eps=None):
    """The plan for one scheme of a case."""
    reference = reference_record(case.reference_scheme, eps)
    return Plan(
        scheme_row(scheme, eps).record,
        case.model,
        case.initial,
        nested_grid(case.final_time, case.reference_step, case.steps, case.truncate_noise, reference),
        brownian(case.seed),
        case.expressions,
        case.samples,
        tuple(case.prefixes or ()),
        None if case.reference_scheme else expected_order(case, scheme_row(scheme, eps)),
    )


def cost(case, scheme, eps=None):
    """Steps of paths, seconds of one thread at typical speed, and bytes of memory."""
    p = plan(case, scheme, eps)
    steps = int((p.grid.reference_steps >> p.grid.doublings).sum()) * p.blocks * LANES
    return steps, steps * 1e-9 * typical_ns(scheme, case.model), int(_BATCH_BYTES)


def start(p):
    """The state before the first block."""
    levels = len(p.grid.doublings)
    quantities = levels * len(p.functions)
    return State(
        *(0, 0.0, 0.0, np.zeros((2, quantities, GROUPS)), np.zeros((1, quantities, GROUPS))),
        np.zeros(levels, np.int64),
        np.zeros((levels, len(REPORT))),
        np.zeros((len(p.prefixes), 1, quantities, GROUPS)),
        np.zeros(len(p.prefixes)),
    )


def advance_state(p, state, blocks):
    """The state after the next `blocks` blocks; the same bits however the blocks are divided into calls."""
    began, cpu_began = time.perf_counter(), time.process_time()
    values, reports = values_of_blocks(p, p.grid, p.noise, state.blocks, blocks, p.samples)
    flat = values.reshape(blocks, -1, LANES)
    with np.errstate(invalid="ignore", over="ignore"):
        differences = (values - values[:, :1]).reshape(blocks, -1, LANES)
    lanes = np.arange(state.blocks * LANES, (state.blocks + blocks) * LANES).reshape(blocks, 1, LANES) < p.samples
    lost = ~np.isfinite(values).all(axis=2) & lanes
    new_values, new_differences = state.values.copy(), state.differences.copy()
    add_powers(flat, state.blocks, p.samples, new_values)
    add_powers(differences, state.blocks, p.samples, new_differences)
    prefix_differences, prefix_cpu = state.prefix_differences.copy(), state.prefix_cpu_seconds.copy()
    cpu = time.process_time() - cpu_began
    for i, samples in enumerate(p.prefixes):
        share = (samples / LANES - state.blocks) / blocks
        if 0 < share <= 1:
            sums = state.differences.copy()
            add_powers(differences, state.blocks, samples, sums)
            prefix_differences[i], prefix_cpu[i] = sums, state.cpu_seconds + share * cpu
    return State(
        state.blocks + blocks,
        state.seconds + time.perf_counter() - began,
        state.cpu_seconds + cpu,
        new_values,
        new_differences,
        state.nonfinite + lost.sum(axis=(0, 2)),
        add_reports(state.report, reports),
        prefix_differences,
        prefix_cpu,
    )


def batches(p, state):
    """Run all blocks that are left; yields the state after each batch of about half a second."""
    levels = len(p.grid.doublings)
    compile_kernels(p, p.grid, p.noise)
    most = max(1, int(_BATCH_BYTES / (8 * LANES * levels * (len(p.initial) + 3 * len(p.functions)))))
    yield from in_batches(state, partial(advance_state, p), lambda state: p.blocks - state.blocks, most)


def progress(p, state):
    """Paths done, all paths, and the standard error at the largest step (of the first function)."""
    done = min(state.blocks * LANES, p.samples)
    if not done:
        return 0, p.samples, float("nan")
    error, without = errors(p, state.differences, group_counts(done))
    return done, p.samples, float(jackknife_stderr(error, without, group_counts(done))[0, 0])


def errors(p, differences, counts):
    """Errors (F, S) from the largest step to the smallest, and their leave-one-out values (groups, F, S)."""
    mean, without = (_by_step(p, x) for x in means(differences[0], counts))
    factor = extension(step_sizes(p), p.grid.reference_step, p.reference_order)
    return mean * factor, without * factor


def _by_step(p, x):
    """(..., levels * F) as (..., F, S), without the reference."""
    x = x.reshape(*x.shape[:-1], len(p.grid.doublings), len(p.functions))
    return np.moveaxis(x, -1, -2)[..., :0:-1]


def _deviation(powers):
    """The standard deviation from means of a quantity and of its square."""
    return np.sqrt(np.maximum(powers[1] - powers[0] ** 2, 0.0))


def step_sizes(p):
    """The step sizes from the largest to the smallest."""
    return p.grid.reference_step * 2.0 ** p.grid.doublings[:0:-1]


def results(p, state):
    """Coordinates, variables and attributes of the results."""
    counts = group_counts(p.samples)
    h = step_sizes(p)
    error, without = errors(p, state.differences, counts)
    expectation, expectation_without = means(state.values[0], counts)
    reference = expectation[: len(p.functions)]
    expectation, expectation_without = _by_step(p, expectation), _by_step(p, expectation_without)
    axes = ("function", "h")
    variables = error_variables(h, error, without, counts) | {
        "expectation": (axes, expectation),
        "expectation_stderr": (axes, jackknife_stderr(expectation, expectation_without, counts)),
        "reference": (("function",), reference),
        "sd": (("function",), _deviation(state.values[:, -len(p.functions) :].sum(axis=-1) / p.samples)),
        "nonfinite": (("h",), state.nonfinite[:0:-1]),
    }
    coordinates = {"h": h}
    if p.prefixes:
        of_prefixes = [
            (error, jackknife_stderr(error, without, counts))
            for counts in map(group_counts, p.prefixes)
            for error, without in [errors(p, state.prefix_differences[p.prefixes.index(sum(counts))], counts)]
        ]
        axes = ("samples", *axes)
        coordinates["samples"] = np.array(p.prefixes, np.int64)
        variables |= {
            "prefix_error": (axes, np.array([e for e, _ in of_prefixes])),
            "prefix_error_stderr": (axes, np.array([s for _, s in of_prefixes])),
            "prefix_cpu_seconds": (("samples",), state.prefix_cpu_seconds),
        }
    steps = (p.grid.reference_steps >> p.grid.doublings).sum() * p.samples
    attributes = {
        "samples": p.samples,
        "cpu_seconds": state.cpu_seconds,
        "wall_seconds": state.seconds,
        "ns_per_step": 1e9 * state.cpu_seconds / steps,
        "reference_nonfinite": int(state.nonfinite[0]),
    }
    return coordinates, variables, attributes
