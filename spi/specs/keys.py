"""Values of a spec file: words of messages, numbers, lists.

pydantic reads values as the annotations here ask, and writes their JSON Schema.
"""

import difflib
import math
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import partial, reduce, wraps
from operator import getitem, or_
from types import MappingProxyType, UnionType
from typing import Annotated, Any, ClassVar, Union, get_args, get_origin, get_type_hints

import pydantic
from annotated_types import Ge, Le, MinLen
from pydantic import AfterValidator, BeforeValidator, Field, ValidationError, create_model, model_validator
from pydantic_core import PydanticCustomError

from ..ensemble.protocol import Positive
from ..expressions.arithmetic import NumberError, parse
from ..plugins import lacking
from ..schemes import SCHEMES
from .document import Location

_MOST_LISTED = 64  # names in a message
ABSENT: Any = Field(default_factory=lambda: None)  # a key may be left out, but the JSON Schema names no default


# --- words of messages -----------------------------------------------------------------------------------------------


def listed(names: Sequence[str]) -> str:
    """Names in a row, the first and the last of very many."""
    return ", ".join(names if len(names) <= _MOST_LISTED else [*names[:3], "...", names[-1]])


def shown(value: Any) -> str:
    """A value in a message."""
    if isinstance(value, str):
        return f"'{value}'" if len(value) <= 60 else f"'{value[:57]}...'"
    if isinstance(value, dict | list):
        return ("a " if value else "an empty ") + ("mapping" if isinstance(value, dict) else "list")
    return {None: "empty", True: "true", False: "false"}[value]


def suggestion(word: Any, words: Collection[str]) -> str:
    """Advice about a word that is none of `words`."""
    word = word if isinstance(word, str) else ""
    near = difflib.get_close_matches(word, words, 1)
    return f"did you mean '{near[0]}'?" if near else f"known: {', '.join(words)}"


def entries_in(count: int) -> str:
    """'3 entries'."""
    return "1 entry" if count == 1 else f"{count} entries"


def quantity(value: float) -> str:
    """A number in a message: as a power of two if it is one."""
    mantissa, exponent = math.frexp(value)
    return f"2^{exponent - 1}" if mantissa == 0.5 and abs(exponent - 1) > 1 else f"{value:.12g}"


def wrong(fault: str, right: str, *keys: str | int) -> PydanticCustomError:
    """Error that pydantic is to report; `keys`, and numbers of entries, lead from the mapping at hand to it."""
    return PydanticCustomError("spec", "{fault}; {right}", {"fault": fault, "right": right, "keys": keys})


def check_here(field: str, name: Any, *keys: str | int, value: Any = None) -> None:
    """Raise the error about a name of a registry that a plug-in has which is not here.

    `keys` are those of :func:`wrong`, and `value` is what stands there, by default the name.
    """
    if advice := lacking(field, name):
        raise wrong(f"is {shown(name if value is None else value)}", advice, *keys)


class SchemaOf:
    """In the JSON Schema, the annotation that a function returns; what plug-ins offer is imported only for that."""

    def __init__(self, hint: Callable[[], Any]) -> None:
        self.hint = hint

    def __get_pydantic_json_schema__(self, schema: Any, handler: pydantic.GetJsonSchemaHandler) -> Any:
        return handler(pydantic.TypeAdapter(self.hint()).core_schema)


# --- keys and numbers ------------------------------------------------------------------------------------------------


def condition(check: Callable[[Any], Any]) -> Any:
    """Decorator for a method of a subclass of :class:`Keys` that raises the error about a condition between its keys.

    It may return a copy of the record with what it makes of it.  Conditions are tried once all keys have been read, up
    to the first that is not met: in the order in which they are defined, those of base classes first.
    """

    @wraps(check)
    def checked(record: Any) -> Any:
        return check(record) or record

    return model_validator(mode="after")(checked)


class Keys(pydantic.BaseModel):
    """A mapping of a spec file."""

    model_config = pydantic.ConfigDict(extra="forbid", frozen=True)
    elsewhere: ClassVar[Mapping[str, str]] = MappingProxyType({})  #: key that people write here -> where it stands

    @model_validator(mode="before")
    @classmethod
    def _check_keys(cls, data: Any) -> Any:
        if isinstance(data, dict):
            allowed = data if cls.model_config["extra"] == "allow" else cls.model_fields
            check_keys(data, allowed, needed_keys(cls), cls.elsewhere)
        return data


