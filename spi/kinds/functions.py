"""Functions of the state, and functionals of the path up to a time, of which statistics are computed."""

import functools
import math
import re
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from spi.ensemble.protocol import conserved, dimension
from spi.expressions import Component, Observable, as_numpy, canonical, has_sum, operations, parse_expression
from spi.expressions.arithmetic import NumberError
from spi.numerics.types import Array
from spi.specs.keys import listed, shown, wrong
from spi.specs.names import Code, check_values, named_in

#: The functionals of a function of the state along a path: words of a spec, and their meanings.
FUNCTIONALS = {
    "maximum": "the largest value until t",
    "minimum": "the smallest value until t",
    "integral": "the integral from 0 to t, by the trapezoidal rule",
    "passage": "1 once a condition such as y1 > 0.5 has been met, 0 before: its mean is the law of the first time",
    "first": "of two named conditions, as in {up: y1 > 0.5, down: y1 < -0.5}, 1 once the former has been met before "
    "the latter, else 0",
    "start": "the value at t = 0, whose covariance with others shows how they remember it",
}
_CONDITION = re.compile(r"([^<>]+)([<>])([^<>]+)")


class PathFunction(NamedTuple):
    """A function of the path up to a time."""

    functional: str  #: one of FUNCTIONALS, or "" for the value at that time
    text: str  #: the function of the state in its least text, or "H", "C1", ..., or the conditions of a passage
    values: Callable[[Array], Array]  #: of states (d, ...); of a passage the first of its conditions
    #: of a passage the function of states that is above 0 where the condition is met; of `first` those of both
    conditions: tuple[Callable[[Array], Array], ...] = ()
    work: tuple[int, int] = (0, 0)  #: operations, and observables such as H, to evaluate it at a state

    @property
    def label(self) -> str:
        """Its text in tables and figures."""
        if self.conditions:
            return f"share with {self.text} until t"
        return f"{self.functional} of {self.text}" if self.functional else self.text

    @property
    def is_constant(self) -> bool:
        """Whether it is a number by its formula."""
        try:
            return not self.functional and math.isfinite(float(self.text))
        except ValueError:
            return False

    @property
    def is_casimir(self) -> bool:
        """Whether it is a Casimir function, or the largest or smallest of one, constant on paths without damping."""
        return re.fullmatch(r"C\d*", self.text) is not None and self.functional in ("", "maximum", "minimum")

    def along(self, values: Array, between: float) -> Array:
        """Functional until each time, of values (blocks, times, LANES) of :attr:`values`, the first at t = 0."""
        match self.functional:
            case "maximum":
                return np.maximum.accumulate(values, axis=1)
            case "minimum":
                return np.minimum.accumulate(values, axis=1)
            case "start":
                return np.broadcast_to(values[:, :1], values.shape)
            case "integral":
                areas = 0.5 * between * (values[:, 1:] + values[:, :-1])
                return np.concatenate((np.zeros_like(values[:, :1]), np.cumsum(areas, axis=1)), axis=1)
        return values


def origin_of(function: PathFunction, initial: tuple[float, ...]) -> float:
    """Its value at t = 0, but 0 where that is no number or where the range is [0, 1]."""
    if function.conditions or function.functional == "integral":
        return 0.0
    with np.errstate(all="ignore"):
        value = float(np.asarray(function.values(np.array(initial)[:, np.newaxis])).ravel()[0])
    return value if math.isfinite(value) else 0.0


def check_function(case: Any, name: str, entry: Any, more: str = "", key: str = "functions") -> None:
    """Raise the error about the entry `name` of a key that is no function; `more` names what else is valid."""
    try:
        check_values(case, function_of(case, entry).values)
    except NumberError as error:
        variables = listed(case.variables) or f"y1 .. y{dimension(case.model)}"
        right = f"must be an expression in {variables}{', H or C1' if conserved(case.model) else ' or H'}{more}"
        raise wrong(f"is {shown(entry)} ({error})", right, key, name) from None


def function_of(case: Any, entry: Any) -> PathFunction:
    """Function of an entry of the key ``functions`` of a case; NumberError, with a reason, if it is none."""
    return path_function(case.model, case.variables, entry, case.python)


def path_function(model: Any, names: tuple[str, ...], entry: Any, code: Code | None = None) -> PathFunction:
    """:func:`function_of` for a model with the `names` of its components, and the functions of a Python file."""
    functional, text = ("", entry) if isinstance(entry, str) else next(iter(entry.items()))
    texts = (text,) if isinstance(text, str) else tuple(text.values())
    return _path_function(model, names, functional, texts, code)


@functools.lru_cache(maxsize=256, typed=True)  # as models of two classes may be equal tuples
def _path_function(
    model: Any, names: tuple[str, ...], functional: str, texts: tuple[str, ...], code: Code | None = None
) -> PathFunction:
    text = " before ".join(texts)
    known = dimension(model), names, named_in(text, model, names, code)
    if functional in ("passage", "first"):
        trees = [parse_expression(_difference(one), *known) for one in texts]
        each, work = tuple(map(_values, trees)), np.sum([operations(tree) for tree in trees], axis=0).tolist()
        return PathFunction(functional, text, each[0], each, tuple(work))
    tree = parse_expression(text, *known)
    shown_as = text if has_sum(tree) else in_names(canonical(tree), names)
    return PathFunction(functional, shown_as, _values(tree), (), operations(tree))


def _difference(condition: str) -> str:
    """Text of what is above 0 where a condition is met."""
    sides = _CONDITION.fullmatch(condition)
    if sides is None:
        raise NumberError("not a condition such as y1 > 0.5")
    greater, less = (sides[1], sides[3]) if sides[2] == ">" else (sides[3], sides[1])
    return f"{greater.strip()} - ({less.strip()})"


def _values(tree: Any) -> Callable[[Array], Array]:
    """Function of states that a tree stands for."""
    if isinstance(tree, Component):
        return partial(_component, tree.k)
    return tree.values if isinstance(tree, Observable) else as_numpy(tree)


def in_names(text: str, names: Sequence[str]) -> str:
    """A canonical text with the names of the components."""
    by_number = dict(enumerate(names, 1))
    return re.sub(r"\by(\d+)\b|\by\((\d+)\)", lambda y: by_number.get(int(y[1] or y[2]), y[0]), text)


def _component(k: int, states: Array) -> Array:
    """Component k of states, as a view."""
    return np.asarray(states)[k]


def evaluated(functions: Sequence[PathFunction], states: Array) -> Array:
    """(F, ...): the functions of states (d, ...), not finite where they are not defined."""
    values = np.empty((len(functions), *states.shape[1:]))
    with np.errstate(all="ignore"):
        for f, function in enumerate(functions):
            values[f] = function.values(states)
    return values


_OPERATION_NS = 4.0  # of arrays, whose operands are fetched from memory


def ns_to_evaluate(function: PathFunction, ns_of_step: float) -> float:
    """Nanoseconds of a function at a state, roughly: an observable takes about as long as a step."""
    own, named = function.work
    return _OPERATION_NS * (1 + own) + ns_of_step * named
