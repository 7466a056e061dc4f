"""References for means: formulas in t, the columns of a file, expectations without sampling, stationary laws."""

import functools
import io
import math
import re
from typing import Any

import numpy as np

from spi.ensemble.protocol import dimension
from spi.ensemble.random_states import RandomState
from spi.exact.expectations import can_solve_equation, demands, exact_expectations, seconds_of_equation
from spi.exact.linear import Moments
from spi.exact.sphere_law import stationary_means
from spi.expressions import as_numpy, canonical, parse_expression
from spi.expressions.arithmetic import NumberError
from spi.kinds.functions import PathFunction, check_named, function_of, gibbs_mean
from spi.kinds.linear import linear_moments
from spi.specs.checks import ROUNDING
from spi.specs.keys import shown, wrong
from spi.specs.names import named_in, numbers_of

EXACT, STATIONARY = "exact", "stationary"
RIGHT = f"must be an expression in t, {EXACT}, {STATIONARY} or {{file: known.csv}}"
_ACCURACY = 1e-6  # numerical error that exact expectations may have

#: Times, means and standard errors.
Curve = tuple[tuple[float, float, float], ...]


def curve(text: str, path: str) -> Curve:
    """The rows of a file, by t; raises the error about the key ``file``."""
    right = "must have t and value, and may have stderr"
    try:
        table = np.genfromtxt(io.StringIO(text.strip() or "nothing"), delimiter=",", names=True, ndmin=1)
    except ValueError as error:
        raise wrong(f"is {shown(path)}, no table: {str(error).split('    ')[-1].strip()}", right, "file") from None
    names: Any = table.dtype.names
    if not {"t", "value"} <= set(names) <= {"t", "value", "stderr"}:
        raise wrong(f"is {shown(path)}, with the columns {', '.join(names)}", right, "file")
    stderr = np.abs(table["stderr"]) if "stderr" in names else np.zeros(len(table))
    rows = sorted(zip(table["t"].tolist(), table["value"].tolist(), stderr.tolist(), strict=True))
    if not rows or not np.isfinite(rows).all():
        right = f"must have rows with a finite number for each of {', '.join(names)}"
        raise wrong(f"is {shown(path)}, with rows that are no such numbers, or without rows", right, "file")
    if len({t for t, _, _ in rows}) < len(rows):
        raise wrong(f"is {shown(path)}, which has a time twice", "give one line for each time", "file")
    return tuple(rows)


def check(case: Any, name: str, reference: str | Curve) -> None:
    """Raise the error about the reference of the function `name`, if it is not valid."""
    check_named(case, name)
    if isinstance(reference, tuple):
        if not np.isfinite(_in_curve(reference, case.t, case.step)[0]).any():
            first, last = reference[0][0], reference[-1][0]
            mistake = f"has a file with t = {first:g} to {last:g}, none of the times of the statistics"
            raise wrong(mistake, "give values at some of these times", "reference", name)
    elif reference in (EXACT, STATIONARY):
        if reason := _unknown(case, name, reference):
            right = "leave it out, or use a formula or a file"
            raise wrong(f"is '{reference}', but {reason}", right, "reference", name)
    else:
        try:
            if re.search(r"\by1\b", reference):
                raise NumberError("unknown name 'y1'")
            _formula(case, reference)
        except NumberError as error:
            raise wrong(f"is {shown(reference)} ({error})", RIGHT, "reference", name) from None


def _formula(case: Any, text: str) -> Any:
    """The tree of a formula in t, parameters and T; NumberError if it is none."""
    return parse_expression(text, 1, ("t",), numbers_of(case))


def _unknown(case: Any, name: str, reference: str) -> str | None:
    """The reason why a mean is not known without sampling; None if it is known."""
    function = function_of(case, case.functions[name])
    if function.functional:
        return "that is known of functions of the state, not of the path"
    if reference == EXACT and case.noise is not None:
        return "that is known where Brownian motion drives"
    if reference == EXACT and _moments(case, name) is not None:
        return None
    if case.damping:
        return "that is known on a Casimir surface, which paths leave with damping"
    law = case.initial.parameters if isinstance(case.initial, RandomState) else {}
    if reference == STATIONARY:
        if law and law["law"] not in ("uniform_on_surface", "gibbs") and not law.get("project"):
            return "that is known of paths on one sphere, and here each has its own"
        try:
            _stationary(case.model, case.initial, case.temperature, function)
        except ValueError as error:
            return str(error)
        return None
    if law:
        return "that is known for one initial state, and here each path has its own"
    if not can_solve_equation(case.model):
        able = "systems on spheres with flows about the axes, and polynomials where the equation is linear"
        return f"no equation is solved for {case.model_name}, only for {able}"
    end = case.final_time
    need = demands(case.model, ((1.0, ()),), case.initial, end, (end,), (function.values,))
    return f"its solver {need.obstacle}: {need.remedy}" if need.obstacle else None