def check_keys(
    data: Mapping[str, Any],
    allowed: Collection[str],
    needed: Mapping[str, Any] = MappingProxyType({}),
    elsewhere: Mapping[str, str] = MappingProxyType({}),
) -> None:
    """Raise the error about the first key of a mapping that is not `allowed`, or the first `needed` one it lacks.

    Of a key that stands `elsewhere` it says where.
    """
    if unknown := next((key for key in data if key not in allowed), None):
        raise wrong("is not a known key", elsewhere.get(unknown) or suggestion(unknown, allowed), unknown)
    if missing := next((key for key in needed if key not in data), None):
        raise wrong(f"missing key '{missing}'", f"add {missing}: {needed[missing].description}", missing)


def needed_keys(cls: type[pydantic.BaseModel]) -> dict[str, Any]:
    """Fields that a mapping of this class must have."""
    return {key: field for key, field in cls.model_fields.items() if field.is_required()}


def one_of(classes: Sequence[type[pydantic.BaseModel]], key: str, names: Iterable[str]) -> Any:
    """Annotation of a mapping of one of these classes, which the value of `key`, one of `names`, tells apart."""
    allowed = dict.fromkeys(k for cls in classes for k in cls.model_fields)

    def check(data: Any) -> Any:
        if isinstance(data, dict) and key not in data:
            check_keys(data, allowed, {key: Field(description=" or ".join(names))})
        return data

    return Annotated[reduce(or_, classes), Field(discriminator=key), BeforeValidator(check)]


_NUMBERS = {
    float: "must be a number or arithmetic such as 2/3, 2^-16 or cos(1.1)",
    int: "must be a whole number such as 500 or 10^6",
}


def _number(kind: type, value: Any) -> Any:
    """Number that a text stands for."""
    if not isinstance(value, str):
        raise wrong(f"is {shown(value)}", _NUMBERS[kind])
    try:
        number = parse(value)
        if isinstance(number, complex):
            raise NumberError("complex")
        if kind is int and number != int(number):
            raise NumberError("not whole")
    except NumberError as error:
        raise wrong(f"is {shown(value)} ({error})", _NUMBERS[kind]) from None
    return kind(number)


def _number_or_infinity(value: Any) -> float:
    """A float that may be infinite."""
    return math.inf if value in ("inf", ".inf") else float(_number(float, value))


def _read(hint: Any) -> Any:
    """An annotation with arithmetic in its numbers, also in those of models, which do not depend on specs."""
    if hint == OrInfinite:
        return hint
    origin, arguments = get_origin(hint), get_args(hint)
    base = arguments[0] if origin is Annotated else hint
    if base in _NUMBERS:
        return Annotated[hint, BeforeValidator(partial(_number, base), json_schema_input_type=hint | str)]
    if origin is Annotated:
        return Annotated[_read(base), *hint.__metadata__]
    if origin is dict:
        return dict[arguments[0], _read(arguments[1])]
    if hasattr(base, "_fields"):
        return _record_of(base)
    if origin is tuple and len(arguments) == 2 and arguments[1] is ... and hasattr(arguments[0], "_fields"):
        return Annotated[tuple[_read(arguments[0]), ...], BeforeValidator(_listed)]
    if origin in (tuple, Union, UnionType):
        return (tuple if origin is tuple else Union)[tuple(map(_read, arguments))]
    return hint


def text_in(hint: Any) -> str | None:
    """Description in an annotation."""
    return next((note for note in getattr(hint, "__metadata__", ()) if isinstance(note, str)), None)


def fields_of(cls: Any) -> dict[str, tuple[Any, Any]]:
    """Annotation and default of each field of a record, ... where it has none, as ``create_model`` takes them."""
    hints = get_type_hints(cls, include_extras=True).items()
    return {key: (key_of(hint, text_in(hint)), cls._field_defaults.get(key, ...)) for key, hint in hints}


def _record_of(cls: Any) -> Any:
    """Annotation of a mapping that stands for a record, a ``NamedTuple``."""
    fields: dict[str, Any] = fields_of(cls)
    keys = create_model(cls.__name__, __base__=Keys, __doc__=cls.__doc__, **fields)
    return Annotated[keys, AfterValidator(lambda keys: cls(*(getattr(keys, key) for key in cls._fields)))]


