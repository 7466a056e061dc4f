"""Key ``sweep``, a parameter and its values: results are curves over them.

    sweep: {sigma: [0.1, 1, 10]}
    sweep: {s: 2^-4 .. 2^0, of: [order, error]}
    model: {name: rigid_body, ..., sigma: [s, s, s/2]}

or two of them, and results are maps over both:

    sweep: {sigma: 2^-4 .. 2^0, T: [0.1, 1, 10]}

The parameter is a word in formulas of the case, or the name of one of its parameters: of the model, or a key with a
number.  Reading makes a case of each value.
"""

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from itertools import product
from types import MappingProxyType
from typing import Annotated, Any, NamedTuple

from annotated_types import MinLen
from pydantic import BeforeValidator, ValidatorFunctionWrapHandler, WrapValidator
from pydantic_core import PydanticCustomError

from ..expressions.arithmetic import Numbers
from ..models import MODELS
from .files import Files
from .keys import powers_of_two, shown, suggestion, wrong
from .models import SOURCES, names_under, source_of

POINT = ("model", "damping", "temperature", "initial", "eps")  #: where a parameter of the system may stand
PLACES = (*POINT, "noise", "functions", "final_time", "step", "reference_step")  #: where it may stand by default
_FORMULAS = ("model", "initial", "noise", "functions")  # those that have formulas; the others have numbers

SWEEP = "a parameter and its values, as in {sigma: [0.1, 1, 10], of: order}: of each result a curve over them; "
SWEEP += "of two parameters a map"
_RIGHT = "must have one or two and their values, as in sweep: {s: [0.1, 1, 10]}"
_NO_FORMULAS = (*SOURCES, "file", "results")
_LISTS = {"steps": "which gives results at each of them", "schemes": "which gives results of each of them"}


class ParameterSweep(NamedTuple):
    """A sweep: its parameters, their values, and those of one of its cases."""

    parameters: Mapping[str, tuple[float, ...]]  #: the values of each
    of: tuple[str, ...] = ()  #: the quantities that are shown; () for those that suit the kind
    case: str = ""  #: the name, and
    title: str = ""  #: the title, of the case that is swept
    places: Mapping[str, float] = MappingProxyType({})  #: the value of each parameter in this case


def _range(value: Any) -> Any:
    return powers_of_two(value) if isinstance(value, str) and ".." in value else value


_Values = Annotated[
    tuple[float, ...], MinLen(1), BeforeValidator(_range, json_schema_input_type=list[float | str] | str)
]


def _read(value: Any, read: ValidatorFunctionWrapHandler) -> ParameterSweep | None:
    """Sweep of a mapping {word: values, of: quantities}; None for None."""
    if value is None:
        return None
    if not isinstance(value, dict):
        return read(value)  # which refuses it
    of = value.get("of", [])
    if not isinstance(of, str | list) or not all(isinstance(name, str) for name in of):
        raise wrong("is no list of quantities", "write one or several, as in of: [order, error]", "of")
    parameters = read({word: values for word, values in value.items() if word != "of"})
    for word, values in parameters.items():
        if len(set(values)) < len(values):
            raise wrong("has a value twice", "remove one", word)
    if len(parameters) > 2:
        raise wrong(f"has {len(parameters)} parameters", _RIGHT)
    return ParameterSweep(parameters, (of,) if isinstance(of, str) else tuple(of))


#: The annotation of ``sweep``.
SweptKey = Annotated[dict[str, _Values], WrapValidator(_read, json_schema_input_type=dict[str, Any])]


def unknown(name: Any, quantities: Collection[str]) -> tuple[str, str]:
    """What is wrong with an entry of the panels of a sweep that is none of its quantities, and what would be right."""
    meant = suggestion(name, quantities)
    right = meant if meant.startswith("did you") else f"of a sweep they are quantities: {', '.join(quantities)}"
    return f"has {shown(name)}", right


