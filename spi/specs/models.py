"""Key ``model``: a built-in model by its name, or one from a file.

    model: {name: rigid_body, inertia: [2, 1, 2/3], ...}
    model: {python: my_top.py, name: HeavyTop, weight: 1}

:data:`SOURCES` says for each key that tells where a model comes from how the mapping is read.
"""

import re
import warnings
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import cache, reduce
from operator import or_
from types import MappingProxyType
from typing import Annotated, Any, Literal, NamedTuple

import pydantic
from pydantic import Field, PlainValidator, create_model
from pydantic_core import PydanticCustomError

from ..checks.model_checks import check_once, undefined
from ..compiler import modules
from ..compiler.dispatch import answers
from ..ensemble.protocol import fault, generated, large, state_fault
from ..expressions.ranges import meaning_of, taken_name
from ..models import MODELS, check_model_class
from ..models.delegation import undamped
from ..plugins import Registry
from .document import Document, Location
from .files import Files
from .keys import ABSENT, Keys, SchemaOf, check_here, fields_of, one_of, shown, suggestion, wrong

#: Keys of a case that people write among those of the model.
OUTSIDE = dict.fromkeys(
    ("temperature", "damping", "initial", "seed", "eps", "schemes", "functions", "samples", "final_time"),
    "it stands outside of model",
)


class Source(NamedTuple):
    """Where a model comes from, told by a key of its mapping: how the mapping is read, and what else is asked of it."""

    read: Callable[[Any, Files], Any]  #: the record of the model, given the mapping and the files of the spec
    fields: Mapping[str, tuple[Any, str]] = MappingProxyType({})  #: for the JSON Schema, key -> its type and what it is
    #: Keys with numbers by name, which higher layers override one by one, each with the word for such a number.
    numbers: Mapping[str, str] = MappingProxyType({})
    in_file: str = ""  #: the key that names a file with further keys of the model, which the others override
    of_file: Callable[[Any, Files], Mapping[str, Any]] = lambda path, files: {}  #: the keys in the file of this path


# ---------------------------------------------------------------------------------------------------------------------
# Parameters
# ---------------------------------------------------------------------------------------------------------------------


class ModelKeys(Keys):
    """Keys of a model."""

    elsewhere = OUTSIDE


def _keys_of(cls: Any, telling: Mapping[str, Any], complete: bool) -> type[Keys]:
    """Keys of a model: `telling`, which identify it, and the fields of its record, all of them if `complete`."""
    fields: dict[str, Any] = {key: (hint, ... if complete else ABSENT) for key, hint in telling.items()}
    fields |= {key: (hint, default if complete else ABSENT) for key, (hint, default) in fields_of(cls).items()}
    with warnings.catch_warnings(action="ignore"):  # of parameters that are called like methods of pydantic
        name = cls.__qualname__ + ("" if complete else "Part")
        return create_model(name, __base__=ModelKeys, __doc__=cls.__doc__, **fields)


def _record(cls: Any, parameters: Keys) -> Any:
    """Record of a model."""
    model = cls(**{name: value for name, value in parameters if name in cls._fields})
    if refused := fault(model):
        key, complaint, right = refused
        raise wrong(complaint, right, key)
    return model._replace(sigma=strengths_of(model.sigma)) if "sigma" in cls._fields else model


def strengths_of(given: Iterable[float | None]) -> tuple[float | None, ...]:
    """Field sigma of a record: None for a noise that is off, given as 0, so that it is left out of compiled code."""
    return tuple(strength or None for strength in given)


# ---------------------------------------------------------------------------------------------------------------------
# By name
# ---------------------------------------------------------------------------------------------------------------------


def _by_name(data: Any, files: Files) -> Any:
    name = data.get("name") if isinstance(data, dict) else None
    if isinstance(name, str) and name in MODELS:
        parameters: Any = keys_of_model(name).model_validate(data)
    else:
        check_here("models", name, "name")
        for key in data if isinstance(data, dict) else ():
            check_here("sources", key, key, value=data[key])
        parameters = pydantic.TypeAdapter(one_of([*map(keys_of_model, MODELS)], "name", MODELS)).validate_python(data)
    if named := taken_name(getattr(parameters, "variables", ())):
        raise wrong(f"has '{named[0]}', {named[1]} in formulas", "take another name", "variables")
    return _record(MODELS[parameters.name], parameters)


