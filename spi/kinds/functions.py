"""Functions of the state, and functionals of the path up to a time, of which statistics are computed."""

import functools
import math
import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from spi.ensemble.protocol import conserved, dimension, initial_time
from spi.expressions import Component, Observable, as_numpy, canonical, has_sum, operations, parse_expression
from spi.expressions.arithmetic import NumberError
from spi.numerics.types import Array, FunctionFamily
from spi.specs.keys import listed, shown, suggestion, wrong
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
#: Those that values at some times of one path tell.
OF_ONE_PATH = ("maximum", "minimum", "integral")
_CONDITION = re.compile(r"([^<>]+)([<>])([^<>]+)")


def check_functional(known: Sequence[str], entry: Any) -> Any:
    """An entry of the key ``functions`` as it is; raises the error about a word that is no `known` functional."""
    for word in entry if isinstance(entry, dict) else ():
        if word not in known:
            raise wrong("is not a known functional", suggestion(word, known), word)
        if word == "first" and not (isinstance(entry[word], dict) and len(entry[word]) == 2):
            raise wrong(f"is {shown(entry[word])}", "must be two conditions, as in {up: y1 > 1, down: y1 < -1}", word)
    return entry


class PathFunction(NamedTuple):
    """A function of the path up to a time."""

    functional: str  #: one of FUNCTIONALS, or "" for the value at that time
    text: str  #: the function of the state in its least text, or "H", "C1", ..., or the conditions of a passage
    values: Callable[[Array], Array]  #: of states (d, ...); of a passage the first of its conditions
    #: of a passage the function of states that is above 0 where the condition is met; of `first` those of both
    conditions: tuple[Callable[[Array], Array], ...] = ()
    work: tuple[int, int] = (0, 0)  #: operations, and observables such as H, to evaluate it at a state
    start: float | None = None  #: where it names t, the value of t at the beginning; states then have a row of times
    is_of_time: bool = False  #: whether it names nothing else

    def at(self, states: Array, t: Any) -> Array:
        """Values (...) of states (d, ...) at the times t of the experiment, which are broadcast."""
        if self.start is None:
            return self.values(states)
        times = np.broadcast_to(self.start + np.asarray(t, float), states.shape[1:])
        return self.values(np.concatenate((states, times[np.newaxis])))

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

    def along(self, values: Array, between: float | Array) -> Array:
        """Functional until each time, of values (blocks, times, LANES) of :attr:`values`, the first at t = 0.

        The times `between` them are one number or (times - 1, 1).
        """
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
    """Its value at the beginning, but 0 where that is no number or where the range is [0, 1]."""
    if function.conditions or function.functional == "integral":
        return 0.0
    with np.errstate(all="ignore"):
        value = float(np.asarray(function.at(np.array(initial)[:, np.newaxis], 0.0)).ravel()[0])
    return value if math.isfinite(value) else 0.0


def check_function(
    case: Any, name: str, entry: Any, more: str = "", key: str = "functions", timeless: str = ""
) -> None:
    """Raise the error about the entry `name` of a key that is no function; `more` names what else is valid.

    `timeless` says why it may not name t, where that is so.
    """
    try:
        function = function_of(case, entry)
        if timeless and function.start is not None:
            raise NumberError(f"it names t, and {timeless}")
        check_values(case, partial(function.at, t=0.0))
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
    text, d = " before ".join(texts), dimension(model)
    words = named_in(text, model, names, code)
    timed = _TIME.search(text) is not None and "t" not in words
    known = d, names, _with_time(words, d) if timed else words
    if functional in ("passage", "first"):
        if timed:
            raise NumberError("it names t, and conditions are watched between the times of looks")
        trees = [parse_expression(_difference(one), *known) for one in texts]
        each, work = tuple(map(_values, trees)), np.sum([operations(tree) for tree in trees], axis=0).tolist()
        return PathFunction(functional, text, each[0], each, tuple(work))
    tree = parse_expression(text, *known)
    shown_as = text if has_sum(tree) else in_names(canonical(tree), names, {d + 1: "t"} if timed else {})
    if not timed:
        return PathFunction(functional, shown_as, _values(tree), (), operations(tree))
    alone = not operations(tree)[1] and not has_sum(tree) and {d + 1} == set(map(int, _OWN.findall(canonical(tree))))
    return PathFunction(functional, shown_as, _values(tree), (), operations(tree), initial_time(model), alone)


_TIME, _OWN = re.compile(r"(?<![\w.])t\b(?!\s*\()"), re.compile(r"\by\(?(\d+)")


def _with_time(words: dict[str, Any], d: int) -> dict[str, Any]:
    """Words of formulas, and t, which stands behind the d components of states; functions get these alone."""

    def of_state(word: Any) -> Any:
        if isinstance(word, FunctionFamily):
            return FunctionFamily(lambda *numbers: partial(_of_state, word.member(*numbers)))
        return Observable(word.name, partial(_of_state, word.values)) if isinstance(word, Observable) else word

    return {**{name: of_state(word) for name, word in words.items()}, "t": Component(d)}


def _of_state(function: Callable[[Array], Array], states: Array) -> Array:
    return function(states[:-1])


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


def in_names(text: str, names: Sequence[str], others: Mapping[int, str] = MappingProxyType({})) -> str:
    """A canonical text with the names of the components, and of others by their numbers."""
    by_number = {**dict(enumerate(names, 1)), **others}
    return re.sub(r"\by(\d+)\b|\by\((\d+)\)", lambda y: by_number.get(int(y[1] or y[2]), y[0]), text)


def _component(k: int, states: Array) -> Array:
    """Component k of states, as a view."""
    return np.asarray(states)[k]


def evaluated(functions: Sequence[PathFunction], states: Array, t: Any = 0.0) -> Array:
    """(F, ...): the functions of states (d, ...) at the times t, not finite where they are not defined."""
    values = np.empty((len(functions), *states.shape[1:]))
    with np.errstate(all="ignore"):
        for f, function in enumerate(functions):
            values[f] = function.at(states, t)
    return values


_OPERATION_NS = 4.0  # of arrays, whose operands are fetched from memory


def ns_to_evaluate(function: PathFunction, ns_of_step: float) -> float:
    """Nanoseconds of a function at a state, roughly: an observable takes about as long as a step."""
    own, named = function.work
    return _OPERATION_NS * (1 + own) + ns_of_step * named
