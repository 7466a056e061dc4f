"""The key ``model``: a built-in model by its name, or one from a file.

    model: {name: rigid_body, inertia: [2, 1, 2/3], ...}
    model: {python: my_top.py, name: HeavyTop, weight: 1}
    model: {system: heavy_top.yaml, parameters: {weight: 1}}

:data:`SOURCES` says for each key that tells where a model comes from how the mapping is read.
"""

import keyword
import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import reduce
from operator import getitem, or_
from pathlib import Path
from typing import Annotated, Any, Literal, NoReturn

import pydantic
from pydantic import BeforeValidator, Field, PlainValidator, create_model
from pydantic_core import PydanticCustomError

from .. import systems
from ..checks.model_checks import check_once
from ..compiler import modules
from ..compiler.dispatch import answers
from ..ensemble.protocol import fault, large, state_fault
from ..expressions.ranges import meaning_of, taken_name
from ..models import MODELS, check_model_class
from ..models.delegation import undamped
from ..models.spins import Anisotropy, Spins, Terms, Transport
from ..models.spins.lattices import Cell
from .document import Document, Location, SpecError
from .files import Files
from .keys import ABSENT, Keys, check_keys, fields_of, one_of, shown, suggestion, wrong

# ---------------------------------------------------------------------------------------------------------------------
# Models that are Lie-Poisson systems written in YAML: in the spec itself, or in a file that it names.
#
#     model: {algebra: so(3), hamiltonian: y1^2/2 + y2^2/4, noises: [y3], sigma: [0.1]}
#     model: {system: heavy_top.yaml, parameters: {weight: 2}}
#
# Keys beside ``system`` override those of the file, parameters and sizes one by one.
# ---------------------------------------------------------------------------------------------------------------------

#: Keys whose mappings are overridden entry by entry.
BY_ENTRY = ("parameters", "sizes")
#: The keys of a system besides those of its definition.
_OTHERS = {
    "system": "path of a YAML file with the keys of a system",
    "name": "what the system is called",
    "lattice": "true: H is a sum over pairs of spins, which the compiled flows of the model spins move",
    "sigma": "strengths of the noises, numbers or formulas in the time t; 0 switches one off",
}
KEYS = {**systems.KEYS, **_OTHERS}


#: Keys of a case that people write among those of the model.
OUTSIDE = ("temperature", "damping", "initial", "seed", "eps", "schemes", "functions", "samples", "final_time")


def read_system(data: Mapping[str, Any], files: Files) -> Any:
    """The record of the model that is generated of a system; raises the error about a key of `data`."""
    check_keys(data, KEYS, outside=OUTSIDE)
    document = _document(data["system"], files) if "system" in data else None
    whole = overridden(document.data, data) if document else data
    name = _name(whole)
    definition = {key: value for key, value in whole.items() if key in systems.KEYS}
    if systems.names_time(whole.get("sigma")):
        definition["sigma"] = whole["sigma"]
    try:
        if whole.get("lattice", "false") not in ("false", False):
            from ..systems.bonds import spins_of  # which imports sympy, as the other one does

            model = _lattice(spins_of(definition, whole.get("sigma")))
            systems.remember(model, definition)
            return model
        made = systems.made(definition, name)
        from ..systems.definition import strengths

        of_noises = strengths(definition, whole.get("sigma"))
    except systems.DefinitionError as error:
        _report(error, data, document)
    return systems.record(made, [strength or None for strength in of_noises], definition)


def _lattice(fields: Mapping[str, Any]) -> Spins:
    """The model of spins with these fields, as ``systems.bonds.spins_of`` finds them."""
    bonds, noise = tuple(Terms(**terms) for terms in fields["bonds"]), fields["noise"]
    own = {"lattice": Cell(**fields["lattice"]), "bonds": bonds, "anisotropy": Anisotropy(**fields["anisotropy"])}
    model = Spins(**{**fields, **own, "noise": noise and Transport(**noise)})
    if fault := model.fault():
        raise wrong(fault[1], fault[2], "lattice")
    return model


def system_in_file(path: Any, files: Files) -> Mapping[str, Any]:
    """The keys of a system in the file at this path; raises the error about the key ``system``."""
    data: Mapping[str, Any] = _document(path, files).data
    return data


