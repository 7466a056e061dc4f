"""What may stand in a spec file: the keys of models, of the kinds of experiment and of the layers of a file.

pydantic reads keys as the annotations here ask, and writes their JSON Schema.  A new kind is a subclass of Case and a
line in KINDS.
"""

import difflib
import math
from functools import partial, reduce
from operator import or_
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import pydantic
from annotated_types import Ge, Le, MinLen
from pydantic import BeforeValidator, Field, create_model, model_validator
from pydantic_core import PydanticCustomError

from ..models import MODELS
from ..numbers import NumberError, parse
from ..protocol import Positive
from ..schemes import SCHEMES

#: ``laptop`` is the file itself; so are the others where the file does not define them.
PROFILES = ("laptop", "paper", "quick")

_MOST_STEPS = 2**34  # of the reference step: what the counter of the random numbers has room for
_ROUNDING = 1e-12  # relative: ratios of steps written as decimals are not exact
_ABSENT = Field(default_factory=lambda: None)  # a key may be left out, but the JSON Schema names no default


# ---------------------------------------------------------------------------------------------------------------------
# Words of messages
# ---------------------------------------------------------------------------------------------------------------------


def shown(value):
    """A value in a message."""
    if isinstance(value, str):
        return f"'{value}'" if len(value) <= 60 else f"'{value[:57]}...'"
    if isinstance(value, dict | list):
        return ("a " if value else "an empty ") + ("mapping" if isinstance(value, dict) else "list")
    return {None: "empty", True: "true", False: "false"}[value]


def suggestion(word, known):
    """What to write instead of an unknown word."""
    near = difflib.get_close_matches(word, known, 1) if isinstance(word, str) else []
    return f"did you mean '{near[0]}'?" if near else f"known: {', '.join(known)}"


def entries_in(count):
    """'3 entries'."""
    return "1 entry" if count == 1 else f"{count} entries"


def _quantity(value):
    """A number in a message: as a power of two if it is one."""
    mantissa, exponent = math.frexp(value)
    return f"2^{exponent - 1}" if mantissa == 0.5 and abs(exponent - 1) > 1 else f"{value:.12g}"


def _wrong(what, right, key=None):
    """The error that pydantic is to report; `key` is a key of the mapping at hand."""
    return PydanticCustomError("spec", "{what}; {right}", {"what": what, "right": right, "key": key})


# ---------------------------------------------------------------------------------------------------------------------
# Keys and numbers
# ---------------------------------------------------------------------------------------------------------------------


def _check_keys(data, known, needed):
    """`data`, whose keys are all `known`; `needed` has the fields that must be there."""
    if isinstance(data, dict):
        for key in data:
            if key not in known:
                raise _wrong("is no known key", suggestion(key, known), key)
        for key, field in needed.items():
            if key not in data:
                raise _wrong(f"missing key '{key}'", f"add {key}: {field.description}", key)
    return data


class Keys(pydantic.BaseModel):
    """A mapping of a spec file."""

    model_config = pydantic.ConfigDict(extra="forbid", frozen=True)

    @model_validator(mode="before")
    @classmethod
    def _check(cls, data):
        return _check_keys(data, cls.model_fields, _needed(cls))


def _needed(cls):
    """The fields that a mapping of this class must have."""
    return {key: field for key, field in cls.model_fields.items() if field.is_required()}


def _one_of(classes, key, names):
    """The annotation of a mapping of one of these classes, which `key` tells apart: it has one of `names`."""
    known = dict.fromkeys(k for cls in classes for k in cls.model_fields)
    check = partial(_check_keys, known=known, needed={key: Field(description=" or ".join(names))})
    return Annotated[reduce(or_, classes), Field(discriminator=key), BeforeValidator(check)]


_NUMBERS = {
    float: "must be a number or arithmetic such as 2/3, 2^-16 or cos(1.1)",
    int: "must be a whole number such as 500 or 10^6",
}


def _number(kind, value):
    """The number that a text stands for."""
    if not isinstance(value, str):
        raise _wrong(f"is {shown(value)}", _NUMBERS[kind])
    try:
        number = parse(value)
        if isinstance(number, complex):
            raise NumberError("complex")
        if kind is int and number != int(number):
            raise NumberError("not whole")
    except NumberError as error:
        raise _wrong(f"is {shown(value)} ({error})", _NUMBERS[kind]) from None
    return kind(number)


def _read(hint):
    """An annotation with arithmetic in its numbers; models, which know nothing of specs, leave that to us."""
    origin, arguments = get_origin(hint), get_args(hint)
    base = arguments[0] if origin is Annotated else hint
    if base in _NUMBERS:
        return Annotated[hint, BeforeValidator(partial(_number, base), json_schema_input_type=hint | str)]
    if origin is Annotated:
        return Annotated[_read(base), *hint.__metadata__]
    if origin in (tuple, Union, UnionType):
        return (tuple if origin is tuple else Union)[tuple(map(_read, arguments))]
    return hint


