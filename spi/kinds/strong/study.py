"""Strong errors: how far the paths of a scheme at step h are from its own paths at the reference step.

The error at h is sup_n (E |y_h(t_n) - y_ref(t_n)|^2)^(1/2) over the grid of h, as in the paper's Theorem 2; the
value at the final time is stored as well.  The reference is the scheme itself, as in the paper, or one scheme for all
(``reference_scheme``), which shows whether schemes have the same limit.
"""

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from spi.ensemble.loop import Grid, integrate, limited_threads
from spi.ensemble.observer import path_observer
from spi.ensemble.protocol import casimirs
from spi.kinds.blocks import BlocksPlan, lanes_of, reported
from spi.kinds.plans import Done, State, each_scheme, reference_grid
from spi.numerics.rng import LANES
from spi.schemes import typical_ns
from spi.schemes.theory import strong_order
from spi.statistics.accumulators import Array, Sums, by_group, counted, largest, reports
from spi.statistics.estimators import (
    fit_order,
    group_counts,
    is_resolved,
    jackknife_stderr,
    note_unresolved,
    root_mean_square,
)

from .results import StrongErrors

_LOST = 0.25  # of |y_0|: larger errors are left out of the order
_TIMED_STEPS = 2048  # of one block, for the time of a step

parts = each_scheme


class StrongSums(Sums):
    """Sums over some paths, at all step sizes, from the largest to the reference."""

    squares: Array = by_group("point")  #: of |y_h - y_ref|, the grid points of the largest step first
    drift: Array = largest("level casimir")
    nonfinite: Array = counted("level")
    report: Array = reports("level")


class Times(NamedTuple):
    """The times measured once all paths are done."""

    seconds: float  #: wall clock
    ns_per_step: np.ndarray  #: (S,) of a step of one path on one thread, NaN until measured


