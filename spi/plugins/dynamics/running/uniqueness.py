"""Warning about a temperature at which exp(-H/T) is not the only stationary law."""

import math
from functools import lru_cache
from typing import Any

from spi.ensemble.protocol import dimension, large
from spi.models.delegation import undamped
from spi.plugins.dynamics.exact.reach import reach
from spi.specs import BaseCase

_MOST_COMPONENTS = 24  #: of states whose reachable set is computed


def warning(case: BaseCase) -> str:
    """A line where further functions than those of Casimir are conserved; "" elsewhere."""
    model = undamped(case.model)
    if math.isinf(case.temperature) or large(model) or dimension(model) > _MOST_COMPONENTS:
        return ""
    return _of_noises(model._replace(sigma=tuple(None if s is None else 1.0 for s in model.sigma)), case.initial)


@lru_cache(typed=True)  # cases that differ in steps or strengths have the same fields
def _of_noises(model: Any, initial: Any) -> str:
    try:
        rank, surface = reach(model, initial)
    except (ValueError, ArithmeticError):  # of formulas that are not for several states at once
        return ""
    if rank >= surface:
        return ""
    return (
        f"warning: the noises and the drift move a state in {rank} of the {surface} dimensions of its Casimir surface,"
        " so that exp(-H/T) is not the only stationary law"
    )