def _moments(case: Any, name: str) -> Moments | None:
    """The moments of a linear equation that a function needs, if these are known."""
    entry = case.functions[name]
    if isinstance(case.initial, RandomState) or not isinstance(entry, str):
        return None
    words = named_in(entry, case.model, case.variables, case.python)
    return linear_moments(case.model, [parse_expression(entry, dimension(case.model), case.variables, words)], case.t)


def seconds_of_means(case: Any) -> float:
    """The seconds of :func:`known_means`, roughly; those of moments are few."""
    exact = [name for name, reference in case.reference.items() if reference == EXACT]
    functions = (function_of(case, case.functions[name]) for name in exact if _moments(case, name) is None)
    return sum(seconds_of_equation(case.model, case.initial, case.t, [phi.values]) for phi in functions)


def known_means(case: Any) -> tuple[np.ndarray, np.ndarray]:
    """Reference means (F, T), NaN where there is none, and their standard errors or numerical errors."""
    value, error = np.full((2, len(case.functions), len(case.t)), np.nan)
    for f, (name, function) in enumerate(zip(case.functions, case.path_functions, strict=True)):
        reference = case.reference.get(name)
        if reference == EXACT and (linear := _moments(case, name)) is not None:
            (value[f],), (error[f],) = linear.expectations(case.initial, case.t)
        elif reference == EXACT:
            value[f], error[f] = _exact(case.model, case.initial, tuple(case.t), function)
        elif reference == STATIONARY:
            value[f], error[f] = _stationary(case.model, case.initial, case.temperature, function)
        elif isinstance(reference, str):
            value[f], error[f] = as_numpy(_formula(case, reference))(case.t[np.newaxis]), 0.0
        elif reference is not None:
            value[f], error[f] = _in_curve(reference, case.t, case.step)
    return value, error


def reference_formulas(case: Any) -> tuple[str, ...]:
    """The references that are formulas, in y1 = t and numbers, and "" for others; () without any."""
    given = [case.reference.get(name) for name in case.functions]
    texts = [canonical(_formula(case, one)) if _is_formula(one) else "" for one in given]
    return tuple(texts) if any(texts) else ()


def _is_formula(reference: Any) -> bool:
    return isinstance(reference, str) and reference not in (EXACT, STATIONARY)


def _in_curve(curve: Curve, t: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Values and standard errors of a curve at times, NaN where it has none."""
    times, *columns = np.array(curve).T
    nearest = np.abs(np.subtract.outer(t, times)).argmin(axis=1)
    met = np.abs(times[nearest] - t) <= ROUNDING * np.maximum(t, step)
    value, error = (np.where(met, column[nearest], np.nan) for column in columns)
    return value, error


def _stationary(model: Any, initial: Any, temperature: float, function: PathFunction) -> tuple[float, float]:
    """The mean of a function under the Gibbs law, uniform without a temperature, and its numerical error.

    ValueError, with the reason in a phrase, where no such law is known.
    """
    if math.isinf(temperature):
        return float(stationary_means(model, initial, [function.values])[0]), 0.0
    return gibbs_mean(model, initial, temperature, function)


@functools.lru_cache(maxsize=256, typed=True)
def _exact(
    model: Any, initial: tuple[float, ...], times: tuple[float, ...], function: PathFunction
) -> tuple[np.ndarray, np.ndarray]:
    """Exact means of a function of the state and their numerical errors.

    Cached, as all schemes and steps have the same; typed, because models of two classes may be equal tuples.
    """
    mean, error = exact_expectations(model, initial, np.array(times), [function.values], _ACCURACY)
    return mean[0], error[0]
