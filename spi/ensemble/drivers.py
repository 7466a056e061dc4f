"""What drives the noises of a run: Brownian motion, or another process whose increments are known.

    dy = B(y) grad H(y) dt + sum_k sigma_k B(y) grad Ĥ_k(y) ∘ dX_k(t)

with independent processes X_k of one law (``laws.py``) that starts at 0.  Brownian increments are drawn in the loop
over time; those of another process are made here, for some steps of some paths at a time, and given to it as arrays.
They are functions of seed, path and step: whatever is computed together, and whatever was computed before, the bits are
the same.  Increments over larger steps are sums of two, in this order, as everywhere.
"""

import math
from typing import Any

import numpy as np

from ..numerics.rng import LANES, STEPS_PER_TOSS
from .given import Given, draw_all_coins
from .laws import Asked, at_once
from .protocol import noises
from .scheme_protocol import substeps, tosses

#: Of the increments that are made at a time.
_BYTES = 2**26

_NO_AREAS, _NO_COINS = np.zeros((0, 0, 0)), np.zeros((0, 0))


class _Nothing:
    """The law of increments that are 0."""

    def draw(self, asked, memory):
        return np.zeros((asked.count, asked.paths, asked.noises))


class Driver:
    """The paths of a seed of another process, as ``streams.RandomStream`` is those of Brownian motion.

    `law` is one of ``laws.py``, `last_time` is that until which the process is asked for, and each step is resolved
    into at least `parts` sub-steps, so that schemes that need fewer have the same paths as those that need them all.
    """

    def __init__(self, law: Any, stream: Any, last_time: float, parts: int = 1) -> None:
        self.law, self.keys, self.last_time, self.parts = law, stream, last_time, parts
        self._memory: dict[Any, Any] = {}

    @property
    def for_a_trial(self):
        """A driver whose increments are 0, for calls that only have kernels compiled."""
        return Driver(_Nothing(), self.keys, self.last_time, self.parts)

    def most_blocks(self, model, times):
        """How many blocks fit into memory, as far as their noise is concerned."""
        steps = times.first_step + times.reference_steps if at_once(self.law) else self._unit(times)
        return max(1, _BYTES // (8 * LANES * noises(model) * self.parts * steps))

    def pieces(self, scheme, model, times, first, blocks, end):
        """As those of ``RandomStream.pieces``, with noise as arrays."""
        used = [one for one in (scheme, times.reference_scheme) if one is not None]
        parts, unit = max(map(substeps, used)), self._unit(times)
        paths = min(end, (first + blocks) * LANES) - first * LANES
        count = max(1, _BYTES // (8 * paths * noises(model) * self.parts * unit)) * unit
        last = times.first_step + times.reference_steps
        for n in range(times.first_step, last, count):
            steps = min(count, last - n)
            dW = self.increments(times.reference_step, n, steps, first * LANES, paths, noises(model), parts)
            coins = self.coins(n, steps, first * LANES, paths) if any(map(tosses, used)) else _NO_COINS
            yield times._replace(first_step=n, reference_steps=steps), Given(dW, _NO_AREAS, coins, n), 0, paths

    def coins(self, first, steps, first_path, paths):
        """(steps, paths) those of steps from number `first` on."""
        coins = np.empty((steps, paths))
        draw_all_coins(self.keys, first, first_path, coins)
        return coins

    def increments(self, h, first, steps, first_path, paths, noises_of_model, parts=1):
        """(parts * steps, paths, noises): those over sub-steps of the steps of size h from number `first` on."""
        fine = max(parts, self.parts)
        total = max(round(self.last_time / h), first + steps)
        asked = Asked(self.keys, h / fine, fine * first, fine * steps, fine * total, first_path, paths, noises_of_model)
        dW = self.law.draw(asked, self._memory)
        while fine > parts:
            dW, fine = dW[0::2] + dW[1::2], fine // 2
        return np.ascontiguousarray(dW)

    def _unit(self, times):
        """Of how many steps the loop can make a multiple at a time."""
        return math.lcm(STEPS_PER_TOSS, 1 << int(times.doublings[-1]))