def _of_class(cls: Any, data: Any, telling: Mapping[str, Any], remedy: str) -> Any:
    """Record of a class that somebody else wrote, from the mapping `data`."""
    try:
        keys = _keys_of(cls, telling, True)
    except Exception as error:
        reason = f"{type(error).__name__}: {error}".splitlines()[0]
        raise wrong(f"is {shown(data['name'])}, whose fields cannot be read ({reason})", remedy, "name") from None
    if taken := next((key for key in (*SOURCES, "code") if key in cls._fields), None):
        fault = f"is {shown(data['name'])}, whose field {taken} has the name of a key"
        raise wrong(fault, f"rename it; {remedy}", "name")
    if named := next((key for key in cls._fields if meaning_of(key)), None):
        fault = f"is {shown(data['name'])}, whose field {named} is {meaning_of(named)} in formulas"
        raise wrong(fault, f"rename it; {remedy}", "name")
    return _record(cls, keys.model_validate(data))


# ---------------------------------------------------------------------------------------------------------------------
# From a Python file
# ---------------------------------------------------------------------------------------------------------------------


def class_in(data: dict[str, Any], files: Files, remedy: str) -> Any:
    """Class `name` in the Python file `python`; raises the error about either key. `remedy` says what to write."""
    path = data["python"]
    if not isinstance(path, str):
        right = "must be the path of a Python file, seen from the folder of this one"
        raise wrong(f"is {shown(path)}", right, "python")
    module = files.module(path, "python")
    here = [
        name
        for name, cls in vars(module).items()
        if isinstance(cls, type) and hasattr(cls, "_fields") and cls.__module__ == module.__name__
    ]
    name = data.get("name")
    if name is None:
        right = f"add name: the class in {path}, one of {', '.join(here) or '(none yet)'}"
        raise wrong("missing key 'name'", right, "name")
    cls = getattr(module, name, None) if isinstance(name, str) else None
    if cls is None:
        right = suggestion(name, here) if here else f"write a {remedy}"
        raise wrong(f"is {shown(name)}, for which there is no class in {path}", right, "name")
    return cls


def _of_python(data: dict[str, Any], files: Files) -> Any:
    cls = class_in(data, files, "class derived from NamedTuple, see docs/own_models.md")
    path, name = data["python"], data["name"]
    try:
        check_model_class(name, cls)
    except Exception as error:
        raise wrong(f"is {shown(name)}: {error}", f"correct {path}", "name") from None
    return _of_class(cls, data, {"python": str, "name": str}, f"correct {path}")


# ---------------------------------------------------------------------------------------------------------------------
# All of them
# ---------------------------------------------------------------------------------------------------------------------

#: Key that tells where a model comes from -> :class:`Source`; plug-ins add to it by :attr:`spi.plugins.Plugin.sources`.
#: If a mapping has several of these keys, ``python`` goes first and ``name`` last.
SOURCES = Registry(
    "sources",
    {
        "python": Source(_of_python, {"python": (str, "path of a Python file, seen from the folder of this one")}),
        "name": Source(_by_name, {"name": (str, "name of a class in the Python file")}),
    },
)


def _key_of_source(data: Any) -> str | None:
    keys = sorted(SOURCES, key="name".__eq__)
    return next((key for key in keys if key in data), None) if isinstance(data, dict) else None


def source_of(*layers: Any) -> Source:
    """Source of a model whose mapping these layers make up."""
    data = {key: True for layer in layers if isinstance(layer, dict) for key in layer}
    source: Source = SOURCES[_key_of_source(data) or "name"]
    return source


