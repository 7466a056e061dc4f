"""Orders of splitting schemes where the noises are driven by another process than Brownian motion, see docs/drivers.md.

Those of compositions of exact flows follow from what such a step lacks: half a commutator of the drift and an
increment, and dX_k dX_l / 2 - A_kl times that of two noises, of which palindromes lack A_kl alone.
"""

from ..ensemble.drivers import Fractional, OrnsteinUhlenbeck
from . import has_theory
from .stages import acting_flows, indices_of, is_reversed_by_coin, needs_coins


def strong_order(law, entry, model, commuting):
    """The strong order for noises that commute or do not; None where it is not known."""
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


def weak_order(law, entry, model):
    """The weak order for smooth functions; None where it is not known."""
    if entry.composition is None or not has_theory(entry, model):
        return None
    if isinstance(law, OrnsteinUhlenbeck):
        return 2.0 if _is_palindrome(entry, model, True) else 1.0
    return None


def _is_palindrome(entry, model, commuting):
    """Whether a step is its own reverse path by path, where noises that commute may stand in any order."""
    stages, indices = entry.composition, indices_of(model)
    words = [acting_flows(stages, indices, coin) for coin in (1, -1)]
    return words[0] == words[0][::-1] == words[1] or (commuting and is_reversed_by_coin(stages))
