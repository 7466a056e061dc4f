"""Multilevel differences: E phi(y_h) - E phi(y_{h/2}) level by level (Giles, Operations Research 56, 2008), added up.

Level j compares the steps 2^(j+1) h_ref and 2^j h_ref on common paths, with random numbers of its own; the last level
is E phi at the largest step.  The error at step h is the sum of the differences of all levels below it.

A scheme that tosses a coin for the order of its flows is symmetric up to this coin, and each path gets an
**antithetic path**: within each coarse step that of the fine path makes all its flows in reversed order (the two
increments exchanged, the coins turned), that of the coarse path turns its coin.  All four are paths of the scheme; in
the difference of the two means the commutators, hence the Lévy areas, cancel to leading order, and the variance of a
level falls from O(h) to O(h^2).  Schemes without antithetic paths are compared with one that has them where that is
possible, see study.py.

An asymptotic-preserving scheme has a **control**: its limit, the splitting scheme, on the same paths.  Where its
expectations are known without sampling, Y - beta (Y_0 - E Y_0) is averaged in place of Y, with the beta of least
variance.

With extrapolation (multilevel Richardson-Romberg, Lemaire and Pagès, Bernoulli 23, 2017) the error at h is
R(h) - R(h_ref), where R(h) = w_0 E phi(y_h) + w_1 E phi(y_{2h}) + ...: another sum over the same differences.
"""

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from spi.ensemble.points import Points
from spi.kinds.plans import Cost, Done, KernelCall, State
from spi.kinds.samples import BATCH_BYTES, POWERS, Sample, SamplesPlan
from spi.numerics.rng import LANES
from spi.schemes import typical_ns
from spi.schemes.splitting import has_antithetic_path
from spi.statistics.estimators import GROUPS, ROUND, jackknife_stderr
from spi.statistics.intervals import zero_share_bound
from spi.storage.records import Part

from ...results import History, Sampled, WeakErrors
from ...study import WeakPlan, sampled_errors, stderr_of
from .combination import Combination, base_gain, expectations
from .decisions import PILOT, SHARES, Decisions, Errors, control_of
from .levels import PRODUCT, levels_of
from .sums import EQUAL, LevelSums, Totals

_OF_STEPS = "error", "without", "unseen"  # fields of errors that have an axis of steps
_BASE_SHARE = 0.05  # of all work, for the largest step alone, which no difference needs
_LONGEST = 1e9  # seconds of work that a target may ask for


