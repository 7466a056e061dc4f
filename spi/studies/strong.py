"""Strong errors: how far the paths of a scheme at step h are from its own paths at the reference step.

The error at h is sup_n (E |y_h(t_n) - y_ref(t_n)|^2)^(1/2) over the grid of h, as in Theorem thm-general; the value at
the final time is kept as well.  The reference is the scheme itself, as in the paper, or one scheme for all
(``reference_scheme``), which shows whether schemes have the same limit.
"""

import time
from functools import partial
from typing import NamedTuple

import numpy as np

from ..dispatch import means, tuplewise
from ..ensemble import (
    Grid,
    Noise,
    add_reports,
    brownian,
    empty_report,
    grid,
    in_batches,
    integrate,
    limited_threads,
    nested_grid,
    report_columns,
    thread_count,
    watch_casimirs,
)
from ..estimators import (
    GROUPS,
    PARTS,
    RESOLVED,
    fit_order,
    group_counts,
    is_resolved,
    jackknife_stderr,
    root_mean_square,
    samples_needed,
)
from ..fields import noise_field, noise_field_derivative, squared_distance
from ..lanes import load
from ..protocol import REPORT, casimirs, noise_indices, observe
from ..records import Group, Part, describe
from ..rng import LANES
from ..schemes import has_theory, reference_record, scheme_row, typical_ns

_BLOCKS_PER_ROUND = GROUPS // PARTS
_LOST = 0.25  # of |y_0|: larger errors are left out of the order
_BATCH_BYTES = 64e6


class StrongSums(NamedTuple):
    """What one batch of blocks contributes; a row per block.

    `squares[row, offsets[l] + n - 1, part]` is the sum of |y_h - y_ref|^2 at time n h over the lanes of a part, for
    step size number l > 0; `drift[row, l, c, lane]` the largest |C_c(y) - C_c(y_0)| so far (for the reference: at the
    end); `nonfinite[row, l]` the number of paths that are not finite at the end.
    """

    squares: np.ndarray
    drift: np.ndarray
    nonfinite: np.ndarray
    offsets: np.ndarray  #: (levels,) int64
    steps: np.ndarray  #: (levels,) int64, how many steps each step size takes
    initial_casimirs: tuple


@tuplewise("a[i] - a[i]", total=True)
def _zero_if_finite(a):
    """0, or NaN if a component is not finite."""


@means(observe, StrongSums)
def _(observer, model, row, paths, level, n, y, reference):
    if level > 0:
        squares = observer.squares[row, observer.offsets[level] + n - 1]
        for first in range(0, LANES, PARTS):
            for part in range(PARTS):
                lane = first + part
                square = squared_distance(load(model, y, lane), load(model, reference, lane))
                squares[part] += square if lane < paths else 0.0
    last = n == observer.steps[level]
    if level > 0 or last:
        watch_casimirs(model, observer.drift[row, level], observer.initial_casimirs, y)
    if last:
        for lane in range(paths):
            observer.nonfinite[row, level] += 0 if _zero_if_finite(load(model, y, lane)) == 0.0 else 1


class State(NamedTuple):
    """What is known after the blocks 0, ..., blocks - 1; enough to go on from."""

    blocks: int
    seconds: float  #: wall clock
    squares: np.ndarray  #: (GROUPS, points)
    drift: np.ndarray  #: (levels, casimirs)
    nonfinite: np.ndarray  #: (levels,)
    report: np.ndarray  #: (levels, len(REPORT))


