"""Experiments from what a Python user gives: a file, a name, or the same keys and values as Python data."""

import contextlib
import inspect
import math
import re
import reprlib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from ..compiler import modules
from ..models import MODELS
from ..running.load import load, load_any
from ..specs import Experiment, SpecError
from ..specs.naming import as_override, as_yaml, separated
from ..storage import StorageError

_AS_ARGUMENT = {
    **{"--fresh": "fresh=True", "--out": "out=", "--results": "results=", "--set ": ""},
    **{"--profile": "profile", "`spi list`": "spi.experiments()"},
}


def experiment_of(
    source: str | Path | Mapping[str, Any],
    name: str | None,
    profile: str | None,
    overrides: Mapping[str, Any],
    trust_code: bool = False,
) -> Experiment:
    """Experiment in a file, of a name, or in a mapping with the keys of a file, called `name` if that is given.

    SpecError if anything is wrong; of a mapping it names no lines.
    """
    right = "must be a spec file, a name that spi.experiments() lists, or a mapping with the keys of a spec file"
    check_type("spec", source, (str, Path, Mapping), right)
    if "kind" in overrides:
        raise SpecError("kind: cannot be overridden; give a spec of the kind that you want")
    arrays: dict[str, str] = {}
    texts = as_overrides(overrides, arrays)
    with in_python():
        if isinstance(source, Mapping):
            return of_mapping(source, name or "experiment", profile or "laptop", texts, arrays=arrays)
        experiment = load_any(source, profile, texts, tuple(arrays.items()), trust_code)
    return experiment if name is None else experiment._replace(name=name)


def as_overrides(overrides: Mapping[str, Any], arrays: dict[str, str]) -> list[str]:
    """Keywords as the overrides of a spec; adds the texts of files that they name to `arrays`."""
    given = separated(overrides, arrays)
    return [as_override(key, model_keys(value) if key == "model" else value) for key, value in given.items()]


def of_mapping(
    data: Mapping[str, Any],
    name: str,
    profile: str = "laptop",
    overrides: Iterable[str] = (),
    place: str = "spec: ",
    arrays: Mapping[str, str] = MappingProxyType({}),
) -> Experiment:
    """Experiment in a mapping; its files are seen from the current folder, and messages begin with `place`.

    `arrays` are the texts of files that `overrides` name.
    """
    model = {"model": model_keys(data["model"])} if "model" in data else {}
    added = dict(arrays)
    text = as_yaml({**separated(data, added), **model})
    try:
        return load(f"{name}.yaml", profile, overrides, text=text, added=tuple(added.items()))
    except SpecError as error:
        line = re.compile(rf"^{re.escape(name)}\.yaml:(\d+:)? ")
        raise SpecError(*(line.sub(place, message) for message in error.messages)) from None


def model_keys(model: Any) -> Any:
    """Keys under ``model:`` for a name, a mapping, a class or a record of one; SpecError if that is unknown."""
    if isinstance(model, str):
        return {"name": model}
    cls = model if isinstance(model, type) else type(model)
    if not hasattr(cls, "_fields"):
        return model
    parameters = {} if isinstance(model, type) else model._asdict()
    if "sigma" in parameters:  # where a spec has 0 a record has None, for a noise that is off
        parameters["sigma"] = [strength or 0 for strength in parameters["sigma"]]
    built_in = MODELS.name_of(cls)
    return ({"name": built_in} if built_in else {"python": _file_of(cls), "name": cls.__qualname__}) | parameters


def _file_of(cls: type) -> str:
    """Python file of a class of somebody's own."""
    try:
        file = inspect.getsourcefile(cls)
    except (OSError, TypeError):
        file = None
    if cls.__module__ == "__main__" or file is None or modules.is_stored(cls):
        right = "write it into a Python file of its own and import it, or give the mapping that stands under model:"
        raise SpecError(f"model: the class {cls.__qualname__} is in no file that other processes can import; {right}")
    return file


def check_type(name: str, value: Any, types: tuple[type, ...], right: str) -> None:
    """SpecError if an argument is of none of these types."""
    if not isinstance(value, types):
        raise SpecError(f"{name}: is {reprlib.repr(value)}; {right}")


_LARGEST = {"seed": 2**64 - 1, "first_path": 2**62, "first_step": 2**62}  # that their types in kernels hold


def whole(name: str, value: Any, least: int, most: int | None = None) -> int:
    """A number of paths, or another whole number; SpecError if it is none."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise SpecError(f"{name}: is {value!r}; must be a whole number, at least {least}")
    most = _LARGEST.get(name, most)
    if most is not None and value > most:
        raise SpecError(f"{name}: is {value}; must be at most {most}")
    return int(value)


def real(name: str, value: Any) -> float:
    """A finite number; SpecError if it is none."""
    if not isinstance(value, int | float | np.integer | np.floating) or not math.isfinite(value):
        raise SpecError(f"{name}: is {value!r}; must be a number")
    return float(value)


@contextlib.contextmanager
def in_python() -> Iterator[None]:
    """Within it messages for people name arguments of functions in place of options of the command line."""
    try:
        yield
    except SpecError as error:
        raise SpecError(*map(_translated, error.messages)) from None
    except StorageError as error:
        raise StorageError(_translated(str(error))) from None


def _translated(message: str) -> str:
    for option, argument in _AS_ARGUMENT.items():
        message = message.replace(option, argument)
    return re.sub(
        r"`spi run ([^ `]+)( [^`]*)?`", lambda run: f"spi.run('{run[1]}'{', ...' if run[2] else ''})", message
    )