def _powers_of_two(value):
    """The texts that a range such as 2^-5 .. 2^-13 stands for; other values as they are."""
    if not isinstance(value, str) or ".." not in value:
        return value
    ends = [math.frexp(_number(float, end)) for end in value.split("..")]
    if len(ends) != 2 or any(mantissa != 0.5 for mantissa, _ in ends):
        right = "a range must have powers of two at both ends, such as 2^-5 .. 2^-13"
        raise _wrong(f"is {shown(value)}", right)
    (_, first), (_, last) = ends
    sign = 1 if last >= first else -1
    return [repr(2.0 ** (k - 1)) for k in range(first, last + sign, sign)]


def _key(hint, description):
    """The annotation of a key."""
    return Annotated[_read(hint), Field(description=description)]


_List = Annotated[tuple[Positive, ...], MinLen(1)]
Steps = Annotated[_List, BeforeValidator(_powers_of_two, json_schema_input_type=_read(_List) | str)]
Seed = Annotated[int, Ge(0), Le(2**64 - 1)]
Samples = Annotated[int, Ge(1), Le(10**15)]
Schemes = Annotated[tuple[Literal[tuple(SCHEMES)], ...], MinLen(1)]
CaseName = Annotated[str, Field(pattern="^[A-Za-z0-9_-]+$")]


# ---------------------------------------------------------------------------------------------------------------------
# Models
# ---------------------------------------------------------------------------------------------------------------------


def _parameters(name, cls, complete):
    """The keys of a model: its name and the fields of its record, all of them if `complete`."""
    fields = {"name": (Literal[name], ... if complete else _ABSENT)}
    for key, hint in get_type_hints(cls, include_extras=True).items():
        text = next((note for note in getattr(hint, "__metadata__", ()) if isinstance(note, str)), None)
        default = cls._field_defaults.get(key, ...) if complete else _ABSENT
        fields[key] = (_key(hint, text), default)
    return create_model(cls.__name__ + ("" if complete else "Part"), __base__=Keys, __doc__=cls.__doc__, **fields)


def _record(parameters):
    """The record of a model; a noise of strength 0 becomes None, so that it is left out of compiled code."""
    values = dict(parameters)
    model = MODELS[values.pop("name")](**values)
    return model._replace(sigma=tuple(s or None for s in model.sigma))


def _name(model):
    return next(name for name, cls in MODELS.items() if cls is type(model))


_COMPLETE = [_parameters(name, cls, True) for name, cls in MODELS.items()]
_PARTS = [_parameters(name, cls, False) for name, cls in MODELS.items()]
Model = Annotated[
    _one_of(_COMPLETE, "name", MODELS),
    pydantic.AfterValidator(_record),
    pydantic.PlainSerializer(lambda model: {"name": _name(model), **model._asdict()}),
    Field(description=f"a mapping with a name ({', '.join(MODELS)}) and parameters"),
]
# Only together with the layers below can it be said which model a part belongs to, so parts are read as any mapping.
_ModelPart = Annotated[dict[str, Any], BeforeValidator(lambda v: v, json_schema_input_type=reduce(or_, _PARTS))]


# ---------------------------------------------------------------------------------------------------------------------
# Kinds of experiment
# ---------------------------------------------------------------------------------------------------------------------


class Case(Keys):
    """What the cases of all kinds have; a spec file gives all fields but the first two as its keys."""

    name: str
    title: str
    model: Model
    initial: _key(tuple[float, ...], "initial value y_0, one number per component")
    final_time: _key(Positive, "final time T, a multiple of every step")
    seed: _key(Seed, "seed of the random numbers") = 1

    @property
    def model_name(self):
        return _name(self.model)

    @model_validator(mode="after")
    def _check_initial(self):
        d, found = type(self.model).dimension, len(self.initial)
        if found != d:
            raise _wrong(f"has {entries_in(found)}", f"must have {d}, the dimension of {self.model_name}", "initial")
        return self


