"""Strong errors: how far the paths of a scheme at step h are from its own paths at the reference step.

The error at h is sup_n (E |y_h(t_n) - y_ref(t_n)|^2)^(1/2) over the grid of h, as in Theorem thm-general; the value at
the final time is kept as well.  The reference is the scheme itself, as in the paper, or one scheme for all
(``reference_scheme``), which shows whether schemes have the same limit.
"""

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from spi.compiler.inlining import uncompiled
from spi.ensemble.fields import noise_field, noise_field_derivative
from spi.ensemble.loop import add_reports, integrate, integrated, limited_threads, nested_grid
from spi.ensemble.observer import path_observer
from spi.ensemble.protocol import casimirs, in_kernels, large, noise_groups, noise_indices
from spi.ensemble.scheme_protocol import REPORT
from spi.kinds.blocks import BlocksPlan, reported
from spi.kinds.plans import Cost, Done, State
from spi.numerics.rng import LANES
from spi.schemes import Scheme, driven, has_theory, typical_ns
from spi.statistics.estimators import (
    GROUPS,
    PARTS,
    RESOLVED,
    ROUND,
    fit_order,
    group_counts,
    is_resolved,
    jackknife_stderr,
    root_mean_square,
    samples_needed,
)
from spi.statistics.tallies import sum_of_fields
from spi.storage.records import Part

from .results import StrongErrors

_BATCH_BYTES = 64e6
_LOST = 0.25  # of |y_0|: larger errors are left out of the order
_TIMED_STEPS = 2048  # of one block, for the time of a step


def parts(case: Any) -> list[Part]:
    """What is run one after the other: each scheme."""
    return [Part(scheme, eps=eps) for scheme, eps in case.runs]


def plan(case: Any, part: Part) -> "StrongPlan":
    """The plan for one scheme of a case."""
    reference = case.reference_record(part.eps)
    times = nested_grid(case.final_time, case.reference_step, case.steps, case.truncate_noise, reference)
    timed = case.noise is None  # other drivers are made beside the loop over time
    return StrongPlan(case=case, part=part, grid=times, samples=case.samples, timed_steps=timed)


class Totals(NamedTuple):
    """What is known of some paths."""

    paths: int
    seconds: float  #: wall clock
    cpu_seconds: float
    squares: np.ndarray  #: (GROUPS, points), those of the largest step first
    drift: np.ndarray  #: (levels, casimirs)
    nonfinite: np.ndarray  #: (levels,)
    report: np.ndarray  #: (levels, len(REPORT))

    def plus(self, later: "Totals") -> "Totals":
        """These paths and some later ones."""
        drift, report = np.maximum(self.drift, later.drift), add_reports(self.report, later.report[np.newaxis])
        return sum_of_fields(self, later)._replace(drift=drift, report=report)


class Rows(NamedTuple):
    """What some blocks contribute, a row for each."""

    squares: np.ndarray  #: (blocks, points, PARTS) sums of |y_h - y_ref|^2
    drift: np.ndarray  #: (blocks, levels, C, LANES)
    nonfinite: np.ndarray  #: (blocks, levels)
    report: np.ndarray  #: (blocks, levels, len(REPORT))


class Times(NamedTuple):
    """What is measured once all paths are done."""

    seconds: float  #: wall clock
    ns_per_step: np.ndarray  #: (levels - 1,) from large to small steps, NaN until measured


