"""What the solvers without sampling give."""

from typing import Any, NamedTuple

import numpy as np


class Expectations(NamedTuple):
    """E phi(y) at the final time for F test functions: of a scheme at S step sizes, and of the equation itself.

    Each bound is an estimate of the numerical error, from refining the discretisation; `weak_error` is value - limit,
    where errors common to both cancel.
    """

    h: np.ndarray  #: (S,) step sizes
    value: np.ndarray  #: (F, S) E phi(y_N)
    limit: np.ndarray  #: (F,) E phi(y(T))
    weak_error: np.ndarray  #: (F, S)
    value_bound: np.ndarray  #: (F, S)
    limit_bound: np.ndarray  #: (F,)
    weak_error_bound: np.ndarray  #: (F, S)
    notes: dict[str, Any]  #: how it was computed: resolution, seconds, ...


class Demands(NamedTuple):
    """What a solver takes for a question, roughly."""

    seconds: float  #: on all threads
    bytes: float  #: of memory, at most
    obstacle: str = ""  #: why the solver cannot do it, in words that follow "the solver"
    remedy: str = ""  #: what would be right then
    least: float = 0.0  #: numerical error below which rounding lets no accuracy be reached
