"""How values of a spec file are read: words of messages, numbers, lists.

pydantic reads values as the annotations here ask, and writes their JSON Schema.
"""

import difflib
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from functools import partial, reduce
from operator import or_
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import pydantic
from annotated_types import Ge, Le, MinLen
from pydantic import AfterValidator, BeforeValidator, Field, create_model, model_validator
from pydantic_core import PydanticCustomError

from ..arithmetic import NumberError, parse
from ..protocol import Positive
from ..schemes import SCHEMES

#: How expectations are estimated: plain Monte Carlo, multilevel Monte Carlo, without sampling on a Casimir surface.
ESTIMATORS = ("plain", "multilevel", "kolmogorov")

ABSENT: Any = Field(default_factory=lambda: None)  # a key may be left out, but the JSON Schema names no default


# ---------------------------------------------------------------------------------------------------------------------
# Words of messages
# ---------------------------------------------------------------------------------------------------------------------


def shown(value: Any) -> str:
    """A value in a message."""
    if isinstance(value, str):
        return f"'{value}'" if len(value) <= 60 else f"'{value[:57]}...'"
    if isinstance(value, dict | list):
        return ("a " if value else "an empty ") + ("mapping" if isinstance(value, dict) else "list")
    return {None: "empty", True: "true", False: "false"}[value]


def suggestion(word: Any, known: Iterable[str]) -> str:
    """What to write instead of an unknown word."""
    near = difflib.get_close_matches(word, known, 1) if isinstance(word, str) else []
    return f"did you mean '{near[0]}'?" if near else f"known: {', '.join(known)}"


def entries_in(count: int) -> str:
    """'3 entries'."""
    return "1 entry" if count == 1 else f"{count} entries"


def quantity(value: float) -> str:
    """A number in a message: as a power of two if it is one."""
    mantissa, exponent = math.frexp(value)
    return f"2^{exponent - 1}" if mantissa == 0.5 and abs(exponent - 1) > 1 else f"{value:.12g}"


def wrong(what: str, right: str, *keys: str | int) -> PydanticCustomError:
    """The error that pydantic is to report; `keys`, and numbers of entries, lead from the mapping at hand to it."""
    return PydanticCustomError("spec", "{what}; {right}", {"what": what, "right": right, "keys": keys})


# ---------------------------------------------------------------------------------------------------------------------
# Keys and numbers
# ---------------------------------------------------------------------------------------------------------------------


def _check_keys(data: Any, known: Iterable[str], needed: Mapping[str, Any]) -> Any:
    """`data`, whose keys are all `known`; `needed` has the fields that must be there."""
    if isinstance(data, dict):
        for key in data:
            if key not in known:
                raise wrong("is no known key", suggestion(key, known), key)
        for key, field in needed.items():
            if key not in data:
                raise wrong(f"missing key '{key}'", f"add {key}: {field.description}", key)
    return data


class Keys(pydantic.BaseModel):
    """A mapping of a spec file."""

    model_config = pydantic.ConfigDict(extra="forbid", frozen=True)

    @model_validator(mode="before")
    @classmethod
    def _check(cls, data: Any) -> Any:
        return _check_keys(data, cls.model_fields, needed_keys(cls))


def needed_keys(cls: type[pydantic.BaseModel]) -> dict[str, Any]:
    """The fields that a mapping of this class must have."""
    return {key: field for key, field in cls.model_fields.items() if field.is_required()}


def one_of(classes: Sequence[type[pydantic.BaseModel]], key: str, names: Iterable[str]) -> Any:
    """The annotation of a mapping of one of these classes, which `key` tells apart: it has one of `names`."""
    known = dict.fromkeys(k for cls in classes for k in cls.model_fields)
    check = partial(_check_keys, known=known, needed={key: Field(description=" or ".join(names))})
    return Annotated[reduce(or_, classes), Field(discriminator=key), BeforeValidator(check)]


_NUMBERS = {
    float: "must be a number or arithmetic such as 2/3, 2^-16 or cos(1.1)",
    int: "must be a whole number such as 500 or 10^6",
}


