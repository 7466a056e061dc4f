"""Plain Monte Carlo, as in the paper: E phi(y_h) - E phi(y_ref) on common Brownian paths.

Any number of paths; only sums over groups of them are kept.  Results for the first so many paths come from the same
run.
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from spi.ensemble import add_reports, in_batches, nested_grid
from spi.estimators import GROUPS, group_counts, jackknife_stderr
from spi.kinds.plans import Cost, Done, KernelCall, PathsPlan
from spi.protocol import REPORT
from spi.records import Group, Part, Variables
from spi.rng import LANES
from spi.schemes import reference_record, typical_ns

from .groups import PER_POINT, error_variables, extension, weak_group
from .sums import compile_kernels, mean_over_paths, sampling_calls, standard_deviation, values_of_blocks, with_powers

_BATCH_BYTES = 64e6


class State(NamedTuple):
    """What is known after the blocks 0, ..., blocks - 1; enough to go on from.

    Of F test functions at L step sizes, the reference first and then from small to large.
    """

    blocks: int
    seconds: float  #: wall clock
    cpu_seconds: float
    values: np.ndarray  #: (2, L, F, GROUPS) sums of phi and of its square
    differences: np.ndarray  #: (1, L, F, GROUPS) sums of phi minus phi at the reference
    nonfinite: np.ndarray  #: (L,)
    report: np.ndarray  #: (L, len(REPORT))
    prefix_differences: np.ndarray  #: (prefixes, 1, L, F, GROUPS) differences of the first so many paths
    prefix_cpu_seconds: np.ndarray  #: (prefixes,)


@dataclass(frozen=True, kw_only=True)
class PlainPlan(PathsPlan):
    """Weak errors of one scheme by plain Monte Carlo."""

    @classmethod
    def of(cls, case: Any, part: Part) -> "PlainPlan":
        """The plan for one scheme of a case."""
        reference = reference_record(case.reference_scheme, part.eps)
        times = nested_grid(case.final_time, case.reference_step, case.steps, case.truncate_noise, reference)
        return cls(case=case, part=part, grid=times, samples=case.samples)

    @property
    def prefixes(self) -> tuple[int, ...]:
        """Numbers of first paths for which there are results as well."""
        return tuple(self.case.prefixes or ())

    @property
    def shape(self) -> tuple[int, int]:
        """(L, F): step sizes, the reference included, and test functions."""
        return len(self.grid.doublings), len(self.case.functions)

    def cost(self) -> Cost:
        """Steps of paths, seconds of one thread at typical speed, and bytes of memory."""
        steps = int(self.steps.sum()) * self.blocks * LANES
        return Cost(steps, steps * 1e-9 * typical_ns(self.part.scheme, self.model), int(_BATCH_BYTES))

    def start(self) -> State:
        """The state before the first block."""
        levels, prefixes = self.shape[0], len(self.prefixes)
        return State(
            blocks=0,
            seconds=0.0,
            cpu_seconds=0.0,
            values=np.zeros((2, *self.shape, GROUPS)),
            differences=np.zeros((1, *self.shape, GROUPS)),
            nonfinite=np.zeros(levels, np.int64),
            report=np.zeros((levels, len(REPORT))),
            prefix_differences=np.zeros((prefixes, 1, *self.shape, GROUPS)),
            prefix_cpu_seconds=np.zeros(prefixes),
        )

    def kernel_calls(self) -> list[KernelCall]:
        """One step of one block, the values of the test functions, and their sums."""
        return sampling_calls(self, self.grid, self.stream)

    def batches(self, state: State) -> Iterator[State]:
        """Run all blocks that are left; yields the state after each batch of about half a second."""
        levels, functions = self.shape
        compile_kernels(self)
        most = max(1, int(_BATCH_BYTES / (8 * LANES * levels * (len(self.initial) + 3 * functions))))
        yield from in_batches(state, partial(advance_state, self), lambda state: self.blocks - state.blocks, most)

    def progress(self, state: State) -> Done:
        """Paths done, all paths, and the standard error at the largest step (of the first function)."""
        done = self.paths_done(state)
        if not done:
            return Done(0, self.samples, float("nan"))
        error, without = errors(self, state.differences, group_counts(done))
        return Done(done, self.samples, float(jackknife_stderr(error, without, group_counts(done))[0, 0]))

    def group(self, state: State) -> Group:
        """The results of one scheme of a case, from its final state."""
        coordinates, of_prefixes = _of_prefixes(self, state)
        attributes = {
            "samples": self.samples,
            "cpu_seconds": state.cpu_seconds,
            "wall_seconds": state.seconds,
            "ns_per_step": 1e9 * state.cpu_seconds / (self.steps.sum() * self.samples),
            "reference_nonfinite": int(state.nonfinite[0]),
        }
        return weak_group(self, coordinates, _of_all_paths(self, state) | of_prefixes, attributes)


def advance_state(p: PlainPlan, state: State, blocks: int) -> State:
    """The state after the next `blocks` blocks; the same bits however the blocks are divided into calls."""
    began, cpu_began = time.perf_counter(), time.process_time()
    values, reports = values_of_blocks(p, p.grid, p.stream, state.blocks, blocks, p.samples)
    with np.errstate(invalid="ignore", over="ignore"):
        differences = values - values[:, :1]
    lanes = np.arange(state.blocks * LANES, (state.blocks + blocks) * LANES).reshape(blocks, 1, LANES) < p.samples
    lost = ~np.isfinite(values).all(axis=2) & lanes
    new_values = with_powers(state.values, values, state.blocks, p.samples)
    new_differences = with_powers(state.differences, differences, state.blocks, p.samples)
    prefix_differences, prefix_cpu = state.prefix_differences.copy(), state.prefix_cpu_seconds.copy()
    cpu = time.process_time() - cpu_began
    for i, samples in enumerate(p.prefixes):
        share = (samples / LANES - state.blocks) / blocks
        if 0 < share <= 1:
            prefix_differences[i] = with_powers(state.differences, differences, state.blocks, samples)
            prefix_cpu[i] = state.cpu_seconds + share * cpu
    return State(
        blocks=state.blocks + blocks,
        seconds=state.seconds + time.perf_counter() - began,
        cpu_seconds=state.cpu_seconds + cpu,
        values=new_values,
        differences=new_differences,
        nonfinite=state.nonfinite + lost.sum(axis=(0, 2)),
        report=add_reports(state.report, reports),
        prefix_differences=prefix_differences,
        prefix_cpu_seconds=prefix_cpu,
    )


def errors(p: PlainPlan, differences: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Errors (F, S) from the largest step to the smallest, and their leave-one-out values (groups, F, S)."""
    mean, without = map(_by_step, mean_over_paths(differences[0], counts))
    return mean * extension(p), without * extension(p)


