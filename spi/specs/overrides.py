"""What overrides parameters or sizes of a system written in YAML must name some that it has.

    model: {system: heavy_top.yaml, parameters: {wieght: 9}}

A name that a layer adds is right only where a formula of the whole has it, as one that the layer brings with it.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pydantic_core import PydanticCustomError

from .document import Document, Location
from .files import Files
from .keys import suggestion
from .models import is_another
from .systems import BY_ENTRY, overridden, system_in_file

_WORD = re.compile(r"[^\W\d]\w*")
_ONE_OF = {"parameters": "parameter", "sizes": "size"}


def check_overrides(layers: Sequence[tuple[Document, Location]], data: Mapping[str, Any], files: Files) -> None:
    """SpecError about a parameter or size that a layer adds to a system and that nothing of it names.

    `data` is what the layers together make of a case.
    """
    whole: dict[str, Any] = {}
    added: list[tuple[Document, Location, str, list[str]]] = []
    for document, top in layers:
        model = document.at(top).get("model")
        if not isinstance(model, dict):
            continue
        if begins := not whole or is_another(model, whole):
            try:
                whole, added = dict(system_in_file(model["system"], files)) if "system" in model else {}, []
            except PydanticCustomError:
                return  # reading the model reports it
        for key in BY_ENTRY if "system" in model or not begins else ():
            known = _names(whole, key)
            new = [name for name in _names(model, key) if name not in known]
            added += [(document, (*top, "model", key, name), _ONE_OF[key], known) for name in new]
        whole = overridden(whole, model)
    used = {word for text in _texts([whole, data.get("initial")]) for word in _WORD.findall(text)}
    for document, loc, what, known in added:
        if loc[-1] not in used:
            right = suggestion(loc[-1], known) if known else "leave it out"
            document.fail(loc, f"is no {what} of the system, and no formula names it; {right}")


def _names(model: Mapping[str, Any], key: str) -> list[str]:
    found = model.get(key)
    return list(found) if isinstance(found, dict) else []


def _texts(value: Any) -> Iterator[str]:
    """The texts in which formulas stand: all but the names of parameters and sizes."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, list):
        for entry in value:
            yield from _texts(entry)
    elif isinstance(value, dict):
        for key, inner in value.items():
            yield from _texts([*inner, *inner.values()] if key == "bracket" and isinstance(inner, dict) else inner)
