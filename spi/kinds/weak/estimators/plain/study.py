"""Plain Monte Carlo, as in the paper: E phi(y_h) - E phi(y_ref) on common Brownian paths.

Any number of paths; only sums over groups of them are kept.  Results for the first so many paths come from the same
run.  With extrapolation the values of phi at h, 2h, ... are combined path by path, and those at h_ref, 2 h_ref, ...
likewise, before anything is summed up.
"""

from dataclasses import dataclass, replace
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from spi.ensemble.areas import fourier_terms
from spi.ensemble.loop import add_reports, nested_grid
from spi.ensemble.scheme_protocol import REPORT
from spi.kinds.blocks import BlocksPlan, values_of_blocks
from spi.kinds.plans import Cost, Done, State
from spi.numerics.rng import LANES
from spi.schemes import typical_ns
from spi.statistics.estimators import (
    GROUPS,
    group_counts,
    jackknife_stderr,
    mean_over_paths,
    standard_deviation,
    with_powers,
)
from spi.statistics.tallies import sum_of_fields
from spi.storage.records import Part

from ...results import Prefixes, Sampled, WeakErrors
from ...study import WeakPlan, sampled_errors, stderr_of

_BATCH_BYTES = 64e6


class Totals(NamedTuple):
    """What is known of some paths.

    Of F test functions at L step sizes, the reference first and then from small to large; with extrapolation there are
    more step sizes of paths than of values.  Where the paths serve several levels of extrapolation, they have L step
    sizes together, those of one level behind those of another.
    """

    paths: int
    seconds: float  #: wall clock
    cpu_seconds: float
    values: np.ndarray  #: (2, L, F, GROUPS) sums of phi and of its square
    differences: np.ndarray  #: (1, L, F, GROUPS) sums of phi minus phi at the reference
    nonfinite: np.ndarray  #: (L,)
    report: np.ndarray  #: (step sizes of paths, len(REPORT))
    prefix_differences: np.ndarray  #: (prefixes, 1, L, F, GROUPS) differences of those that are among the first paths
    prefix_cpu_seconds: np.ndarray  #: (prefixes,)

    def plus(self, later: "Totals") -> "Totals":
        """These paths and some later ones."""
        return sum_of_fields(self, later)._replace(report=add_reports(self.report, later.report[np.newaxis]))


class Rows(NamedTuple):
    """What some blocks contribute, a row for each."""

    values: np.ndarray  #: (blocks, L, F, LANES)
    report: np.ndarray  #: (blocks, step sizes of paths, len(REPORT))


def plan(case: Any, part: Part) -> "PlainPlan":
    """The plan for one scheme of a case."""
    return PlainPlan.of(case, part)


