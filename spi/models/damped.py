"""Linear damping of any model: dy = B grad H dt - gamma y dt + noise.

The field -gamma y has the exact flow exp(-gamma t) y, which acts as one more piece, after those of H.  It is conformal:
a Casimir function that is homogeneous of degree k decays as exp(-k gamma t), on every path and to rounding.
"""

from typing import Any, NamedTuple

from ..compiler.records import field
from ..ensemble.fields import add_scaled
from ..ensemble.protocol import (
    casimir_degrees,
    casimirs,
    commuting_noises,
    conserved,
    dimension,
    drift_angle,
    drift_flow,
    drift_gradient,
    drift_hessian,
    exact_flows,
    flow_ns,
    hamiltonian,
    noise_angle,
    noise_flow,
    noise_gradient,
    noise_hessian,
    noise_structure,
    noise_structure_derivative,
    noises,
    pieces,
    populations,
    structure,
    structure_derivative,
)
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

    def dimension(model):
        return dimension(_inner(model))

    def noises(model):
        return noises(_inner(model))

    def conserved(model):
        return conserved(_inner(model))

    def casimir_degrees(model):
        return casimir_degrees(_inner(model))

    def commuting_noises(model):
        return commuting_noises(_inner(model))

    def exact_flows(model):
        return exact_flows(_inner(model))

    def populations(model):
        return populations(_inner(model))

    def flow_ns(model):
        return flow_ns(_inner(model))

    def decay_rates(model):
        return tuple(k * model.damping for k in casimir_degrees(model))

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

    def structure(model, y, v):
        return structure(model.model, y, v)

    def structure_derivative(model, y, u, v):
        return structure_derivative(model.model, y, u, v)

    def noise_structure(model, k, y, v):
        return noise_structure(model.model, k, y, v)

    def noise_structure_derivative(model, k, y, u, v):
        return noise_structure_derivative(model.model, k, y, u, v)

    def noise_flow(model, k, t, y, angles):
        return noise_flow(model.model, k, t, y, angles)

    def noise_angle(model, k, t, y):
        return noise_angle(model.model, k, t, y)

    def hamiltonian(model, y):
        return hamiltonian(model.model, y)

    def drift_gradient(model, y):
        return drift_gradient(model.model, y)

    def drift_hessian(model, y, v):
        return drift_hessian(model.model, y, v)

    def noise_gradient(model, k, y):
        return noise_gradient(model.model, k, y)

    def noise_hessian(model, k, y, v):
        return noise_hessian(model.model, k, y, v)

    def casimirs(model, y):
        return casimirs(model.model, y)


def damped(model, damping):
    """The record of a model with damping, the model itself where that is 0."""
    return Damped(model, damping, model.sigma) if damping else model


def undamped(model):
    """The record of a model without its damping."""
    return model.model if isinstance(model, Damped) else model