def overridden(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Keys of a model, overridden by those of a higher layer."""
    pairs = {key: (below.get(key), above.get(key)) for key in source_of(below, above).numbers}
    both = {key: {**a, **b} for key, (a, b) in pairs.items() if isinstance(a, dict) and isinstance(b, dict)}
    return {**below, **above, **both}


def is_another(above: Any, below: Any) -> bool:
    """Whether a mapping names another model than the one that it overrides, instead of changing parameters of that."""
    source = _key_of_source(above)
    if source is None or not isinstance(above, dict) or not isinstance(below, dict):
        return False
    other = "name" in above and above["name"] != below.get("name")
    return other or source not in ("name", _key_of_source(below))


def name_of(model: Any) -> str:
    """Name of a model in spec files, or that of its class if it comes from a file."""
    cls = type(undamped(model))
    return MODELS.name_of(cls) or cls.__qualname__


def check_words(model: Any, initial: tuple[float, ...]) -> None:
    """Raise the error about a model that is not built in and fails the generic checks."""
    model = undamped(model)
    if large(model):
        if fault := answers(state_fault, model) and state_fault(model, initial):
            raise wrong(*fault, "initial")
        return
    if complaints := check_once(model, initial):
        more = f" (and {len(complaints) - 1} more)" if complaints[1:] else ""
        if generated(model):  # the name and lines of its class say nothing
            if where := undefined(model, initial):
                right = "near the initial state the formulas must be finite; begin elsewhere, or take others"
                raise wrong(f"is {where}", right, "initial")
            complaint = re.sub(r"^\w+, line \d+, raises \w+ ", "a number cannot be computed ", complaints[0])
            raise wrong(f"{complaint}{more}", _remedy(complaint), "model", *SOURCES)
        fault = f"{type(model).__qualname__} in {modules.source_name(type(model))}: {complaints[0]}{more}"
        raise wrong(fault, "correct the class, see docs/own_models.md", "model", *SOURCES)


def _remedy(complaint: str) -> str:
    """Advice where a model that is made of formulas fails a generic check."""
    if "not finite" in complaint or "cannot be computed" in complaint:
        return "near the initial state the formulas must be finite; take others, or another state"
    if "gradient" in complaint or "hessian" in complaint:
        return "near the initial state the formulas must be smooth; take others, or another state"
    return "numbers of very different size cost it too many digits; take other parameters, units or another state"


def _plain(model: Any) -> dict[str, Any]:
    """All that decides results, of a model from elsewhere its code too."""
    record = undamped(model)
    code = modules.digest(type(record))
    return {"name": name_of(model), **({"code": code} if code else {}), **record._asdict()}


def _read(data: Any, info: pydantic.ValidationInfo) -> Any:
    files: Any = info.context
    return source_of(data).read(data, files)


@cache
def keys_of_model(name: str, complete: bool = True) -> type[Keys]:
    """Keys of a model with a name, all of them or, unless `complete`, any."""
    return _keys_of(MODELS[name], {"name": Literal[name]}, complete)


#: In the JSON Schema, a name that is none of theirs.
_NOT_BUILT_IN: dict[str, Any] = {"not": {"enum": list(MODELS)}}


class _FromElsewhere(Keys):
    """A model that is not built in: by its class in a Python file, or by what else :data:`SOURCES` names."""

    model_config = pydantic.ConfigDict(
        extra="allow", json_schema_extra={"anyOf": [{"required": ["python"]}, {"properties": {"name": _NOT_BUILT_IN}}]}
    )


Model = Annotated[
    Any,
    PlainValidator(_read),
    pydantic.PlainSerializer(_plain),
    Field(description=f"a mapping with a name ({', '.join(MODELS)}) and parameters"),
]


# Only together with the layers below can it be said which model a part belongs to, so parts are read as any mapping.
def _any_model() -> Any:
    """Annotation of a mapping of any model."""
    parts = [keys_of_model(name, complete=False) for name in MODELS]
    told = {key: field for source in SOURCES.values() for key, field in source.fields.items()}
    fields: Any = {key: (Annotated[hint, Field(description=what)], ABSENT) for key, (hint, what) in told.items()}
    elsewhere = create_model("FromElsewhere", __base__=_FromElsewhere, __doc__=_FromElsewhere.__doc__, **fields)
    return reduce(or_, [*parts, elsewhere])


ModelPart = Annotated[dict[str, Any], SchemaOf(_any_model)]


_WORD = re.compile(r"[^\W\d]\w*")


def check_overrides(layers: Sequence[tuple[Document, Location]], data: Mapping[str, Any], files: Files) -> None:
    """Raise the error about a number with a name that a layer adds to a model and that no formula names.

    `data` are the keys of a case, which the layers together make up.
    """
    model = data.get("model")
    if not isinstance(model, dict):
        return
    lowest = next(part["model"] for document, top in layers if "model" in (part := document.at(top)))
    source, whole = source_of(model), model
    if source.in_file in model:
        try:
            lowest = source.of_file(model[source.in_file], files)
        except PydanticCustomError:
            return  # reading the model reports it
        whole = overridden(lowest, model)
    used = _words(whole, source.numbers, data.get("initial"))
    for key, noun in source.numbers.items():
        declared = names_under(key, lowest)
        for name in names_under(key, model):
            if name not in declared and name not in used:
                right = suggestion(name, declared) if declared else "leave it out"
                raise wrong(f"is no {noun} of the system, and no formula names it", right, "model", key, name)


def _words(model: Mapping[str, Any], numbers: Collection[str], initial: Any) -> set[str]:
    """Words in the formulas of a model and of an initial state, but not the names under the keys `numbers`."""
    named = {key: list(value.values()) for key, value in model.items() if key in numbers and value}
    states = list(initial.values()) if isinstance(initial, dict) else initial
    return {word for text in _texts([list({**model, **named}.values()), states]) for word in _WORD.findall(text)}


def names_under(key: str, model: Any) -> list[str]:
    """Names in a mapping of a model that stands under a key."""
    named = model.get(key) if isinstance(model, dict) else None
    return list(named) if isinstance(named, dict) else []


def _texts(value: Any) -> Iterator[str]:
    """Texts in which formulas may stand, keys of mappings included."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, list):
        for entry in value:
            yield from _texts(entry)
    elif isinstance(value, dict):
        yield from _texts([*value, *value.values()])
