"""What damping asks of a case."""

from typing import Any

from ..ensemble.protocol import casimir_degrees, conserved, large
from ..models.damped import damped
from .keys import quantity, wrong

_MOST_DECAY = 600.0  # of the logarithm of a Casimir function, whose smallest values are about exp(-700)
LAWS = ("law", "distance", "moments")  # panels about a stationary law


def damped_model(case: Any) -> Any:
    """The record of the model of a case, with its damping; raises the error about it if it cannot be."""
    if large(case.model):
        raise wrong(f"is for models of few components, which {case.model_name} is not", "leave it out", "damping")
    degrees = casimir_degrees(case.model)
    if len(degrees) != conserved(case.model):
        what = f"is for models that state the degrees of their Casimir functions, which {case.model_name} does not"
        raise wrong(what, "leave it out, or state casimir_degrees", "damping")
    if laws := [panel for panel in getattr(case, "panels", ()) if panel in LAWS]:
        raise wrong(f"has '{laws[0]}', and no law is known with damping", "leave out one of them", "panels")
    most = _MOST_DECAY / max(degrees, default=1) / case.last_time
    if case.damping > most:
        what = f"is {quantity(case.damping)}, with which all states are 0 but for rounding before the end"
        raise wrong(what, f"must be at most {most:.3g} for paths until the time {quantity(case.last_time)}", "damping")
    return damped(case.model, case.damping)