@dataclass(frozen=True, kw_only=True)
class PlainPlan(WeakPlan, BlocksPlan):
    """Weak errors of one scheme by plain Monte Carlo."""

    of_others: ClassVar[frozenset[str]] = frozenset(("standard_error", "seconds", "accuracy"))

    @classmethod
    def of(cls, case: Any, part: Part) -> Self:
        """The plan for one scheme of a case."""
        reference = case.reference_record(part.eps)
        of_reference = {case.reference_step * 2.0**i for i in range(1, max(part.extrapolate, *part.also, 0) + 1)}
        steps = sorted({*case.steps, *of_reference}, reverse=True)
        schemes = [case.row(part.scheme, part.eps).record, reference]
        terms = fourier_terms(case.model, schemes, case.reference_step, min(case.steps), case.areas)
        times = nested_grid(case.final_time, case.reference_step, steps, case.truncate_noise, reference, terms)
        return cls(case=case, part=part, grid=times, samples=case.samples)

    @property
    def prefixes(self) -> tuple[int, ...]:
        """Numbers of first paths for which there are results as well."""
        return tuple(self.case.prefixes or ())

    @property
    def shape(self) -> tuple[int, int]:
        """(L, F): step sizes of the results, references included, and test functions."""
        return sum(1 + len(one.h) for one in self.by_level), len(self.case.functions)

    @property
    def own(self) -> slice:
        """Where the step sizes of this level of extrapolation and their reference stand among all."""
        return self.own_among(lambda one: 1 + len(one.h))

    def cost(self) -> Cost:
        """Steps of paths, seconds of one thread at typical speed, and bytes of memory."""
        steps = int(self.steps.sum()) * self.blocks * LANES
        return Cost(steps, steps * 1e-9 * typical_ns(self.row, self.model), int(_BATCH_BYTES))

    def empty(self, number: int) -> Totals:
        """The totals over no paths."""
        levels, prefixes, paths = self.shape[0], len(self.prefixes), len(self.grid.doublings)
        return Totals(
            paths=0,
            seconds=0.0,
            cpu_seconds=0.0,
            values=np.zeros((2, *self.shape, GROUPS)),
            differences=np.zeros((1, *self.shape, GROUPS)),
            nonfinite=np.zeros(levels, np.int64),
            report=np.zeros((paths, len(REPORT))),
            prefix_differences=np.zeros((prefixes, 1, *self.shape, GROUPS)),
            prefix_cpu_seconds=np.zeros(prefixes),
        )

    def most_blocks(self, number: int) -> int:
        """How many blocks a batch may have, because of memory."""
        levels, functions = max(len(self.grid.doublings), self.shape[0]), self.shape[1]
        return max(1, int(_BATCH_BYTES / (8 * LANES * levels * (len(self.initial) + 3 * functions))))

    def rows(self, number: int, first: int, blocks: int, end: int) -> Rows:
        """The values of the test functions at the end of some blocks."""
        values, report = values_of_blocks(self, self.grid, self.stream, first, blocks, end)
        return Rows(np.concatenate([one._extrapolated(values) for one in self.by_level], axis=1), report)

    def added(self, sums: Totals, rows: Rows, at: slice, first: int, end: int) -> Totals:
        """The totals with the rows `at`, of which the first is that of block `first`."""
        values = rows.values[at]
        with np.errstate(invalid="ignore", over="ignore"):
            differences = np.concatenate([v - v[:, -1:] for v in (values[:, one.own] for one in self.by_level)], axis=1)
        lanes = np.arange(first * LANES, (first + len(values)) * LANES).reshape(-1, 1, LANES) < end
        lost = ~np.isfinite(values).all(axis=2) & lanes
        of_prefixes = sums.prefix_differences.copy()
        for i, samples in enumerate(self.prefixes):
            if first * LANES < samples:
                of_prefixes[i] = with_powers(sums.prefix_differences[i], differences, first, min(samples, end))
        return sums._replace(
            values=with_powers(sums.values, values, first, end),
            differences=with_powers(sums.differences, differences, first, end),
            nonfinite=sums.nonfinite + lost.sum(axis=(0, 2)),
            report=add_reports(sums.report, rows.report[at]),
            prefix_differences=of_prefixes,
        )

    def timed(self, sums: Totals, first: int, blocks: int, seconds: float, cpu_seconds: float) -> Totals:
        """The totals with the time that some blocks took, shared out to the first so many paths."""
        shares = np.clip((np.array(self.prefixes) / LANES - first) / blocks, 0.0, 1.0)
        return sums._replace(
            seconds=sums.seconds + seconds,
            cpu_seconds=sums.cpu_seconds + cpu_seconds,
            prefix_cpu_seconds=sums.prefix_cpu_seconds + shares * cpu_seconds,
        )

    def progress(self, state: State) -> Done:
        """Paths done, all paths, and the standard error at the largest step (of the first function)."""
        known = state.so_far()
        if not known.paths:
            return Done(0, self.samples, float("nan"))
        counts = group_counts(known.paths)
        errors = self.errors(known.differences[:, self.own], counts)
        return Done(known.paths, self.samples, float(stderr_of(*errors)[0, 0]))

    def so_far(self, state: State) -> State | None:
        """The state of the first paths, without those prefixes that have more."""
        found = super().so_far(state)
        plan: Any = found and found.plan
        if found is None or all(samples <= plan.samples for samples in self.prefixes):
            return found
        return found.of(replace(plan, case=plan.case.model_copy(update={"prefixes": None})))

    def results(self, state: State) -> WeakErrors:
        """The results of one scheme of a case, from its final state."""
        totals, counts = self._of_own(state.total()), group_counts(self.samples)
        mean, without = mean_over_paths(totals.values[0], counts)
        expectation = _by_step(mean)
        fields, sampled = sampled_errors(self.h, *self.errors(totals.differences, counts))
        spread = jackknife_stderr(expectation, _by_step(without), counts)
        lacking = self._unseen(expectation, spread, self.samples)
        return self.weak_errors(
            state.seconds,
            **fields,
            expectation=expectation,
            nonfinite=totals.nonfinite[:-1],
            prefixes=self._of_prefixes(totals) if self.prefixes else None,
            sampled=Sampled(
                **sampled,
                expectation_stderr=stderr_of(expectation, _by_step(without), counts, lacking),
                reference=mean[-1],
                sd=standard_deviation(*totals.values[:, 0].sum(axis=-1) / self.samples),
                samples=self.samples,
                ns_per_step=float(1e9 * totals.cpu_seconds / (self.steps.sum() * self.samples)),
            ),
            cpu_seconds=totals.cpu_seconds,
            reference_nonfinite=int(totals.nonfinite[-1]),
        )

    def errors(self, differences: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, ...]:
        """What :func:`stderr_of` asks for: errors (F, S), from the largest step to the smallest, and so on."""
        mean, without = map(_by_step, mean_over_paths(differences[0], counts))
        unseen = self._unseen(mean, jackknife_stderr(mean, without, counts), int(counts.sum()))
        return self.completed(mean), self.completed(without), counts, self.completed(unseen)

    def _unseen(self, value: np.ndarray, stderr: np.ndarray, samples: int) -> np.ndarray:
        """(F, S): as :meth:`WeakPlan.unseen`; extrapolated values can be further apart."""
        weights = np.abs(self.extrapolation.weights).sum()
        return weights * self.unseen(value.T, stderr.T, samples).T

    def _of_own(self, totals: Totals) -> Totals:
        """The totals without the step sizes of other levels of extrapolation."""
        own = self.own
        return totals._replace(
            values=totals.values[:, own],
            differences=totals.differences[:, own],
            nonfinite=totals.nonfinite[own],
            prefix_differences=totals.prefix_differences[:, :, own],
        )

    def _extrapolated(self, values: np.ndarray) -> np.ndarray:
        """Values (blocks, step sizes of paths, F, LANES) extrapolated path by path, (blocks, 1 + S, F, LANES)."""
        weights, smallest = self.extrapolation.weights.tolist(), self.case.reference_step
        sizes = (smallest * 2.0**self.grid.doublings).tolist()
        wanted = [*self.h.tolist(), smallest]
        if not self.part.extrapolate:
            return values[:, [sizes.index(h) for h in wanted]]
        with np.errstate(invalid="ignore", over="ignore"):
            each = (w * values[:, [sizes.index(h * 2.0**i) for h in wanted]] for i, w in enumerate(weights))
            return np.sum(list(each), axis=0)

    def _of_prefixes(self, totals: Totals) -> Prefixes:
        """What the first so many paths give."""
        errors, stderrs = [], []
        for samples, differences in zip(self.prefixes, totals.prefix_differences, strict=True):
            counts = group_counts(samples)
            found = self.errors(differences, counts)
            errors.append(found[0])
            stderrs.append(stderr_of(*found))
        return Prefixes(
            samples=np.array(self.prefixes, np.int64),
            error=np.array(errors),
            error_stderr=np.array(stderrs),
            cpu_seconds=totals.prefix_cpu_seconds,
        )


def _by_step(x: np.ndarray) -> np.ndarray:
    """(..., L, F) as (..., F, S): without the reference."""
    return np.moveaxis(x, -1, -2)[..., :-1]
