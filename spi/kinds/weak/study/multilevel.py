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
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from spi.ensemble import add_reports, in_batches
from spi.estimators import GROUPS, jackknife_stderr
from spi.kinds.plans import Cost, Done, KernelCall, PartPlan
from spi.kolmogorov import can_solve
from spi.protocol import REPORT, noise_indices
from spi.records import Group, Part
from spi.rng import LANES
from spi.schemes import scheme_row, typical_ns
from spi.schemes.asymptotic import AsymptoticPreserving
from spi.schemes.splitting import has_reversed_twin

from .estimates import errors, group, moments
from .kolmogorov import solution
from .levels import Level, levels_of
from .sums import ROUND, compile_kernels, sampling_calls, values_of_blocks, with_powers

PILOT = 2 * ROUND  #: blocks of each level before the first allocation
SHARES = (1 / 16, 1 / 4, 1.0, 1.0)  #: of the budget, or of 1/target^2, that the allocations have in view
_BASE_SHARE = 0.05  # of all work, for the largest step alone, which no difference needs
_POWERS = 4
_BATCH_BYTES = 64e6


class State(NamedTuple):
    """What is known so far, of F test functions at S step sizes; enough to go on from."""

    seconds: float  #: wall clock
    allocations: int  #: how many have been made
    blocks: np.ndarray  #: (levels,) done
    targets: np.ndarray  #: (levels,) of the current allocation
    sums: np.ndarray  #: (levels, powers, quantities, F, GROUPS), the quantities as in levels.py
    known: np.ndarray  #: (levels, F) expectations of the control, NaN until they are
    control_bound: float  #: the largest estimate of their numerical error
    nonfinite: np.ndarray  #: (levels,)
    reports: np.ndarray  #: (levels, len(REPORT))
    cpu_seconds: np.ndarray  #: (levels,)
    history_error: np.ndarray  #: (allocations, F, S) when each allocation was fulfilled
    history_error_stderr: np.ndarray  #: (allocations, F, S)
    history_cpu_seconds: np.ndarray  #: (allocations,)


@dataclass(frozen=True, kw_only=True)
class MultilevelPlan(PartPlan):
    """Weak errors of one scheme from differences between levels."""

    levels: tuple[Level, ...]
    control: tuple | None  #: the rows of its limit, if the scheme has one of which the expectations are known

    @classmethod
    def of(cls, case: Any, part: Part) -> "MultilevelPlan":
        """The plan for one scheme of a case."""
        record = scheme_row(part.scheme, part.eps).record
        control = _control(case, record)
        levels = levels_of(case, has_reversed_twin(record), record._replace(eps=0.0) if control else None)
        return cls(case=case, part=part, levels=levels, control=control)

    @property
    def seconds_per_block(self) -> np.ndarray:
        """(levels,) of one thread at typical speed."""
        ns = typical_ns(self.part.scheme, self.model)
        return np.array([1e-9 * ns * level.steps * LANES for level in self.levels])

    @property
    def shape(self) -> tuple[int, int]:
        """(F, S): test functions and step sizes."""
        return len(self.case.functions), len(self.case.steps)

    def cost(self) -> Cost:
        """Steps of paths, seconds of one thread at typical speed (NaN if there is no budget), and bytes of memory."""
        steps = np.array([level.steps * LANES for level in self.levels])
        round_of_all = self.seconds_per_block.sum()
        seconds = PILOT * round_of_all + self.case.seconds if self.case.seconds else np.nan
        return Cost(seconds * steps.sum() / round_of_all, seconds, int(_BATCH_BYTES))

    def start(self) -> State:
        """The state before the pilot."""
        levels, functions, allocations = len(self.levels), self.shape[0], len(SHARES)
        quantities = 4 if self.control else 2
        return State(
            seconds=0.0,
            allocations=0,
            blocks=np.zeros(levels, np.int64),
            targets=np.full(levels, PILOT),
            sums=np.zeros((levels, _POWERS, quantities, functions, GROUPS)),
            known=np.full((levels, functions), np.nan if self.control else 0.0),
            control_bound=0.0,
            nonfinite=np.zeros(levels, np.int64),
            reports=np.zeros((levels, len(REPORT))),
            cpu_seconds=np.zeros(levels),
            history_error=np.zeros((allocations, *self.shape)),
            history_error_stderr=np.zeros((allocations, *self.shape)),
            history_cpu_seconds=np.zeros(allocations),
        )

    def kernel_calls(self) -> list[KernelCall]:
        """One step of one block, the values of the test functions, and their sums."""
        return sampling_calls(self, self.levels[0].grid, self.levels[0].stream)

    def batches(self, state: State) -> Iterator[State]:
        """Fulfil all allocations; yields the state after each batch of about half a second."""
        compile_kernels(self)
        if self.control and np.isnan(state.known).any():
            state = _with_known(self, self.control, state)
            yield state
        while True:
            for j in range(len(self.levels)):
                for state in _level_batches(self, state, j):  # noqa: B020, the state moves on
                    yield state
            if state.allocations > 0:
                state = _note_history(self, state)
                yield state
            if state.allocations == len(SHARES):
                return
            targets = np.maximum(state.blocks, allocation(self, state, SHARES[state.allocations]))
            state = state._replace(targets=targets, allocations=state.allocations + 1)
            yield state

    def progress(self, state: State) -> Done:
        """Work done and work allocated, in seconds of typical speed, and the standard error at the largest step."""
        done, total = (float(blocks @ self.seconds_per_block) for blocks in (state.blocks, state.targets))
        if state.blocks.min() < ROUND:
            return Done(done, total, float("nan"))
        return Done(done, total, float(jackknife_stderr(*errors(self, state))[0, 0]))

    def group(self, state: State) -> Group:
        """The results of one scheme of a case, from its final state."""
        return group(self, state)


