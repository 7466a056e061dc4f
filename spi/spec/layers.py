"""The layers of a spec file, as pydantic reads them, and their JSON Schema."""

from typing import Annotated, Literal, get_type_hints

import pydantic
from annotated_types import Ge, MinLen
from pydantic import create_model

from ..models import MODELS
from .keys import (
    ABSENT,
    COMPLETE,
    CaseName,
    Keys,
    ModelPart,
    Unread,
    key_of,
    needed_keys,
    one_of,
)
from .kinds import KINDS
from .sweep import PLACES

#: ``laptop`` is the file itself; so are the others where the file does not define them.
PROFILES = ("laptop", "paper", "quick")


def _layers(kind, record):
    """The classes of a profile and of a file; their keys need not be complete, since other layers may have the rest."""
    hints = get_type_hints(record, include_extras=True)
    keys = [k for k in record.model_fields if k not in ("name", "title")]
    swept = PLACES if "sweep" in keys else ()  # only together with the values of the word can these be read
    read = {k: Unread if k in swept else hints[k] for k in keys} | {"model": ModelPart}
    optional = {k: (hint, ABSENT) for k, hint in read.items()}
    name, title = (key_of(CaseName, "letters, digits, _ and -"), ...), (str, ABSENT)
    part = create_model(f"{kind}_part", __base__=Keys, **optional)
    case = create_model(f"{kind}_case", __base__=part, name=name, title=title)
    profile = create_model(f"{kind}_profile", __base__=part, cases=(dict[str, part], ABSENT))
    profiles = create_model(f"{kind}_profiles", __base__=Keys, **dict.fromkeys(PROFILES[1:], (profile, ABSENT)))
    classes = zip(MODELS, COMPLETE, strict=True)
    models = [{"properties": {"name": {"const": n}}, "required": list(needed_keys(cls))} for n, cls in classes]
    alone = {"required": [k for k in keys if k in needed_keys(record)], "properties": {"model": {"anyOf": models}}}
    file = create_model(
        kind,
        __base__=part,
        __doc__=record.__doc__,
        __cls_kwargs__={"json_schema_extra": {"anyOf": [{"required": ["cases"]}, alone]}},
        kind=(Literal[kind], ...),
        title=title,
        figure=(key_of(Annotated[int, Ge(1)] | None, "number of the figure of the paper"), None),
        cases=(key_of(Annotated[list[case], MinLen(1)], "panels, each overriding some keys"), ABSENT),
        profiles=(profiles, ABSENT),
    )
    return profile, file


#: kind -> (class of a profile or an override, class of a file)
LAYERS = {kind: _layers(kind, record) for kind, record in KINDS.items()}
FILE = pydantic.TypeAdapter(one_of([file for _, file in LAYERS.values()], "kind", KINDS))


def json_schema():
    """The JSON Schema (draft 2020-12) of spec files, for editors; it knows few of the conditions between keys."""
    schema = {"$schema": "https://json-schema.org/draft/2020-12/schema", **FILE.json_schema()}
    return {**schema, "title": "An experiment of spi"}
