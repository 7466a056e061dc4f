"""Models that add a term to another model, damping or friction, and otherwise have its traits and methods."""

import inspect
import math
from typing import Any, NamedTuple

from ..compiler.dispatch import FieldOf, answers, device, function_of, number, unrolled
from ..compiler.records import field
from ..compiler.vectors import WIDTH
from ..ensemble import protocol
from ..ensemble.fields import add_scaled, cross_product, dot, lie_poisson, noise_field, noise_field_derivative
from ..ensemble.protocol import (
    add_block_drift,
    add_block_noises,
    at_temperature,
    block_noise_slopes,
    block_work,
    casimir_degrees,
    conserved,
    dimension,
    drift_angle,
    drift_flow,
    drift_gradient,
    drift_hessian,
    friction_after,
    friction_rate,
    frozen,
    in_kernels,
    large,
    noise_gradient,
    noise_hessian,
    noise_indices,
    noises,
    pieces,
)
from ..numerics.elementary import expm1

#: Traits and methods that such a model does not take from the inner one: it lacks these properties, or the default
#: holds.
_NOT_FORWARDED = (
    *("axis_inertias", "rotation_shear_rates", "flow_places"),
    *("lie_bracket", "noise_bracket_gradient", "bracket_factors"),
    *("large", "in_kernels", "fault", "at_temperature", "one_path", "gibbs_law", "state_fault", "observables"),
    *("bath_fault", "function_calls"),
    *("frozen", "has_friction", "friction_time", "friction_slope"),
)


def inner(model):
    """Inner model of a model, or the Numba type of it."""
    return field(model, "model")


def undamped(model):
    """Record of a model without added damping and without friction at a temperature."""
    while hasattr(type(model), "answers_as_inner"):
        model = model.model
    return model


def answering_as_inner(*left_out):
    """Decorator for a class with a field ``model``: it gets the traits and methods of that model that it lacks."""

    def decorate(cls):
        for name, member in vars(protocol).items():
            if hasattr(member, "declared") and name not in (*vars(cls), *_NOT_FORWARDED, *left_out):
                setattr(cls, name, _forwarded(member))
        cls.answers_as_inner = True
        return cls

    return decorate


def _forwarded(member):
    """Method that calls that of the inner model."""
    if member.declared.of:  # also of the Numba type of a record
        return lambda model: member(inner(model))
    _, *others = inspect.signature(member).parameters
    parameters, arguments = (", ".join([first, *others]) for first in ("model", "model.model"))
    return function_of([f"def forwarded({parameters}):", f"return asked({arguments})"], {"asked": member})


# ---------------------------------------------------------------------------------------------------------------------
# Linear damping of any model: dy = B grad H dt - gamma y dt + noise.
#
# The field -gamma y has the exact flow exp(-gamma t) y, which acts as one more piece, after those of H.  It is
# conformal: a Casimir function that is homogeneous of degree k decays as exp(-k gamma t), on every path and to
# rounding.
# ---------------------------------------------------------------------------------------------------------------------


def depends_on_time(model):
    """Whether the equations of a model, or the H of its record for kernels, depend on time."""
    model = undamped(model)
    return answers(frozen, model) or answers(frozen, in_kernels(model))


@answering_as_inner("squared_length_is_casimir")
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
    """Record of a model with damping, the model itself where that is 0."""
    return Damped(model, damping, model.sigma) if damping else model


# ---------------------------------------------------------------------------------------------------------------------
# Any model at a temperature T: friction along the fields of its noises X_k = B grad Ĥ_k,
#
#     dy = B grad H dt + sum_k [sigma_k X_k ∘ dW_k - c_k (X_k H) X_k dt],      c_k = sigma_k^2 / (2 T),
#
# with which exp(-H/T) is the density of a stationary law on each Casimir surface, see docs/temperature.md.
# ---------------------------------------------------------------------------------------------------------------------