class StrongCase(Case):
    """Strong errors of schemes, each against itself at the reference step on the same Brownian paths."""

    steps: _key(Steps, "step sizes, a list or a range such as 2^-5 .. 2^-13")
    reference_step: _key(Positive, "step size of the reference; steps are 2, 4, 8, ... times as large")
    schemes: _key(Schemes, "a list of schemes")
    samples: _key(Samples, "number of Brownian paths")
    truncate_noise: _key(pydantic.StrictBool, "clip increments to sqrt(4 h |ln h|) in modulus, for all schemes") = False

    @model_validator(mode="after")
    def _check_steps(self):
        """The case with its steps from large to small."""
        if self.final_time / self.reference_step > _MOST_STEPS:
            least = _quantity(self.final_time / _MOST_STEPS)
            what = "gives more than 2^34 steps until final_time"
            raise _wrong(what, f"must be at least {least}", "reference_step")
        steps = [self._dyadic(h) for h in self.steps]
        for key, values in (("steps", [_quantity(h) for h in steps]), ("schemes", [f"'{s}'" for s in self.schemes])):
            if len(set(values)) < len(values):
                raise _wrong(f"has {next(v for v in values if values.count(v) > 1)} twice", "remove one", key)
        if self.truncate_noise and max(steps) >= 1:
            right = "must be below 1 with truncate_noise, whose bound is 0 there"
            raise _wrong(f"has {_quantity(max(steps))}", right, "steps")
        for name in self.schemes:
            if SCHEMES[name].needs_truncation and not self.truncate_noise:
                raise _wrong(f"has '{name}', which needs bounded increments", "set truncate_noise: true", "schemes")
        return self.model_copy(update={"steps": tuple(sorted(steps, reverse=True))})

    def _dyadic(self, h):
        """h as exactly the reference step times a power of two that divides the final time."""
        end, reference = self.final_time, self.reference_step
        if h > end * (1 + _ROUNDING):
            raise _wrong(f"has {_quantity(h)}", f"must not exceed final_time, which is {_quantity(end)}", "steps")
        doublings = math.log2(h) - math.log2(reference)
        exact = reference * 2.0 ** round(doublings)
        if round(doublings) < 1 or abs(h - exact) > _ROUNDING * h:
            lower = reference * 2.0 ** max(1, math.floor(doublings))
            what = f"has {_quantity(h)}, which is not 2, 4, 8, ... times the reference_step {_quantity(reference)}"
            raise _wrong(what, f"the nearest are {_quantity(lower)} and {_quantity(2 * lower)}", "steps")
        if abs(round(end / h) * h - end) > _ROUNDING * end:
            lower = math.floor(end / h) * h
            what = f"has {_quantity(h)}, of which final_time {_quantity(end)} is no multiple"
            raise _wrong(what, f"the nearest multiples are {_quantity(lower)} and {_quantity(lower + h)}", "steps")
        return exact


#: kind in a spec file -> record of a case
KINDS: dict[str, type[Case]] = {"strong": StrongCase}


# ---------------------------------------------------------------------------------------------------------------------
# Layers of a file
# ---------------------------------------------------------------------------------------------------------------------


def _layers(kind, record):
    """The classes of a profile and of a file; their keys need not be complete, since other layers may have the rest."""
    hints = get_type_hints(record, include_extras=True)
    keys = [k for k in record.model_fields if k not in ("name", "title")]
    optional = {k: (_ModelPart if k == "model" else hints[k], _ABSENT) for k in keys}
    name, title = (_key(CaseName, "letters, digits, _ and -"), ...), (str, _ABSENT)
    part = create_model(f"{kind}_part", __base__=Keys, **optional)
    case = create_model(f"{kind}_case", __base__=part, name=name, title=title)
    profile = create_model(f"{kind}_profile", __base__=part, cases=(dict[str, part], _ABSENT))
    profiles = create_model(f"{kind}_profiles", __base__=Keys, **dict.fromkeys(PROFILES[1:], (profile, _ABSENT)))
    classes = zip(MODELS, _COMPLETE, strict=True)
    models = [{"properties": {"name": {"const": n}}, "required": list(_needed(cls))} for n, cls in classes]
    alone = {"required": [k for k in keys if k in _needed(record)], "properties": {"model": {"anyOf": models}}}
    file = create_model(
        kind,
        __base__=part,
        __doc__=record.__doc__,
        __cls_kwargs__={"json_schema_extra": {"anyOf": [{"required": ["cases"]}, alone]}},
        kind=(Literal[kind], ...),
        title=title,
        figure=(_key(Annotated[int, Ge(1)] | None, "number of the figure of the paper"), None),
        cases=(_key(Annotated[list[case], MinLen(1)], "panels, each overriding some keys"), _ABSENT),
        profiles=(profiles, _ABSENT),
    )
    return profile, file


#: kind -> (class of a profile or an override, class of a file)
LAYERS = {kind: _layers(kind, record) for kind, record in KINDS.items()}
FILE = pydantic.TypeAdapter(_one_of([file for _, file in LAYERS.values()], "kind", KINDS))


def json_schema():
    """The JSON Schema (draft 2020-12) of spec files, for editors; it knows few of the conditions between keys."""
    schema = {"$schema": "https://json-schema.org/draft/2020-12/schema", **FILE.json_schema()}
    return {**schema, "title": "An experiment of spi"}