def _number(kind: type, value: Any) -> Any:
    """The number that a text stands for."""
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


def _read(hint: Any) -> Any:
    """An annotation with arithmetic in its numbers; models, which know nothing of specs, leave that to us."""
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
    """The text in an annotation, which says what it is."""
    return next((note for note in getattr(hint, "__metadata__", ()) if isinstance(note, str)), None)


def _record_of(cls: Any) -> Any:
    """The annotation of a mapping that stands for a record, a ``NamedTuple``."""
    hints = get_type_hints(cls, include_extras=True)
    fields: dict[str, Any] = {
        key: (key_of(hint, text_in(hint)), cls._field_defaults.get(key, ...)) for key, hint in hints.items()
    }
    keys = create_model(cls.__name__, __base__=Keys, __doc__=cls.__doc__, **fields)
    return Annotated[keys, AfterValidator(lambda found: cls(*(getattr(found, key) for key in cls._fields)))]


def _powers_of_two(value: Any) -> Any:
    """The texts that a range such as 2^-5 .. 2^-13 stands for; other values as they are."""
    if not isinstance(value, str) or ".." not in value:
        return value
    ends = [math.frexp(_number(float, end)) for end in value.split("..")]
    if len(ends) != 2 or any(mantissa != 0.5 for mantissa, _ in ends):
        right = "a range must have powers of two at both ends, such as 2^-5 .. 2^-13"
        raise wrong(f"is {shown(value)}", right)
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


NAME = "^[A-Za-z0-9_]+$"  #: of what a user names


def _by_name(value: Any) -> Any:
    """The mapping of names that a text stands for, with the name phi; other values as they are."""
    if isinstance(value, dict):
        for name in value:
            if not re.match(NAME, name):
                raise wrong("is no name of a function", "must consist of letters, digits and _", name)
    return {"phi": value} if isinstance(value, str) else value


def _listed(value: Any) -> Any:
    """A single entry as a list of it."""
    return value if isinstance(value, list) else [value]


def key_of(hint: Any, description: str | None, unit: str | None = None) -> Any:
    """The annotation of a key; its unit, if it has one, stands in the JSON Schema."""
    return Annotated[_read(hint), Field(description=description, json_schema_extra={"unit": unit} if unit else None)]


_List = Annotated[tuple[Positive, ...], MinLen(1)]
Steps = Annotated[_List, BeforeValidator(_powers_of_two, json_schema_input_type=_read(_List) | str)]
_State = tuple[float, ...]
State = Annotated[_State, BeforeValidator(_complex_modes, json_schema_input_type=_read(_State))]
_Eps = Annotated[tuple[Annotated[float, Ge(0), Le(1e100)], ...], MinLen(1)]
Eps = Annotated[
    _Eps,
    BeforeValidator(_listed, json_schema_input_type=_read(_Eps) | float | str),
]
_Levels = Annotated[tuple[Annotated[int, Ge(0), Le(3)], ...], MinLen(1)]
Levels = Annotated[
    _Levels,
    BeforeValidator(_listed, json_schema_input_type=_read(_Levels) | int | str),
]
Seed = Annotated[int, Ge(0), Le(2**64 - 1)]
Samples = Annotated[int, Ge(1), Le(10**15)]
# A name may be that of a composition, which stands among other keys; the schema offers the others.
SchemeName = Annotated[str, Field(json_schema_extra={"anyOf": [{"enum": list(SCHEMES)}, {"pattern": NAME}]})]
Schemes = Annotated[tuple[SchemeName, ...], MinLen(1)]
Estimators = Annotated[tuple[Literal[ESTIMATORS], ...], MinLen(1)]
_ByName = Annotated[dict[Annotated[str, Field(pattern=NAME)], str], MinLen(1)]
Functions = Annotated[_ByName, BeforeValidator(_by_name, json_schema_input_type=_ByName | str)]
CaseName = Annotated[str, Field(pattern="^[A-Za-z0-9_-]+$")]
# What can be read only together with other layers.
Unread = Annotated[Any, BeforeValidator(lambda v: v)]
