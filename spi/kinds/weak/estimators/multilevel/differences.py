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
from typing import Any

import numpy as np

from spi.ensemble.inexact import flows_lacking
from spi.ensemble.loop import AS_TOSSED, COINS_TURNED, Grid, grid
from spi.ensemble.protocol import exact_flows
from spi.ensemble.scheme_protocol import needs_areas, tosses
from spi.ensemble.streams import RandomStream
from spi.kinds.plans import KernelCall, State
from spi.numerics.rng import DIFFERENCES, LANES
from spi.schemes import has_theory, typical_ns
from spi.schemes.splitting import has_antithetic_path
from spi.storage.records import Part

from ...results import Differences, Sampled, WeakErrors
from ...study.plans import sampled_errors
from ...study.sums import values_of_blocks
from .decisions import Errors
from .levels import DIFFERENCE, VALUE, Level
from .plans import MultilevelPlan, Rows
from .sums import LevelSums

#: The scheme of weak order 2.
ORDER_2 = "splitting_order2"

_BOTH_SIDES = (AS_TOSSED, COINS_TURNED)


def can_compare(case: Any, part: Part) -> bool:
    """Whether the errors of a scheme are found by differences to the scheme of weak order 2."""
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
    def of(cls, case: Any, part: Part) -> "DifferencesPlan":
        """The plan for one scheme of a case."""
        order2 = MultilevelPlan.of(case, Part(ORDER_2, part.estimator))
        sides = _sides(case.row(part.scheme, part.eps).record)
        levels = *order2.levels, *(_difference(case, h, len(sides)) for h in case.steps)
        return cls(case=case, part=part, levels=levels, control=None, order2=order2)

    @property
    def base(self) -> int:
        """The number of the level that has the largest step alone."""
        return self.order2.base

    @property
    def seconds_per_block(self) -> np.ndarray:
        """(levels,) of one thread at typical speed."""
        ns = np.array([typical_ns(self.order2.row, self.model), typical_ns(self.row, self.model)])
        paths = np.array([len(_BOTH_SIDES), len(_sides(self.scheme))])
        steps = np.array([level.steps for level in self.levels[self.base + 1 :]])
        return np.append(self.order2.seconds_per_block, 1e-9 * LANES * (ns @ paths) / paths.sum() * steps)

    def kernel_calls(self) -> list[KernelCall]:
        """Those of both schemes."""
        difference = self.levels[-1]
        return [*self.order2.kernel_calls(), *self.calls_of_a_step(self._with_sides(difference), difference.stream)]

    def rows(self, number: int, first: int, blocks: int, end: int) -> Rows:
        """The values of the test functions at the end of some blocks of one level."""
        if number <= self.base:
            return self.order2.rows(number, first, blocks, end)
        level = self.levels[number]
        grids = (self.order2, level.grid), (self, self._with_sides(level))
        values = [values_of_blocks(p, times, level.stream, first, blocks, end)[0] for p, times in grids]
        return Rows(np.concatenate(values, axis=1), level.weights)

    def least_work(self, variance: np.ndarray, cost: np.ndarray) -> tuple[float, np.ndarray]:
        """As :meth:`MultilevelPlan.least_work`, where all differences get the same standard error.

        With A = sum V C over the differences and B = sum (V C)^(1/2) over the levels the error of each step size has
        the variance v + w, where v = V_h / N_h is that of its difference and w that of all levels.  The work
        A / v + B^2 / w is least for v : w = A^(1/2) : B.
        """
        levels, differences = slice(self.base + 1), slice(self.base + 1, None)
        root, per_root = self.order2.least_work(variance[levels], cost[levels])
        of_differences = np.sqrt((variance * cost)[differences].sum())
        share = variance[differences] / of_differences if of_differences > 0 else np.zeros(len(self.case.steps))
        return root + float(of_differences), np.append(per_root, share)

    def errors(self, levels: LevelSums) -> Errors:
        """Those of the scheme of weak order 2, with the differences added."""
        own, differences = self._divided(levels)
        base, (mean, without) = self.order2.errors(own), differences.averages()
        return Errors(base.error + mean.T, base.without + np.moveaxis(without, 1, 2), base.counts)

    def _divided(self, levels: LevelSums) -> tuple[LevelSums, LevelSums]:
        """The levels of the scheme of weak order 2, and the differences."""
        return levels.only(slice(self.base + 1)), levels.only(slice(self.base + 1, None))

    def results(self, state: State) -> WeakErrors:
        """The results of one scheme of a case, from its final state; its levels are those of the other scheme."""
        levels = self.level_sums(state)
        own, differences = self._divided(levels)
        order2, moments = self.order2.results_of(own, state), differences.moments()
        fields, sampled = sampled_errors(self.h, *self.errors(levels))
        of_order2: Any = order2.sampled
        steps, cpu_seconds = np.array([level.steps for level in self.levels]), float(levels.cpu_seconds.sum())
        sampled |= {
            "expectation_stderr": np.hypot(of_order2.expectation_stderr, moments.stderr.T),
            **{name: getattr(of_order2, name) for name in ("reference", "sd")},
            "samples": int(levels.samples.sum()),
            "ns_per_step": 1e9 * float(cpu_seconds / (steps @ levels.samples)),
        }
        return self.weak_errors(
            state.seconds,
            **fields,
            expectation=order2.expectation + moments.mean.T,
            sampled=Sampled(**sampled),
            **{name: getattr(order2, name) for name in ("levels", "history")},
            differences=Differences(
                scheme=ORDER_2,
                mean=moments.mean.T,
                variance=moments.variance.T,
                kurtosis=moments.kurtosis.T,
                consistency=self._consistency(own, differences),
                samples=differences.samples,
                nonfinite=differences.nonfinite,
                seconds=differences.cpu_seconds / differences.samples,
                variance_rate=differences.variance_rates(self.h),
            ),
            cpu_seconds=cpu_seconds,
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

    def _with_sides(self, level: Level) -> Grid:
        """The grid of the paths of the scheme itself, at the step of a difference."""
        sides, times = _sides(self.scheme), level.grid
        doublings = [0] * len(sides)
        return grid(times.reference_step, times.reference_steps, doublings, truncate=times.truncate, reversals=sides)


def _difference(case: Any, h: float, sides: int) -> Level:
    """The difference at one step: both sides of the scheme of weak order 2, and `sides` of the scheme itself.

    The first of the two quantities is the difference, the second the mean of phi at the scheme of weak order 2.
    """
    steps, doublings = round(case.final_time / h), round(np.log2(h / case.reference_step))
    times = grid(h, steps, (0, 0), truncate=case.truncate_noise, reversals=_BOTH_SIDES)
    weights = [[-0.5, -0.5, *[1.0 / sides] * sides], [0.5, 0.5, *[0.0] * sides]]
    stream = RandomStream(np.uint64(case.seed), np.uint64(DIFFERENCES + 2 * doublings))
    return Level(times, stream, np.array(weights), steps * (2 + sides))


def _sides(record: Any) -> tuple[int, ...]:
    """What the paths of a scheme do with its coins: as tossed, and turned if there are any."""
    return _BOTH_SIDES if tosses(record) else _BOTH_SIDES[:1]