@dataclass(frozen=True, kw_only=True)
class StrongPlan(BlocksPlan):
    """Strong errors of one scheme; `timed_steps` says whether the time of a step is measured at the end."""

    record = StrongErrors
    sums = StrongSums

    timed_steps: bool = True

    @cached_property
    def grid(self) -> Grid:
        """The step sizes of the case and the reference, on the same Brownian paths."""
        return reference_grid(self.case, self.part, self.case.steps, areas=False)

    @property
    def measured(self) -> bool:
        """Whether the time of a step is measured: other drivers are made beside the loop over time."""
        return self.timed_steps and self.case.noise is None

    def lengths(self, number: int) -> dict[str, int]:
        """The lengths of the axes of the sums."""
        levels, conserved = len(self.steps), len(casimirs(self.model, self.initial))
        return {"point": int(self.steps[:-1].sum()), "level": levels, "casimir": conserved}

    def initial_extra(self) -> Times:
        """No time has been measured."""
        return Times(0.0, np.full(len(self.steps) - 1, np.nan))

    def observe(self, number: int, first: int, blocks: int, end: int) -> dict[str, Array]:
        """The contributions of some blocks."""
        observer = path_observer(self.model, self.initial, self.grid, blocks, squares=True)
        states, report = self.integrated(first, blocks, end, observer)
        idle = np.arange(first * LANES, (first + blocks) * LANES).reshape(-1, 1, 1, LANES) >= end
        # a diverged path has no last drift but NaN: it is infinitely far
        drift = np.where(idle, 0.0, np.nan_to_num(observer.extremes, nan=np.inf, posinf=np.inf)).max(axis=-1)
        lost = np.logical_not(np.isfinite(lanes_of(states, len(self.initial))).all(axis=2))
        return {"squares": observer.rows, "drift": drift, "nonfinite": lost, "report": report}

    def finalise(self, state: State) -> Iterator[Times]:
        """Measure the time of a step at each step size."""
        for i in np.flatnonzero(np.isnan(state.extra.ns_per_step)) if self.measured else ():
            began, ns = time.perf_counter(), state.extra.ns_per_step.copy()
            ns[i] = self.nanoseconds_per_step(self.case.steps[i])
            yield Times(state.extra.seconds + time.perf_counter() - began, ns)

    def nanoseconds_per_step(self, h: float) -> float:
        """Time of one step of one path at step size h, alone on one thread: the best of three runs of one block."""
        most = 2e8 / (LANES * typical_ns(self.row, self.model))  # about 0.2 s
        steps = max(1, min(_TIMED_STEPS, int(most)))
        best = np.inf
        with limited_threads(1):
            for _ in range(3):
                arguments = self.arguments_of_steps(h, steps, 1)
                began = time.perf_counter()
                integrate(*arguments)
                best = min(best, time.perf_counter() - began)
        return 1e9 * best / (steps * LANES)

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

    def whole(self, state: State) -> dict[str, Any]:
        """Also the times of steps."""
        times = state.extra.ns_per_step
        seconds = times * 1e-9 * self.steps[:-1] * self.samples
        timed = {"seconds": seconds, "ns_per_step": times} if self.measured else {}
        return super().whole(state) | timed

    def estimates(self, sums: StrongSums) -> dict[str, Any]:
        """The errors, their order, and the extremes along the paths."""
        case, counts, h = self.case, group_counts(sums.paths), np.array(self.case.steps)
        error = errors(sums.squares, counts, self.steps[:-1])
        stderr = jackknife_stderr(error.sup, error.sup_without, counts)
        resolved = is_resolved(error.sup, stderr)
        # paths that are farther apart than this have lost one another: the error no longer grows as the step does
        together = error.sup <= _LOST * (math.hypot(*case.initial) or math.inf)
        own_reference = case.reference_step if case.reference_scheme in (None, self.part.scheme) else 0.0
        return {
            "h": h,
            "error": error.sup,
            "error_stderr": stderr,
            "error_time": (error.at + 1) * h,
            "error_final": error.final,
            "error_final_stderr": jackknife_stderr(error.final, error.final_without, counts),
            "casimir_drift": sums.drift[:-1],
            "nonfinite": sums.nonfinite[:-1],
            "resolved": resolved,
            **reported(sums.report[:-1]),
            "order": fit_order(h, error.sup, error.sup_without, counts, resolved & together, own_reference),
            "expected_order": strong_order(self.row, case.model, case.initial, case.noise),
            "reference_nonfinite": int(sums.nonfinite[-1]),
            "reference_casimir_drift": tuple(sums.drift[-1].tolist()),
            "note": note_unresolved(error.sup, stderr, resolved, sums.paths),
        }


# ---------------------------------------------------------------------------------------------------------------------
# Strong errors from sums over paths.
# ---------------------------------------------------------------------------------------------------------------------


class Errors(NamedTuple):
    """Errors per step size, S of them from large to small, with leave-one-out values (groups, S).

    Leaving out groups is done at the time where the supremum over all paths is reached.
    """

    sup: np.ndarray  #: (S,) largest root mean square distance over the grid
    sup_without: np.ndarray
    at: np.ndarray  #: (S,) number of the grid point where it is reached
    final: np.ndarray  #: (S,) the same at the final time
    final_without: np.ndarray


def errors(squares: np.ndarray, counts: np.ndarray, steps: np.ndarray) -> Errors:
    """The errors from sums of squares (GROUPS, points) over `counts` (GROUPS,) paths.

    Step size after step size, from large to small, has as many points as `steps` (S,).
    """
    value, without = root_mean_square(squares, counts)
    value = np.nan_to_num(value, nan=np.inf, posinf=np.inf)  # a diverged path makes the mean square infinite
    ends = np.cumsum(steps)
    at = np.array([np.argmax(value[end - n : end]) for end, n in zip(ends, steps, strict=True)], dtype=int)
    first = ends - steps
    return Errors(
        sup=value[first + at],
        sup_without=without[:, first + at],
        at=at,
        final=value[ends - 1],
        final_without=without[:, ends - 1],
    )


plan = StrongPlan.of
