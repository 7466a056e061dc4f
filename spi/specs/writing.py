"""Specs that are Python data instead of files: written as YAML, so that they are read, checked and stored as any other.

NumPy numbers and arrays become numbers and lists, complex numbers texts such as ``0.1+0.3i``, records mappings.
"""

import hashlib
from collections.abc import Mapping
from typing import Any

import numpy as np
import yaml

from .files import array_text

_WIDTH = 110  # of a line of a stored spec


def as_yaml(data: Mapping[str, Any]) -> str:
    """The text of a spec file; SpecError is raised when that is read, if anything is wrong with the data."""
    return yaml.safe_dump(plain(data), sort_keys=False, allow_unicode=True, default_flow_style=None, width=_WIDTH)


def as_override(key: str, value: Any) -> str:
    """``key=value`` as ``spi.specs.load`` takes overrides, in one line."""
    text = yaml.safe_dump(plain(value), sort_keys=False, allow_unicode=True, default_flow_style=True, width=2**31)
    value_text = text.removesuffix("...\n").strip()  # the end of a document, which follows a number or a word
    return f"{key}={value_text}"


_LONG = 1000  # numbers of an initial value that is no longer written out


def separated(data: Mapping[str, Any], files: dict[str, str]) -> dict[str, Any]:
    """The keys of a spec in which long initial values, and fields, are ``{file: NAME}``; adds the texts to `files`."""
    within = {"cases", "profiles"}
    return {
        key: _as_file(value, files) if key == "initial" else _each(value, files) if key in within else value
        for key, value in data.items()
    }


def _each(parts: Any, files: dict[str, str]) -> Any:
    """The cases of a spec, or its profiles, with :func:`separated` keys."""
    if isinstance(parts, Mapping):
        return {name: separated(one, files) if isinstance(one, Mapping) else one for name, one in parts.items()}
    if isinstance(parts, list | tuple):
        return [separated(one, files) if isinstance(one, Mapping) else one for one in parts]
    return parts


def _as_file(value: Any, files: dict[str, str]) -> Any:
    """An initial value, as a file if it is long or a field."""
    if not (isinstance(value, list | tuple) or hasattr(value, "__array__")):
        return value
    try:
        values = np.asarray(value)
    except ValueError:  # of lists of several lengths
        return value
    if values.dtype.kind not in "iufc" or (values.ndim < 2 and values.size <= _LONG):
        return value
    text = array_text(values)
    name = f"initial_{hashlib.sha256(text.encode()).hexdigest()[:8]}.npy"
    files[name] = text
    return {"file": name}


def plain(value: Any) -> Any:
    """Some data as dicts with texts as keys, lists, texts, numbers, True, False and None."""
    if hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, Mapping):
        return {str(key): plain(inner) for key, inner in value.items()}
    if hasattr(value, "__array__"):
        value = np.asarray(value).tolist()
    if isinstance(value, list | tuple | range):
        return [plain(inner) for inner in value]
    if isinstance(value, complex):
        return f"{value.real!r}{value.imag:+}i"
    return value if value is None or isinstance(value, bool | int | float) else str(value)
