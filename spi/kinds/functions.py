"""Functions of the state, and functionals of the path up to a time, of which statistics are computed."""

import functools
import math
import re
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from spi.compiler.dispatch import answers
from spi.ensemble.observer import energies, invariants_of
from spi.ensemble.protocol import casimirs, conserved, dimension, frozen, hamiltonian, in_kernels, large, observables
from spi.exact import gibbs
from spi.expressions import Component, Observable, as_numpy, canonical, has_sum, parse_expression
from spi.expressions.arithmetic import NumberError
from spi.models.delegation import undamped
from spi.numerics.rng import LANES
from spi.specs import cases
from spi.specs.keys import listed, shown, wrong
from spi.systems import observables_of, words

Array = np.ndarray

#: The functionals of a function of the state along a path: words of a spec, and their meanings.
FUNCTIONALS = {
    "maximum": "the largest value until t",
    "minimum": "the smallest value until t",
    "integral": "the integral from 0 to t, by the trapezoidal rule",
    "passage": "1 once a condition such as y1 > 0.5 has been seen, 0 before: its mean is the law of the first time",
    "start": "the value at t = 0, whose covariance with others shows how they remember it",
}
_CONDITION = re.compile(r"([^<>]+)([<>])([^<>]+)")
_WORD = re.compile(r"\b[A-Za-z]\w*")
_INVARIANT = re.compile(r"\b(?:H|C(\d*))\b(?!\s*\()")


class PathFunction(NamedTuple):
    """A function of the path up to a time."""

    functional: str  #: one of FUNCTIONALS, or "" for the value at that time
    text: str  #: the function of the state in its least text, or "H", "C1", ..., or the condition of a passage
    values: Callable[[Array], Array]  #: of states (d, ...)

    @property
    def label(self) -> str:
        """Its text in tables and figures."""
        if self.functional == "passage":
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
        """The functional until each time, of values (blocks, times, LANES) of :attr:`values`, the first at t = 0."""
        match self.functional:
            case "passage":
                met = np.where(np.isfinite(values), values > 0, np.nan)
                return np.maximum.accumulate(met, axis=1)
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
    if function.functional in ("passage", "integral"):
        return 0.0
    with np.errstate(all="ignore"):
        value = float(np.asarray(function.values(np.array(initial)[:, np.newaxis])).ravel()[0])
    return value if math.isfinite(value) else 0.0


def check_function(case: Any, name: str, entry: Any, more: str = "", key: str = "functions") -> None:
    """Raise the error about the entry `name` of a key that is no function; `more` names what else is valid."""
    try:
        path_function(case.model, case.variables, entry)
    except NumberError as error:
        variables = listed(case.variables) or f"y1 .. y{dimension(case.model)}"
        right = f"must be an expression in {variables}{', H or C1' if conserved(case.model) else ' or H'}{more}"
        raise wrong(f"is {shown(entry)} ({error})", right, key, name) from None


def path_function(model: Any, names: tuple[str, ...], entry: Any) -> PathFunction:
    """The function of an entry of the key ``functions``; NumberError, with a reason, if it is none."""
    functional, text = ("", entry) if isinstance(entry, str) else next(iter(entry.items()))
    condition = text
    if functional == "passage":
        sides = _CONDITION.fullmatch(text)
        if sides is None:
            raise NumberError("not a condition such as y1 > 0.5")
        greater, less = (sides[1], sides[3]) if sides[2] == ">" else (sides[3], sides[1])
        text = f"{greater.strip()} - ({less.strip()})"
    own = undamped(model)
    named = observables(own) if answers(observables, own) else observables_of(own) if "energy_current" in text else {}
    found = {match[0]: match for match in _INVARIANT.finditer(text) if match[0] not in names}
    found |= {word[0]: word for word in _WORD.finditer(text) if word[0] in named}
    invariants = {name: named.get(name) or _invariant(model, match) for name, match in found.items()}
    if text in invariants:
        return PathFunction(functional, text, invariants[text])
    observed = {name: Observable(name, values) for name, values in invariants.items()}
    tree = parse_expression(text, dimension(model), names, {**words(own), **observed})
    values = partial(_component, tree.k) if isinstance(tree, Component) else as_numpy(tree)
    written = text if has_sum(tree) else in_names(canonical(tree), names)
    return PathFunction(functional, condition if functional == "passage" else written, values)


