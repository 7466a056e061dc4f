"""Models that are generated from definitions: made once, stored as modules, and what their classes say about them.

These import sympy, which takes a third of a second, only where a definition is read.
"""

import contextlib
import functools
import hashlib
import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from spi import digest_of, sources
from spi.compiler import modules
from spi.compiler.dispatch import answers
from spi.compiler.inlining import uncompiled
from spi.ensemble.protocol import frozen
from spi.expressions import parse_expression

from .keys import DefinitionError


class Made(NamedTuple):
    """A generated model: its module, the numbers of a record, and a report for people."""

    text: str  #: of the module
    fields: list[tuple[str, float]]  #: the parameters, by the names of their fields
    constants: list[float]  #: numbers computed from the parameters
    report: list[str]  #: flows, merged terms, Casimir functions; lines for people


def made(definition: Mapping[str, Any], name: str) -> Made:
    """Model of a definition, with a class of this name; DefinitionError if the definition has a mistake.

    Models are cached beside the stored modules.
    """
    return _made(json.dumps([definition, name]))


def record(
    system: Made, strengths: Sequence[float | None] | None = None, definition: Mapping[str, Any] | None = None
) -> Any:
    """The record of a generated model, with strength 1 of all noises unless some are given, None for one that is off.

    Quantities that depend on time have their initial values.  OSError if its module cannot be stored.
    """
    module = modules.stored("system", system.text)
    cls = getattr(module, module.__system__["name"])
    values = dict(system.fields) | ({"constants": tuple(system.constants)} if system.constants else {})
    if "driving" in module.__system__:
        values["driving"] = (0.0,) * module.__system__["driving"]
    model = cls(**values)
    if strengths is not None:
        model = model._replace(sigma=tuple(strengths))
    if answers(frozen, model):
        with uncompiled():
            now = frozen(model, 0.0, 0.0)
        sigma = tuple(None if old is None else float(new) for old, new in zip(model.sigma, now.sigma, strict=True))
        model = now._replace(driving=tuple(map(float, now.driving)), sigma=sigma)
    _MADE[_key(model)] = system.report, json.dumps(definition or {})
    return model


def strengths(definition: Mapping[str, Any], given: Any) -> list[float]:
    """Strengths of the noises of a definition, see :func:`.definition.strengths`."""
    from .definition import strengths

    return strengths(definition, given)


def names_time(given: Any) -> bool:
    """Whether the word t stands in the text, or in one of the texts, of strengths."""
    texts = given if isinstance(given, list) else [given]
    return any(isinstance(text, str) and re.search(r"\bt\b", text) for text in texts)


@functools.lru_cache(maxsize=16)
def numbers_of(definition: str) -> dict[str, float | int]:
    """{name: number} of the sizes and parameters of a definition, as JSON, which formulas may name."""
    sizes, parameters = (json.loads(definition).get(key, {}) for key in ("sizes", "parameters"))
    known: dict[str, Any] = {}
    for name, text in [*sizes.items(), *parameters.items()]:
        value = parse_expression(text, 0, (), known).value
        known[name] = int(value) if name in sizes else value
    return known


# ---------------------------------------------------------------------------------------------------------------------
# What a generated class says about itself
# ---------------------------------------------------------------------------------------------------------------------

#: The report and the definition of each model that this process has made.
_MADE: dict[Any, tuple[list[str], str]] = {}


def _key(model: Any) -> Any:
    return type(model), model._replace(sigma=())


def _made_of(model: Any) -> tuple[list[str], str]:
    return _MADE.get(_key(model), ([], "{}"))


def described(facts: Mapping[str, Any]) -> Callable[[type], type]:
    """Decorator for a generated class, which makes it answer about itself from the facts that stand in its module."""

    def component_names(model: Any) -> tuple[str, ...]:
        return tuple(facts["variables"])

    def named_numbers(model: Any) -> dict[str, float | int]:
        """Parameters and sizes, by the names that the definition gives them."""
        return numbers_of(_made_of(model)[1])

    def parameters(model: Any) -> dict[str, Any]:
        """All fields but the values of functions of time."""
        hidden = set[str]()
        if "driving" in facts:
            hidden = {"driving", *["time"] * (model.time == 0.0), *["sigma"] * bool(facts["strengths"])}
        return {key: value for key, value in model._asdict().items() if key not in hidden}

    def why_inexact(model: Any, part: str, k: int) -> tuple[str, str]:
        why: tuple[str, str] = facts["inexact"][part][k]
        return why

    def observables(model: Any) -> Mapping[str, Callable[[np.ndarray], np.ndarray]]:
        return CurrentObservables(_made_of(model)[1])

    def report(model: Any, y: Sequence[float]) -> list[str]:
        """Flows, merged terms, Casimir functions."""
        return _made_of(model)[0]

    def decorate(cls: type) -> type:
        for method in (component_names, named_numbers, parameters, why_inexact, observables, report):
            setattr(cls, method.__name__, method)
        cls.generated = True  # type: ignore[attr-defined]
        return cls

    return decorate


class CurrentObservables(Mapping[str, Callable[[np.ndarray], np.ndarray]]):
    """Current of energy of a system, see ``currents``, which is derived when it is first asked for."""

    def __init__(self, definition: str) -> None:
        self.definition = definition  #: as JSON

    def __getitem__(self, name: str) -> Callable[[np.ndarray], np.ndarray]:
        current = _energy_current(self.definition) if name == "energy_current" else None
        if current is None:
            raise KeyError(name)
        return current

    def __iter__(self) -> Iterator[str]:
        return iter(["energy_current"] if _energy_current(self.definition) else [])

    def __len__(self) -> int:
        return sum(1 for _ in self)


@functools.lru_cache(maxsize=16)
def _energy_current(definition: str) -> Callable[[np.ndarray], np.ndarray] | None:
    from .currents import energy_current

    try:
        return energy_current(json.loads(definition))
    except DefinitionError:  # H depends on time
        return None


@functools.cache
def _digest_of_makers() -> str:
    """Digest of the code that makes modules from definitions."""
    return digest_of(sources("checks", "expressions", "plugins/systems"))


@functools.lru_cache(maxsize=256)
def _made(key: str) -> Made:
    digest = hashlib.sha256(f"{_digest_of_makers()} {key}".encode()).hexdigest()
    file = modules.folder() / f"definition_{digest[:32]}.json"
    with contextlib.suppress(OSError, ValueError, TypeError):
        checksum, text = json.loads(file.read_text(encoding="utf-8"))
        if checksum == hashlib.sha256(text.encode()).hexdigest():
            return Made(*json.loads(text))
    from .definition import make

    model = Made(*make(*json.loads(key)))
    text = json.dumps(model)
    with contextlib.suppress(OSError):  # then it is made again in the next process
        modules.write(file, json.dumps([hashlib.sha256(text.encode()).hexdigest(), text]).encode())
    return model
