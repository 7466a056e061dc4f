"""Schemes, by the names that experiments use, and the orders that theory states of them."""

import math

import numpy as np

from ..compiler.inlining import uncompiled
from ..ensemble.fields import noise_field, noise_field_derivative
from ..ensemble.protocol import (
    exact_flows,
    flows_lacking,
    has_friction,
    in_kernels,
    in_place,
    inner,
    noise_indices,
    noises_commute,
)
from ..ensemble.protocol import large as has_arrays
from ..ensemble.scheme_protocol import judges
from .midpoint import is_reversible, preserved
from .splitting import splitting
from .stages import acting_flows, has_loops, indices_of, is_own_reverse, is_reversed_by_coin, with_friction
from .table import POISSON, SCHEMES, Scheme, register_scheme, typical_ns

__all__ = [
    "SCHEMES",
    "Scheme",
    "composed",
    "has_theory",
    "of_model",
    "register_scheme",
    "scheme_entry",
    "strong_order",
    "typical_ns",
    "weak_exponents",
    "weak_order",
    "with_eps",
]


def has_theory(entry, model):
    """Whether an entry has orders that hold for a model; not for a splitting without exact flows."""
    return not math.isnan(entry.weak_order) and (exact_flows(model) or entry.composition is None)


def weak_exponents(entry, model, count):
    """The first powers of h in the weak error of a scheme at smooth functions, `count` of them; None without theory.

    p, p + 1, ... (Talay and Tubaro, Stochastic Analysis and Applications 8, 1990), and p, p + 2, ... of a composition
    that equals itself reversed.  None for a scheme of the multiscale system, since they would not be uniform in eps.
    """
    if entry.multiscale or judges(entry.record) or not has_theory(entry, model):
        return None
    reversible = is_reversible(model) and not has_friction(model)  # which is exact to order 2
    symmetric = entry.composition is not None and is_own_reverse(entry.composition, model) and reversible
    apart = 2 if symmetric else 1
    return tuple(entry.weak_order + apart * i for i in range(count))


def of_model(entry, model):
    """An entry as it holds for a model, which may have inner steps in place of flows without a closed form.

    Inner steps leave the strong orders as they are, and the weak order where no noise needs them.  A composition has
    friction among its stages where the model is at a temperature.  Judged noises without friction in what is proposed
    have lower orders, see ``metropolis.py``.
    """
    if judges(entry.record) and has_arrays(model) and not in_place(model):
        entry = entry._replace(strong_order=0.25, strong_order_commuting=0.25, weak_order=0.5)
    if entry.composition is not None and has_friction(model):
        entry = entry._replace(record=entry.record._replace(stages=with_friction(entry.composition)))
    lacking = flows_lacking(model)
    if entry.composition is None or not lacking or not inner(model):
        return entry
    entry = entry._replace(preserves=preserved(model))
    if all(part == "pieces" for part, _ in lacking):
        return entry
    implicit = inner(model) == "midpoint"
    return entry._replace(weak_order=min(1.0, entry.weak_order), needs_truncation=implicit)


def composed(name, stages, weak_order):
    """An entry for a composition of flows that is not in the table, without orders if `weak_order` is NaN.

    Its strong orders are those of all compositions that are whole steps: their errors of first order are brackets of a
    noise with the drift, of mean 0, and, without loops, of noises with one another.
    """
    has_order = not math.isnan(weak_order)
    orders = {"strong_order": 1.0 if has_loops(stages) else 0.5, "strong_order_commuting": 1.0}
    return Scheme(
        record=splitting(*stages),
        label=name,
        formula="z = the flows of its stages one after the other",
        reference="the experiment",
        look=("", ""),
        weak_order=weak_order,
        **(POISSON | (orders if has_order else dict.fromkeys(orders, math.nan))),
    )


def with_eps(entry, eps):
    """An entry with this eps in its record if it is for the multiscale system."""
    return entry._replace(record=entry.record._replace(eps=eps)) if entry.multiscale else entry


def scheme_entry(name, eps=None):
    """Entry of a scheme in the table, for the multiscale system with this eps in its record."""
    return with_eps(SCHEMES[name], eps)


# ---------------------------------------------------------------------------------------------------------------------
# Orders of convergence.
# ---------------------------------------------------------------------------------------------------------------------


def strong_order(entry, model, initial, law=None):
    """Strong order of a scheme, None where theory states none: a splitting need not be made of exact flows.

    The order with several noises rises to that with one where they commute, f_k' f_l = f_l' f_k, and to 1 where what a
    scheme leaves out is 0 as well, f_k' f_l for Euler-Maruyama, which is then Milstein's scheme.  `initial` is y_0, and
    `law` that of the driver, None for Brownian motion.
    """
    model = in_kernels(model)
    if entry.composition is not None and not has_theory(entry, model):
        return None
    if not noise_indices(model):
        return order_without_noise(entry, model)
    states = [] if has_arrays(model) else _states_near(initial)
    commuting = noises_commute(model) if has_arrays(model) else _commute(model, states)
    if law is not None:
        return law.strong_order(entry, model, commuting)
    order = entry.strong_order_commuting if commuting else entry.strong_order
    if commuting and entry.left_out is not None and not has_arrays(model):  # of large models f_k' f_k is not 0
        left_out = _products(entry.left_out, model, states)
        order = order if np.any(np.abs(left_out + np.swapaxes(left_out, 1, 2)) > 1e-12) else 1.0
    return None if order is None or math.isnan(order) else order  # NaN in a Python file that does not state it


def order_without_noise(entry, model):
    """Order of a scheme for the ordinary differential equation without noise; None where theory states none."""
    if not has_theory(entry, model):
        return None
    if entry.composition is not None:
        return 2.0 if is_palindrome(entry, model, False) else 1.0
    return None if math.isnan(entry.order_without_noise) else entry.order_without_noise


def _states_near(initial):
    """Some states at which noises are compared; their components are positive, as those of populations."""
    states = np.array(initial) + np.random.default_rng(0).standard_normal((4, len(initial)))
    return list(map(tuple, np.abs(states).tolist()))


def _commute(model, states):
    """Whether f_k' f_l = f_l' f_k for all noises at all of the states."""
    products = _products(noise_field_derivative, model, states)
    return np.allclose(products, np.swapaxes(products, 1, 2), rtol=1e-12, atol=1e-12)


def _products(word, model, states):
    """word(model, k, y, f_m(y)) for all states y and noises k and m."""
    noises = noise_indices(model)
    with uncompiled():  # not worth compiling
        return np.array(
            [[[word(model, k, y, noise_field(model, m, y)) for m in noises] for k in noises] for y in states]
        )


def weak_order(entry, model, extrapolate=0, law=None):
    """Weak order for smooth functions, after so many levels of extrapolation; None where theory states none.

    `law` is that of the driver, None for Brownian motion.
    """
    if law is not None:
        return law.weak_order(entry, model)
    if not extrapolate:
        if not noise_indices(in_kernels(model)):
            return order_without_noise(entry, in_kernels(model))
        return entry.weak_order if has_theory(entry, model) else None
    exponents = weak_exponents(entry, model, extrapolate + 1)
    return exponents[-1] if exponents else None


def is_palindrome(entry, model, commuting):
    """Whether a step is its own reverse path by path, where noises that commute may stand in any order."""
    stages, indices = entry.composition, indices_of(model)
    words = [acting_flows(stages, indices, coin) for coin in (1, -1)]
    return words[0] == words[0][::-1] == words[1] or (commuting and is_reversed_by_coin(stages))