def with_panels(data: Any, quantities: Collection[str]) -> Any:
    """Keys of a case in which the quantities that `panels` names stand under ``of`` of its sweep."""
    swept = data.get("sweep") if isinstance(data, dict) else None
    panels = data.get("panels") if isinstance(swept, dict) else None
    if not (isinstance(swept, dict) and isinstance(panels, list) and panels):
        return data
    if "of" in swept:
        raise wrong("is given beside of: in sweep, which says the same", "leave out one of them", "panels")
    if twice := next((name for name in panels if panels.count(name) > 1), None):
        raise wrong(f"has '{twice}' twice", "remove one", "panels")
    if others := [name for name in panels if not isinstance(name, str) or name not in quantities]:
        raise wrong(*unknown(others[0], quantities), "panels")
    return {key: value for key, value in data.items() if key != "panels"} | {"sweep": swept | {"of": panels}}


def check_shown(case: Any) -> None:
    """Raise the error about quantities that do not come out of the kind, or about a single value."""
    if case.sweep is None:
        return
    if not case.quantities:
        raise wrong("is not possible for this kind of experiment, which shows no quantities", "remove it", "sweep")
    if len({*case.sweep.of}) < len(case.sweep.of):
        raise wrong("has a quantity twice", "remove one", "sweep", "of")
    for name in case.sweep.of:
        if name not in case.quantities:
            raise wrong(f"has '{name}'", suggestion(name, case.quantities), "sweep", "of")
    for word, values in case.sweep.parameters.items():
        if len(values) == 1:
            right = "give several, or leave out the sweep and write the value where the parameter stands"
            raise wrong("has one value", right, "sweep", word)


# ---------------------------------------------------------------------------------------------------------------------
# The case with each value
# ---------------------------------------------------------------------------------------------------------------------


def versions(data: dict[str, Any], keys: Sequence[str], files: Files, most: int = 2) -> dict[str, dict[str, Any]]:
    """By ``sigma = 0.5``, of each value, the keys of a case with it in place of the parameter, or of two parameters.

    `keys` are those in which a parameter may stand, of which there are `most`; raises the error about them.
    """
    sweep = {word: values for word, values in data["sweep"].items() if word != "of"}
    if not 1 <= len(sweep) <= most:
        right = _RIGHT if most > 1 else _RIGHT.replace("one or two and their", "one and its")
        raise wrong(f"has {len(sweep)} parameters", right)
    cases = {"": data}
    for word, values in sweep.items():
        put = _putting(data, word, keys, files)
        texts = [str(value) for value in _range(values)]
        cases = {f"{at}{word} = {text}, ": put(case, text) for at, case in cases.items() for text in texts}
    return {at.removesuffix(", "): case for at, case in cases.items()}


def _putting(
    data: Mapping[str, Any], word: str, keys: Sequence[str], files: Files
) -> Callable[[dict[str, Any], str], dict[str, Any]]:
    """Function that puts a value, as text, in place of a parameter in the keys of a case, such as `data`."""
    _check_word(word)
    model = data.get("model")
    declared = _declared(model, files)
    place = _place(data, word, declared, keys)
    within = [key for key in keys if key in data and not (key == "model" and word in declared)]
    if not place and not any(_names(data[key], word) for key in within):
        meant = suggestion(word, [*declared, *_parameters(model), *(key for key in keys if key not in _FORMULAS)])
        right = meant if meant.startswith("did you") else f"use it in one of {', '.join(keys)}"
        raise wrong(f"the parameter '{word}' is not used", right)

    def put(case: dict[str, Any], text: str) -> dict[str, Any]:
        replaced = {key: _replaced(part, word, text) if key in within else part for key, part in case.items()}
        return _with(replaced, place, text) if place else replaced

    return put


def _check_word(word: str) -> None:
    """A parameter to be swept has a name of its own."""
    if word in (*Numbers.functions, *Numbers.constants) or not re.match("^[A-Za-z_][A-Za-z0-9_]*$", word):
        raise wrong(f"'{word}' cannot be swept", "must be a name that is not a function or constant")
    if word in _LISTS:
        raise wrong(f"'{word}' cannot be swept", f"write {word}: [...] without sweep, {_LISTS[word]}")