def _control(case: Any, record: Any) -> tuple | None:
    """The rows of the limit, a splitting scheme, if the scheme has a limit of which the expectations are known."""
    known = can_solve(case.model) and not case.truncate_noise
    return record.rows if known and isinstance(record, AsymptoticPreserving) else None


def advance_state(p: MultilevelPlan, state: State, j: int, blocks: int) -> State:
    """The state after the next `blocks` blocks of level j; the same bits however they are divided into calls."""
    began, cpu_began = time.perf_counter(), time.process_time()
    level, first = p.levels[j], int(state.blocks[j])
    samples = (first + blocks) * LANES
    values, reports = values_of_blocks(p, level.grid, level.stream, first, blocks, samples)
    lost = ~np.isfinite(values).all(axis=(1, 2))
    with np.errstate(invalid="ignore", over="ignore"):
        quantities = sum(w[:, np.newaxis, np.newaxis] * values[:, i, np.newaxis] for i, w in enumerate(level.weights.T))
    if p.control:
        product = quantities[:, :1] * quantities[:, 2:]
        quantities = np.concatenate([quantities, product], axis=1)
    sums, report = state.sums.copy(), state.reports.copy()
    sums[j] = with_powers(sums[j], quantities, first, samples)
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


def _level_batches(p: MultilevelPlan, state: State, j: int) -> Iterator[State]:
    bytes_per_block = 8 * LANES * len(p.levels[j].grid.doublings) * (len(p.initial) + 4 * len(p.case.functions))
    most = max(1, int(_BATCH_BYTES / bytes_per_block))
    return in_batches(
        state,
        lambda state, blocks: advance_state(p, state, j, blocks),
        lambda state: int(state.targets[j] - state.blocks[j]),
        most,
    )


def _with_known(p: MultilevelPlan, control: tuple, state: State) -> State:
    """The state with the expectations of the control, rows of flows, from the finest level to the last."""
    began, cpu_began = time.perf_counter(), time.process_time()
    steps = p.case.reference_step * 2.0 ** np.arange(len(p.levels) - 1, -1, -1)
    found = solution(p.case, control, steps)
    known = np.concatenate([(found.weak_error[:, :-1] - found.weak_error[:, 1:]).T[::-1], found.value[:, :1].T])
    cpu = state.cpu_seconds.copy()
    cpu[-1] += time.process_time() - cpu_began
    return state._replace(
        seconds=state.seconds + time.perf_counter() - began,
        cpu_seconds=cpu,
        known=known,
        control_bound=float(found.weak_error_bound.max()),
    )


def allocation(p: MultilevelPlan, state: State, share: float) -> np.ndarray:
    """Blocks of each level, a multiple of ROUND: N_l proportional to (V_l / C_l)^(1/2), least work for the variance.

    As many as `share` of the budget allows, or `share` of what the target asks for, if that is less.  V_l is the
    largest over the test functions; a level whose values are not finite gets no more.
    """
    with np.errstate(invalid="ignore"):
        variance = np.nan_to_num(moments(p, state).variance.max(axis=1), nan=0.0, posinf=0.0)
    cost = p.seconds_per_block / LANES
    root = np.sqrt(variance * cost)[:-1]
    samples = np.zeros(len(p.levels))
    if root.sum() > 0 and noise_indices(p.model):  # without noise one path is all, whatever rounding says
        budget, target = p.case.seconds or np.inf, p.case.standard_error
        work = share * min(budget * (1.0 - _BASE_SHARE), root.sum() ** 2 / target**2 if target else np.inf)
        samples[:-1] = work / root.sum() * np.sqrt(variance[:-1] / cost[:-1])
        samples[-1] = work * _BASE_SHARE / cost[-1]
    return np.ceil(samples / (ROUND * LANES)).astype(np.int64) * ROUND


def _note_history(p: MultilevelPlan, state: State) -> State:
    """The state with the errors of the allocation that has been fulfilled."""
    found, i = errors(p, state), state.allocations - 1
    error, stderr, seconds = (
        values.copy() for values in (state.history_error, state.history_error_stderr, state.history_cpu_seconds)
    )
    error[i], stderr[i], seconds[i] = found.error, jackknife_stderr(*found), state.cpu_seconds.sum()
    return state._replace(history_error=error, history_error_stderr=stderr, history_cpu_seconds=seconds)