def overridden(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """The keys of a system, overridden by those of a higher layer."""
    pairs = {key: (below.get(key), above.get(key)) for key in BY_ENTRY}
    both = {key: {**a, **b} for key, (a, b) in pairs.items() if isinstance(a, dict) and isinstance(b, dict)}
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
        fault = f"is {shown(path)}, {document.places[(unknown,)]}, {unknown}: is not a known key"
        right = suggestion(unknown, [key for key in KEYS if key != "system"])
        raise wrong(fault, "it stands outside of model" if unknown in OUTSIDE else right, "system")
    return document


def _report(error: systems.DefinitionError, data: Mapping[str, Any], document: Document | None) -> NoReturn:
    """Raise the error about the key to which one of a definition belongs."""
    fault, _, right = str(error).rpartition("; ")
    fault, right = (fault, right) if fault else (right, "correct it")
    keys = tuple(error.keys)
    if document is None or (keys and keys[0] in data and keys[0] not in BY_ENTRY) or _stands_in(data, keys):
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


# ---------------------------------------------------------------------------------------------------------------------
# Parameters
# ---------------------------------------------------------------------------------------------------------------------


class ModelKeys(Keys):
    """The keys of a model."""

    outside = OUTSIDE


def _keys_of(cls: Any, telling: Mapping[str, Any], complete: bool) -> type[Keys]:
    """The keys of a model: `telling`, which identify it, and the fields of its record, all of them if `complete`."""
    fields: dict[str, Any] = {key: (hint, ... if complete else ABSENT) for key, hint in telling.items()}
    fields |= {key: (hint, default if complete else ABSENT) for key, (hint, default) in fields_of(cls).items()}
    with warnings.catch_warnings(action="ignore"):  # of parameters that are called like methods of pydantic
        name = cls.__qualname__ + ("" if complete else "Part")
        return create_model(name, __base__=ModelKeys, __doc__=cls.__doc__, **fields)


def _record(cls: Any, parameters: Keys) -> Any:
    """The record of a model; a noise of strength 0 becomes None, so that it is left out of compiled code."""
    model = cls(**{name: value for name, value in parameters if name in cls._fields})
    if refused := fault(model):
        key, complaint, right = refused
        raise wrong(complaint, right, key)
    return model._replace(sigma=tuple(s or None for s in model.sigma)) if "sigma" in cls._fields else model


# ---------------------------------------------------------------------------------------------------------------------
# By name
# ---------------------------------------------------------------------------------------------------------------------


def _by_name(data: Any, files: Files) -> Any:
    parameters = _BUILT_IN.validate_python(data)
    if named := taken_name(getattr(parameters, "variables", ())):
        raise wrong(f"has '{named[0]}', {named[1]} in formulas", "take another name", "variables")
    return _record(MODELS[parameters.name], parameters)


def _of_class(cls: Any, data: Any, telling: Mapping[str, Any], remedy: str) -> Any:
    """The record of a class that somebody else wrote, from the mapping `data`."""
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
    """The class `name` in the Python file `python`; raises the error about either key. `remedy` says what to write."""
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

#: Key that tells where a model comes from -> how its mapping becomes a record, given the files that belong to the spec.
#: If a mapping has several of these keys, the first of them counts.
SOURCES: dict[str, Callable[[Any, Files], Any]] = {
    "python": _of_python,
    "system": read_system,
    "algebra": read_system,
    "bracket": read_system,
    "name": _by_name,
}


def _source(data: Any) -> str | None:
    return next((key for key in SOURCES if key in data), None) if isinstance(data, dict) else None


def is_another(above: Any, below: Any) -> bool:
    """Whether a mapping names another model than the one that it overrides, instead of changing parameters of that."""
    source = _source(above)
    if source is None or not isinstance(above, dict) or not isinstance(below, dict):
        return False
    other = "name" in above and above["name"] != below.get("name")
    return other or source not in ("name", _source(below))


def name_of(model: Any) -> str:
    """The name of a model in spec files, or that of its class if it comes from a file."""
    cls = type(undamped(model))
    return next((name for name, built_in in MODELS.items() if built_in is cls), cls.__qualname__)


def check_words(model: Any, initial: tuple[float, ...]) -> None:
    """Raise the error about a model that is not built in and fails the generic checks."""
    model = undamped(model)
    if large(model):
        if fault := answers(state_fault, model) and state_fault(model, initial):
            raise wrong(*fault, "initial")
        return
    if complaints := check_once(model, initial):
        more = f" (and {len(complaints) - 1} more)" if complaints[1:] else ""
        if systems.variables(model):  # nobody wrote its class, whose name and lines say nothing
            complaint = re.sub(r"^\w+, line \d+, raises \w+ ", "a number cannot be computed ", complaints[0])
            raise wrong(f"{complaint}{more}", _remedy(complaint), "model", *SOURCES)
        fault = f"{type(model).__qualname__} in {modules.source_name(type(model))}: {complaints[0]}{more}"
        raise wrong(fault, "correct the class, see docs/own_models.md", "model", *SOURCES)


def _remedy(complaint: str) -> str:
    """Advice where a system written in YAML fails a generic check."""
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
    return SOURCES[_source(data) or "name"](data, files)


#: The keys of the built-in models, complete and in part.
COMPLETE = [_keys_of(cls, {"name": Literal[name]}, True) for name, cls in MODELS.items()]
_PARTS = [_keys_of(cls, {"name": Literal[name]}, False) for name, cls in MODELS.items()]
_BUILT_IN = pydantic.TypeAdapter(one_of(COMPLETE, "name", MODELS))


#: In the JSON Schema, a name that is none of theirs.
_NOT_BUILT_IN: dict[str, Any] = {"not": {"enum": list(MODELS)}}


class _FromElsewhere(Keys):
    """A model that is not built in: by its class in a Python file, or a system."""

    model_config = pydantic.ConfigDict(
        extra="allow", json_schema_extra={"anyOf": [{"required": ["python"]}, {"properties": {"name": _NOT_BUILT_IN}}]}
    )

    python: Annotated[str, Field(description="path of a Python file, seen from the folder of this one")] = ABSENT
    system: Annotated[str, Field(description=KEYS["system"])] = ABSENT
    algebra: Annotated[str, Field(description=KEYS["algebra"])] = ABSENT
    bracket: Annotated[dict[str, Any], Field(description=KEYS["bracket"])] = ABSENT
    name: Annotated[str, Field(description="name of a class in the Python file")] = ABSENT


Model = Annotated[
    Any,
    PlainValidator(_read),
    pydantic.PlainSerializer(_plain),
    Field(description=f"a mapping with a name ({', '.join(MODELS)}) and parameters"),
]
# Only together with the layers below can it be said which model a part belongs to, so parts are read as any mapping.
ModelPart = Annotated[
    dict[str, Any], BeforeValidator(lambda v: v, json_schema_input_type=reduce(or_, [*_PARTS, _FromElsewhere]))
]


_WORD = re.compile(r"[^\W\d]\w*")


def check_overrides(layers: Sequence[tuple[Document, Location]], data: Mapping[str, Any], files: Files) -> None:
    """Raise the error about a parameter or size that a layer adds to a system and that no formula names.

    `data` are the keys of a case, which the layers together make up.
    """
    model = data.get("model")
    if not isinstance(model, dict):
        return
    lowest = next(part["model"] for document, top in layers if "model" in (part := document.at(top)))
    whole: Mapping[str, Any] = model
    if "system" in model:
        try:
            lowest = system_in_file(model["system"], files)
        except PydanticCustomError:
            return  # reading the model reports it
        whole = overridden(lowest, model)
    used = {word for text in _texts([whole, data.get("initial")]) for word in _WORD.findall(text)}
    for key, noun in zip(BY_ENTRY, ("parameter", "size"), strict=True):
        declared = names_under(key, lowest)
        for name in names_under(key, model):
            if name not in declared and name not in used:
                right = suggestion(name, declared) if declared else "leave it out"
                raise wrong(f"is no {noun} of the system, and no formula names it", right, "model", key, name)


def names_under(key: str, model: Any) -> list[str]:
    """The names in a mapping of a model that stands under a key."""
    named = model.get(key) if isinstance(model, dict) else None
    return list(named) if isinstance(named, dict) else []


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
