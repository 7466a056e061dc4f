"""References for means: formulas in t, the columns of a file, expectations without sampling, stationary laws."""

import functools
import math
from typing import Any

import numpy as np

from spi.ensemble.protocol import dimension
from spi.ensemble.random_states import RandomState
from spi.exact.expectations import can_solve_equation, demands, exact_expectations, seconds_of_equation
from spi.exact.linear import MomentEquations
from spi.expressions import canonical, parse_expression
from spi.kinds.functions import PathFunction, function_of
from spi.kinds.linear import linear_moments
from spi.plugins import lacking
from spi.plugins.dynamics.exact.sphere_law import stationary_means
from spi.plugins.dynamics.kinds.references import EXACT, STATIONARY, References, Word, gibbs_mean, reason_of
from spi.specs.names import named_in

_ACCURACY = 1e-6  # numerical error that exact expectations may have
_OF_PATH = "that is known of functions of the state, not of the path or of time"
_DAMPED = "that is known on a Casimir surface, which paths leave with damping"


def _unsolved(case: Any, name: str) -> str | None:
    """The reason why the mean of a function is not known without sampling; None if it is known."""
    function = function_of(case, case.functions[name])
    if function.functional or function.start is not None:
        return _OF_PATH
    if case.noise is not None:
        return "that is known where Brownian motion drives"
    if _moments(case, name) is not None:
        return None
    if case.damping:
        return _DAMPED
    if isinstance(case.initial, RandomState):
        return "that is known for one initial state, and here each path has its own"
    if advice := lacking("solvers", "axis_inertias"):
        return f"no equation is solved without a solver ({advice})"
    if not can_solve_equation(case.model):
        able = "systems on spheres with flows about the axes, and polynomials where the equation is linear"
        return f"no equation is solved for {case.model_name}, only for {able}"
    end = case.final_time
    need = demands(case.model, ((1.0, ()),), case.initial, end, (end,), (function.values,))
    return f"its solver {need.obstacle}: {need.remedy}" if need.obstacle else None


def _not_stationary(case: Any, name: str) -> str | None:
    """The reason why no stationary law is known; None if it is."""
    function = function_of(case, case.functions[name])
    if function.functional or function.start is not None:
        return _OF_PATH
    if case.damping:
        return _DAMPED
    law = case.initial.parameters if isinstance(case.initial, RandomState) else {}
    if law and law["law"] not in ("uniform_on_surface", "gibbs") and not law.get("project"):
        return "that is known of paths on one sphere, and here each has its own"
    return reason_of(_stationary)(case, name)


def _moments(case: Any, name: str) -> MomentEquations | None:
    """Moments of a linear equation that a function needs, if these are known."""
    entry = case.functions[name]
    if isinstance(case.initial, RandomState) or not isinstance(entry, str):
        return None
    words = named_in(entry, case.model, case.variables, case.python)
    return linear_moments(case.model, [parse_expression(entry, dimension(case.model), case.variables, words)], case.t)


def seconds_of_means(case: Any) -> float:
    """Seconds that the means of :data:`REFERENCES` take, roughly; those of moments are few."""
    exact = [name for name, reference in case.reference.items() if reference == EXACT]
    functions = (function_of(case, case.functions[name]) for name in exact if _moments(case, name) is None)
    return sum(seconds_of_equation(case.model, case.initial, case.t, [phi.values]) for phi in functions)


def reference_formulas(case: Any) -> tuple[str, ...]:
    """References that are formulas, in y1 = t and numbers, and "" for others; () without any."""
    given = [case.reference.get(name) for name in case.functions]
    texts = [canonical(REFERENCES.formula(case, one)) if REFERENCES.is_formula(one) else "" for one in given]
    return tuple(texts) if any(texts) else ()


def _solved(case: Any, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Means of the equation at the times of the statistics, and their numerical errors."""
    if (linear := _moments(case, name)) is not None:
        (value,), (error,) = linear.expectations(case.initial, case.t)
        return value, error
    return _exact(case.model, case.initial, tuple(case.t), function_of(case, case.functions[name]))


def _stationary(case: Any, name: str) -> tuple[float, float]:
    """The mean of a function under the Gibbs law, uniform without a temperature, and its numerical error.

    ValueError, with the reason in a phrase, where no such law is known.
    """
    law, function = (case.model, case.initial), function_of(case, case.functions[name])
    if math.isinf(case.temperature):
        return float(stationary_means(*law, [function.values])[0]), 0.0
    return gibbs_mean(*law, case.temperature, function)


@functools.lru_cache(maxsize=256, typed=True)
def _exact(
    model: Any, initial: tuple[float, ...], times: tuple[float, ...], function: PathFunction
) -> tuple[np.ndarray, np.ndarray]:
    """Exact means of a function of the state and their numerical errors.

    Cached, as all schemes and steps have the same; typed, because models of two classes may be equal tuples.
    """
    mean, error = exact_expectations(model, initial, np.array(times), [function.values], _ACCURACY)
    return mean[0], error[0]


REFERENCES = References(
    {EXACT: Word(_unsolved, _solved), STATIONARY: Word(_not_stationary, _stationary)},
    right=f"must be an expression in t, {EXACT}, {STATIONARY} or {{file: known.csv}}",
    names=("t",),
)