def powers_of_two(value: Any) -> Any:
    """Entries of a range such as 2^-5 .. 2^-13, as texts; a list as it is."""
    if isinstance(value, list):
        if ranges := [entry for entry in value if isinstance(entry, str) and ".." in entry]:
            raise wrong(f"has a range in a list, {shown(ranges[0])}", f"write it without brackets: {ranges[0]}")
        return value
    fault, such = f"is {shown(value)}", "such as 2^-5 .. 2^-13"
    if not isinstance(value, str) or ".." not in value:
        raise wrong(fault, f"must be a list such as [2^-5, 2^-6], or a range {such}")
    ends = [math.frexp(_number(float, end)) for end in value.split("..")]
    if len(ends) != 2 or any(mantissa != 0.5 for mantissa, _ in ends):
        raise wrong(fault, f"a range must have powers of two at both ends, {such}")
    (_, first), (_, last) = ends
    sign = 1 if last >= first else -1
    return [repr(2.0 ** (k - 1)) for k in range(first, last + sign, sign)]


def _complex_modes(value: Any) -> Any:
    """A list with complex numbers such as 0.1+0.3i as real and imaginary parts; other values as they are."""
    if not isinstance(value, list) or not all(isinstance(v, str) for v in value):
        return value
    try:
        numbers = [parse(v) for v in value]
    except NumberError:
        return value  # to be reported with its place
    if not any(isinstance(z, complex) for z in numbers):
        return value
    return [repr(float(part)) for z in numbers for part in (complex(z).real, complex(z).imag)]


NAME = "^[A-Za-z0-9_]+$"  #: pattern of names that a user gives


def by_name(value: Any) -> Any:
    """Mapping of names that a text stands for, with the name phi; other values as they are."""
    if isinstance(value, str):
        return {"phi": value}
    if not isinstance(value, dict):
        raise wrong(f"is {shown(value)}", "must be a mapping, as in {phi: y1^2, psi: y2}, or the text of one named phi")
    for name in value:
        if not re.match(NAME, name):
            raise wrong("is not a valid name", "must consist of letters, digits and _", name)
    return value


def _listed(value: Any) -> Any:
    """A single entry as a list of it."""
    return value if isinstance(value, list) else [value]


def key_of(hint: Any, description: str | None, unit: str | None = None) -> Any:
    """Annotation of a key; its unit, if it has one, stands in the JSON Schema."""
    units = [Field(json_schema_extra={"unit": unit})] if unit else []
    return Annotated[_read(hint), *units, Field(description=description)]


OrInfinite = Annotated[float, BeforeValidator(_number_or_infinity, json_schema_input_type=float | str)]
_List = Annotated[tuple[Positive, ...], MinLen(1)]
Steps = Annotated[_List, BeforeValidator(powers_of_two, json_schema_input_type=_read(_List) | str)]
_State = tuple[float, ...]
StateKey = Annotated[_State, BeforeValidator(_complex_modes, json_schema_input_type=_read(_State))]
_Eps = Annotated[tuple[Annotated[float, Ge(0), Le(1e100)], ...], MinLen(1)]
Eps = Annotated[_Eps, BeforeValidator(_listed, json_schema_input_type=_read(_Eps) | float | str)]
_Levels = Annotated[tuple[Annotated[int, Ge(0), Le(3)], ...], MinLen(1)]
ExtrapolationLevels = Annotated[_Levels, BeforeValidator(_listed, json_schema_input_type=_read(_Levels) | int | str)]
Seed = Annotated[int, Ge(0), Le(2**64 - 1)]
Samples = Annotated[int, Ge(1), Le(10**15)]
# A name may be that of a composition, which stands among other keys; the schema offers the others.
SchemeName = Annotated[str, Field(json_schema_extra={"anyOf": [{"enum": list(SCHEMES)}, {"pattern": NAME}]})]
Schemes = Annotated[tuple[SchemeName, ...], MinLen(1)]
_ByName = Annotated[dict[Annotated[str, Field(pattern=NAME)], str], MinLen(1)]
Functions = Annotated[_ByName, BeforeValidator(by_name, json_schema_input_type=_ByName | str)]
CaseName = Annotated[str, Field(pattern="^[A-Za-z0-9_-]+$")]


# ---------------------------------------------------------------------------------------------------------------------
# Errors of pydantic in the words of a spec file: place, fault, remedy.
# ---------------------------------------------------------------------------------------------------------------------

