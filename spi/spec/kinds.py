"""What may stand in a spec file: the keys of each kind of experiment and the layers of a file.

A new kind is a subclass of Case and a line in KINDS.
"""

import math
from typing import Annotated, Literal, get_type_hints

import pydantic
from annotated_types import Ge, MinLen
from pydantic import create_model, model_validator

from ..models import MODELS
from ..protocol import Positive
from ..schemes import SCHEMES
from .keys import (
    ABSENT,
    COMPLETE,
    PANELS,
    CaseName,
    Keys,
    Model,
    ModelPart,
    Panels,
    Path,
    Samples,
    Schemes,
    Seed,
    State,
    Steps,
    entries_in,
    key_of,
    name_of,
    needed_keys,
    one_of,
    quantity,
    wrong,
)

#: ``laptop`` is the file itself; so are the others where the file does not define them.
PROFILES = ("laptop", "paper", "quick")

CLIP = "clip increments to sqrt(4 h |ln h|) in modulus, for all schemes"
_MOST_STORED = 10**7  # states of a trajectory
_MOST_STEPS = 2**34  # of the reference step: what the counter of the random numbers has room for
_ROUNDING = 1e-12  # relative: ratios of steps written as decimals are not exact


# ---------------------------------------------------------------------------------------------------------------------
# Kinds of experiment
# ---------------------------------------------------------------------------------------------------------------------


class Case(Keys):
    """What the cases of all kinds have; a spec file gives all fields but the first two as its keys."""

    name: str
    title: str
    model: Model
    initial: key_of(State, "initial value y_0, a number per component or a complex number such as 0.1+0.3i per mode")
    final_time: key_of(Positive, "final time T, a multiple of every step")
    seed: key_of(Seed, "seed of the random numbers") = 1

    @property
    def model_name(self):
        return name_of(self.model)

    @model_validator(mode="after")
    def _check_initial(self):
        d, found = type(self.model).dimension, len(self.initial)
        if found != d:
            raise wrong(f"has {entries_in(found)}", f"must have {d}, the dimension of {self.model_name}", "initial")
        return self


class StrongCase(Case):
    """Strong errors of schemes, each against itself at the reference step on the same Brownian paths."""

    steps: key_of(Steps, "step sizes, a list or a range such as 2^-5 .. 2^-13")
    reference_step: key_of(Positive, "step size of the reference; steps are 2, 4, 8, ... times as large")
    schemes: key_of(Schemes, "a list of schemes")
    samples: key_of(Samples, "number of Brownian paths")
    truncate_noise: key_of(pydantic.StrictBool, "clip increments to sqrt(4 h |ln h|) in modulus, for all schemes") = (
        False
    )

    reference_scheme: key_of(Literal[tuple(SCHEMES)] | None, "scheme of the reference; default: each its own") = None

    @model_validator(mode="after")
    def _check_steps(self):
        """The case with its steps from large to small."""
        _check_count(self.final_time, self.reference_step, "reference_step")
        steps = [self._dyadic(h) for h in self.steps]
        if len(set(steps)) < len(steps):
            raise wrong(f"has {quantity(next(h for h in steps if steps.count(h) > 1))} twice", "remove one", "steps")
        schemes = self.schemes + ((self.reference_scheme,) if self.reference_scheme else ())
        _check_schemes(self.schemes, schemes, max(steps), self.truncate_noise, "steps")
        return self.model_copy(update={"steps": tuple(sorted(steps, reverse=True))})

    def _dyadic(self, h):
        """h as exactly the reference step times a power of two that divides the final time."""
        end, reference = self.final_time, self.reference_step
        if h > end * (1 + _ROUNDING):
            raise wrong(f"has {quantity(h)}", f"must not exceed final_time, which is {quantity(end)}", "steps")
        doublings = math.log2(h) - math.log2(reference)
        exact = reference * 2.0 ** round(doublings)
        if round(doublings) < 1 or abs(h - exact) > _ROUNDING * h:
            lower = reference * 2.0 ** max(1, math.floor(doublings))
            what = f"has {quantity(h)}, which is not 2, 4, 8, ... times the reference_step {quantity(reference)}"
            raise wrong(what, f"the nearest are {quantity(lower)} and {quantity(2 * lower)}", "steps")
        _check_multiple(end, h, "steps", "has")
        return exact


class TrajectoryCase(Case):
    """One path of each scheme, all on the same Brownian path."""

    step: key_of(Positive, "step size h")
    schemes: key_of(Schemes, "a list of schemes")
    panels: key_of(Panels, f"what the figure shows, some of {', '.join(PANELS)}")
    path: key_of(Path, "number of the path") = 0
    truncate_noise: key_of(pydantic.StrictBool, "clip increments to sqrt(4 h |ln h|) in modulus, for all schemes") = (
        False
    )

    @model_validator(mode="after")
    def _check_step(self):
        if self.final_time / self.step > _MOST_STORED:
            least = quantity(self.final_time / _MOST_STORED)
            raise wrong("gives more than 10^7 steps, all of which are kept", f"must be at least {least}", "step")
        _check_multiple(self.final_time, self.step, "step", "is")
        _check_schemes(self.schemes, self.schemes, self.step, self.truncate_noise, "step")
        return self


def _check_count(end, step, key):
    if end / step > _MOST_STEPS:
        what = "gives more than 2^34 steps until final_time"
        raise wrong(what, f"must be at least {quantity(end / _MOST_STEPS)}", key)


def _check_multiple(end, h, key, has):
    """The final time must be a multiple of h."""
    if h > end * (1 + _ROUNDING) or abs(round(end / h) * h - end) > _ROUNDING * end:
        lower = max(math.floor(end / h), 1) * h
        what = f"{has} {quantity(h)}, of which final_time {quantity(end)} is no multiple"
        raise wrong(what, f"the nearest multiples are {quantity(lower)} and {quantity(lower + h)}", key)


def _check_schemes(listed, used, largest_step, truncated, key):
    """No scheme twice; and what the truncation of increments asks for."""
    if len(set(listed)) < len(listed):
        raise wrong(f"has '{next(s for s in listed if listed.count(s) > 1)}' twice", "remove one", "schemes")
    if truncated and largest_step >= 1:
        has = "has" if key == "steps" else "is"
        right = "must be below 1 with truncate_noise, whose bound is 0 there"
        raise wrong(f"{has} {quantity(largest_step)}", right, key)
    for name in used:
        if SCHEMES[name].needs_truncation and not truncated:
            key = "schemes" if name in listed else "reference_scheme"
            raise wrong(f"has '{name}', which needs bounded increments", "set truncate_noise: true", key)


#: kind in a spec file -> record of a case
KINDS: dict[str, type[Case]] = {"strong": StrongCase, "trajectory": TrajectoryCase}


# ---------------------------------------------------------------------------------------------------------------------
# Layers of a file
# ---------------------------------------------------------------------------------------------------------------------


def _layers(kind, record):
    """The classes of a profile and of a file; their keys need not be complete, since other layers may have the rest."""
    hints = get_type_hints(record, include_extras=True)
    keys = [k for k in record.model_fields if k not in ("name", "title")]
    optional = {k: (ModelPart if k == "model" else hints[k], ABSENT) for k in keys}
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