class Plan(NamedTuple):
    """A case turned into what the ensemble needs."""

    scheme: NamedTuple
    model: NamedTuple
    initial: tuple
    grid: Grid
    noise: Noise
    steps: np.ndarray  #: (levels,)
    samples: int

    @property
    def points(self):
        """Grid points of all step sizes but the reference."""
        return int(self.steps[1:].sum())

    @property
    def blocks(self):
        return -(-self.samples // LANES)


def parts(case):
    """What is run one after the other: each scheme."""
    return [Part(scheme, eps=eps) for scheme, eps in case.runs]


def plan(case, part):
    """The plan for one scheme of a case."""
    reference = reference_record(case.reference_scheme, part.eps)
    times = nested_grid(case.final_time, case.reference_step, case.steps, case.truncate_noise, reference)
    return Plan(
        scheme_row(part.scheme, part.eps).record,
        case.model,
        case.initial,
        times,
        brownian(case.seed),
        times.reference_steps >> times.doublings,
        case.samples,
    )


def cost(case, part):
    """Steps of paths, seconds of one thread at typical speed, and bytes of memory."""
    p = plan(case, part)
    steps = int(p.steps.sum()) * case.samples
    return steps, steps * 1e-9 * typical_ns(part.scheme, case.model), int(_BATCH_BYTES) + 8 * GROUPS * p.points


def start(p):
    """The state before the first block."""
    levels = len(p.steps)
    return State(
        0,
        0.0,
        np.zeros((GROUPS, p.points)),
        np.zeros((levels, len(casimirs(p.model, p.initial)))),
        np.zeros(levels, np.int64),
        np.zeros((levels, len(REPORT))),
    )


def sums_of(model, initial, steps, rows):
    """Empty sums for `rows` blocks; `steps` (levels,) is how many steps each step size takes."""
    levels, conserved = len(steps), casimirs(model, initial)
    return StrongSums(
        np.zeros((rows, max(int(steps[1:].sum()), 1), PARTS)),
        np.zeros((rows, levels, len(conserved), LANES)),
        np.zeros((rows, levels), np.int64),
        np.concatenate(([0, 0], np.cumsum(steps[1:-1])))[:levels].astype(np.int64),
        steps,
        conserved,
    )


def advance_state(p, state, blocks):
    """The state after the next `blocks` blocks; the same bits however the blocks are divided into calls."""
    began = time.perf_counter()
    sums, report = sums_of(p.model, p.initial, p.steps, blocks), empty_report(blocks, len(p.steps))
    integrate(p.scheme, p.model, p.initial, p.grid, p.noise, sums, report, state.blocks, blocks, p.samples)
    squares = state.squares.reshape(_BLOCKS_PER_ROUND, PARTS, -1).copy()
    drift = state.drift.copy()
    for row in range(blocks):
        block = state.blocks + row
        squares[block % _BLOCKS_PER_ROUND] += sums.squares[row, : p.points].T
        lanes = min(LANES, p.samples - block * LANES)
        # a path that left the finite numbers has no last drift but NaN: it is infinitely far
        drift = np.maximum(drift, np.nan_to_num(sums.drift[row, :, :, :lanes], nan=np.inf, posinf=np.inf).max(axis=-1))
    return State(
        state.blocks + blocks,
        state.seconds + time.perf_counter() - began,
        squares.reshape(GROUPS, -1),
        drift,
        state.nonfinite + sums.nonfinite.sum(axis=0),
        add_reports(state.report, report),
    )


def batches(p, state):
    """Run all blocks that are left; yields the state after each batch of about half a second."""
    most = max(1, min(_BLOCKS_PER_ROUND * 8, int(_BATCH_BYTES / (8 * PARTS * max(p.points, 1)))))
    return in_batches(state, partial(advance_state, p), lambda state: p.blocks - state.blocks, most)


def errors(p, state):
    """Per step size, from large to small: error, its leave-one-out values, time index, and the same at the final time.

    Leaving out groups is done at the time where the supremum over all paths is reached.
    """
    counts = group_counts(min(state.blocks * LANES, p.samples))
    value, without = root_mean_square(state.squares, counts)
    sup, sup_without, where, final, final_without = [], [], [], [], []
    end = 0
    for n in p.steps[1:]:
        begin, end = end, end + n
        # a path that left the finite numbers makes the mean square infinite
        curve = np.nan_to_num(value[begin:end], nan=np.inf, posinf=np.inf)
        at = int(np.argmax(curve))
        sup.append(curve[at])
        sup_without.append(without[:, begin + at])
        where.append(at)
        final.append(curve[-1])
        final_without.append(without[:, end - 1])
    pick = np.array(where, dtype=int)[::-1]
    return (
        np.array(sup)[::-1],
        np.array(sup_without).T[:, ::-1],
        pick,
        np.array(final)[::-1],
        np.array(final_without).T[:, ::-1],
        counts,
    )


def progress(p, state):
    """Paths done, all paths, and the standard error at the final time of the largest step."""
    done = min(state.blocks * LANES, p.samples)
    if not done:
        return 0, p.samples, float("nan")
    value, without = root_mean_square(state.squares[:, -1], group_counts(done))
    return done, p.samples, float(jackknife_stderr(value, without, group_counts(done)))


def nanoseconds_per_step(p, h):
    """Time of one step of one path at step size h, alone on one thread: the best of three runs of one block."""
    steps = 2048
    times = grid(h, steps, truncate=p.grid.truncate, reference_scheme=p.grid.reference_scheme, by_reference=(0,))
    best = np.inf
    with limited_threads(1):
        for _ in range(3):
            sums, report = sums_of(p.model, p.initial, np.array([steps]), 1), empty_report(1, 1)
            began = time.perf_counter()
            integrate(p.scheme, p.model, p.initial, times, p.noise, sums, report, 0, 1, LANES)
            best = min(best, time.perf_counter() - began)
    return 1e9 * best / (steps * LANES)


def group(case, part, state):
    """The results of one scheme of a case, from its final state, and how long its steps take."""
    p, found = plan(case, part), untimed_group(case, part, state)
    ns = np.array([nanoseconds_per_step(p, step) for step in case.steps])
    seconds = ns * 1e-9 * p.steps[:0:-1] * case.samples
    return found._replace(variables=found.variables | {"seconds": (("h",), seconds), "ns_per_step": (("h",), ns)})


def untimed_group(case, part, state):
    """The results without the times of steps."""
    p = plan(case, part)
    row = scheme_row(part.scheme, part.eps)
    h = np.array(case.steps)
    error, without, where, final, final_without, counts = errors(p, state)
    stderr = jackknife_stderr(error, without, counts)
    resolved = is_resolved(error, stderr)
    # paths that are farther apart than this have lost one another: the error no longer grows as the step does
    together = error <= _LOST * np.linalg.norm(case.initial)
    own_reference = 0.0 if case.reference_scheme else case.reference_step
    order = fit_order(h, error, without, counts, resolved & together, own_reference)
    down = slice(None, 0, -1)  # levels from the largest step to the smallest, without the reference
    variables = {
        "error": error,
        "error_stderr": stderr,
        "error_time": (where + 1) * h,
        "error_final": final,
        "error_final_stderr": jackknife_stderr(final, final_without, counts),
        "nonfinite": state.nonfinite[down],
        "resolved": resolved,
    }
    variables |= report_columns(state.report[down])
    return Group(
        case.name,
        part.group,
        {"h": h, "casimir": np.arange(state.drift.shape[1])},
        {name: (("h",), values) for name, values in variables.items()}
        | {"casimir_drift": (("h", "casimir"), state.drift[down])},
        {
            **describe(case, row, part.eps),
            "order": order.order,
            "order_ci": (order.low, order.high),
            "points_in_fit": order.points,
            "expected_order": _expected_order(row, case),
            "samples": case.samples,
            "reference_step": case.reference_step,
            "reference_scheme": case.reference_scheme,
            "reference_nonfinite": int(state.nonfinite[0]),
            "reference_casimir_drift": tuple(float(x) for x in state.drift[0]),
            "wall_seconds": state.seconds,
            "threads": thread_count(),
            "note": _note(error, stderr, resolved, case.samples),
        },
    )


def _expected_order(row, case):
    """What theory says; None where it says nothing, because a splitting is not made of exact flows.

    The order with several noises rises to that with one where they commute, f_k' f_l = f_l' f_k, and for every scheme
    to 1 where f_k' f_l = 0, since Euler-Maruyama is then Milstein's scheme.
    """
    model = case.model
    if not has_theory(row, model):
        return None
    states = np.array(case.initial) + np.random.default_rng(0).standard_normal((4, len(case.initial)))
    products = np.array(
        [
            [
                [noise_field_derivative(model, k, y, noise_field(model, m, y)) for m in noise_indices(model)]
                for k in noise_indices(model)
            ]
            for y in map(tuple, np.abs(states).tolist())  # populations are positive
        ]
    )
    if not np.any(products):
        return 1.0
    commute = np.allclose(products, np.swapaxes(products, 1, 2), rtol=1e-12, atol=1e-12)
    return row.strong_order_commuting if commute else row.strong_order


def _note(error, stderr, resolved, samples):
    """What a reader must know about points that are not resolved, or an empty text."""
    finite = np.isfinite(error)
    if resolved.all():
        return ""
    if samples == 1:
        return "one path has no standard error: not resolved"
    if not finite.all():
        return "the mean square is infinite where paths left the finite numbers or nearly so"
    needed = samples_needed(error, stderr, samples)[~resolved].max()
    if not np.isfinite(needed) or needed <= 0:
        return f"in brackets: errors below {RESOLVED:g} standard errors"
    return f"in brackets: not resolved, would need about {float(f'{needed:.1g}'):.0f} samples"
