"""Names of results: one for each experiment, profile and set of overrides.

    rigid_body_strong                 the spec as it stands
    rigid_body_strong.quick           --profile quick
    rigid_body_strong.e70e6b          --seed 2, or --set seed=2
    rigid_body_strong.quick.3d2508    --profile quick --set 'steps=[2^-3]'
    rigid_body_strong.KIND.e70e6b     a spec about its system that a command makes, --seed 2

The six characters are a digest of all overrides, which stand in the file; `spi list results` tells them.  What changes
no path is no part of the name: with other `samples` a run goes on in the same file, and titles and claims are written
anew.  A name follows from the options alone, so that results are found where their spec is not.
"""

import hashlib
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from .files import array_text

#: Keys that decide no path.
_NEUTRAL = ("samples", "title", "asks", "figure", "panels", "expect")


def results_name(name: str, profile: str = "laptop", overrides: Iterable[str] = ()) -> str:
    """Name of the results of the experiment `name`; `overrides` are texts as ``spi.specs.load`` takes them."""
    last = _last(overrides)
    digest = [_digest("\n".join(f"{key}={last[key]}" for key in sorted(last)))] if last else []
    return ".".join([name, *([] if profile == "laptop" else [profile]), *digest])


def results_in(folder: str | Path, name: str, profile: str = "laptop", overrides: Iterable[str] = ()) -> Path:
    """File of results in a folder."""
    return Path(folder) / f"{results_name(name, profile, overrides)}.h5"


def _last(overrides: Iterable[str]) -> dict[str, str]:
    """The last value of each key that decides paths, without spaces."""
    pairs = (override.partition("=") for override in overrides)
    last = {key.strip().removeprefix("--"): "".join(value.split()) for key, _, value in pairs}
    return {key: value for key, value in last.items() if not _is_neutral(key)}


def _is_neutral(key: str) -> bool:
    words = key.split(".")
    return words[2 if words[0] == "cases" and len(words) > 2 else 0] in _NEUTRAL


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode(errors="surrogateescape")).hexdigest()[:6]


# ---------------------------------------------------------------------------------------------------------------------
# Specs that are Python data instead of files: written as YAML, so that they are read, checked and stored as any other.
#
# NumPy numbers and arrays become numbers and lists, complex numbers texts such as ``0.1+0.3i``, records mappings.
# ---------------------------------------------------------------------------------------------------------------------

_WIDTH = 110  # of a line of a stored spec


def as_yaml(data: Mapping[str, Any]) -> str:
    """Text of a spec file; SpecError is raised when that is read, if anything is wrong with the data."""
    return yaml.safe_dump(plain(data), sort_keys=False, allow_unicode=True, default_flow_style=None, width=_WIDTH)


def as_override(key: str, value: Any) -> str:
    """``key=value`` as ``spi.specs.load`` takes overrides, in one line."""
    text = yaml.safe_dump(plain(value), sort_keys=False, allow_unicode=True, default_flow_style=True, width=2**31)
    value_text = text.removesuffix("...\n").strip()  # the end of a document, which follows a number or a word
    return f"{key}={value_text}"


def completed(text: str, keys: Mapping[str, Any]) -> str:
    """Text of a spec file with further keys behind it, so that no line of it moves."""
    return "\n".join([text.rstrip(), *(as_override(key, value).replace("=", ": ", 1) for key, value in keys.items())])


_LONG = 1000  # numbers of an initial value that is no longer written out


def separated(data: Mapping[str, Any], files: dict[str, str]) -> dict[str, Any]:
    """Keys of a spec in which long initial values, and fields, are ``{file: NAME}``; adds the texts to `files`."""
    within = {"cases", "profiles"}
    return {
        key: _as_file(value, files) if key == "initial" else _each(value, files) if key in within else value
        for key, value in data.items()
    }


def _each(parts: Any, files: dict[str, str]) -> Any:
    """Cases of a spec, or its profiles, with :func:`separated` keys."""
    if isinstance(parts, Mapping):
        return {name: separated(part, files) if isinstance(part, Mapping) else part for name, part in parts.items()}
    if isinstance(parts, list | tuple):
        return [separated(part, files) if isinstance(part, Mapping) else part for part in parts]
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


def with_numbers(value: Any) -> Any:
    """Values as a person would write them: numbers without quotes."""
    if isinstance(value, dict):
        return {key: with_numbers(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [with_numbers(inner) for inner in value]
    for kind in (int, float) if isinstance(value, str) else ():
        with suppress(ValueError):
            if str(kind(value)) == value:
                return kind(value)
    return value