def _by_step(x: np.ndarray) -> np.ndarray:
    """(..., L, F) as (..., F, S): without the reference, from the largest step to the smallest."""
    return np.moveaxis(x, -1, -2)[..., :0:-1]


def _of_all_paths(p: PlainPlan, state: State) -> Variables:
    """The variables that all paths together give."""
    counts = group_counts(p.samples)
    mean, without = mean_over_paths(state.values[0], counts)
    expectation = _by_step(mean)
    error, error_without = errors(p, state.differences, counts)
    coarsest = state.values[:, -1].sum(axis=-1) / p.samples
    return error_variables(np.array(p.case.steps), error, error_without, counts) | {
        "expectation": (PER_POINT, expectation),
        "expectation_stderr": (PER_POINT, jackknife_stderr(expectation, _by_step(without), counts)),
        "reference": (("function",), mean[0]),
        "sd": (("function",), standard_deviation(*coarsest)),
        "nonfinite": (("h",), state.nonfinite[:0:-1]),
    }


def _of_prefixes(p: PlainPlan, state: State) -> tuple[dict[str, np.ndarray], Variables]:
    """The coordinate and the variables of the first so many paths; nothing if no results of them are asked for."""
    if not p.prefixes:
        return {}, {}
    found, stderrs = [], []
    for samples, differences in zip(p.prefixes, state.prefix_differences, strict=True):
        counts = group_counts(samples)
        error, without = errors(p, differences, counts)
        found.append(error)
        stderrs.append(jackknife_stderr(error, without, counts))
    axes = ("samples", *PER_POINT)
    return {"samples": np.array(p.prefixes, np.int64)}, {
        "prefix_error": (axes, np.array(found)),
        "prefix_error_stderr": (axes, np.array(stderrs)),
        "prefix_cpu_seconds": (("samples",), state.prefix_cpu_seconds),
    }
