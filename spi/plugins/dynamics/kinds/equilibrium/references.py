"""References for means at equilibrium: numbers, the Gibbs law by quadrature, or the smallest step size."""

import functools
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from spi.expressions import as_numpy, is_constant, parse_expression
from spi.expressions.arithmetic import NumberError
from spi.kinds.functions import PathFunction, function_of
from spi.plugins.dynamics.exact import gibbs
from spi.plugins.dynamics.kinds.references import EXACT, FINEST, References, Word, gibbs_mean, reason_of


class FunctionReferences(NamedTuple):
    """References of F functions; NaN where there is none."""

    value: np.ndarray  #: (F,)
    error: np.ndarray  #: (F,) numerical
    variance: np.ndarray  #: (F,)
    at_finest: np.ndarray  #: (F,) whether the reference is the mean at the smallest step size
    shares: np.ndarray  #: (S, F, bins) probabilities of bins


def _exact(case: Any, name: str) -> tuple[float, float]:
    return gibbs_mean(case.model, case.initial, case.temperature, function_of(case, case.functions[name]))


def _alone(case: Any, name: str) -> str | None:
    return "there is one step size" if len(case.steps) < 2 else None


REFERENCES = References(
    {
        EXACT: Word(reason_of(_exact), _exact, f"use a formula such as 1/3, or {FINEST}"),
        FINEST: Word(_alone, lambda case, name: (np.nan, np.nan), "give more steps"),
    },
    right=f"must be a formula in parameters and T, {EXACT} or {FINEST}",
)


def known_laws(case: Any, edges: Sequence[np.ndarray]) -> FunctionReferences:
    """References of the functions of a case; `edges` (F, bins + 1) at each step size are those of the bins."""
    value, error = REFERENCES.means(case, np.zeros(1))
    variance = np.full(len(case.functions), np.nan)
    shares = np.full((len(edges), len(case.functions), edges[0].shape[1] - 1), np.nan)
    given = [case.reference.get(name, "") for name in case.functions]
    law = case.model, case.initial, case.temperature
    for f, (reference, function) in enumerate(zip(given, case.path_functions, strict=True)):
        if reference == EXACT:
            variance[f] = _variance(*law, function)
            for i, of_step in enumerate(edges):
                shares[i, f] = _shares(*law, function, tuple(of_step[f].tolist()))
    return FunctionReferences(value[:, 0], error[:, 0], variance, np.array([one == FINEST for one in given]), shares)


@functools.lru_cache(maxsize=64, typed=True)
def _variance(model: Any, initial: Any, temperature: float, function: PathFunction) -> float:
    """Variance of a function whose mean is known; NaN where it is not known, as of sums over many spheres."""
    law, values = gibbs.law_of(model, initial, temperature), function.values
    mean, _ = gibbs_mean(model, initial, temperature, function)
    try:
        return float(law.expectation(lambda y: (values(y) - mean) ** 2)[0])
    except ValueError:
        return np.nan


@functools.lru_cache(maxsize=64, typed=True)
def _shares(
    model: Any, initial: Any, temperature: float, function: PathFunction, edges: tuple[float, ...]
) -> np.ndarray:
    """Probabilities of a function in bins; NaN where they are not known, as on more than one sphere."""
    law = gibbs.law_of(model, initial, temperature)
    try:
        return np.asarray(law.probabilities(function.values, np.array(edges)))
    except ValueError:
        return np.full(len(edges) - 1, np.nan)


def derived_quantity(
    text: str, names: tuple[str, ...], numbers: Mapping[str, float] = MappingProxyType({})
) -> Callable[[np.ndarray, float], np.ndarray]:
    """The function of means (..., F) and T that a formula in names of functions, T and `numbers` of the model is.

    NumberError if it is none.
    """
    others = [name for name in numbers if name not in (*names, "T")]
    tree = parse_expression(text, len(names) + 1 + len(others), (*names, "T", *others))
    if is_constant(tree):
        raise NumberError("a constant")
    values = as_numpy(tree)

    def quantity(means: np.ndarray, temperature: float) -> np.ndarray:
        columns = np.moveaxis(np.atleast_2d(means), -1, 0)
        fixed = [temperature, *(float(numbers[name]) for name in others)]
        found = np.asarray(values(np.concatenate([columns, *(np.full_like(columns[:1], one) for one in fixed)])))
        return found.reshape(means.shape[:-1])

    return quantity
