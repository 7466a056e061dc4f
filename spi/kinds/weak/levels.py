"""Sums of a multilevel estimator over the samples of its levels, and their moments, Giles' table and rates."""

import time
from typing import Any, NamedTuple

import numpy as np

from spi.ensemble.areas import fourier_terms
from spi.ensemble.increments import RandomStream
from spi.ensemble.loop import AS_TOSSED, COINS_TURNED, grid
from spi.ensemble.random_states import RandomState
from spi.exact.expectations import can_solve
from spi.kinds.blocks import DIFFERENCE, POWERS, VALUE, Sample, two_steps
from spi.numerics.rng import LANES, LEVELS
from spi.schemes.asymptotic import AsymptoticPreserving
from spi.statistics.accumulators import Array, Sums, counted, moments
from spi.statistics.estimators import (
    GROUPS,
    PARTS,
    ROUND,
    Extrapolation,
    fit_order,
    group_counts,
    kurtosis,
    mean_over_paths,
    standard_deviation,
)
from spi.statistics.intervals import student_factor
from spi.storage.records import Order

from .plans import stderr_of
from .results import LevelEstimates as LevelTable
from .solved import solution

# ---------------------------------------------------------------------------------------------------------------------
# The paths of a multilevel estimator: the steps, reversals and schemes of a sample of each level.
# ---------------------------------------------------------------------------------------------------------------------

#: Further quantities of a level with a control: the difference of the control, and the product of the two.  The last
#: level, which has one step size only, has phi with the antithetic path, phi without it, and phi of the control.
CONTROL, PRODUCT = 2, 3


def levels_of(case: Any, scheme: Any, antithetic: bool, limit: tuple | None) -> tuple[Sample, ...]:
    """Level j compares the steps 2^(j+1) h_ref and 2^j h_ref, the last one has the largest step alone.

    `scheme` is the record of the scheme, `antithetic` says whether paths are antithetic, and `limit` is the record
    of the scheme that is the control, None without control.
    """
    count = round(np.log2(max(case.steps) / case.reference_step))
    differences = [_level(case, scheme, j, limit, *_two_steps(antithetic, limit)) for j in range(count)]
    last = _level(case, scheme, count, limit, *_one_step(antithetic, limit))
    return *differences, last


def _two_steps(antithetic: bool, limit: tuple | None) -> tuple[dict[str, Any], list[list[float]]]:
    """Paths of a level, as words of :func:`spi.ensemble.loop.grid`, and their weights."""
    if limit is not None:
        shape: dict[str, Any] = {"doublings": (1, 1, 0, 0), "by_reference": (0, 1, 0, 1)}
        return shape, [[-1.0, 0.0, 1.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, -1.0, 0.0, 1.0]]
    shape, difference = two_steps(antithetic)
    return shape, [difference, [max(weight, 0.0) for weight in difference]]


def _one_step(antithetic: bool, limit: tuple | None) -> tuple[dict[str, Any], list[list[float]]]:
    """Paths of the last level, as words of :func:`spi.ensemble.loop.grid`, and their weights."""
    if antithetic:
        return {"doublings": (0, 0), "reversals": (AS_TOSSED, COINS_TURNED)}, [[0.5, 0.5], [1.0, 0.0]]
    if limit is not None:
        return {"doublings": (0, 0), "by_reference": (0, 1)}, [[1.0, 0.0], [1.0, 0.0], [0.0, 1.0]]
    return {"doublings": (0,)}, [[1.0], [1.0]]


def _level(
    case: Any, scheme: Any, j: int, limit: tuple | None, shape: dict[str, Any], weights: list[list[float]]
) -> Sample:
    h = case.reference_step * 2.0**j
    steps = round(case.final_time / h)
    terms = fourier_terms(case.model, [scheme], h, areas=case.areas)
    times = grid(h, steps, truncate=case.clipping, reference_scheme=limit, area_terms=terms, **shape)
    stream = RandomStream(np.uint64(case.seed), np.uint64(LEVELS + 2 * j))
    return Sample.of(times, stream, weights)


# ---------------------------------------------------------------------------------------------------------------------
# The decisions of a multilevel estimator: the samples of each level, and the errors after earlier allocations.
# ---------------------------------------------------------------------------------------------------------------------

PILOT = 2 * ROUND  #: blocks of each level before the first allocation
SHARES = (1 / 16, 1 / 4, 1.0, 1.0)  #: of the budget, or of 1/target^2, one for each allocation


class Errors(NamedTuple):
    """Errors and their leave-one-out values, in which each level lacks a group."""

    error: np.ndarray  #: (F, S)
    without: np.ndarray  #: (GROUPS, F, S)
    counts: np.ndarray  #: (GROUPS,) proportional to the paths of each group
    unseen: np.ndarray  #: (F, S) their unseen part, half the width of an interval


