"""Strong errors from sums over paths."""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from spi.compiler.inlining import uncompiled
from spi.ensemble.fields import noise_field, noise_field_derivative
from spi.ensemble.protocol import in_kernels, large, noise_groups, noise_indices
from spi.kinds.plans import State
from spi.kinds.solver import reported
from spi.schemes import Scheme, has_theory
from spi.statistics.estimators import (
    RESOLVED,
    fit_order,
    group_counts,
    is_resolved,
    jackknife_stderr,
    root_mean_square,
    samples_needed,
)

from ..results import StrongErrors
from .paths import Totals

if TYPE_CHECKING:
    from . import StrongPlan

_LOST = 0.25  # of |y_0|: larger errors are left out of the order


class Errors(NamedTuple):
    """Errors per step size, S of them from large to small, with leave-one-out values (groups, S).

    Leaving out groups is done at the time where the supremum over all paths is reached.
    """

    sup: np.ndarray  #: (S,) largest root mean square distance over the grid
    sup_without: np.ndarray
    at: np.ndarray  #: (S,) number of the grid point where it is reached
    final: np.ndarray  #: (S,) the same at the final time
    final_without: np.ndarray
    counts: np.ndarray  #: (GROUPS,) paths of each group


def errors(p: "StrongPlan", totals: Totals) -> Errors:
    """The errors that some paths tell."""
    counts = group_counts(totals.paths)
    value, without = root_mean_square(totals.squares, counts)
    ends = np.cumsum(p.steps[1:])
    # a diverged path makes the mean square infinite
    curves = [np.nan_to_num(curve, nan=np.inf, posinf=np.inf) for curve in np.split(value, ends[:-1])]
    at = np.array([np.argmax(curve) for curve in curves], dtype=int)
    return Errors(
        sup=np.array([curve[i] for curve, i in zip(curves, at, strict=True)])[::-1],
        sup_without=without[:, ends - p.steps[1:] + at][:, ::-1],
        at=at[::-1],
        final=np.array([curve[-1] for curve in curves])[::-1],
        final_without=without[:, ends - 1][:, ::-1],
        counts=counts,
    )


def results(p: "StrongPlan", state: State) -> StrongErrors:
    """The results of one scheme of a case, from its final state."""
    case, totals, times = p.case, state.total(), state.more.ns_per_step
    found = errors(p, totals)
    h = np.array(case.steps)
    down = slice(None, 0, -1)  # levels from the largest step to the smallest, without the reference
    stderr = jackknife_stderr(found.sup, found.sup_without, found.counts)
    resolved = is_resolved(found.sup, stderr)
    # paths that are farther apart than this have lost one another: the error no longer grows as the step does
    together = found.sup <= _LOST * np.linalg.norm(case.initial)
    own_reference = 0.0 if case.reference_scheme else case.reference_step
    return StrongErrors(
        **p.whole(state),
        h=h,
        error=found.sup,
        error_stderr=stderr,
        error_time=(found.at + 1) * h,
        error_final=found.final,
        error_final_stderr=jackknife_stderr(found.final, found.final_without, found.counts),
        casimir_drift=totals.drift[down],
        nonfinite=totals.nonfinite[down],
        resolved=resolved,
        seconds=times * 1e-9 * p.steps[down] * p.samples if p.timed_steps else None,
        ns_per_step=times if p.timed_steps else None,
        **reported(totals.report[down]),
        order=fit_order(h, found.sup, found.sup_without, found.counts, resolved & together, own_reference),
        expected_order=_expected_order(p.row, case),
        samples=case.samples,
        reference_step=case.reference_step,
        reference_scheme=case.reference_scheme,
        reference_nonfinite=int(totals.nonfinite[0]),
        reference_casimir_drift=tuple(totals.drift[0].tolist()),
        note=_note(found.sup, stderr, resolved, case.samples),
    )


def _expected_order(row: Scheme, case: Any) -> float | None:
    """What theory says; None where it says nothing, because a splitting is not made of exact flows.

    The order with several noises rises to that with one where they commute, f_k' f_l = f_l' f_k, and to 1 where what a
    scheme leaves out is 0 as well, f_k' f_l for Euler-Maruyama, which is then Milstein's scheme.
    """
    model = in_kernels(case.model)
    if not has_theory(row, model):
        return None
    if large(model):  # noises of one group commute, and f_k' f_k, which Euler-Maruyama leaves out, is not 0
        return row.strong_order_commuting if noise_groups(model) <= 1 else row.strong_order
    states = np.array(case.initial) + np.random.default_rng(0).standard_normal((4, len(case.initial)))
    at = list(map(tuple, np.abs(states).tolist()))  # populations are positive
    if not noise_indices(model):
        return 1.0
    products = _products(noise_field_derivative, model, at)
    swapped = np.swapaxes(products, 1, 2)
    if not np.allclose(products, swapped, rtol=1e-12, atol=1e-12):
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


def _note(error: np.ndarray, stderr: np.ndarray, resolved: np.ndarray, samples: int) -> str:
    """What a reader must know about points that are not resolved, or an empty text."""
    finite = np.isfinite(error)
    if resolved.all():
        return ""
    if samples == 1:
        return "one path has no standard error: not resolved"
    if not finite.all():
        return "the mean square is infinite where paths diverged (NaN or infinity) or nearly so"
    needed = samples_needed(error, stderr, samples)[~resolved].max()
    if not np.isfinite(needed) or needed <= 0:
        return f"in brackets: errors below {RESOLVED:g} standard errors"
    return f"in brackets: not resolved, would need about {float(f'{needed:.1g}'):.0f} samples"
