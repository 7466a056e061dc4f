"""The Euler-Maruyama scheme, the paper's first comparator, and the same with its length corrected."""

from typing import NamedTuple

import numpy as np

from ..compiler.dispatch import device
from ..ensemble.fields import add_ito_correction, add_noise_fields, add_scaled, dot, drift_field, scaled
from ..ensemble.lanes import load_lane, store_lane
from ..numerics.rng import LANES
from .large import euler_step_of_large, size_or


@device
def euler_step(model, h, dW, lane, y):
    """One step of one lane."""
    new = add_scaled(y, h, drift_field(model, y))
    new = add_ito_correction(model, new, h, y)
    return add_noise_fields(model, new, dW, lane, y)


class EulerMaruyama(NamedTuple):
    """y + h (f(y) + 1/2 sum_k sigma_k^2 f_k'(y) f_k(y)) + sum_k sigma_k dW_k f_k(y), the system in its Itô form.

    Here f = B grad H and f_k = B grad Ĥ_k.
    """

    def advance(scheme, model, h, dW, coins, y, work, report):
        for lane in range(LANES):
            store_lane(y, lane, euler_step(model, h, dW, lane, load_lane(model, y, lane)))

    def advance_large(scheme, model, paths, h, dW, coins, y, work, report):
        euler_step_of_large(model, paths, h, dW, y, work)

    def work_size(scheme, model):
        return size_or(0, model)


class RenormalisedEulerMaruyama(NamedTuple):
    """A step z of Euler-Maruyama scaled back to the length of y, |y| z / |z|, where |y|^2 is a Casimir function.

    It stays on the sphere, and no more: it is no composition of Poisson maps.
    """

    def advance(scheme, model, h, dW, coins, y, work, report):
        for lane in range(LANES):
            state = load_lane(model, y, lane)
            new = euler_step(model, h, dW, lane, state)
            store_lane(y, lane, scaled(new, np.sqrt(dot(state, state) / dot(new, new))))