def laid_over(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    """A sweep, overridden by a higher layer: by another parameter, other values or another choice of quantities."""
    return {key: value for key, value in below.items() if key == "of" or above.keys() - {"of"} <= below.keys()} | above


def apart(cases: Sequence[Any]) -> list[Any]:
    """Cases of all values of a sweep, each with its value and with a name of its own."""
    first, separate = cases[0], []
    sweep = first.sweep._replace(case=first.name, title=first.title)
    names, titles = ([], []) if first.name == "main" else ([first.name], [first.title])
    for case, values in zip(cases, product(*sweep.parameters.values()), strict=True):
        places = dict(zip(sweep.parameters, values, strict=True))
        texts = {word: repr(number).removesuffix(".0") for word, number in places.items()}
        own = {
            "name": "_".join([*names, *(f"{word}={text}" for word, text in texts.items())]),
            "title": ", ".join([*titles, *(f"{word} = {text}" for word, text in texts.items())]),
            "sweep": sweep._replace(places=places),
        }
        separate.append(case.model_copy(update=own))
    return separate


def _place(data: Mapping[str, Any], word: str, declared: Mapping[str, str], keys: Sequence[str]) -> tuple[str, ...]:
    """Where a parameter of this name has its value; () if there is none, or if that is a formula with the name."""
    model: Any = data.get("model")
    if word in declared:
        return "model", declared[word], word
    if word in _parameters(model) and not _names(model.get(word), word):
        return "model", word
    return (word,) if word in keys and word not in _FORMULAS and not _names(data.get(word), word) else ()


def _declared(model: Any, files: Files) -> dict[str, str]:
    """Numbers to which a model gives names, also in a file that it names -> the key under which they stand."""
    if not isinstance(model, dict):
        return {}
    source, layers = source_of(model), [model]
    if source.in_file in model:
        with suppress(PydanticCustomError):  # reading the model reports it
            layers.append(dict(source.of_file(model[source.in_file], files)))
    return {name: key for key in source.numbers for layer in layers for name in names_under(key, layer)}


def _parameters(model: Any) -> list[str]:
    """Parameters of a model that are keys under ``model``."""
    if not isinstance(model, dict):
        return []
    keys = dict.fromkeys((*getattr(_class_of(model), "_fields", ()), *model))
    return [key for key in keys if key not in (*SOURCES, *source_of(model).numbers)]


def _class_of(model: Mapping[str, Any]) -> Any:
    """Class of a model that has a name; None if that is none, which reading the model reports."""
    name = model.get("name")
    return MODELS.get(name) if isinstance(name, str) else None


def _with(data: dict[str, Any], place: tuple[str, ...], value: str) -> dict[str, Any]:
    """Keys of a case with a value at a place; in a list of alike entries each becomes that."""
    key, *inner = place
    if not inner:
        return data | {key: value}
    model, (name, *further) = data[key], inner
    if further:
        return data | {key: model | {name: (model.get(name) or {}) | {further[0]: value}}}
    default = getattr(_class_of(model), "_field_defaults", {}).get(name)
    old = model.get(name, list(map(str, default)) if isinstance(default, tuple) else default)
    if isinstance(old, list):
        parts = [str(entry).partition(" for ") for entry in old]
        if len({first.strip() for first, *_ in parts}) > 1:
            entries = "s, 0, s/2" if len(old) > 2 else "s, s/2"
            right = f"write the parameter in them, as in {name}: [{entries}] with sweep: {{s: [...]}}"
            raise wrong(f"has '{name}', whose entries differ", right)
        return data | {key: model | {name: [value + "".join(rest) for _, *rest in parts]}}
    return data | {key: model | {name: value}}


def _names(part: Any, word: str) -> bool:
    """Whether a word stands in a formula."""
    return bool(_replaced(part, word, "") != part)


def _replaced(part: Any, word: str, value: str) -> Any:
    if isinstance(part, dict):
        return {key: inner if key in _NO_FORMULAS else _replaced(inner, word, value) for key, inner in part.items()}
    if isinstance(part, list):
        return [_replaced(inner, word, value) for inner in part]
    if isinstance(part, str):
        return re.sub(rf"(?<![\w.]){re.escape(word)}(?!\w)", lambda _: f"({value})", part)
    return part
