"""Multilevel differences: E phi(y_h) - E phi(y_{h/2}) level by level (Giles, Operations Research 56, 2008), added up.

Level j compares the steps 2^(j+1) h_ref and 2^j h_ref on common paths, with random numbers of its own; the last level
is E phi at the largest step.  The error at step h is the sum of the differences of all levels below it.

A scheme that tosses a coin for the order of its flows is symmetric up to this coin, and each path gets an
**antithetic path**: within each coarse step that of the fine path makes all its flows in reversed order (the two
increments exchanged, the coins turned), that of the coarse path turns its coin.  All four are paths of the scheme; in
the difference of the two means the commutators, hence the Lévy areas, cancel to leading order, and the variance of a
level falls from O(h) to O(h^2).  Schemes without antithetic paths are compared with one that has them where that is
possible, see differences.py.

An asymptotic-preserving scheme has a **control**: its limit, the splitting scheme, on the same paths.  Where its
expectations are known without sampling, Y - beta (Y_0 - E Y_0) is averaged in place of Y, with the beta of least
variance.

With extrapolation (multilevel Richardson-Romberg, Lemaire and Pagès, Bernoulli 23, 2017) the error at h is
R(h) - R(h_ref), where R(h) = w_0 E phi(y_h) + w_1 E phi(y_{2h}) + ...: another sum over the same differences.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from spi.ensemble.protocol import dimension, noise_indices
from spi.exact.kolmogorov import can_solve
from spi.kinds.blocks import Blockwise
from spi.kinds.plans import Cost, Done, KernelCall, PartPlan, State
from spi.numerics.rng import LANES
from spi.schemes import typical_ns
from spi.schemes.asymptotic import AsymptoticPreserving
from spi.schemes.splitting import has_antithetic_path
from spi.statistics.estimators import GROUPS, jackknife_stderr
from spi.statistics.tallies import PathSet, chunk_blocks
from spi.storage.records import Part

from ...results import WeakErrors
from ...study.fields import result_steps
from ...study.sums import ROUND, values_of_blocks, with_powers
from ..kolmogorov.study import solution
from .estimates import Errors, errors, moments, results
from .extrapolated import shares
from .levels import Level, levels_of

PILOT = 2 * ROUND  #: blocks of each level before the first allocation
SHARES = (1 / 16, 1 / 4, 1.0, 1.0)  #: of the budget, or of 1/target^2, that the allocations have in view
_BASE_SHARE = 0.05  # of all work, for the largest step alone, which no difference needs
_POWERS = 4
_BATCH_BYTES = 64e6


class Totals(NamedTuple):
    """What is known of some samples of one level, for F test functions."""

    paths: int  #: samples, each of them all paths of the level
    seconds: float  #: wall clock
    cpu_seconds: float
    sums: np.ndarray  #: (powers, quantities, F, GROUPS), the quantities as in levels.py
    nonfinite: int

    def plus(self, later: "Totals") -> "Totals":
        """These samples and some later ones."""
        mine, others = self._asdict(), later._asdict()
        return Totals(**{name: mine[name] + others[name] for name in self._fields})


class Rows(NamedTuple):
    """What some blocks contribute, a row for each."""

    values: np.ndarray  #: (blocks, paths of a sample, F, LANES)
    weights: np.ndarray  #: of the level


class Decisions(NamedTuple):
    """What is known besides sums over paths, of F test functions at S step sizes."""

    seconds: float  #: wall clock
    cpu_seconds: float
    allocations: int  #: how many have been made
    targets: np.ndarray  #: (levels,) blocks that the current allocation wants
    known: np.ndarray  #: (levels, F) expectations of the control, NaN until they are
    control_bound: float  #: the largest estimate of their numerical error
    history_error: np.ndarray  #: (allocations, F, S) when each allocation was fulfilled
    history_error_stderr: np.ndarray  #: (allocations, F, S)
    history_cpu_seconds: np.ndarray  #: (allocations,)


class Levels(NamedTuple):
    """The totals of all levels, and the decisions so far."""

    blocks: np.ndarray  #: (levels,)
    sums: np.ndarray  #: (levels, powers, quantities, F, GROUPS)
    nonfinite: np.ndarray  #: (levels,)
    cpu_seconds: np.ndarray  #: (levels,), that of the control in the last one
    more: Decisions


@dataclass(frozen=True, kw_only=True)
class MultilevelPlan(Blockwise, PartPlan):
    """Weak errors of one scheme from differences between levels."""

    levels: tuple[Level, ...]
    control: tuple | None  #: the rows of its limit, if the scheme has one of which the expectations are known

    @classmethod
    def of(cls, case: Any, part: Part) -> "MultilevelPlan":
        """The plan for one scheme of a case."""
        record = case.row(part.scheme, part.eps).record
        control = _control(case, record)
        levels = levels_of(case, record, has_antithetic_path(record), record._replace(eps=0.0) if control else None)
        return cls(case=case, part=part, levels=levels, control=control)

    @property
    def seconds_per_block(self) -> np.ndarray:
        """(levels,) of one thread at typical speed."""
        ns = typical_ns(self.row, self.model)
        return np.array([1e-9 * ns * level.steps * LANES for level in self.levels])

    @property
    def shape(self) -> tuple[int, int]:
        """(F, S): test functions and step sizes."""
        return len(self.case.functions), len(result_steps(self))

    def cost(self) -> Cost:
        """Steps of paths, seconds of one thread at typical speed (NaN if there is no budget), and bytes of memory."""
        steps = np.array([level.steps * LANES for level in self.levels])
        round_of_all = self.seconds_per_block.sum()
        seconds = PILOT * round_of_all + self.case.seconds if self.case.seconds else np.nan
        return Cost(seconds * steps.sum() / round_of_all, seconds, int(_BATCH_BYTES))

    def begin(self) -> Decisions:
        """The pilot is wanted."""
        levels, functions, allocations = len(self.levels), self.shape[0], len(SHARES)
        return Decisions(
            seconds=0.0,
            cpu_seconds=0.0,
            allocations=0,
            targets=np.full(levels, PILOT),
            known=np.full((levels, functions), np.nan if self.control else 0.0),
            control_bound=0.0,
            history_error=np.zeros((allocations, *self.shape)),
            history_error_stderr=np.zeros((allocations, *self.shape)),
            history_cpu_seconds=np.zeros(allocations),
        )

    def path_sets(self, more: Decisions) -> Sequence[PathSet]:
        """The samples of each level that the current allocation wants."""
        return tuple(
            PathSet(int(blocks) * LANES, max(ROUND, chunk_blocks(level.steps, dimension(self.model))))
            for blocks, level in zip(more.targets, self.levels, strict=True)
        )

    def empty(self, number: int) -> Totals:
        """The totals over no samples."""
        sums = np.zeros((_POWERS, 4 if self.control else 2, self.shape[0], GROUPS))
        return Totals(paths=0, seconds=0.0, cpu_seconds=0.0, sums=sums, nonfinite=0)

    def kernel_calls(self) -> list[KernelCall]:
        """One step of one block."""
        return self.calls_of_a_step(self.levels[0].grid, self.levels[0].stream)

    def most_blocks(self, number: int) -> int:
        """How many blocks of a level a batch may have, because of memory."""
        paths = self.levels[number].weights.shape[1]
        return max(1, int(_BATCH_BYTES / (8 * LANES * paths * (len(self.initial) + 4 * len(self.case.functions)))))

    def rows(self, number: int, first: int, blocks: int, end: int) -> Rows:
        """The values of the test functions at the end of some blocks of one level."""
        level = self.levels[number]
        values, _ = values_of_blocks(self, level.grid, level.stream, first, blocks, end)
        return Rows(values, level.weights)

    def added(self, sums: Totals, rows: Rows, at: slice, first: int, end: int) -> Totals:
        """The totals with the rows `at`, of which the first is that of block `first`."""
        values, weights = rows.values[at], rows.weights
        with np.errstate(invalid="ignore", over="ignore"):
            quantities = sum(w[:, np.newaxis, np.newaxis] * values[:, i, np.newaxis] for i, w in enumerate(weights.T))
        if self.control:
            product = quantities[:, :1] * quantities[:, 2:]
            quantities = np.concatenate([quantities, product], axis=1)
        return sums._replace(
            sums=with_powers(sums.sums, quantities, first, end),
            nonfinite=sums.nonfinite + int((~np.isfinite(values).all(axis=(1, 2))).sum()),
        )

    def settle(self, state: State) -> Decisions | None:
        """The next allocation; first the expectations of the control, where there is one and they are not known yet."""
        more = state.more
        if self.control and np.isnan(more.known).any():
            return _with_known(self, self.control, more)
        levels = snapshot(self, state)
        if more.allocations > 0 and not more.history_cpu_seconds[more.allocations - 1]:
            more = _with_history(self, levels)
        if more.allocations == len(SHARES):
            return more if more is not state.more else None
        targets = np.maximum(levels.blocks, allocation(self, levels, SHARES[more.allocations]))
        return more._replace(targets=targets, allocations=more.allocations + 1)

    def progress(self, state: State) -> Done:
        """Work done and work allocated, in seconds of typical speed, and the standard error at the largest step."""
        levels = snapshot(self, state)
        done, total = (float(blocks @ self.seconds_per_block) for blocks in (levels.blocks, state.more.targets))
        if levels.blocks.min() < ROUND:
            return Done(done, total, float("nan"))
        return Done(done, total, float(jackknife_stderr(*self.errors(levels))[0, 0]))

    @property
    def base(self) -> int:
        """The number of the level that has the largest step alone."""
        return len(self.levels) - 1

    def least_work(self, variance: np.ndarray, cost: np.ndarray) -> tuple[float, np.ndarray]:
        """R, and n (levels,), of levels with such a variance and cost of a sample.

        The least work by which all errors have the variance s^2 is R^2 / s^2, and takes (work / R) n samples of each
        level but that of the largest step alone: N_l proportional to (V_l / C_l)^(1/2).  V_l is the variance times the
        square of what of the level is in the error at the largest step.
        """
        variance = variance * np.append(shares(self)[0] ** 2, 1.0)
        return float(np.sqrt(variance * cost)[: self.base].sum()), np.sqrt(variance / cost)

    def errors(self, levels: Levels) -> Errors:
        """The errors that the levels tell."""
        return errors(self, levels)

    def results(self, state: State) -> WeakErrors:
        """The results of one scheme of a case, from its final state."""
        return results(self, snapshot(self, state), state.seconds)


def _control(case: Any, record: Any) -> tuple | None:
    """The rows of the limit, a splitting scheme, if the scheme has a limit of which the expectations are known."""
    known = can_solve(case.model) and not case.truncate_noise
    return record.stages if known and isinstance(record, AsymptoticPreserving) else None


def snapshot(p: MultilevelPlan, state: State) -> Levels:
    """What is known of all levels: of all paths that are wanted, or of those that are there."""
    totals = [state.so_far(j) for j in range(len(p.levels))]
    cpu_seconds = np.array([one.cpu_seconds for one in totals])
    cpu_seconds[-1] += state.more.cpu_seconds
    return Levels(
        blocks=np.array([one.paths // LANES for one in totals]),
        sums=np.array([one.sums for one in totals]),
        nonfinite=np.array([one.nonfinite for one in totals]),
        cpu_seconds=cpu_seconds,
        more=state.more,
    )


def _with_known(p: MultilevelPlan, control: tuple, more: Decisions) -> Decisions:
    """The decisions with the expectations of the control, rows of flows, from the finest level to the last."""
    began, cpu_began = time.perf_counter(), time.process_time()
    steps = p.case.reference_step * 2.0 ** np.arange(len(p.levels) - 1, -1, -1)
    found = solution(p.case, control, steps)
    known = np.concatenate([(found.weak_error[:, :-1] - found.weak_error[:, 1:]).T[::-1], found.value[:, :1].T])
    return more._replace(
        seconds=more.seconds + time.perf_counter() - began,
        cpu_seconds=more.cpu_seconds + time.process_time() - cpu_began,
        known=known,
        control_bound=float(found.weak_error_bound.max()),
    )


def allocation(p: MultilevelPlan, levels: Levels, share: float) -> np.ndarray:
    """Blocks of each level, a multiple of ROUND, as :meth:`MultilevelPlan.least_work` shares out the work.

    As many as `share` of the budget allows, or `share` of what the target asks for, if that is less.  The variance is
    the largest over the test functions; a level whose values are not finite gets no more.
    """
    with np.errstate(invalid="ignore"):
        variance = np.nan_to_num(moments(p, levels).variance.max(axis=1), nan=0.0, posinf=0.0)
    cost = p.seconds_per_block / LANES
    root, per_root = p.least_work(variance, cost)
    samples = np.zeros(len(p.levels))
    if root > 0 and noise_indices(p.model):  # without noise one path is all, whatever rounding says
        budget, target = p.case.seconds or np.inf, p.case.standard_error
        work = share * min(budget * (1.0 - _BASE_SHARE), root**2 / target**2 if target else np.inf)
        samples = work / root * per_root
        samples[p.base] = work * _BASE_SHARE / cost[p.base]
    return np.ceil(samples / (ROUND * LANES)).astype(np.int64) * ROUND


def _with_history(p: MultilevelPlan, levels: Levels) -> Decisions:
    """The decisions with the errors of the allocation that has been fulfilled."""
    more = levels.more
    found, i = p.errors(levels), more.allocations - 1
    error, stderr, seconds = (
        values.copy() for values in (more.history_error, more.history_error_stderr, more.history_cpu_seconds)
    )
    error[i], stderr[i], seconds[i] = found.error, jackknife_stderr(*found), levels.cpu_seconds.sum()
    return more._replace(history_error=error, history_error_stderr=stderr, history_cpu_seconds=seconds)