@dataclass(frozen=True, kw_only=True)
class StrongPlan(BlocksPlan):
    """Strong errors of one scheme; `timed_steps` says whether the time of a step is measured at the end."""

    timed_steps: bool = True

    @property
    def points(self) -> int:
        """Grid points of all step sizes but the reference."""
        return int(self.steps[:-1].sum())

    def cost(self) -> Cost:
        """Steps of paths, seconds of one thread at typical speed, and bytes of memory."""
        steps = int(self.steps.sum()) * self.samples
        seconds = steps * 1e-9 * typical_ns(self.row, self.model)
        return Cost(steps, seconds, int(_BATCH_BYTES) + 8 * GROUPS * self.points)

    def initial_extra(self) -> Times:
        """No time has been measured."""
        return Times(0.0, np.full(len(self.steps) - 1, np.nan))

    def empty(self, number: int) -> Totals:
        """The totals over no paths."""
        levels = len(self.steps)
        return Totals(
            paths=0,
            seconds=0.0,
            cpu_seconds=0.0,
            squares=np.zeros((GROUPS, self.points)),
            drift=np.zeros((levels, len(casimirs(self.model, self.initial)))),
            nonfinite=np.zeros(levels, np.int64),
            report=np.zeros((levels, len(REPORT))),
        )

    def most_blocks(self, number: int) -> int:
        """How many blocks a batch may have, because of memory."""
        return max(1, min(ROUND * 8, int(_BATCH_BYTES / (8 * PARTS * max(self.points, 1)))))

    def rows(self, number: int, first: int, blocks: int, end: int) -> Rows:
        """Integrate the blocks from block `first` on; paths from number `end` on are idle."""
        observer = path_observer(self.model, self.initial, self.grid, blocks, squares=True)
        what = self.scheme, self.model, self.initial, self.grid, self.stream
        states, report = integrated(*what, first, blocks, end, observer)
        y = states[..., : len(self.initial) * LANES].reshape(*states.shape[:2], -1, LANES)
        idle = np.arange(first * LANES, (first + blocks) * LANES).reshape(-1, 1, LANES) >= end
        nonfinite = (~(np.isfinite(y).all(axis=2) | idle)).sum(axis=-1)
        return Rows(observer.rows, observer.extremes, nonfinite, report)

    def added(self, sums: Totals, rows: Rows, at: slice, first: int, end: int) -> Totals:
        """The totals with the rows `at`, of which the first is that of block `first`."""
        squares = sums.squares.reshape(ROUND, PARTS, -1).copy()
        drift = sums.drift
        for block, row in enumerate(range(at.start, at.stop), first):
            squares[block % ROUND] += rows.squares[row].T
            lanes = min(LANES, end - block * LANES)
            # a diverged path has no last drift but NaN: it is infinitely far
            worst = np.nan_to_num(rows.drift[row, :, :, :lanes], nan=np.inf, posinf=np.inf).max(axis=-1)
            drift = np.maximum(drift, worst)
        return sums._replace(
            squares=squares.reshape(GROUPS, -1),
            drift=drift,
            nonfinite=sums.nonfinite + rows.nonfinite[at].sum(axis=0),
            report=add_reports(sums.report, rows.report[at]),
        )

    def finalise(self, state: State) -> Iterator[Times]:
        """Measure the time of a step at each step size."""
        for i in np.flatnonzero(np.isnan(state.extra.ns_per_step)) if self.timed_steps else ():
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

    def so_far(self, state: State) -> State | None:
        """The state of the first paths, without times of steps where they have not been measured."""
        found = super().so_far(state)
        plan: Any = found and found.plan
        untimed = found is not None and bool(np.isnan(state.extra.ns_per_step).any())
        return found.of(replace(plan, timed_steps=False)) if found is not None and untimed else found

    def progress(self, state: State) -> Done:
        """Paths done, all paths, and the standard error at the final time of the largest step."""
        tally = state.tally()
        if not tally.paths:
            return Done(0, self.samples, float("nan"))
        counts = group_counts(tally.paths)
        # of one time alone: sums over all of them are large, and this is asked after each batch
        value, without = root_mean_square(
            np.sum([sums.squares[:, self.steps[0] - 1] for sums in tally.each], axis=0), counts
        )
        return Done(tally.paths, self.samples, float(jackknife_stderr(value, without, counts)))

    def results(self, state: State) -> StrongErrors:
        """The results of one scheme of a case, from its final state."""
        case, totals, times = self.case, state.total(), state.extra.ns_per_step
        h, counts = np.array(case.steps), group_counts(totals.paths)
        error = errors(totals.squares, counts, self.steps[:-1])
        stderr = jackknife_stderr(error.sup, error.sup_without, counts)
        resolved = is_resolved(error.sup, stderr)
        # paths that are farther apart than this have lost one another: the error no longer grows as the step does
        together = error.sup <= _LOST * (math.hypot(*case.initial) or math.inf)
        own_reference = case.reference_step if case.reference_scheme in (None, self.part.scheme) else 0.0
        return StrongErrors(
            **self.whole(state),
            h=h,
            error=error.sup,
            error_stderr=stderr,
            error_time=(error.at + 1) * h,
            error_final=error.final,
            error_final_stderr=jackknife_stderr(error.final, error.final_without, counts),
            casimir_drift=totals.drift[:-1],
            nonfinite=totals.nonfinite[:-1],
            resolved=resolved,
            seconds=times * 1e-9 * self.steps[:-1] * self.samples if self.timed_steps else None,
            ns_per_step=times if self.timed_steps else None,
            **reported(totals.report[:-1]),
            order=fit_order(h, error.sup, error.sup_without, counts, resolved & together, own_reference),
            expected_order=expected_order(self.row, case),
            samples=case.samples,
            reference_step=case.reference_step,
            reference_scheme=case.reference_scheme,
            reference_nonfinite=int(totals.nonfinite[-1]),
            reference_casimir_drift=tuple(totals.drift[-1].tolist()),
            note=note(error.sup, stderr, resolved, case.samples),
        )