class Allocation(NamedTuple):
    """Results besides sums over paths, of F test functions at S step sizes."""

    seconds: float  #: wall clock
    cpu_seconds: float
    allocations: int  #: number of allocations made
    targets: np.ndarray  #: (levels,) blocks that the current allocation wants
    known: np.ndarray  #: (levels, F) expectations of the control, NaN until they are
    control_bound: float  #: the largest estimate of their numerical error
    history_error: np.ndarray  #: (allocations, F, S) when each allocation was fulfilled
    history_error_stderr: np.ndarray  #: (allocations, F, S)
    history_cpu_seconds: np.ndarray  #: (allocations,)

    @classmethod
    def pilot(cls, levels: int, functions: int, steps: int, control: bool) -> "Allocation":
        """The pilot is wanted, and the expectations of the control, if there is one, are not computed."""
        return cls(
            seconds=0.0,
            cpu_seconds=0.0,
            allocations=0,
            targets=np.full(levels, PILOT),
            known=np.full((levels, functions), np.nan if control else 0.0),
            control_bound=0.0,
            history_error=np.zeros((len(SHARES), functions, steps)),
            history_error_stderr=np.zeros((len(SHARES), functions, steps)),
            history_cpu_seconds=np.zeros(len(SHARES)),
        )

    @property
    def recorded(self) -> bool:
        """Whether the errors of the current allocation, if there is one, are in the history."""
        return not self.allocations or bool(self.history_cpu_seconds[self.allocations - 1])

    def with_errors(self, errors: Errors, cpu_seconds: float) -> "Allocation":
        """These with the errors of the current allocation, which has been fulfilled."""
        error, stderr, seconds = (
            values.copy() for values in (self.history_error, self.history_error_stderr, self.history_cpu_seconds)
        )
        i = self.allocations - 1
        error[i], stderr[i], seconds[i] = errors.error, stderr_of(*errors), cpu_seconds
        return self._replace(history_error=error, history_error_stderr=stderr, history_cpu_seconds=seconds)

    def with_control(self, case: Any, control: tuple, steps: np.ndarray) -> "Allocation":
        """These with the expectations of the control, rows of flows, at steps from the largest to that of reference."""
        began, cpu_began = time.perf_counter(), time.process_time()
        exact, _ = solution(case, control, steps)
        differences = (exact.weak_error[:, 1:] - exact.weak_error[:, :-1]).T[::-1]
        return self._replace(
            seconds=self.seconds + time.perf_counter() - began,
            cpu_seconds=self.cpu_seconds + time.process_time() - cpu_began,
            known=np.concatenate([differences, exact.value[:, :1].T]),
            control_bound=float(exact.weak_error_bound.max()),
        )


def control_of(case: Any, record: Any) -> tuple | None:
    """Rows of the limit, a splitting scheme, if the scheme has a limit whose expectations can be solved for."""
    solvable = can_solve(case.model) and not case.truncate_noise and not isinstance(case.initial, RandomState)
    return record.stages if solvable and isinstance(record, AsymptoticPreserving) else None


EQUAL = np.full(GROUPS, PARTS)  #: all groups of a level are equally large, so any equal counts will do

_CLEAR = 4.0  # standard errors from which on a mean difference counts for the rate of means


class LevelTotals(Sums):
    """Sums over some samples of one level, each of which is all paths of the level, for F test functions."""

    sums: Array = moments("quantity function", POWERS)  #: the quantities as in :data:`DIFFERENCE` and so on
    nonfinite: Array = counted()


class LevelMoments(NamedTuple):
    """Moments of each level, all (levels, F)."""

    mean: np.ndarray  #: of Y, with a control of Y - beta (Y_0 - E Y_0)
    stderr: np.ndarray  #: of that mean
    variance: np.ndarray  #: of a sample of the same
    kurtosis: np.ndarray  #: of the difference Y itself, at the last level of the value


