"""Strong errors from sums over paths, and what theory says of their order."""

import math
from typing import Any, NamedTuple

import numpy as np

from spi.compiler.inlining import uncompiled
from spi.ensemble.array_states import noise_groups
from spi.ensemble.fields import noise_field, noise_field_derivative
from spi.ensemble.protocol import in_kernels, large, noise_indices
from spi.schemes import Scheme, driven, has_theory
from spi.statistics.estimators import RESOLVED, root_mean_square, samples_needed


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

    Step size after step size, from small to large, has as many points as `steps` (S,).
    """
    value, without = root_mean_square(squares, counts)
    value = np.nan_to_num(value, nan=np.inf, posinf=np.inf)  # a diverged path makes the mean square infinite
    ends, steps = np.cumsum(steps)[::-1], steps[::-1]
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
