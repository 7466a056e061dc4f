"""Conditions on a case with damping or a temperature."""

import math
from contextlib import suppress
from typing import Any

import numpy as np

from ..ensemble.protocol import (
    casimir_degrees,
    conserved,
    dimension,
    large,
    noise_indices,
    squared_length_is_casimir,
)
from ..exact.surfaces import casimir_form, semidefinite
from ..models.damped import damped
from ..models.thermal import thermal
from .drivers import described
from .keys import quantity, wrong

_MOST_DECAY = 600.0  # of the logarithm of a Casimir function, whose smallest values are about exp(-700)
LAWS = ("law", "distance", "moments")  # panels about a stationary law


def damped_model(case: Any) -> Any:
    """The record of the model of a case, with its damping; raises the error about it if it cannot be."""
    if large(case.model):
        raise wrong(f"is for models of few components, which {case.model_name} is not", "leave it out", "damping")
    degrees = casimir_degrees(case.model)
    if len(degrees) != conserved(case.model):
        fault = f"is for models that state the degrees of their Casimir functions, which {case.model_name} does not"
        raise wrong(fault, "leave it out, or state casimir_degrees", "damping")
    if laws := [panel for panel in getattr(case, "panels", ()) if panel in LAWS]:
        raise wrong(f"has '{laws[0]}', and no law is known with damping", "leave out one of them", "panels")
    most = _MOST_DECAY / max(degrees, default=1) / case.last_time
    if case.damping > most:
        fault = f"is {quantity(case.damping)}, with which all states are 0 but for rounding before the end"
        raise wrong(fault, f"must be at most {most:.3g} for paths until the time {quantity(case.last_time)}", "damping")
    return damped(case.model, case.damping)


def dissipation(case: Any) -> dict[str, float]:
    """The keys about dissipation that a case has, by name."""
    keys = {"damping": bool, "temperature": math.isfinite}
    return {key: getattr(case, key) for key, is_there in keys.items() if is_there(getattr(case, key))}


def dissipative_model(case: Any) -> Any:
    """The record of the model of a case with its damping or at its temperature."""
    if math.isfinite(case.temperature):
        return thermal_model(case)
    return damped_model(case) if case.damping else case.model


def thermal_model(case: Any) -> Any:
    """The record of the model of a case at its temperature; raises the error about it if it cannot be."""
    model, temperature = case.model, case.temperature
    if temperature == 0:
        right = "for selective decay at the rate gamma take a small one, T, and sigma = sqrt(2*gamma*T)"
        raise wrong("is 0, at which friction would be infinite", right, "temperature")
    if case.damping:
        raise wrong("is given beside damping, with which no law is stationary", "leave out one of them", "temperature")
    if described(case.noise):
        fault = "is given beside noise, and friction belongs to Brownian motion"
        raise wrong(fault, "leave out one of them", "temperature")
    if not noise_indices(model):
        fault = "is given to a model without noise, which nothing would bring to it"
        raise wrong(fault, "leave it out, or give sigma a number above 0", "temperature")
    if temperature < 0 and not has_compact_surfaces(model):
        fault = f"is {quantity(temperature)}, and no sum of Casimir functions of {case.model_name} bounds the state"
        raise wrong(fault, "must be above 0 where energy has no upper bound", "temperature")
    if laws := [panel for panel in getattr(case, "panels", ()) if panel in LAWS]:
        raise wrong(f"has '{laws[0]}', whose law is that without a temperature", "leave out one of them", "panels")
    return thermal(model, temperature)


def has_compact_surfaces(model: Any) -> bool:
    """Whether the quadratic Casimir functions that grow in every direction in which they change add up to all of |y|.

    Sufficient, not necessary: Casimir functions of other forms are not looked at.
    """
    if large(model) or squared_length_is_casimir(model):
        return True
    total = np.zeros((dimension(model), dimension(model)))
    for c in range(conserved(model)):
        with suppress(ValueError):  # it is not quadratic
            b, Q = casimir_form(model, c)
            total += 0 if b.any() else semidefinite(Q)
    return bool(np.linalg.eigvalsh(total)[0] > 1e-9)