class LevelSums(NamedTuple):
    """Totals of several levels."""

    blocks: np.ndarray  #: (levels,)
    sums: np.ndarray  #: (levels, powers, quantities, F, GROUPS)
    nonfinite: np.ndarray  #: (levels,)
    cpu_seconds: np.ndarray  #: (levels,), that of the control in the last one
    control: np.ndarray  #: (levels, F) its expectations

    def only(self, levels: slice) -> "LevelSums":
        """Totals of some levels."""
        return LevelSums(*(values[levels] for values in self))

    @property
    def samples(self) -> np.ndarray:
        """(levels,) samples done."""
        return self.blocks * LANES

    @property
    def controlled(self) -> bool:
        """Whether there is a control."""
        return self.sums.shape[2] > CONTROL

    def means_of_powers(self) -> np.ndarray:
        """Means of the powers of each quantity, (quantities, powers, levels, F)."""
        return (self.sums.sum(axis=-1) / self.samples.reshape(-1, 1, 1, 1)).transpose(2, 1, 0, 3)

    def beta(self) -> np.ndarray:
        """cov(Y, Y_0) / var(Y_0), (levels, F); 0 without control."""
        if not self.controlled:
            return np.zeros((len(self.blocks), self.sums.shape[3]))
        y, y0, product = self.means_of_powers()[[DIFFERENCE, CONTROL, PRODUCT]]
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.nan_to_num((product[0] - y[0] * y0[0]) / (y0[1] - y0[0] ** 2))

    def averages(self) -> tuple[np.ndarray, np.ndarray]:
        """The means of :class:`LevelMoments`, (levels, F), and their leave-one-out values (groups, levels, F)."""
        beta, means, withouts = self.beta(), [], []
        for j, (sums, blocks) in enumerate(zip(self.sums, self.blocks, strict=True)):
            mean, without = mean_over_paths(sums[0, DIFFERENCE], _counts(blocks))
            if self.controlled:
                of_control, control_without = mean_over_paths(sums[0, CONTROL], _counts(blocks))
                mean = mean - beta[j] * (of_control - self.control[j])
                without = without - beta[j] * (control_without - self.control[j])
            means.append(mean)
            withouts.append(without)
        return np.array(means), np.stack(withouts, axis=1)

    def moments(self) -> LevelMoments:
        """Moments of each level."""
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            powers = self.means_of_powers()
            m1, m2 = powers[DIFFERENCE][:2]
            variance = np.maximum(m2 - m1 * m1, 0.0)
            tails = kurtosis(powers[DIFFERENCE], variance)
            if self.controlled:
                covariance = powers[PRODUCT][0] - m1 * powers[CONTROL][0]
                variance = np.maximum(variance - self.beta() * covariance, 0.0)
            return LevelMoments(self.averages()[0], np.sqrt(variance / self.samples.reshape(-1, 1)), variance, tails)

    def consistency(self) -> np.ndarray:
        """Giles' check |a - b + d| / (3 (sd a + sd b + sd d)), above 1 with probability 0.3 %, (levels - 1, F).

        b is the mean at the fine step of a level, d = b - a the mean difference, and a the mean at the coarse step from
        the level above.
        """
        moments = self.moments()
        with np.errstate(invalid="ignore", divide="ignore"):
            fine, square = self.means_of_powers()[VALUE][:2]
            sd_fine = np.sqrt(np.maximum(square - fine**2, 0.0) / self.samples.reshape(-1, 1))
            off = fine[1:] - fine[:-1] + moments.mean[:-1]
            return np.abs(off) / (3.0 * (sd_fine[1:] + sd_fine[:-1] + moments.stderr[:-1]))

    def variance_rates(self, h: np.ndarray) -> tuple[Order, ...]:
        """Rates p in V = O(h^p), with their intervals, of the variances of levels at the steps h."""
        rates = []
        for f, beta in enumerate(self.beta().T):
            each = [mean_over_paths(s[:2, :, f], _counts(n)) for s, n in zip(self.sums, self.blocks, strict=True)]
            value = np.array([_variance(mean, b) for (mean, _), b in zip(each, beta, strict=True)])
            withouts = [_variance(np.moveaxis(without, 0, -1), b) for (_, without), b in zip(each, beta, strict=True)]
            rates.append(fit_order(h, value, np.array(withouts).T, EQUAL, value > 0))
        return tuple(rates)

    def table(self, h: np.ndarray, antithetic: bool, control_bound: float) -> LevelTable:
        """Giles' table of the levels that are differences, and the rates of means and variances in the steps h."""
        differences, moments = self.only(slice(-1)), self.moments()
        mean, without = differences.averages()
        clear = (np.abs(mean) > _CLEAR * moments.stderr[:-1]).T
        per_sample = differences.cpu_seconds / differences.samples
        each = zip(np.abs(mean).T, np.abs(without).transpose(2, 0, 1), clear, strict=True)
        return LevelTable(
            h=h,
            mean=0.0 - mean.T,  # of the coarse step minus the fine one
            variance=moments.variance[:-1].T,
            kurtosis=moments.kurtosis[:-1].T,
            consistency=self.consistency().T,
            samples=differences.samples,
            nonfinite=differences.nonfinite,
            seconds=per_sample,
            mean_rate=tuple(fit_order(h, value, left_out, EQUAL, used) for value, left_out, used in each),
            variance_rate=differences.variance_rates(h),
            cost_rate=float(-np.polyfit(np.log(h), np.log(per_sample), 1)[0]) if len(h) > 1 else float("nan"),
            antithetic=antithetic,
            control="the limit without sampling" if self.controlled else "",
            control_bound=control_bound,
        )


