"""Linear damping of any model: dy = B grad H dt - gamma y dt + noise.

The field -gamma y has the exact flow exp(-gamma t) y, which acts as one more piece, after those of H.  It is conformal:
a Casimir function that is homogeneous of degree k decays as exp(-k gamma t), on every path and to rounding.
"""

from typing import Any, NamedTuple

from ..ensemble.fields import add_scaled, cross_product
from ..ensemble.protocol import casimir_degrees, drift_angle, drift_flow, frozen, pieces
from ..numerics.elementary import expm1
from .delegation import answering_as_inner, inner


@answering_as_inner(
    "squared_length_is_casimir", "phases", "drift_phases", "drift_turned", "noise_phases", "noise_turned"
)
class Damped(NamedTuple):
    """A model with the field -gamma y added: its traits and methods are those of the model, with one more piece."""

    model: Any
    damping: float  #: gamma
    sigma: tuple  #: that of the model

    def pieces(model):
        return pieces(inner(model)) + 1

    def structure_is_cross_product(model):
        return cross_product(inner(model))

    def decay_rates(model):
        return tuple(k * model.damping for k in casimir_degrees(model))

    def frozen(model, begin, h):
        within = frozen(model.model, begin, h)
        return Damped(within, model.damping, within.sigma)

    def drift_flow(model, k, t, y, angles):
        """The factor exp(-gamma t) minus 1, and not itself, because its rounding is the same in every step.

        It would be a drift of 1e-16 a step; that of the small number is smaller by a factor of gamma t.
        """
        if k < pieces(model.model):
            return drift_flow(model.model, k, t, y, angles)
        return add_scaled(y, expm1(-model.damping * t), y)

    def drift_angle(model, k, t, y):
        return drift_angle(model.model, k, t, y) if k < pieces(model.model) else 0.0

    def add_dissipation(model, value, h, y):
        return add_scaled(value, -model.damping * h, y)


def damped(model, damping):
    """The record of a model with damping, the model itself where that is 0."""
    return Damped(model, damping, model.sigma) if damping else model
