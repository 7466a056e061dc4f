"""What formulas in the state may name beside its components: numbers, H, Casimir functions, functions with names.

    python: winding.py

makes the functions of a Python file words of formulas.  They take states (d, ...) and return arrays (...).
"""

import functools
import hashlib
import inspect
import math
import re
from collections import ChainMap
from collections.abc import Callable, Iterable
from types import FunctionType
from typing import Annotated, Any, NamedTuple

import numpy as np
import pydantic

from spi.numerics.types import Array, FunctionFamily

from ..compiler.dispatch import answers
from ..ensemble.observer import energies, invariants_of
from ..ensemble.protocol import (
    casimirs,
    conserved,
    dimension,
    hamiltonian,
    in_kernels,
    large,
    named_numbers,
    observables,
)
from ..expressions import Observable
from ..expressions.arithmetic import NumberError
from ..expressions.ranges import meaning_of
from ..models.delegation import depends_on_time, undamped
from ..numerics.rng import LANES
from .keys import Keys, key_of, shown, wrong

_INVARIANT = re.compile(r"\b(?:H|C(\d*))\b(?!\s*\()")
_COMPONENT = re.compile(r"y([1-9]\d*)")
_WORD = re.compile(r"\b[A-Za-z]\w*")


class Code(NamedTuple):
    """Functions of a Python file."""

    digest: str  #: of its text
    functions: tuple[tuple[str, Callable], ...]  #: by name


def _code(path: Any, info: pydantic.ValidationInfo) -> Code | None:
    """Functions in the file of this path."""
    if path is None or isinstance(path, Code):
        return path
    if not isinstance(path, str) or not path:
        right = "must be the path of a Python file, seen from the folder of this one"
        raise wrong(f"is {shown(path)}", right, "python")
    files: Any = info.context
    module = files.module(path, "python")
    here = [(name, f) for name, f in vars(module).items() if isinstance(f, FunctionType) and name[0] != "_"]
    found = tuple((name, f) for name, f in here if f.__module__ == module.__name__)
    if not found:
        raise wrong(f"is {path!r}, which has no function", "define functions such as def angle(y): ...", "python")
    for name, f in found:
        if meaning := meaning_of(name):
            raise wrong(f"is {path!r}, where {name} is {meaning} in formulas", "call the function otherwise", "python")
        if len(inspect.signature(f).parameters) != 1:
            right = "functions for formulas take the states alone; names of others begin with _"
            raise wrong(f"is {path!r}, where {name} does not take one argument", right, "python")
    return Code(hashlib.sha256(files.text(path, "python").encode()).hexdigest()[:16], found)


class CodeKeys(Keys):
    """Python file whose functions formulas may name."""

    python: key_of(
        Annotated[Any, pydantic.BeforeValidator(_code, json_schema_input_type=str | None)],
        "a Python file whose functions formulas may name; they take states (d, ...) and return arrays (...)",
    ) = None

    @pydantic.field_serializer("python")
    def _digest(self, python: Code | None) -> str | None:
        return python and python.digest


def named_in(text: str, model: Any, variables: Iterable[str] = (), code: Code | None = None) -> dict[str, Any]:
    """Words that formulas may name and their values: numbers, and of functions those that stand in the `text`.

    NumberError if one of them is not a function of the state, as a Casimir function with a number that is too high.
    """
    own, variables = undamped(model), set(variables)
    found = {match[0]: match for match in _INVARIANT.finditer(text) if match[0] not in variables}
    named = observables(own) if answers(observables, own) else {}
    own_code = {name: _checked(name, f) for name, f in (code.functions if code else ()) if name not in variables}
    named = ChainMap(own_code, named)
    values = {word: named[word] for word in _WORD.findall(text) if word in named}
    values |= {name: _invariant(model, match[1]) for name, match in found.items() if name not in named}
    each = {name: f if isinstance(f, FunctionFamily) else Observable(name, f) for name, f in values.items()}
    return {**named_numbers(own), **each}


def numbers_of(case: Any) -> dict[str, float | int]:
    """Numbers that a formula of a case may name where no state is meant: those of the model, and T."""
    temperature = {"T": case.temperature} if math.isfinite(case.temperature) else {}
    return {**named_numbers(undamped(case.model)), **temperature}


def check_values(case: Any, values: Callable[[Array], Array]) -> None:
    """Call a function of states once where the case has a Python file; NumberError, with a reason, where that fails."""
    if case.python:
        values(np.repeat(np.array(case.initial, float)[:, np.newaxis], 2, axis=1))


class Taken:
    """Words that have a meaning in formulas of a case, so that they do not stand for others of its functions."""

    def __init__(self, case: Any) -> None:
        own = undamped(case.model)
        invariants = ("H", "C", *(f"C{c + 1}" for c in range(conserved(case.model))))
        code = (name for name, _ in case.python.functions) if case.python else ()
        self.words = {*case.variables, *named_numbers(own), *invariants, *code}
        self.named = observables(own) if answers(observables, own) else {}
        self.components = dimension(case.model)

    def __contains__(self, word: Any) -> bool:
        if word in self.words or word in self.named:
            return True
        match = _COMPONENT.fullmatch(word)
        return match is not None and int(match[1]) <= self.components


@functools.lru_cache(maxsize=64)
def _checked(name: str, function: Callable) -> Callable:
    """A function of a Python file, whose values must have the shape of states."""

    def values(states: Array) -> Array:
        try:
            found = np.asarray(function(states), float)
        except Exception as error:  # whatever is wrong in it
            raise NumberError(f"{name}: {type(error).__name__}: {error}") from None
        if found.shape != states.shape[1:]:
            raise NumberError(f"{name} returns an array of shape {found.shape} for states of shape {states.shape}")
        return found

    return values


@functools.lru_cache(maxsize=64, typed=True)
def _takes_arrays(model: Any) -> bool:
    """Whether H and the Casimir functions take arrays: elementary functions of models take numbers only."""
    y = tuple(np.full((dimension(model), 2), 0.5))
    try:
        with np.errstate(all="ignore"):
            hamiltonian(model, y), casimirs(model, y)
    except Exception:  # of the compiler, or of Python without it
        return False
    return True


@functools.lru_cache(maxsize=64, typed=True)
def _invariant(model: Any, digits: str | None) -> Callable[[Array], Array]:
    """H, for None, or a Casimir function by its number from 1 on, C being the only one."""
    count = conserved(model)
    if digits is None and depends_on_time(model):
        raise NumberError("H depends on time; write it as a function of the state")
    number = int(digits or (count == 1)) if digits is not None else None
    if number is not None and not 0 < number <= count:
        names = ", ".join(["H", *(f"C{c + 1}" for c in range(count))])
        raise NumberError(f"known are {names}")
    takes_arrays = not large(model) and _takes_arrays(model)
    model = in_kernels(model)

    def values(states: Array) -> Array:
        if number is None and states.ndim == 4:
            by_block = np.ascontiguousarray(np.moveaxis(states, 0, 2))
            energy = np.empty((*by_block.shape[:2], LANES))
            energies(model, by_block.reshape(*by_block.shape[:2], -1), energy)
            return energy
        if takes_arrays:
            y = tuple(states)
            return np.asarray(hamiltonian(model, y) if number is None else casimirs(model, y)[number - 1])
        rows = np.ascontiguousarray(states.reshape(len(states), -1).T)
        energy, others = invariants_of(model, rows, np.zeros(len(rows)))
        return (energy if number is None else others[:, number - 1]).reshape(states.shape[1:])

    return values
