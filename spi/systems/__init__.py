"""Lie-Poisson systems defined in YAML: checked exactly, split into exact flows, generated as Python models.

``definition`` reads texts into a :class:`~.source.System`, ``splitting`` and ``spectrum`` derive flows in closed form,
``source`` writes them as a module.  These import sympy, which takes a third of a second, and are imported only where
a definition is read.
"""

import contextlib
import functools
import hashlib
import json
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from .. import digest_of, sources
from ..compiler import modules
from ..compiler.dispatch import answers
from ..compiler.inlining import uncompiled
from ..ensemble.protocol import frozen
from ..expressions import parse_expression
from ..expressions.arithmetic import NumberError
from .keys import KEYS, USED, DefinitionError

__all__ = [
    "KEYS",
    "USED",
    "DefinitionError",
    "Made",
    "NumberError",
    "expanded",
    "has_range",
    "hidden",
    "inexact",
    "made",
    "names_time",
    "observables_of",
    "record",
    "remember",
    "report",
    "variables",
    "words",
]


class Made(NamedTuple):
    """A generated model: its module, the numbers of a record, and a report for people."""

    text: str  #: of the module
    fields: list[tuple[str, float]]  #: the parameters, by the names of their fields
    constants: list[float]  #: numbers computed from the parameters
    report: list[str]  #: flows, merged terms, Casimir functions; lines for people


def made(definition: Mapping[str, Any], name: str) -> Made:
    """The model of a definition, with a class of this name; DefinitionError if the definition has a mistake.

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
    _REPORTS[_key(model)] = system.report
    remember(model, definition)
    return model


def report(model: Any) -> list[str]:
    """The report about a generated model, lines for people; none for other models."""
    return _REPORTS.get(_key(model), []) if _facts_of(model) else []


def remember(model: Any, definition: Mapping[str, Any] | None) -> None:
    """Keep the definition of a model, of which :func:`words` and :func:`observables_of` tell, for this process."""
    _DEFINITIONS[_key(model)] = json.dumps(definition)


def words(model: Any) -> dict[str, float | int]:
    """The numbers that formulas may name: parameters and sizes of a system, or the fields of another model."""
    if (definition := _DEFINITIONS.get(_key(model), "null")) != "null":
        return _words(definition)
    fields = {} if _facts_of(model) else model._asdict()
    numbers = {name: x for name, x in fields.items() if isinstance(x, float | int) and not isinstance(x, bool)}
    return numbers | getattr(model, "sizes", {})


@functools.lru_cache(maxsize=16)
def _words(definition: str) -> dict[str, float | int]:
    sizes, parameters = (json.loads(definition).get(key, {}) for key in ("sizes", "parameters"))
    known: dict[str, Any] = {}
    for name, text in [*sizes.items(), *parameters.items()]:
        value = parse_expression(text, 0, (), known).value
        known[name] = int(value) if name in sizes else value
    return known


def observables_of(model: Any) -> dict[str, Callable]:
    """Functions of the states of a generated model by name: its current of energy, see ``currents``."""
    return _observables(_DEFINITIONS.get(_key(model), "null")) if _facts_of(model) else {}


@functools.lru_cache(maxsize=16)
def _observables(definition: str) -> dict[str, Callable]:
    from .currents import energy_current

    try:
        current = energy_current(json.loads(definition) or {})
    except DefinitionError:  # H depends on time
        current = None
    return {} if current is None else {"energy_current": current}


_REPORTS: dict[Any, list[str]] = {}  # of this process
_DEFINITIONS: dict[Any, str] = {}


def _key(model: Any) -> Any:
    return type(model), model._replace(sigma=()) if "sigma" in model._fields else model


def hidden(model: Any) -> tuple[str, ...]:
    """The fields of a generated model that are no parameters: values of functions of time."""
    facts = _facts_of(model)
    if "driving" not in facts:
        return ()
    return ("driving", *["time"] * (model.time == 0.0), *["sigma"] * bool(facts["strengths"]))


def names_time(given: Any) -> bool:
    """Whether the word t stands in the text, or in one of the texts, of strengths."""
    texts = given if isinstance(given, list) else [given]
    return any(isinstance(text, str) and re.search(r"\bt\b", text) for text in texts)


def variables(model: Any) -> tuple[str, ...]:
    """The names of the components of a generated model or of spins; none for other models."""
    return tuple(_facts_of(model).get("variables") or getattr(model, "names", None) or ())


def expanded(texts: list[Any], model: Any) -> list[Any]:
    """Texts such as ``cos(2*pi*i/n), 0 for i = 1..n`` as numbers, with the sizes of a generated model; others stay.

    NumberError if one cannot be read.
    """
    if not any(map(has_range, texts)):
        return texts
    from ..expressions.ranges import entries
    from .text import Symbols, expression

    symbols = Symbols(indices=_facts_of(model).get("sizes") or getattr(model, "sizes", {}))
    numbers = []
    for text in texts:
        if has_range(text):
            values = [expression(entry, inner) for entry, inner in entries(text, symbols)]
            numbers += [repr(float(value)) for value in values]
        else:
            numbers.append(text)
    return numbers


def has_range(text: Any) -> bool:
    """Whether a text stands for several entries, as ``x(i) for i = 1..n`` does."""
    return isinstance(text, str) and re.search(r"\bfor\b", text) is not None


def inexact(model: Any) -> dict[str, dict[int, tuple[str, str]]]:
    """{"pieces" or "noises": {k: (formula, why)}} of the parts of a generated model without an exact flow."""
    return _facts_of(model).get("inexact", {})


def _facts_of(model: Any) -> dict[str, Any]:
    """The facts about its system in the module of a generated model; none for other models."""
    return modules.system_of(type(model)) or {}


@functools.cache
def _digest_of_makers() -> str:
    """The digest of the code that makes modules from definitions."""
    return digest_of(sources("checks", "expressions", "systems"))


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