# ---------------------------------------------------------------------------------------------------------------------
# Strong errors from sums over paths, and what theory says of their order.
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


def expected_order(row: Scheme, case: Any) -> float | None:
    """What theory says; None where it says nothing, because a splitting is not made of exact flows.

    The order with several noises rises to that with one where they commute, f_k' f_l = f_l' f_k, and to 1 where what a
    scheme leaves out is 0 as well, f_k' f_l for Euler-Maruyama, which is then Milstein's scheme.
    """
    order = _order(row, case)
    return None if order is None or math.isnan(order) else order


def _order(row: Scheme, case: Any) -> float | None:
    """The same, or NaN of a scheme in a Python file that does not state this order."""
    model = in_kernels(case.model)
    if row.composition is not None and not has_theory(row, model):
        return None
    if large(model):  # noises of one group commute, and f_k' f_k, which Euler-Maruyama leaves out, is not 0
        commuting = noise_groups(model) <= 1
        if case.noise is not None:
            return driven.strong_order(case.noise, row, model, commuting)
        return row.strong_order_commuting if commuting else row.strong_order
    states = np.array(case.initial) + np.random.default_rng(0).standard_normal((4, len(case.initial)))
    at = list(map(tuple, np.abs(states).tolist()))  # populations are positive
    if not noise_indices(model):
        return 1.0 if has_theory(row, model) else None
    products = _products(noise_field_derivative, model, at)
    swapped = np.swapaxes(products, 1, 2)
    commuting = np.allclose(products, swapped, rtol=1e-12, atol=1e-12)
    if case.noise is not None:
        return driven.strong_order(case.noise, row, model, commuting)
    if not commuting:
        return row.strong_order
    if row.left_out is None:
        return row.strong_order_commuting
    left_out = _products(row.left_out, model, at)
    missed = np.any(np.abs(left_out + np.swapaxes(left_out, 1, 2)) > 1e-12)
    return row.strong_order_commuting if missed else 1.0


def _products(word: Any, model: Any, states: list[tuple[float, ...]]) -> np.ndarray:
    """word(model, k, y, f_m(y)) for all states y and noises k and m."""
    noises = noise_indices(model)
    with uncompiled():  # not worth compiling
        return np.array(
            [[[word(model, k, y, noise_field(model, m, y)) for m in noises] for k in noises] for y in states]
        )


def note(error: np.ndarray, stderr: np.ndarray, resolved: np.ndarray, samples: int) -> str:
    """What a reader must know about points that are not resolved, or an empty text."""
    finite = np.isfinite(error)
    if resolved.all():
        return ""
    if samples == 1:
        return "one path has no standard error: not resolved"
    if not finite.all():
        return "the mean square is infinite where paths diverged (NaN or infinity) or nearly so"
    if not error.any():
        return "errors of 0 have no order"
    needed = samples_needed(error, stderr, samples)[~resolved].max()
    if not np.isfinite(needed) or needed <= 0:
        return f"in brackets: errors below {RESOLVED:g} standard errors"
    return f"in brackets: not resolved, would need about {float(f'{needed:.1g}'):.0f} samples"