def in_names(text: str, names: Sequence[str]) -> str:
    """A canonical text with the names of the components."""
    by_number = dict(enumerate(names, 1))
    return re.sub(r"\by(\d+)\b|\by\((\d+)\)", lambda y: by_number.get(int(y[1] or y[2]), y[0]), text)


def with_others(case: Any, functions: dict[str, Any]) -> dict[str, Any]:
    """The entries of the key ``functions``, in which names of other functions stand for these."""
    own = undamped(case.model)
    named = observables(own) if answers(observables, own) else ()
    invariants = ("H", "C", *(f"C{c + 1}" for c in range(conserved(case.model))))
    return cases.with_others(case, functions, (*named, *invariants))


def _component(k: int, states: Array) -> Array:
    """Component k of states, as a view."""
    return np.asarray(states)[k]


def _take_arrays(model: Any) -> bool:
    """Whether H and the Casimir functions take arrays: elementary functions of models take numbers only."""
    y = tuple(np.full((dimension(model), 2), 0.5))
    try:
        with np.errstate(all="ignore"):
            hamiltonian(model, y), casimirs(model, y)
    except Exception:  # of the compiler, or of Python without it
        return False
    return True


def _invariant(model: Any, match: re.Match[str]) -> Callable[[Array], Array]:
    """H, or a Casimir function by its number from 1 on, C being the only one."""
    count = conserved(model)
    if match[0] == "H" and answers(frozen, undamped(model)):
        raise NumberError("H depends on time; write it as a function of the state")
    if match[0] == "H":
        number = None
    elif not count or not (number := int(match[1] or (count == 1))) or number > count:
        names = ", ".join(["H", *(f"C{c + 1}" for c in range(count))])
        raise NumberError(f"known are {names}")

    takes_arrays = not large(model) and _take_arrays(model)
    model = in_kernels(model)

    def values(states: Array) -> Array:
        if number is None and states.ndim == 4:
            by_block = np.ascontiguousarray(np.moveaxis(states, 0, 2))
            energy = np.empty((*by_block.shape[:2], LANES))
            energies(model, by_block.reshape(*by_block.shape[:2], -1), energy)
            return energy
        if large(model) or not takes_arrays:
            rows = np.ascontiguousarray(states.reshape(len(states), -1).T)
            energy, others = invariants_of(model, rows, np.zeros(len(rows)))
            return (energy if number is None else others[:, number - 1]).reshape(states.shape[1:])
        y = tuple(states)
        return np.asarray(hamiltonian(model, y) if number is None else casimirs(model, y)[number - 1])

    return values


def evaluated(functions: Sequence[PathFunction], states: Array) -> Array:
    """(F, ...): the functions of states (d, ...), not finite where they are not defined."""
    values = np.empty((len(functions), *states.shape[1:]))
    with np.errstate(all="ignore"):
        for f, function in enumerate(functions):
            values[f] = function.values(states)
    return values


def check_named(case: Any, name: str) -> None:
    """Raise the error about a reference of a function that the case does not have."""
    if name not in case.functions:
        raise wrong("is not the name of a function", f"known: {', '.join(case.functions)}", "reference", name)


@functools.lru_cache(maxsize=64, typed=True)
def gibbs_mean(model: Any, initial: Any, temperature: float, names: tuple[str, ...], text: str) -> tuple[float, float]:
    """Mean of a function under the Gibbs law and its numerical error; ValueError, with a reason, where it is not known.

    Cached, as all schemes have the same; typed, because models of two classes may be equal tuples.
    """
    values = path_function(model, names, text).values
    expectation: tuple[float, float] = gibbs.law_of(model, initial, temperature).expectation(values)
    return expectation
