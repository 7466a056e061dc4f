"""Models that are Lie-Poisson systems written in YAML: in the spec itself, or in a file that it names.

    model: {algebra: so(3), hamiltonian: y1^2/2 + y2^2/4, noises: [y3], sigma: [0.1]}
    model: {system: heavy_top.yaml, parameters: {weight: 2}}

What the spec says beside ``system`` overrides what the file says, parameters and sizes one by one.
"""

import keyword
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .. import systems
from .document import Document, SpecError
from .files import Files
from .keys import shown, suggestion, wrong

#: Keys whose mappings are overridden entry by entry.
BY_ENTRY = ("parameters", "sizes")
#: The keys of a system besides those of its definition.
_OTHERS = {
    "system": "path of a YAML file with the keys of a system",
    "name": "what the system is called",
    "sigma": "strengths of the noises, numbers or formulas in the time t; 0 switches one off",
}
KEYS = {**systems.KEYS, **_OTHERS}


def read_system(data: Mapping[str, Any], files: Files) -> Any:
    """The record of the model that is generated of a system; raises the error about a key of `data`."""
    for key in data:
        if key not in KEYS:
            raise wrong("is not a known key", suggestion(key, KEYS), key)
    document = _document(data["system"], files) if "system" in data else None
    whole = overridden(document.data, data) if document else data
    name = _name(whole)
    definition = {key: value for key, value in whole.items() if key in systems.KEYS}
    if systems.names_time(whole.get("sigma")):
        definition["sigma"] = whole["sigma"]
    try:
        made = systems.made(definition, name)
        strengths = systems.strengths(definition, whole.get("sigma"))
    except systems.DefinitionError as error:
        _report(error, data, document)
    return systems.record(made, [strength or None for strength in strengths])


def system_in_file(path: Any, files: Files) -> Mapping[str, Any]:
    """The keys of a system in the file at this path; raises the error about the key ``system``."""
    found: Mapping[str, Any] = _document(path, files).data
    return found


def overridden(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """The keys of a system with those that stand above them."""
    both = {
        key: {**below[key], **above[key]}
        for key in BY_ENTRY
        if isinstance(below.get(key), dict) and isinstance(above.get(key), dict)
    }
    return {**below, **above, **both}


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
    return word.isidentifier() and not word.startswith("_") and not keyword.iskeyword(word) and word not in systems.USED


def _document(path: Any, files: Files) -> Document:
    """The file of a system."""
    if not isinstance(path, str):
        raise wrong(f"is {shown(path)}", "must be the path of a YAML file, seen from the folder of this one", "system")
    text = files.text(path, "system")
    try:
        document = Document(text, lambda line: f"line {line}")
    except SpecError as error:
        raise wrong(f"is {shown(path)}, {error}", "correct that file", "system") from None
    if not isinstance(document.data, dict):
        raise wrong(f"is {shown(path)}, which is not a mapping", f"give it some of {', '.join(systems.KEYS)}", "system")
    if unknown := next((key for key in document.data if key not in KEYS or key == "system"), None):
        what = f"is {shown(path)}, {document.places[(unknown,)]}, {unknown}: is not a known key"
        raise wrong(what, suggestion(unknown, [key for key in KEYS if key != "system"]), "system")
    return document


def _report(error: systems.DefinitionError, data: Mapping[str, Any], document: Document | None) -> Any:
    """Raise the error about the key to which one of a definition belongs."""
    what, _, right = str(error).rpartition("; ")
    what, right = (what, right) if what else (right, "correct it")
    keys = tuple(error.keys)
    if document is None or (keys and keys[0] in data and keys[0] not in BY_ENTRY) or _found(data, keys):
        raise wrong(what, right, *keys) from None
    place = document.places.get(keys[: document.depth(keys)], "line 1")
    key = ".".join(str(k) for k in keys if isinstance(k, str))
    raise wrong(f"is {shown(data['system'])}, {place}, {key}: {what}", right, "system") from None


def _found(data: Any, keys: tuple[Any, ...]) -> bool:
    for key in keys:
        if not isinstance(data, dict | list) or (key not in data if isinstance(data, dict) else key >= len(data)):
            return False
        data = data[key]
    return bool(keys)