def _counts(blocks: int) -> np.ndarray:
    return group_counts(int(blocks) * LANES)


def _variance(m: np.ndarray, beta: np.ndarray) -> np.ndarray:
    """The variance of Y - beta Y_0 from means of powers (2, quantities, ...)."""
    variance = m[1, DIFFERENCE] - m[0, DIFFERENCE] ** 2
    if m.shape[1] <= CONTROL:
        return variance
    covariance = m[0, PRODUCT] - m[0, DIFFERENCE] * m[0, CONTROL]
    return variance - 2 * beta * covariance + beta**2 * (m[1, CONTROL] - m[0, CONTROL] ** 2)


# ---------------------------------------------------------------------------------------------------------------------
# Errors, extrapolated or not, and expectations from the levels of a multilevel estimator.
# ---------------------------------------------------------------------------------------------------------------------


class Combination(NamedTuple):
    """Errors at S steps as sums of the differences of levels.

    With d_l = E phi at 2^l h_ref minus E phi at 2^(l+1) h_ref the error of the step 2^k h_ref, measured against h_ref,
    is -(d_0 + ... + d_(k-1)).  An extrapolated error is R(h) - R(h_ref), R(h) = sum_i w_i E phi(y_{2^i h}), hence
    another sum of the same differences.
    """

    extrapolation: Extrapolation
    below: np.ndarray  #: for each step of the case the number of levels between it and the reference step

    def errors(self, differences: np.ndarray) -> np.ndarray:
        """Errors (..., F, S) against the reference from the differences (..., levels, F) of the levels."""
        sums = np.moveaxis(np.cumsum(0.0 - differences, axis=-2), -2, -1)  # of the steps 2 h_ref, 4 h_ref, ...
        count, weights = self.extrapolation.levels, self.extrapolation.weights
        errors = self.extrapolation.combined(sums[..., self.below - 1])
        return errors - (sums[..., :count] * weights[1:]).sum(axis=-1, keepdims=True) if count else errors

    def shares(self) -> np.ndarray:
        """(S, levels) the weights of the differences in the error at each step; 1 or 0 without extrapolation."""
        level = np.arange(self.below.max())
        return self.extrapolation.combined((level[:, np.newaxis] < self.below) * 1.0).T - self._of_reference()

    def shares_above(self) -> tuple[np.ndarray, np.ndarray]:
        """Shares of the differences in E phi at the largest step less R(h_ref), (levels,), or R(h), (S, levels)."""
        whole = 1.0 - self._of_reference()
        return whole, whole - self.shares()

    def _of_reference(self) -> np.ndarray:
        """(levels,) the weights of the differences in R(h_ref) - E phi(y_{h_ref})."""
        return np.array([self.extrapolation.weights[level + 1 :].sum() for level in range(self.below.max())])


def expectations(p: Any, levels: LevelSums) -> tuple[np.ndarray, dict[str, Any]]:
    """E phi at all steps: at the largest one from the last level, at the others by the differences between levels.

    Beside it the fields of Sampled that state its uncertainty.
    """
    h, coarse, moments = np.array(p.case.steps), p.coarse, levels.moments()
    lacking = (p.unseen_levels(levels) / student_factor(GROUPS)) ** 2
    last, variances = moments.stderr[-1] ** 2 + lacking[-1], moments.stderr[:-1] ** 2 + lacking[:-1]
    fine, square = levels.means_of_powers()[VALUE][:2, -1]
    differences = p.combination.errors(moments.mean[:-1])
    largest = differences[:, :1]
    if p.part.extrapolate:
        to_reference, to_steps = p.combination.shares_above()
        largest = (to_reference * (0.0 - moments.mean[:-1].T)).sum(axis=1, keepdims=True)
        spread = np.sqrt(last + (to_steps[..., np.newaxis] ** 2 * variances).sum(axis=1)).T
    else:
        above = [(coarse > step) & (coarse <= h[0]) for step in h]  # levels between the largest step and this one
        spread = np.array([np.sqrt(last + variances[used].sum(axis=0)) for used in above]).T
    return moments.mean[-1][:, np.newaxis] - largest + differences, {
        "expectation_stderr": spread,
        "reference": moments.mean[-1] - largest[:, 0],
        "sd": standard_deviation(fine, square),
    }
