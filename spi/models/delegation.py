"""Models that add a term to another model, and otherwise have its traits and methods."""

import inspect

from ..compiler.generated import function_of
from ..compiler.records import field
from ..ensemble import protocol

#: Traits and methods that such a model does not take from the inner one: it lacks these properties, or the default
#: holds.
_NOT_FORWARDED = (
    *("axis_inertias", "rotation_shear_rates", "flow_places"),
    *("lie_bracket", "noise_bracket_gradient", "bracket_factors"),
    *("large", "in_kernels", "fault"),
    *("frozen", "has_friction", "friction_time"),
)


def inner(model):
    """The inner model of a model, or the Numba type of it."""
    return field(model, "model")


def undamped(model):
    """The record of a model without added damping and without friction at a temperature."""
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
    """The method that calls that of the inner model."""
    if member.declared.of:  # also of the Numba type of a record
        return lambda model: member(inner(model))
    _, *others = inspect.signature(member).parameters
    parameters, arguments = (", ".join([first, *others]) for first in ("model", "model.model"))
    return function_of([f"def forwarded({parameters}):", f"return asked({arguments})"], {"asked": member})
