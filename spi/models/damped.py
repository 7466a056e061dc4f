"""Linear damping of any model: dy = B grad H dt - gamma y dt + noise.

The field -gamma y has the exact flow exp(-gamma t) y, which acts as one more piece, after those of H.  It is conformal:
a Casimir function that is homogeneous of degree k decays as exp(-k gamma t), on every path and to rounding.
"""

import inspect
from typing import Any, NamedTuple

from ..compiler.generated import function_of
from ..compiler.records import field
from ..ensemble import inexact, joint, protocol
from ..ensemble.fields import add_scaled, cross_product
from ..ensemble.protocol import casimir_degrees, drift_angle, drift_flow, pieces
from ..ensemble.special import frozen
from ..numerics.elementary import expm1


def _inner(model):
    """The model that is damped, or the Numba type of it."""
    return field(model, "model")


class Damped(NamedTuple):
    """A model with the field -gamma y added: its traits and methods are those of the model, but for one more piece."""

    model: Any
    damping: float  #: gamma
    sigma: tuple  #: that of the model

    def pieces(model):
        return pieces(_inner(model)) + 1

    def structure_is_cross_product(model):
        return cross_product(_inner(model))

    def decay_rates(model):
        return tuple(k * model.damping for k in casimir_degrees(model))

    def frozen(model, begin, h):
        inner = frozen(model.model, begin, h)
        return Damped(inner, model.damping, inner.sigma)

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


#: Where a damped model answers as any model does that does not answer: it lacks what these say, or has no such need.
_NOT_FORWARDED = (
    *("squared_length_is_casimir", "axis_inertias", "rotation_shear_rates", "flow_places"),
    *("lie_bracket", "noise_bracket_gradient", "bracket_factors"),
    *("large", "in_kernels", "fault"),
)


def _forwarded(asked):
    """The method by which a damped model answers as the model within."""
    if asked.declared.of:  # also of the Numba type of a record
        return lambda model: asked(_inner(model))
    _, *others = inspect.signature(asked).parameters
    parameters, arguments = (", ".join([first, *others]) for first in ("model", "model.model"))
    return function_of([f"def forwarded({parameters}):", f"return asked({arguments})"], {"asked": asked})


for _name, _asked in (vars(protocol) | vars(inexact) | vars(joint)).items():
    if hasattr(_asked, "declared") and _name not in (*vars(Damped), *_NOT_FORWARDED):
        setattr(Damped, _name, _forwarded(_asked))


def damped(model, damping):
    """The record of a model with damping, the model itself where that is 0."""
    return Damped(model, damping, model.sigma) if damping else model


def undamped(model):
    """The record of a model without its damping."""
    return model.model if isinstance(model, Damped) else model
