"""Weak errors of a scheme by one difference, at each step size, to the scheme of weak order 2.

With the noises in a fixed order the steps h and h/2 of a path differ by Lévy areas, and so do a step of the scheme and
one of the scheme of weak order 2, z, on the same path: either way the variance is O(h).  But differences between
levels have to be added up from the reference to h, where the error

    E phi(y_h) - E phi(y(T)) = E[phi(y_h) - (phi(z_h) + phi(z_h turned)) / 2] + (E phi(z_h) - E phi(y(T)))

takes **one** difference at the same h, plus the error of z, which its own levels give for little, since they have
antithetic paths.  The mean over both sides of z's coins halves the variance, because what a coin decides is as large as
the Lévy areas of y.  A scheme that tosses coins itself, but has no antithetic paths, is averaged over both sides
as well.

This needs a scheme that has the same limit as z: flows must be exact, and y must not be a scheme for the multiscale
system, which for eps > 0 has a limit of its own.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from spi.ensemble.increments import RandomStream
from spi.ensemble.loop import AS_TOSSED, COINS_TURNED, TimeGrid, grid
from spi.ensemble.protocol import exact_flows, flows_lacking
from spi.ensemble.random_states import RandomState
from spi.ensemble.scheme_protocol import needs_areas, tosses
from spi.exact.expectations import can_solve
from spi.kinds.blocks import BATCH_BYTES, DIFFERENCE, VALUE, LevelPlan, Sample, ns_of, values_at_end
from spi.kinds.plans import Done, KernelCall, PartCost, State
from spi.numerics.rng import DIFFERENCES, LANES
from spi.schemes import has_theory, typical_ns
from spi.schemes.splitting import has_antithetic_path
from spi.specs.checks import check_areas, need
from spi.specs.keys import wrong
from spi.statistics.estimators import GROUPS, ROUND, jackknife_stderr
from spi.statistics.intervals import student_factor, zero_share_bound
from spi.statistics.tallies import Batch
from spi.storage.records import Part

from .levels import (
    EQUAL,
    PILOT,
    PRODUCT,
    SHARES,
    Allocation,
    Combination,
    Errors,
    LevelSums,
    LevelTotals,
    control_of,
    expectations,
    levels_of,
)
from .plans import WeakPlan, sampled_errors, stderr_of
from .results import Differences, History, SampledFields, WeakErrors
from .solved import check_demands

# ---------------------------------------------------------------------------------------------------------------------
# Multilevel differences: E phi(y_h) - E phi(y_{h/2}) level by level (Giles, Operations Research 56, 2008), added up.
#
# Level j compares the steps 2^(j+1) h_ref and 2^j h_ref on common paths, with random numbers of its own; the last level
# is E phi at the largest step.  The error at step h is the sum of the differences of all levels below it.
#
# A scheme that tosses a coin for the order of its flows is symmetric up to this coin, and each path gets an
# **antithetic path**: within each coarse step that of the fine path makes all its flows in reversed order (the two
# increments exchanged, the coins turned), that of the coarse path turns its coin.  All four are paths of the scheme; in
# the difference of the two means the commutators, hence the Lévy areas, cancel to leading order, and the variance of a
# level falls from O(h) to O(h^2).  Schemes without antithetic paths are compared with one that has them where that is
# possible, see :class:`DifferencesPlan`.
#
# An asymptotic-preserving scheme has a **control**: its limit, the splitting scheme, on the same paths.  Where its
# expectations are known without sampling, Y - beta (Y_0 - E Y_0) is averaged in place of Y, with the beta of least
# variance.
#
# With extrapolation (multilevel Richardson-Romberg, Lemaire and Pagès, Bernoulli 23, 2017) the error at h is
# R(h) - R(h_ref), where R(h) = w_0 E phi(y_h) + w_1 E phi(y_{2h}) + ...: another sum over the same differences.
# ---------------------------------------------------------------------------------------------------------------------

_BASE_SHARE = 0.05  # of all work, for the largest step alone, which no difference needs
_LONGEST = 1e9  # seconds of work for a target, at most


@dataclass(frozen=True, kw_only=True)
class MultilevelPlan(LevelPlan, WeakPlan):
    """Weak errors of one scheme from differences between levels."""

    sums = LevelTotals
    LABEL, LOOK = "multilevel", ("D", "#D55E00")
    of_others: ClassVar[frozenset[str]] = frozenset(("prefixes",))

    levels: tuple[Sample, ...]
    control: tuple | None  #: the rows of its limit, if the scheme has one of which the expectations are known

    @classmethod
    def check(cls, case: Any) -> None:
        """Raise the error about a case without target and budget, with a reference scheme, or an unsolvable control."""
        need(case, "multilevel", "standard_error", "seconds")
        if case.reference_scheme:
            mistake = "has 'multilevel', which has references of its own, and reference_scheme is set"
            raise wrong(mistake, "use plain or leave out reference_scheme", "estimators")
        check_areas(case, case.reference_step, "reference_step")  # each level draws its own
        if can_solve(case.model) and not case.truncate_noise and not isinstance(case.initial, RandomState):
            check_demands(case, "multilevel", multiscale=True)

    @classmethod
    def of(cls, case: Any, part: Part) -> "MultilevelPlan":
        """Plan for one scheme of a case: by differences to the scheme of weak order 2 where that is possible."""
        return (DifferencesPlan if can_compare(case, part) else MultilevelPlan).by_levels(case, part)

    @classmethod
    def by_levels(cls, case: Any, part: Part) -> "MultilevelPlan":
        """Plan by differences between levels."""
        record = case.row(part.scheme, part.eps).record
        control = control_of(case, record)
        levels = levels_of(case, record, has_antithetic_path(record), record._replace(eps=0.0) if control else None)
        return cls(case=case, part=part, levels=levels, control=control)

    @property
    def seconds_per_block(self) -> np.ndarray:
        """(levels,) of one thread at typical speed."""
        ns = typical_ns(self.row, self.model)
        return np.array([1e-9 * ns * level.steps * LANES for level in self.levels])

    @property
    def combination(self) -> Combination:
        """Combination of the differences of levels into errors."""
        below = [round(np.log2(h / self.case.reference_step)) for h in self.case.steps]
        return Combination(self.extrapolation, np.array(below))

    def cost(self) -> PartCost:
        """Steps of paths, seconds of one thread at typical speed (NaN if there is no budget), and bytes of memory."""
        steps = np.array([level.steps * LANES for level in self.levels])
        round_of_all = self.seconds_per_block.sum()
        seconds = PILOT * round_of_all + self.case.seconds if self.case.seconds else np.nan
        target = self.case.standard_error is not None
        return PartCost(seconds * steps.sum() / round_of_all, seconds, int(BATCH_BYTES), at_most=target)

    def deciding(self, number: int | None) -> dict[str, Any]:
        """See :meth:`Plan.deciding`; a level is the same whatever is asked of the others."""
        entries = super().deciding(number)
        if number is None:
            return entries
        for key in ("standard_error", "seconds", "accuracy", "steps", "path_set"):
            entries.pop(key, None)
        return entries | {"part": self.part._replace(extrapolate=0), "level": self.name_of_level(number)}

    def name_of_level(self, number: int) -> list[Any]:
        """All that tells a level from the others of its scheme."""
        return ["largest step", max(self.case.steps)] if number == self.base else ["difference", number]

    def initial_extra(self) -> Allocation:
        """The pilot is wanted."""
        return Allocation.pilot(len(self.levels), len(self.case.functions), len(self.h), bool(self.control))

    @property
    def sets(self) -> tuple[Sample, ...]:
        """Levels."""
        return self.levels

    def wanted(self, extra: Allocation) -> np.ndarray:
        """(levels,) the samples that the current allocation wants."""
        return extra.targets * LANES

    def lengths(self, number: int) -> dict[str, int]:
        return {"quantity": 4 if self.control else 2, "function": len(self.case.functions)}

    def kernel_calls(self) -> list[KernelCall]:
        return self.calls_of_a_step(self.levels[0].grid, self.levels[0].stream)

    def observe(self, batch: Batch) -> dict[str, np.ndarray]:
        """Quantities of a batch of samples, with a control the product as well."""
        quantities = super().observe(batch)["sums"]
        lost = np.logical_not(np.isfinite(quantities[:, :PRODUCT]).all(axis=(1, 2)))
        if self.control:
            with np.errstate(invalid="ignore", over="ignore"):
                quantities = np.concatenate([quantities, quantities[:, :1] * quantities[:, 2:]], axis=1)
        return {"sums": quantities, "nonfinite": lost}

    def next_allocation(self, state: State) -> Allocation | None:
        """The next allocation; before the first the expectations of the control, where there is one."""
        extra = state.extra
        if self.control and np.isnan(extra.known).any():
            steps = self.case.reference_step * 2.0 ** np.arange(self.base, -1, -1)
            return extra.with_control(self.case, self.control, steps)
        levels = self.level_sums(state)
        if not extra.recorded:
            extra = extra.with_errors(self.errors(levels), levels.cpu_seconds.sum())
        if extra.allocations == len(SHARES):
            return extra if extra is not state.extra else None
        targets = np.maximum(levels.blocks, self.allocation(levels, SHARES[extra.allocations]))
        return extra._replace(targets=targets, allocations=extra.allocations + 1)

    def level_sums(self, state: State) -> LevelSums:
        """Sums of all levels, over the paths that are computed."""
        totals = [state.so_far(j) for j in range(len(self.levels))]
        cpu_seconds = np.array([level.cpu_seconds for level in totals])
        cpu_seconds[-1] += state.extra.cpu_seconds
        return LevelSums(
            blocks=np.array([level.paths // LANES for level in totals]),
            sums=np.array([level.sums for level in totals]),
            nonfinite=np.array([level.nonfinite for level in totals]),
            cpu_seconds=cpu_seconds,
            control=state.extra.known,
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
        """Number of the level that has the largest step alone."""
        return len(self.levels) - 1

    def least_work(self, variance: np.ndarray, cost: np.ndarray) -> tuple[float, np.ndarray]:
        """R, and n (levels,), of levels with such a variance and cost of a sample.

        The least work by which all errors have the variance s^2 is R^2 / s^2, and takes (work / R) n samples of each
        level but that of the largest step alone: N_l proportional to (V_l / C_l)^(1/2).  V_l is the variance times the
        square of the weight of the level in the error at the largest step.
        """
        shares = self.completed(self.combination.shares().T)[:, 0]
        variance = variance * np.append(shares**2, 1.0)
        return float(np.sqrt(variance * cost)[: self.base].sum()), np.sqrt(variance / cost)

    def allocation(self, levels: LevelSums, share: float) -> np.ndarray:
        """Blocks of each level, a multiple of ROUND, as :meth:`least_work` shares out the work.

        As many as `share` of the budget allows, or `share` of what the target asks for, if that is less.  The variance
        is the largest over the test functions; a level whose values are not finite gets no more.
        """
        with np.errstate(invalid="ignore"):
            variance = np.maximum(levels.moments().variance, self.least_variance(levels)).max(axis=1)
            variance = np.nan_to_num(variance, nan=0.0, posinf=0.0)
        cost = self.seconds_per_block / LANES
        root, per_root = self.least_work(variance, cost)
        samples = np.zeros(len(self.levels))
        if root > 0 and self.is_random:  # else one path is all, whatever rounding says
            budget, target = self.case.seconds or np.inf, self.case.standard_error
            floor = max(target**2, root**2 / _LONGEST, 1e-300) if target else 0.0
            work = share * min(budget * (1.0 - _BASE_SHARE), root**2 / floor if target else np.inf)
            samples = work / root * per_root
            samples[self.base] = work * _BASE_SHARE / cost[self.base]
        return np.ceil(samples / (ROUND * LANES)).astype(np.int64) * ROUND

    def errors(self, levels: LevelSums) -> Errors:
        """Errors, sums of the differences of the levels."""
        mean, without = levels.averages()
        combine = self.combination.errors
        each = np.eye(self.base)[..., np.newaxis]  # to find the weight of each level in each error
        shares = np.abs(self.completed(combine(each)))[:, 0]
        lacking = shares[:, np.newaxis] * self.unseen_levels(levels)[:-1, :, np.newaxis]
        unseen = np.where(shares[:, np.newaxis] > 0, lacking, 0.0).sum(axis=0)
        return Errors(self.completed(combine(mean[:-1])), self.completed(combine(without[:, :-1])), EQUAL, unseen)

    def unseen_levels(self, levels: LevelSums) -> np.ndarray:
        """(levels, F) the unseen part of the mean of each level, see :meth:`WeakPlan.unseen`."""
        mean, without = levels.averages()
        return self.unseen(mean, jackknife_stderr(mean, without, EQUAL), levels.samples[:, np.newaxis])

    def least_variance(self, levels: LevelSums) -> np.ndarray:
        """(levels, F) the variance of a level whose unseen part is as large as it may be."""
        return np.nan_to_num(self.unseen_levels(levels) ** 2 / zero_share_bound(levels.samples[:, np.newaxis]))

    def results(self, state: State) -> WeakErrors:
        return self.results_of(self.level_sums(state), state)

    def results_of(self, levels: LevelSums, state: State) -> WeakErrors:
        """Results from the sums over these levels, which may be fewer than the state has."""
        steps = sum(level.steps * int(n) * LANES for level, n in zip(self.levels, levels.blocks, strict=True))
        errors, extra = self.errors(levels), state.extra
        fields, sampled = sampled_errors(self, *errors)
        expectation, of_expectation = expectations(self, levels)
        samples, cpu_seconds = int(levels.samples.sum()), float(levels.cpu_seconds.sum())
        estimated = fields | {
            "expectation": expectation,
            "sampled": SampledFields(
                **sampled, **of_expectation, samples=samples, ns_per_step=ns_of(cpu_seconds, steps)
            ),
            "levels": levels.table(self.coarse, has_antithetic_path(self.scheme), extra.control_bound),
            "history": History(
                allocations=np.arange(1, len(SHARES) + 1),
                error=extra.history_error,
                error_stderr=extra.history_error_stderr,
                cpu_seconds=extra.history_cpu_seconds,
            ),
            "cpu_seconds": cpu_seconds,
            "accuracy": self.case.accuracy if self.control else None,
        }
        return WeakErrors(**(self.whole(state) | estimated))

    @property
    def coarse(self) -> np.ndarray:
        """(levels - 1,) the coarse steps of the differences."""
        return self.case.reference_step * 2.0 ** np.arange(1, self.base + 1)


#: The scheme of weak order 2.
ORDER_2 = "splitting_order2"

_BOTH_SIDES = (AS_TOSSED, COINS_TURNED)


def can_compare(case: Any, part: Part) -> bool:
    """Whether the errors of a scheme are estimated by differences to the scheme of weak order 2."""
    row = case.row(part.scheme, part.eps)
    same_limit = exact_flows(case.model) and has_theory(row, case.model) and not row.multiscale
    if flows_lacking(case.model):  # there is no such scheme
        return False
    steep = has_antithetic_path(row.record) or needs_areas(row.record)  # the variances of its levels fall like h^2
    return same_limit and not steep and not part.extrapolate


@dataclass(frozen=True, kw_only=True)
class DifferencesPlan(MultilevelPlan):
    """Weak errors of one scheme from differences to the scheme of weak order 2, and from levels of that scheme.

    The levels are those of `order2`, and behind them the differences, from the largest step to the smallest.
    """

    order2: MultilevelPlan  #: of the scheme of weak order 2

    @classmethod
    def by_levels(cls, case: Any, part: Part) -> "DifferencesPlan":
        """Plan by one difference at each step, and levels of the scheme of weak order 2."""
        order2 = MultilevelPlan.by_levels(case, Part(ORDER_2, part.estimator))
        sides = len(_sides(case.row(part.scheme, part.eps).record))
        levels = *order2.levels, *(_difference(case, h, sides) for h in case.steps)
        return cls(case=case, part=part, levels=levels, control=None, order2=order2)

    @property
    def base(self) -> int:
        """Number of the level that has the largest step alone."""
        return self.order2.base

    @property
    def seconds_per_block(self) -> np.ndarray:
        """(levels,) of one thread at typical speed."""
        paths = np.array([len(_BOTH_SIDES), len(_sides(self.scheme))])
        ns = paths @ [typical_ns(self.order2.row, self.model), typical_ns(self.row, self.model)] / paths.sum()
        steps = np.array([level.steps for level in self.levels[self.base + 1 :]])
        return np.append(self.order2.seconds_per_block, 1e-9 * LANES * ns * steps)

    def deciding(self, number: int | None) -> dict[str, Any]:
        """As for other multilevel plans; the levels are those of the scheme of weak order 2, whoever needs them."""
        return super().deciding(number) if number is None or number > self.base else self.order2.deciding(number)

    def name_of_level(self, number: int) -> list[Any]:
        """Step of a difference."""
        return ["of schemes", self.case.steps[number - self.base - 1]]

    def kernel_calls(self) -> list[KernelCall]:
        """Kernels of all schemes."""
        own = self.calls_of_a_step(self._own_paths(self.base + 1), self.levels[-1].stream)
        return [*self.order2.kernel_calls(), *own]

    def values(self, batch: Batch) -> np.ndarray:
        """Values of the test functions at the end of a batch of one level."""
        if batch.path_set <= self.base:
            return self.order2.values(batch)
        level = self.levels[batch.path_set]
        grids = (self.order2, level.grid), (self, self._own_paths(batch.path_set))
        values = [values_at_end(p, times, level.stream, batch)[0] for p, times in grids]
        return np.concatenate(values, axis=1)

    def least_work(self, variance: np.ndarray, cost: np.ndarray) -> tuple[float, np.ndarray]:
        """As :meth:`MultilevelPlan.least_work`, where all differences get the same standard error.

        With A = sum V C over the differences and B = sum (V C)^(1/2) over the levels the error of each step size has
        the variance v + w, where v = V_h / N_h is that of its difference and w that of all levels.  The work
        A / v + B^2 / w is least for v : w = A^(1/2) : B.
        """
        levels, differences = slice(self.base + 1), slice(self.base + 1, None)
        root, per_root = self.order2.least_work(variance[levels], cost[levels])
        of_differences = np.sqrt((variance * cost)[differences].sum())
        if not of_differences > 0:
            return root, np.append(per_root, np.zeros(len(self.case.steps)))
        return root + float(of_differences), np.append(per_root, variance[differences] / of_differences)

    def errors(self, levels: LevelSums) -> Errors:
        """Errors of the scheme of weak order 2, with the differences added."""
        own, differences = self._divided(levels)
        base, (mean, without) = self.order2.errors(own), differences.averages()
        unseen = base.unseen + self.unseen_levels(differences).T
        return Errors(base.error + mean.T, base.without + np.moveaxis(without, 1, 2), base.counts, unseen)

    def _divided(self, levels: LevelSums) -> tuple[LevelSums, LevelSums]:
        """Levels of the scheme of weak order 2, and the differences."""
        return levels.only(slice(self.base + 1)), levels.only(slice(self.base + 1, None))

    def results(self, state: State) -> WeakErrors:
        """Results of one scheme of a case, from its final state; its levels are those of the other scheme."""
        levels = self.level_sums(state)
        own, differences = self._divided(levels)
        order2, table = self.order2.results_of(own, state), self._table(own, differences)
        stderr = np.sqrt(table.variance / table.samples)
        unseen = self.unseen_levels(differences) / student_factor(GROUPS)
        fields, sampled = sampled_errors(self, *self.errors(levels))
        of_order2: Any = order2.sampled
        steps, cpu_seconds = np.array([level.steps for level in self.levels]), float(levels.cpu_seconds.sum())
        sampled |= {
            "expectation_stderr": np.hypot(np.hypot(of_order2.expectation_stderr, stderr), unseen.T),
            **{name: getattr(of_order2, name) for name in ("reference", "sd")},
            "samples": int(levels.samples.sum()),
            "ns_per_step": ns_of(cpu_seconds, float(steps @ levels.samples)),
        }
        estimated = fields | {
            "expectation": order2.expectation + table.mean,
            "sampled": SampledFields(**sampled),
            **{name: getattr(order2, name) for name in ("levels", "history")},
            "differences": table,
            "cpu_seconds": cpu_seconds,
        }
        return WeakErrors(**(self.whole(state) | estimated))

    def _table(self, own: LevelSums, differences: LevelSums) -> Differences:
        """Differences at each step."""
        moments = differences.moments()
        return Differences(
            scheme=ORDER_2,
            mean=moments.mean.T,
            variance=moments.variance.T,
            kurtosis=moments.kurtosis.T,
            consistency=self._consistency(own, differences),
            samples=differences.samples,
            nonfinite=differences.nonfinite,
            seconds=differences.cpu_seconds / differences.samples,
            variance_rate=differences.variance_rates(self.h),
        )

    def _consistency(self, own: LevelSums, differences: LevelSums) -> np.ndarray:
        """|a - b| / (3 (sd a + sd b)), above 1 with probability 0.3 % at most, (F, S).

        a and b are the means of phi(z) at a step on the paths of its difference and on those of the levels of z.
        """
        level = self.combination.below
        quantity = np.where(level == self.base, DIFFERENCE, VALUE)  # of the last level, which has one step, the mean
        on_levels = np.swapaxes(own.means_of_powers()[quantity, :2, level], 0, 1), own.samples[level]
        on_differences = differences.means_of_powers()[VALUE][:2], differences.samples
        with np.errstate(invalid="ignore", divide="ignore"):
            (b, sd_b), (a, sd_a) = (
                (mean, np.sqrt(np.maximum(square - mean**2, 0.0) / n.reshape(-1, 1)))
                for (mean, square), n in (on_levels, on_differences)
            )
            return (np.abs(a - b) / (3.0 * (sd_b + sd_a))).T

    def _own_paths(self, number: int) -> TimeGrid:
        """Grid of the paths of the scheme itself in a difference."""
        times, sides = self.levels[number].grid, _sides(self.scheme)
        words: dict[str, Any] = {"doublings": [0] * len(sides), "reversals": sides}
        return grid(times.reference_step, times.reference_steps, truncate=self.case.clipping, **words)


def _difference(case: Any, h: float, sides: int) -> Sample:
    """Difference at one step: both sides of the scheme of weak order 2, and `sides` of the scheme itself.

    The first of the two quantities is the difference, the second the mean of phi at the scheme of weak order 2.
    """
    steps, doublings = round(case.final_time / h), round(np.log2(h / case.reference_step))
    times = grid(h, steps, (0, 0), truncate=case.clipping, reversals=_BOTH_SIDES)
    weights = np.array([[-0.5, -0.5, *[1.0 / sides] * sides], [0.5, 0.5, *[0.0] * sides]])
    stream = RandomStream(np.uint64(case.seed), np.uint64(DIFFERENCES + 2 * doublings))
    return Sample(times, stream, weights, steps * weights.shape[1])


def _sides(record: Any) -> tuple[int, ...]:
    """Reversals of the paths of a scheme: coins as tossed, and turned if there are any."""
    return _BOTH_SIDES if tosses(record) else _BOTH_SIDES[:1]
