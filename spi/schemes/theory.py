"""The orders of convergence that theory states of a scheme for a model, with Brownian motion and with other drivers.

With other drivers, see docs/drivers.md, the orders of compositions of exact flows follow from what such a step lacks:
half a commutator of the drift and an increment, and dX_k dX_l / 2 - A_kl times that of two noises, of which palindromes
lack A_kl alone.
"""

import math

import numpy as np

from ..compiler.inlining import uncompiled
from ..ensemble.drivers import Fractional, OrnsteinUhlenbeck
from ..ensemble.fields import noise_field, noise_field_derivative
from ..ensemble.protocol import in_kernels, large, noise_groups, noise_indices
from . import has_theory, weak_exponents
from .stages import acting_flows, indices_of, is_reversed_by_coin, needs_coins


def strong_order(entry, model, initial, law=None):
    """The strong order of a scheme, None where theory states none: a splitting need not be made of exact flows.

    The order with several noises rises to that with one where they commute, f_k' f_l = f_l' f_k, and to 1 where what a
    scheme leaves out is 0 as well, f_k' f_l for Euler-Maruyama, which is then Milstein's scheme.  `initial` is y_0, and
    `law` that of the driver, None for Brownian motion.
    """
    model = in_kernels(model)
    if entry.composition is not None and not has_theory(entry, model):
        return None
    if not large(model) and not noise_indices(model):
        return 1.0 if has_theory(entry, model) else None
    states = [] if large(model) else _states_near(initial)
    commuting = noise_groups(model) <= 1 if large(model) else _commute(model, states)
    if law is not None:
        return driven_order(law, entry, model, commuting)
    order = entry.strong_order_commuting if commuting else entry.strong_order
    if commuting and entry.left_out is not None and not large(model):  # of large models f_k' f_k is not 0
        left_out = _products(entry.left_out, model, states)
        order = order if np.any(np.abs(left_out + np.swapaxes(left_out, 1, 2)) > 1e-12) else 1.0
    return None if order is None or math.isnan(order) else order  # NaN in a Python file that does not state it


def _states_near(initial):
    """Some states at which noises are compared; their components are positive, as those of populations."""
    states = np.array(initial) + np.random.default_rng(0).standard_normal((4, len(initial)))
    return list(map(tuple, np.abs(states).tolist()))


def _commute(model, states):
    """Whether f_k' f_l = f_l' f_k for all noises at all of the states; of large models those of one group do."""
    products = _products(noise_field_derivative, model, states)
    return np.allclose(products, np.swapaxes(products, 1, 2), rtol=1e-12, atol=1e-12)


def _products(word, model, states):
    """word(model, k, y, f_m(y)) for all states y and noises k and m."""
    noises = noise_indices(model)
    with uncompiled():  # not worth compiling
        return np.array(
            [[[word(model, k, y, noise_field(model, m, y)) for m in noises] for k in noises] for y in states]
        )


def driven_order(law, entry, model, commuting):
    """The strong order with a driver, for noises that commute or do not; None where it is not known."""
    if entry.composition is None or not has_theory(entry, model):
        return None
    balanced = _is_palindrome(entry, model, commuting)
    if isinstance(law, OrnsteinUhlenbeck):
        return 2.0 if balanced else 1.5 if is_reversed_by_coin(entry.composition) else 1.0
    if isinstance(law, Fractional):
        even = balanced or needs_coins(entry.composition)
        order = law.hurst + 0.5 if commuting else 2.0 * law.hurst - 0.5
        return order if even else min(1.0, order)
    return None


def weak_order(entry, model, extrapolate=0, law=None):
    """The weak order for smooth functions, after so many levels of extrapolation; None where theory states none.

    `law` is that of the driver, None for Brownian motion.
    """
    if law is not None:
        stated = entry.composition is not None and has_theory(entry, model) and isinstance(law, OrnsteinUhlenbeck)
        return (2.0 if _is_palindrome(entry, model, True) else 1.0) if stated else None
    if not extrapolate:
        return entry.weak_order if has_theory(entry, model) else None
    exponents = weak_exponents(entry, model, extrapolate + 1)
    return exponents[-1] if exponents else None


def _is_palindrome(entry, model, commuting):
    """Whether a step is its own reverse path by path, where noises that commute may stand in any order."""
    stages, indices = entry.composition, indices_of(model)
    words = [acting_flows(stages, indices, coin) for coin in (1, -1)]
    return words[0] == words[0][::-1] == words[1] or (commuting and is_reversed_by_coin(stages))
