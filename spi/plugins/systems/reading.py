"""Models that are Poisson systems written in YAML: in the spec itself, or in a file that it names.

    model: {algebra: so(3), hamiltonian: y1^2/2 + y2^2/4, noises: [y3], sigma: [0.1]}
    model: {system: heavy_top.yaml, parameters: {weight: 2}}

Keys beside ``system`` override those of the file, parameters and sizes one by one.
"""

import keyword
from collections.abc import Mapping
from functools import reduce
from operator import getitem
from pathlib import Path
from typing import Any, NoReturn

from spi.plugins import Registry, lacking
from spi.specs.document import Document, SpecError
from spi.specs.files import Files
from spi.specs.keys import check_keys, shown, suggestion, wrong
from spi.specs.models import OUTSIDE, Source, overridden, strengths_of

from . import generated
from .keys import KEYS, USED, DefinitionError

#: Keys whose mappings are overridden entry by entry, and what such an entry is.
NUMBERS = {"parameters": "parameter", "sizes": "size"}
#: Key of a definition -> what makes the model of it where the key is true: a function of the definition and of what
#: stands under ``sigma``, which may raise :class:`.keys.DefinitionError`.
OTHERS = Registry("definitions")
_ALLOWED = (*KEYS, "system", "name", *OTHERS, "sigma")


def read(data: Mapping[str, Any], files: Files) -> Any:
    """Record of the model of a system; raises the error about a key of `data`."""
    if absent := next((key for key in data if lacking("definitions", key)), None):
        raise wrong(f"is {shown(data[absent])}", f"{lacking('definitions', absent)}", absent)
    check_keys(data, _ALLOWED, elsewhere=OUTSIDE)
    document = _document(data["system"], files) if "system" in data else None
    whole = overridden(document.data, data) if document else data
    name = _name(whole)
    definition = {key: value for key, value in whole.items() if key in KEYS}
    if generated.names_time(whole.get("sigma")):
        definition["sigma"] = whole["sigma"]
    try:
        for key in OTHERS:
            if whole.get(key, "false") not in ("false", False):
                return OTHERS[key](definition, whole.get("sigma"))
        made = generated.made(definition, name)
        strengths = generated.strengths(definition, whole.get("sigma"))
    except DefinitionError as error:
        _report(error, data, document)
    return generated.record(made, strengths_of(strengths), definition)


def in_file(path: Any, files: Files) -> Mapping[str, Any]:
    """Keys of a system in the file at this path; raises the error about the key ``system``."""
    data: Mapping[str, Any] = _document(path, files).data
    return data


def _name(whole: Mapping[str, Any]) -> str:
    path = whole.get("system")
    given = whole.get("name")
    if given is None:
        stem = "".join(c if c.isalnum() else "_" for c in Path(path).stem) if path else "own_system"
        return stem if _is_name(stem) else f"system_{stem}"
    if not isinstance(given, str) or not _is_name(given):
        right = "must be a word of letters, digits and _ that begins with a letter, and no name that Python or we use"
        raise wrong(f"is {shown(given)}", right, "name")
    return given


def _is_name(word: str) -> bool:
    """Whether the class that is generated can be called so."""
    return word.isidentifier() and not word.startswith("_") and not keyword.iskeyword(word) and word not in USED


def _document(path: Any, files: Files) -> Document:
    """File of a system."""
    if not isinstance(path, str):
        raise wrong(f"is {shown(path)}", "must be the path of a YAML file, seen from the folder of this one", "system")
    text = files.text(path, "system")
    try:
        document = Document(text, lambda line: f"line {line}")
    except SpecError as error:
        raise wrong(f"is {shown(path)}, {error}", "correct that file", "system") from None
    if not isinstance(document.data, dict):
        raise wrong(f"is {shown(path)}, which is not a mapping", f"give it some of {', '.join(KEYS)}", "system")
    if unknown := next((key for key in document.data if key not in _ALLOWED or key == "system"), None):
        fault = f"is {shown(path)}, {document.places[(unknown,)]}, {unknown}: is not a known key"
        right = lacking("definitions", unknown) or suggestion(unknown, [key for key in _ALLOWED if key != "system"])
        raise wrong(fault, "it stands outside of model" if unknown in OUTSIDE else right, "system")
    return document


def _report(error: DefinitionError, data: Mapping[str, Any], document: Document | None) -> NoReturn:
    """Raise the error about the key to which one of a definition belongs."""
    fault, _, right = str(error).rpartition("; ")
    fault, right = (fault, right) if fault else (right, "correct it")
    keys = tuple(error.keys)
    if document is None or (keys and keys[0] in data and keys[0] not in NUMBERS) or _stands_in(data, keys):
        raise wrong(fault, right, *keys) from None
    place = document.places.get(keys[: document.depth(keys)], "line 1")
    key = ".".join(str(k) for k in keys if isinstance(k, str))
    raise wrong(f"is {shown(data['system'])}, {place}, {key}: {fault}", right, "system") from None


def _stands_in(data: Any, keys: tuple[Any, ...]) -> bool:
    """Whether `keys` lead to a value."""
    try:
        reduce(getitem, keys, data)
    except (LookupError, TypeError):
        return False
    return bool(keys)


SOURCE = Source(
    read,
    {
        "system": (str, "path of a YAML file with the keys of a system"),
        "algebra": (str, KEYS["algebra"]),
        "bracket": (dict[str, Any], KEYS["bracket"]),
    },
    NUMBERS,
    "system",
    in_file,
)