#: type of an error of pydantic -> remedy, where its own words are not those of a spec file
_RIGHT = {
    "bool_type": "must be true or false",
    "string_type": "must be text",
    "string_pattern_mismatch": "must consist of letters, digits, _ and -",
    **dict.fromkeys(("tuple_type", "list_type"), "must be a list in square brackets"),
    **dict.fromkeys(("dict_type", "model_type", "model_attributes_type"), "must be a mapping, lines of key: value"),
}


def explained(error: Any, errors: Sequence[Any], data: Any) -> tuple[Location, str]:
    """(place in `data`, message) of an error of pydantic, which is one of `errors`."""
    kind, context = error["type"], error.get("ctx", {})
    keys = context.get("keys") or (context.get("discriminator", "").strip("'"),)
    loc, value = _reached(error["loc"], keys, data)
    if kind == "spec":
        lacking = [key for key in keys[-1:] if key and isinstance(value, dict) and loc[-1:] != (key,)]
        return (*loc, *lacking), error["msg"]
    if kind in ("literal_error", "union_tag_invalid"):
        words = re.findall("'(.*?)'", context.get("expected") or context["expected_tags"])
        return loc, f"is {shown(value)}; {suggestion(value, words)}"
    if kind in ("missing", "too_long"):
        missing = [int(e["loc"][-1]) for e in errors if e["type"] == "missing" and e["loc"][:-1] == error["loc"][:-1]]
        count = context["max_length"] if context else 1 + max(missing)
        return loc, f"has {entries_in(len(value))}; must have {count}"
    right = re.sub(r"^\w+ should (.*?)( after validation.*)?$", r"must \1", error["msg"])
    right = right.replace("greater than or equal to", "at least").replace("less than or equal to", "at most")
    return loc, f"is {shown(value)}; {_RIGHT.get(kind, right)}"


def _reached(steps: tuple[Any, ...], keys: Sequence[str], data: Any) -> tuple[Location, Any]:
    """Place in `data` that the steps of pydantic and then some keys name, and what stands there.

    A step that is not there is the name of a class, or missing.
    """
    loc: Location = ()
    value = data
    tagged = isinstance(data, dict) and steps[:1] == (data.get("kind"),)  # by pydantic, with the class of the file
    for step in (*steps[tagged:], *keys):
        if step in (value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()):
            loc, value = (*loc, step), value[step]
    return loc, value


def _others(error: Any, errors: Sequence[Any]) -> list[Any]:
    """Mistakes of what may stand in the place of a word, if the mistake is that the word is none of some."""
    if error["type"] != "literal_error" or not str(error["loc"][-1]).startswith("literal["):
        return []
    union = error["loc"][:-1]
    return [each for each in errors if each is not error and each["loc"][: len(union)] == union]


def _of_nearest(errors: Sequence[Any]) -> list[Any]:
    """Errors, and of several lists that may stand in one place only those of the list with the fewest, or the first."""
    counts: dict[Location, dict[str, int]] = {}
    where = []
    for error in errors:
        at = next((n for n, step in enumerate(error["loc"]) if str(step).startswith("tuple[")), None)
        where.append(None if at is None else (error["loc"][:at], error["loc"][at]))
        if where[-1]:
            of_place = counts.setdefault(where[-1][0], {})
            of_place[where[-1][1]] = of_place.get(where[-1][1], 0) + 1
    nearest = {place: min(of_place, key=of_place.__getitem__) for place, of_place in counts.items()}
    return [e for e, at in zip(errors, where, strict=True) if at is None or nearest[at[0]] == at[1]]


def attempt(read: Callable[[Any], Any], data: Any) -> tuple[Any, dict[Location, str]]:
    """(the record that pydantic reads from `data`, no mistakes) or (None, place -> mistake)."""
    try:
        return read(data), {}
    except ValidationError as invalid:
        errors = _of_nearest(invalid.errors(include_url=False))
    mistakes: dict[Location, str] = {}
    for error in errors:
        loc, message = explained(error, errors, data)
        others = _others(error, errors)
        if others and isinstance(reduce(getitem, loc, data), dict):
            continue  # a word may stand there or a mapping, and a mapping stands there
        if "known: " in message and any(each["type"] == "model_type" for each in others):
            message += ", or a mapping"
        # one mistake may be seen as each of the things that may stand there
        if not any(loc[: len(other)] == other or other[: len(loc)] == loc for other in mistakes):
            mistakes[loc] = message
    return None, mistakes