@dataclass(frozen=True, kw_only=True)
class MultilevelPlan(SamplesPlan, WeakPlan):
    """Weak errors of one scheme from differences between levels."""

    of_others: ClassVar[frozenset[str]] = frozenset(("prefixes", "construction", "coarse"))

    levels: tuple[Sample, ...]
    control: tuple | None  #: the rows of its limit, if the scheme has one of which the expectations are known

    @classmethod
    def of(cls, case: Any, part: Part) -> "MultilevelPlan":
        """The plan for one scheme of a case."""
        record = case.row(part.scheme, part.eps).record
        control = control_of(case, record)
        levels = levels_of(case, record, has_antithetic_path(record), record._replace(eps=0.0) if control else None)
        return cls(case=case, part=part, levels=levels, control=control)

    def deciding(self, number: int | None) -> dict[str, Any]:
        """Also how the largest step is sampled, where that is by points: of the other levels it decides nothing."""
        along = {"coarse": self.case.construction} if self.scrambled and number in (None, self.base) else {}
        return super().deciding(number) | along

    @property
    def scrambled(self) -> bool:
        """Whether the largest step alone is sampled by scrambled points."""
        return isinstance(self.levels[self.base].stream, Points)

    @property
    def seconds_per_block(self) -> np.ndarray:
        """(levels,) of one thread at typical speed."""
        ns = typical_ns(self.row, self.model)
        return np.array([1e-9 * ns * level.steps * LANES for level in self.levels])

    @property
    def combination(self) -> Combination:
        """How differences make errors."""
        below = [round(np.log2(h / self.case.reference_step)) for h in self.case.steps]
        return Combination(self.extrapolation, np.array(below))

    def cost(self) -> Cost:
        """Steps of paths, seconds of one thread at typical speed (NaN if there is no budget), and bytes of memory."""
        steps = np.array([level.steps * LANES for level in self.levels])
        round_of_all = self.seconds_per_block.sum()
        seconds = PILOT * round_of_all + self.case.seconds if self.case.seconds else np.nan
        return Cost(seconds * steps.sum() / round_of_all, seconds, int(BATCH_BYTES))

    def initial_extra(self) -> Decisions:
        """The pilot is wanted."""
        steps = sum(len(one.h) for one in self.by_level)
        return Decisions.pilot(len(self.levels), len(self.case.functions), steps, bool(self.control))

    @property
    def sets(self) -> tuple[Sample, ...]:
        """The levels."""
        return self.levels

    def wanted(self, extra: Decisions) -> np.ndarray:
        """(levels,) the samples that the current allocation wants."""
        return extra.targets * LANES

    def empty(self, number: int) -> Totals:
        """The totals over no samples."""
        sums = np.zeros((POWERS, 4 if self.control else 2, len(self.case.functions), GROUPS))
        return Totals(paths=0, seconds=0.0, cpu_seconds=0.0, sums=sums, nonfinite=0)

    def kernel_calls(self) -> list[KernelCall]:
        """One step of one block."""
        last = self.levels[self.base]
        along_points = self.calls_of_a_step(last.grid, last.stream)[:1] if self.scrambled else []
        return [*self.calls_of_a_step(self.levels[0].grid, self.levels[0].stream), *along_points]

    def rows(self, number: int, first: int, blocks: int, end: int) -> np.ndarray:
        """The quantities of some blocks of samples, with a control the product as well."""
        quantities = super().rows(number, first, blocks, end)
        if not self.control:
            return quantities
        with np.errstate(invalid="ignore", over="ignore"):
            return np.concatenate([quantities, quantities[:, :1] * quantities[:, 2:]], axis=1)

    def added(self, sums: Totals, rows: np.ndarray, at: slice, first: int, end: int) -> Totals:
        """The totals with the quantities `at`, of which the first is that of block `first`."""
        lost = ~np.isfinite(rows[at, :PRODUCT]).all(axis=(1, 2))
        return super().added(sums._replace(nonfinite=sums.nonfinite + int(lost.sum())), rows, at, first, end)

    def next_allocation(self, state: State) -> Decisions | None:
        """The next allocation; first the expectations of the control, where there is one and they are not known yet."""
        extra = state.extra
        if self.control and np.isnan(extra.known).any():
            steps = self.case.reference_step * 2.0 ** np.arange(self.base, -1, -1)
            return extra.with_control(self.case, self.control, steps)
        levels = self.level_sums(state)
        if not extra.recorded:
            extra = extra.with_errors(self.all_errors(levels), levels.cpu_seconds.sum())
        if extra.allocations == len(SHARES):
            return extra if extra is not state.extra else None
        if not extra.allocations:
            extra = extra._replace(used=self.chosen(levels))
            levels = levels._replace(used=extra.used)
        targets = np.maximum(levels.blocks, self.allocation(levels, SHARES[extra.allocations]))
        return extra._replace(targets=targets, allocations=extra.allocations + 1)

    def chosen(self, levels: LevelSums) -> np.ndarray:
        """(levels,) bool, which levels make the errors, by the sums of the pilot: all."""
        return levels.used

    def level_sums(self, state: State) -> LevelSums:
        """The sums of all levels: over all paths that are wanted, or those that are there."""
        totals = [state.so_far(j) for j in range(len(self.levels))]
        cpu_seconds = np.array([one.cpu_seconds for one in totals])
        cpu_seconds[-1] += state.extra.cpu_seconds
        return LevelSums(
            blocks=np.array([one.paths // LANES for one in totals]),
            sums=np.array([one.sums for one in totals]),
            nonfinite=np.array([one.nonfinite for one in totals]),
            cpu_seconds=cpu_seconds,
            known=state.extra.known,
            used=state.extra.used,
        )

    def progress(self, state: State) -> Done:
        """Work done and work allocated, in seconds of typical speed, and the standard error at the largest step."""
        levels = self.level_sums(state)
        done, total = (float(blocks @ self.seconds_per_block) for blocks in (levels.blocks, state.extra.targets))
        if levels.blocks.min() < ROUND:
            return Done(done, total, float("nan"))
        return Done(done, total, float(stderr_of(*self.errors(levels))[0, 0]))

    @property
    def base(self) -> int:
        """The number of the level that has the largest step alone."""
        return len(self.levels) - 1

    def least_work(self, variance: np.ndarray, cost: np.ndarray) -> tuple[float, np.ndarray]:
        """R, and n (levels,), of levels with such a variance and cost of a sample.

        The least work by which all errors have the variance s^2 is R^2 / s^2, and takes (work / R) n samples of each
        level but that of the largest step alone: N_l proportional to (V_l / C_l)^(1/2).  V_l is the variance times the
        square of what of the level is in the error at the largest step, with the extrapolation in which that is most.
        """
        shares = np.abs([one.completed(one.combination.shares().T)[:, 0] for one in self.each]).max(axis=0)
        variance = variance * np.append(shares**2, 1.0)
        return float(np.sqrt(variance * cost)[: self.base].sum()), np.sqrt(variance / cost)

    def allocation(self, levels: LevelSums, share: float) -> np.ndarray:
        """Blocks of each level, a multiple of ROUND, as :meth:`least_work` shares out the work.

        As many as `share` of the budget allows, or `share` of what the target asks for, if that is less.  The variance
        is the largest over the test functions; a level whose values are not finite gets no more.
        """
        with np.errstate(invalid="ignore"):
            variance = np.maximum(levels.moments().variance, self.least_variance(levels)).max(axis=1)
            variance = np.nan_to_num(variance, nan=0.0, posinf=0.0) * levels.used
        cost = self.seconds_per_block / LANES
        root, per_root = self.least_work(variance, cost)
        samples = np.zeros(len(self.levels))
        if root > 0 and self.is_random:  # else one path is all, whatever rounding says
            budget, target = self.case.seconds or np.inf, self.case.standard_error
            floor = max(target**2, root**2 / _LONGEST, 1e-300) if target else 0.0
            work = share * min(budget * (1.0 - _BASE_SHARE), root**2 / floor if target else np.inf)
            samples = work / root * per_root
            samples[self.base] = work * _BASE_SHARE / cost[self.base]
        rounds = np.ceil(samples / (ROUND * LANES)).astype(np.int64)
        if self.scrambled:  # which is fair for powers of two
            rounds[self.base] = 1 << max(int(rounds[self.base]).bit_length() - 1, 0)
        return rounds * ROUND

    def errors(self, levels: LevelSums) -> Errors:
        """The errors that the differences of the levels make."""
        mean, without = levels.averages()
        combine = self.combination.errors
        each = np.eye(self.base)[..., np.newaxis]  # of each level how much of it is in each error
        shares = np.abs(self.completed(combine(each)))[:, 0]
        lacking = shares[:, np.newaxis] * self.unseen_levels(levels)[:-1, :, np.newaxis]
        unseen = np.where(shares[:, np.newaxis] > 0, lacking, 0.0).sum(axis=0)
        return Errors(self.completed(combine(mean[:-1])), self.completed(combine(without[:, :-1])), EQUAL, unseen)

    def unseen_levels(self, levels: LevelSums) -> np.ndarray:
        """(levels, F) what the mean of each level lacks unseen, see :meth:`WeakPlan.unseen`."""
        mean, without = levels.averages()
        return self.unseen(mean, jackknife_stderr(mean, without, EQUAL), levels.samples[:, np.newaxis])

    def least_variance(self, levels: LevelSums) -> np.ndarray:
        """(levels, F) the variance that a level has if as much of it differs as may do so unseen."""
        return np.nan_to_num(self.unseen_levels(levels) ** 2 / zero_share_bound(levels.samples[:, np.newaxis]))

    def all_errors(self, levels: LevelSums) -> Errors:
        """Those of all levels of extrapolation behind one another, fewest first, as the decisions keep them."""
        each = [one.errors(levels) for one in self.by_level]
        error, without, unseen = (np.concatenate([getattr(one, name) for one in each], -1) for name in _OF_STEPS)
        return Errors(error, without, EQUAL, unseen)

    def so_far(self, state: State) -> State | None:
        """The state of whole rounds of groups, once each level has one and the control is known."""
        if self.control and np.isnan(state.extra.known).any():
            return None
        found = state.of(self)
        for number, tally in state.tallies.items():
            short = {i: sums for i, sums in tally.short.items() if sums.paths % (ROUND * LANES) == 0}
            found.tallies[number] = tally._replace(short=short)
        return found if self.level_sums(found).blocks.min() >= ROUND else None

    def results(self, state: State) -> WeakErrors:
        """The results of one scheme of a case, from its final state."""
        return self.results_of(self.level_sums(state), state)

    def results_of(self, levels: LevelSums, state: State) -> WeakErrors:
        """The results from the sums over these levels, which may be fewer than the state has."""
        steps = sum(level.steps * int(n) * LANES for level, n in zip(self.levels, levels.blocks, strict=True))
        errors, extra, own = self.errors(levels), state.extra, self.own_among(lambda one: len(one.h))
        fields, sampled = sampled_errors(self.h, *errors)
        expectation, of_expectation = expectations(self, levels)
        cpu_seconds = float(levels.cpu_seconds.sum())
        work: Any = {"samples": int(levels.samples.sum()), "ns_per_step": 1e9 * float(cpu_seconds / steps)}
        return self.weak_errors(
            state.seconds,
            **fields,
            expectation=expectation,
            sampled=Sampled(**sampled, **of_expectation, **work),
            levels=replace(
                levels.table(self.coarse, has_antithetic_path(self.scheme), extra.control_bound),
                base_gain=base_gain(self, levels),
            ),
            history=History(
                allocations=np.arange(1, len(SHARES) + 1),
                error=extra.history_error[..., own],
                error_stderr=extra.history_error_stderr[..., own],
                cpu_seconds=extra.history_cpu_seconds,
            ),
            cpu_seconds=cpu_seconds,
            accuracy=self.case.accuracy if self.control else None,
        )

    @property
    def coarse(self) -> np.ndarray:
        """(levels - 1,) the coarse steps of the differences."""
        return self.case.reference_step * 2.0 ** np.arange(1, self.base + 1)