@answering_as_inner("add_dissipation", "structure_is_kept")
class Thermal(NamedTuple):
    """A model with friction: its traits and methods are those of the model, except for the ones below.

    All friction together is B times -sum_k c_k (X_k H) grad Ĥ_k.  So ``drift_gradient`` is grad H plus that sum, while
    the flows of the pieces are those of H.
    """

    model: Any
    temperature: float  #: T, which may be negative
    sigma: tuple  #: that of the model

    has_friction = True

    def structure_is_cross_product(model):
        return cross_product(inner(model))

    def lie_poisson(model):
        return lie_poisson(inner(model))

    def frozen(model, begin, h):
        within = frozen(model.model, begin, h)
        return Thermal(within, model.temperature, within.sigma)

    def friction_slope(model, k, y):
        return dot(drift_gradient(model.model, y), noise_field(model.model, k, y))

    def friction_time(model, k, t, y):
        c = friction_rate(model, k)
        field = noise_field(model.model, k, y)
        gradient = drift_gradient(model.model, y)
        bent = dot(gradient, noise_field_derivative(model.model, k, y, field))
        bend = bent + dot(field, drift_hessian(model.model, y, field))
        return friction_after(c, t, dot(gradient, field), bend)

    def drift_gradient(model, y):
        gradient = drift_gradient(model.model, y)
        return _add_friction(model, gradient, gradient, y)

    def drift_hessian(model, y, v):
        turned = drift_hessian(model.model, y, v)
        return _add_friction_derivative(model, turned, drift_gradient(model.model, y), turned, y, v)


@unrolled(noise_indices)
def _add_friction(index, model, value, gradient, y):
    """value - sum_k c_k (X_k H)(y) grad Ĥ_k(y), given grad H."""
    k = number(index)
    c = friction_rate(model, k)
    slope = dot(gradient, noise_field(model.model, k, y))
    return add_scaled(value, -c * slope, noise_gradient(model, k, y))


@unrolled(noise_indices)
def _add_friction_derivative(index, model, value, gradient, turned, y, v):
    """value plus the derivative along v of the sum of :func:`_add_friction`, given grad H and turned = Hess H v."""
    k = number(index)
    c = friction_rate(model, k)
    field = noise_field(model.model, k, y)
    change = dot(turned, field) + dot(gradient, noise_field_derivative(model.model, k, y, v))
    value = add_scaled(value, -c * change, noise_gradient(model, k, y))
    return add_scaled(value, -c * dot(gradient, field), noise_hessian(model, k, y, v))


@answering_as_inner()
class ThermalArrays(NamedTuple):
    """An array-state model with friction."""

    model: Any
    temperature: float

    large = True

    def has_friction(model):
        return True

    def in_kernels(model):
        tables = in_kernels(model.model)
        sizes = (trait(tables) for trait in (dimension, pieces, noises, conserved))
        return ThermalTables(tables, model.temperature, tables.sigma, *sizes)


@answering_as_inner()
class ThermalTables(NamedTuple):
    """Record of :class:`ThermalArrays` for kernels."""

    model: Any
    temperature: float
    sigma: Any  #: (m,)
    d: int
    p: int
    m: int
    c: int

    large = True
    has_friction = True
    dimension, pieces, noises, conserved = FieldOf("d"), FieldOf("p"), FieldOf("m"), FieldOf("c")

    def block_work(model):
        return block_work(model.model) + (model.d + model.m) * WIDTH

    def block_friction_times(model, t, width, y, times, work):
        """From the slopes at t/2, at a state moved along the fields at y."""
        middle, work = work[: model.d * WIDTH], work[model.d * WIDTH :]
        for i in range(model.d * width):
            middle[i] = y[i]
        _take_friction_times(model, 0.5 * t, width, y, times, work)
        add_block_noises(model.model, times, width, y, middle, work)
        _take_friction_times(model, t, width, middle, times, work)

    def add_block_drift(model, t, width, y, out, work):
        """Drift of the model and the friction."""
        times, rest = work[: model.m * WIDTH], work[model.m * WIDTH :]
        add_block_drift(model.model, t, width, y, out, rest)
        _take_friction_times(model, t, width, y, times, rest)
        add_block_noises(model.model, times, width, y, out, rest)


@device
def _take_friction_times(model, t, width, y, times, work):
    """Put -c_k t (X_k H)(y) of all noises into `times`."""
    block_noise_slopes(model.model, width, y, times, work)
    for k in range(model.m):
        for path in range(width):
            times[k * width + path] *= -t * model.sigma[k] * model.sigma[k] / (2.0 * model.temperature)


def thermal(model, temperature):
    """Record of a model at a temperature, the model itself where that is infinite."""
    if math.isinf(temperature):
        return model
    if answers(at_temperature, model):
        return model.at_temperature(temperature)
    return ThermalArrays(model, temperature) if large(model) else Thermal(model, temperature, model.sigma)
