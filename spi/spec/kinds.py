"""The kinds of experiment: for each the record of one case, whose annotations say what a spec file may hold.

A record starts with name, title, model and model_name; its other fields are keys of the file.
"""

import math
from typing import Annotated, Any, Literal, NamedTuple

from annotated_types import Ge, Le, MinLen

from ..entries import RANGE, entries_in, schema_of_fields
from ..models import MODELS
from ..protocol import Positive
from ..schemes import SCHEMES

ModelName = Literal[tuple(MODELS)]
SchemeName = Literal[tuple(SCHEMES)]

#: ``laptop`` is the file itself; so are the others where the file does not define them.
PROFILES = ("laptop", "paper", "quick")

CASE_NAME = "[A-Za-z0-9_-]+"  # it is also the name of a group in the results file

_MOST_STEPS = 2**34  # of the reference step: what the counter of the random numbers has room for
_ROUNDING = 1e-12  # relative: ratios of steps written as decimals are not exact


class StrongCase(NamedTuple):
    """Strong errors of schemes, each against itself at the reference step on the same Brownian paths."""

    name: str
    title: str
    model: Any
    model_name: str
    initial: Annotated[tuple[float, ...], "initial value y_0, one number per component"]
    final_time: Annotated[Positive, "final time T, a multiple of every step"]
    steps: Annotated[tuple[Positive, ...], MinLen(1), RANGE, "step sizes, a list or a range such as 2^-5 .. 2^-13"]
    reference_step: Annotated[Positive, "step size of the reference; steps are 2, 4, 8, ... times as large"]
    schemes: Annotated[tuple[SchemeName, ...], MinLen(1), "a list of schemes"]
    samples: Annotated[int, Ge(1), Le(10**15), "number of Brownian paths"]
    truncate_noise: Annotated[bool, "clip increments to sqrt(4 h |ln h|) in modulus, for all schemes"] = False
    seed: Annotated[int, Ge(0), Le(2**64 - 1), "seed of the random numbers"] = 1

    def checked(self, wrong):
        """The case with its steps from large to small; wrong(key, what, right) is to raise where keys disagree."""
        d = type(self.model).dimension
        if len(self.initial) != d:
            what = f"has {entries_in(len(self.initial))}"
            wrong("initial", what, f"must have {d}, the dimension of {self.model_name}")
        if self.final_time / self.reference_step > _MOST_STEPS:
            least = _shown(self.final_time / _MOST_STEPS)
            wrong("reference_step", "gives more than 2^34 steps until final_time", f"must be at least {least}")
        steps = [self._dyadic(h, wrong) for h in self.steps]
        for key, values in (("steps", steps), ("schemes", self.schemes)):
            if len(set(values)) < len(values):
                repeated = next(v for v in values if values.count(v) > 1)
                wrong(key, f"has {_shown(repeated)} twice", "remove one")
        if self.truncate_noise and max(steps) >= 1:
            wrong("steps", f"has {_shown(max(steps))}", "must be below 1 with truncate_noise, whose bound is 0 there")
        if "midpoint" in self.schemes and not self.truncate_noise:
            wrong("schemes", "has 'midpoint', which needs bounded increments", "set truncate_noise: true")
        return self._replace(steps=tuple(sorted(steps, reverse=True)))

    def _dyadic(self, h, wrong):
        """h as exactly the reference step times a power of two that divides the final time."""
        end, reference = self.final_time, self.reference_step
        if h > end * (1 + _ROUNDING):
            wrong("steps", f"has {_shown(h)}", f"must not exceed final_time, which is {_shown(end)}")
        doublings = math.log2(h) - math.log2(reference)
        exact = reference * 2.0 ** round(doublings)
        if round(doublings) < 1 or abs(h - exact) > _ROUNDING * h:
            lower = reference * 2.0 ** max(1, math.floor(doublings))
            what = f"has {_shown(h)}, which is not 2, 4, 8, ... times the reference_step {_shown(reference)}"
            wrong("steps", what, f"the nearest are {_shown(lower)} and {_shown(2 * lower)}")
        count = round(end / h)
        if abs(count * h - end) > _ROUNDING * end:
            lower = math.floor(end / h) * h
            what = f"has {_shown(h)}, of which final_time {_shown(end)} is no multiple"
            wrong("steps", what, f"the nearest multiples are {_shown(lower)} and {_shown(lower + h)}")
        return exact


#: kind in a spec file -> record of a case
KINDS: dict[str, type] = {"strong": StrongCase}


def keys(record):
    """The keys of a spec file that belong to a case; cases, profiles and --set may override them."""
    return [k for k in record._fields if k not in ("name", "title", "model_name")]


def _shown(value):
    """A number in a message: as a power of two if it is one."""
    if isinstance(value, str):
        return f"'{value}'"
    mantissa, exponent = math.frexp(value)
    return f"2^{exponent - 1}" if mantissa == 0.5 and abs(exponent - 1) > 1 else f"{value:.12g}"


# ---------------------------------------------------------------------------------------------------------------------
# JSON Schema
# ---------------------------------------------------------------------------------------------------------------------


def json_schema():
    """The JSON Schema (draft 2020-12) of spec files, for editors; it knows nothing of conditions between keys."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "An experiment of spi",
        "oneOf": [_file_schema(kind, record) for kind, record in KINDS.items()],
    }


def _file_schema(kind, record):
    plain = [k for k in keys(record) if k != "model"]
    required = ["model", *(k for k in plain if k not in record._field_defaults)]
    title = {"type": "string"}
    partly = {**schema_of_fields(record, plain), "model": _any_model_schema(required=False)}
    by_name = {"type": "object", "patternProperties": {f"^{CASE_NAME}$": _object(partly)}}
    profile = _object({**partly, "cases": by_name})
    case = _object({"name": {"type": "string", "pattern": f"^{CASE_NAME}$"}, "title": title, **partly}, ["name"])
    figure = {"type": ["integer", "null"], "minimum": 1, "description": "number of the figure of the paper"}
    own = {
        "title": title,
        "figure": figure,
        "kind": {"const": kind},
        "cases": {"type": "array", "minItems": 1, "items": case, "description": "panels, each overriding some keys"},
        "profiles": _object(dict.fromkeys(PROFILES[1:], profile)),
    }
    # With cases the file itself may leave anything to them, so a model need not be complete there.
    alone = {"required": required, "properties": {"model": _any_model_schema(required=True)}}
    schema = _object({**own, **partly}, ["kind"], record.__doc__)
    return {**schema, "anyOf": [{"required": ["cases"]}, alone]}


def _any_model_schema(required):
    return {"anyOf": [_model_schema(name, cls, required) for name, cls in MODELS.items()]}


def _model_schema(name, cls, required):
    needed = ["name", *(f for f in cls._fields if f not in cls._field_defaults)] if required else []
    return _object({"name": {"const": name}, **schema_of_fields(cls, cls._fields)}, needed, cls.__doc__)


def _object(properties, required=(), description=None):
    schema = {"type": "object", "properties": properties, "required": list(required), "additionalProperties": False}
    return {**schema, "description": description} if description else schema
