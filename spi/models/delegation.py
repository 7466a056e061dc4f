"""Models that are another one and something more: they answer as the model within does, but for what they add."""

import inspect

from ..compiler.generated import function_of
from ..compiler.records import field
from ..ensemble import protocol

#: Where such a model answers as any model does that does not answer: it lacks what these say, or has no such need.
_NOT_FORWARDED = (
    *("axis_inertias", "rotation_shear_rates", "flow_places"),
    *("lie_bracket", "noise_bracket_gradient", "bracket_factors"),
    *("large", "in_kernels", "fault"),
    *("frozen", "has_friction", "friction_time"),
)


def inner(model):
    """The model within one, or the Numba type of it."""
    return field(model, "model")


def undamped(model):
    """The record of a model without what is added to it: damping, or friction at a temperature."""
    while hasattr(type(model), "answers_as_inner"):
        model = model.model
    return model


def answering_as_inner(*left_out):
    """Decorator for a class with a field ``model``: it answers what it does not say itself as that model does."""

    def decorate(cls):
        for name, asked in vars(protocol).items():
            if hasattr(asked, "declared") and name not in (*vars(cls), *_NOT_FORWARDED, *left_out):
                setattr(cls, name, _forwarded(asked))
        cls.answers_as_inner = True
        return cls

    return decorate


def _forwarded(asked):
    """The method by which such a model answers as the model within."""
    if asked.declared.of:  # also of the Numba type of a record
        return lambda model: asked(inner(model))
    _, *others = inspect.signature(asked).parameters
    parameters, arguments = (", ".join([first, *others]) for first in ("model", "model.model"))
    return function_of([f"def forwarded({parameters}):", f"return asked({arguments})"], {"asked": asked})
