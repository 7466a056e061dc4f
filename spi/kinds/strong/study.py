"""Strong errors: how far the paths of a scheme at step h are from its own paths at the reference step.

The error at h is sup_n (E |y_h(t_n) - y_ref(t_n)|^2)^(1/2) over the grid of h, as in the paper's Theorem 2; the
value at the final time is stored as well.  The reference is the scheme itself, as in the paper, or one scheme for all
(``reference_scheme``), which shows whether schemes have the same limit.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from spi.ensemble.loop import TimeGrid
from spi.ensemble.observer import path_observer
from spi.ensemble.protocol import casimirs
from spi.kinds.blocks import SampledPlan, lanes_of, reported
from spi.kinds.plans import Done, State, each_scheme, reference_grid
from spi.schemes import strong_order
from spi.statistics.accumulators import Array, Batch, Sums, by_group, counted, largest, reports
from spi.statistics.estimators import (
    fit_order,
    group_counts,
    is_resolved,
    jackknife_stderr,
    note_unresolved,
    root_mean_square,
)
from spi.statistics.rounding import is_rounding, note_exact, size_of, with_rounding

from .results import StrongErrors

_LOST = 0.25  # of |y_0|: larger errors are left out of the order

parts = each_scheme


class StrongSums(Sums):
    """Sums over some paths, at all step sizes, from the largest to the reference."""

    squares: Array = by_group("point")  #: of |y_h - y_ref|, the grid points of the largest step first
    drift: Array = largest("level casimir")
    nonfinite: Array = counted("level")
    report: Array = reports("level")


@dataclass(frozen=True, kw_only=True)
class StrongPlan(SampledPlan):
    """Strong errors of one scheme."""

    record = StrongErrors
    sums = StrongSums

    @cached_property
    def grid(self) -> TimeGrid:
        """Step sizes of the case and the reference, on the same Brownian paths."""
        return reference_grid(self.case, self.part, self.case.steps, areas=False)

    def lengths(self, number: int) -> dict[str, int]:
        levels, conserved = len(self.steps), len(casimirs(self.model, self.initial))
        return {"point": int(self.steps[:-1].sum()), "level": levels, "casimir": conserved}

    def observe(self, batch: Batch) -> dict[str, Array]:
        """Contributions of a batch."""
        observer = path_observer(self.model, self.initial, self.grid, batch.blocks, squares=True)
        states, report = self.integrated(batch, observer)
        counted = batch.counted[:, np.newaxis, np.newaxis]
        # a diverged path has no last drift but NaN: it is infinitely far
        drift = np.where(counted, np.nan_to_num(observer.extremes, nan=np.inf, posinf=np.inf), 0.0).max(axis=-1)
        lost = np.logical_not(np.isfinite(lanes_of(states, len(self.initial))).all(axis=2))
        return {"squares": observer.rows, "drift": drift, "nonfinite": lost, "report": report}

    def progress(self, state: State) -> Done:
        """Paths done, all paths, and the standard error at the final time of the largest step."""
        tally = state.tally()
        if not tally.paths:
            return Done(0, self.samples, float("nan"))
        # of one time alone: sums over all of them are large, and this is asked after each batch
        squares = np.sum([sums.squares[:, self.steps[0] - 1] for sums in tally.each], axis=0)
        counts = group_counts(tally.paths)
        value, without = root_mean_square(squares, counts)
        return Done(tally.paths, self.samples, float(jackknife_stderr(value, without, counts)))

    def estimates(self, sums: StrongSums) -> dict[str, Any]:
        """Errors, their order, and the extremes along the paths.

        Standard errors are those at the time where the supremum over all paths is reached.
        """
        case, counts, h, steps = self.case, group_counts(sums.paths), np.array(self.case.steps), self.steps[:-1]
        distance, without = root_mean_square(sums.squares, counts)
        distance = np.nan_to_num(distance, nan=np.inf, posinf=np.inf)  # a diverged path makes the mean infinite
        ends = np.cumsum(steps)
        numbers = np.array([np.argmax(distance[end - n : end]) for end, n in zip(ends, steps, strict=True)])
        farthest, last = ends - steps + numbers, ends - 1
        error = distance[farthest]
        stderr, final_stderr = (jackknife_stderr(distance[at], without[:, at], counts) for at in (farthest, last))
        of = size_of(case.initial), self.steps[-1]
        exact, stderr = is_rounding(error, *of), with_rounding(stderr, error, *of)
        final_stderr = with_rounding(final_stderr, distance[last], *of)
        resolved = is_resolved(error, stderr)
        # paths that are farther apart than this have lost one another: the error no longer grows as the step does
        fitted = resolved & (error <= _LOST * (math.hypot(*case.initial) or math.inf))
        notes = note_exact(error, exact), note_unresolved(error, stderr, resolved | exact, sums.paths)
        ns = self.ns_per_step(sums)
        own_reference = case.reference_step if case.reference_scheme in (None, self.part.scheme) else 0.0
        return {
            "h": h,
            "error": error,
            "error_stderr": stderr,
            "error_time": (numbers + 1) * h,
            "error_final": distance[last],
            "error_final_stderr": final_stderr,
            "casimir_drift": sums.drift[:-1],
            "nonfinite": sums.nonfinite[:-1],
            "resolved": resolved,
            "seconds": 1e-9 * ns * steps * sums.paths,
            "ns_per_step": np.full(len(h), ns),
            **reported(sums.report[:-1]),
            "order": fit_order(h, error, without[:, farthest], counts, fitted, own_reference),
            "expected_order": strong_order(self.row, case.model, case.initial, case.noise),
            "reference_nonfinite": int(sums.nonfinite[-1]),
            "reference_casimir_drift": tuple(sums.drift[-1].tolist()),
            "note": "; ".join(filter(None, notes)),
        }


plan = StrongPlan.of
