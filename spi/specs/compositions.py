"""Key ``compositions``: splitting schemes of the user's own, as stages.

    compositions:
      strang: [noise 1/2, drift 1, noise 1/2]
      palindrome: [drift 1/2, noise 1 symmetric, drift 1/2 backwards]
      there_and_back: [noise 1/2 shared, drift 1, noise 1/2 backwards shared]
      together: [joint 1 symmetric]
      with_areas: [drift 1/2, noise 1, loops, drift 1/2 backwards]

A stage is the part that acts, ``joint`` for pieces of H together with the noises of their families, its share of the
step and, where that is not forwards, the order of its flows; the word ``coin`` has the order reversed for the paths
whose coin is -1, and with the word ``shared`` noise flows have their shares of the increment of the whole step, in
place of increments of their own.  The stage ``loops`` supplies the Lévy areas of noises that do not commute, and so
does ``areas``, by fewer flows where these are known.  The first stage acts first.

A scheme that is no composition of flows is a class in a Python file:

    compositions:
      heun: {python: heun.py, name: Heun, strong_order: 1/2, strong_order_commuting: 1, weak_order: 1}

Such an entry says which orders are expected and what is preserved, and gives the fields of the class.
"""

import functools
import math
import re
from typing import Annotated, Any, cast

import pydantic
from annotated_types import Ge, Le
from pydantic import AfterValidator, PlainSerializer, PlainValidator, create_model

from ..checks.registration import check_class
from ..checks.scheme_checks import check_scheme
from ..compiler import modules
from ..ensemble.protocol import joined_noises, large, noise_indices, noises, piece_indices
from ..exact.words import weak_order as order_of_words
from ..exact.words import words_of
from ..expressions.arithmetic import NumberError, parse
from ..models import MODELS
from ..models.delegation import undamped
from ..schemes import SCHEMES, Scheme
from ..schemes.splitting import splitting
from ..schemes.stages import ORDERS, PARTS, Flows, compositions, flows, has_loops, repeats_increments
from .files import Files
from .keys import NAME, Keys, entries_in, fields_of, key_of, shown, suggestion, wrong
from .models import class_in

# ---------------------------------------------------------------------------------------------------------------------
# Classes in Python files
# ---------------------------------------------------------------------------------------------------------------------

ClaimedOrder = Annotated[float, Ge(0), Le(8)]

_PRESERVES = "what tables say that it preserves"


class Told(Keys):
    """Keys of an entry besides the fields of the class."""

    python: str
    name: str
    strong_order: key_of(ClaimedOrder | None, "strong order with noises that do not commute, if it is known") = None
    strong_order_commuting: key_of(ClaimedOrder | None, "strong order with one noise, or noises that commute") = None
    weak_order: key_of(ClaimedOrder | None, "weak order, if it is known") = None
    preserves: key_of(str, _PRESERVES) = "nothing"
    needs_truncation: key_of(pydantic.StrictBool, "whether it needs bounded increments") = False


def read_scheme(data: dict[str, Any], files: Files) -> Scheme:
    """Entry of the table of schemes for a class in a Python file, but for its label."""
    cls = class_in(data, files, "NamedTuple with a method advance, see docs/own_schemes.md")
    try:
        check_class(cls, "scheme", data["name"])
    except TypeError as error:
        raise wrong(f"is {data['name']}: {error}", f"correct {data['python']}", "name") from None
    fields: dict[str, Any] = fields_of(cls)
    keys = create_model(cls.__qualname__, __base__=Told, **fields).model_validate(data)
    stated: dict[str, Any] = keys.model_dump(include={*Told.model_fields} - {"python", "name"})
    return Scheme(
        record=cls(**{key: getattr(keys, key) for key in fields}),
        label="",
        formula=(cls.__doc__ or "").strip().splitlines()[0] if cls.__doc__ else "see the Python file",
        reference=f"{data['name']} in {data['python']}",
        look=("", ""),
        work=10.0,
        **(stated | {key: math.nan for key, value in stated.items() if value is None}),
    )


def plain_scheme(entry: Scheme) -> dict[str, Any]:
    """All of it that decides results."""
    cls = type(entry.record)
    orders = entry.strong_order, entry.strong_order_commuting, entry.weak_order  # by which results are extrapolated
    stated = {"orders": str(orders), "needs_truncation": entry.needs_truncation}
    return {"name": cls.__qualname__, "code": modules.digest(cls), **stated, **entry.record._asdict()}


def check_steps(compositions: dict[str, Any], model: Any, initial: tuple[float, ...]) -> None:
    """Raise the error about schemes in Python files whose steps do not fit the equation near the initial state."""
    for name, entry in compositions.items():
        if isinstance(entry, Scheme) and not large(model):
            for complaint in check_scheme(entry.record, undamped(model), initial)[:1]:
                raise wrong(f"is {entry.reference}: {complaint}", "correct the class", "compositions", name)


CompositionKey = tuple[Flows, ...]

_MOST_STAGES = 16  # each becomes compiled code of its own
_OF_VARIANTS = ("eps", "extrapolated")  # second words in the names of variants of a scheme
_COIN, _SHARED = "coin", "shared"
_WORDS = (*ORDERS, _COIN, _SHARED)
_SUPPLYING = ("loops", "areas")
_RIGHT = "must be like noise 1/2, drift 1 symmetric, noise 1 coin or loops"
_NAMES = {type(record): name for name, record in (*PARTS.items(), *ORDERS.items())}


def _stage(n: int, text: Any) -> Flows:
    """Stage that entry `n` stands for."""
    part, *words = (text.split() if isinstance(text, str) else []) or [""]
    if part in _SUPPLYING and not words:
        return flows(part)
    if part not in PARTS or part in _SUPPLYING or not words:
        raise wrong(f"is {shown(text)}", _RIGHT, n)
    number, further = _divided(words)
    order = _order(n, text, further)
    try:
        stage = flows(part, order, _fraction(" ".join(number)), _COIN in further, _SHARED in further)
    except NumberError as error:
        raise wrong(f"is {shown(text)} ({error})", _RIGHT, n) from None
    except ValueError as error:
        raise wrong(f"is {shown(text)}", f"{error}", n) from None
    if stage.fraction == 0:
        raise wrong(f"is {shown(text)}, which does nothing", "leave it out", n)
    return stage


def _divided(words: list[str]) -> tuple[list[str], list[str]]:
    """Words of the fraction, which has one at least, and those after it."""
    last = len(words)
    while last > 1 and words[last - 1].isalpha():
        last -= 1
    return words[:last], words[last:]


def _order(n: int, text: str, further: list[str]) -> str:
    """Order of flows among the words after the fraction, each of which may stand there once."""
    if unknown := next((word for word in further if word not in _WORDS), None):
        raise wrong(f"is {shown(text)} with the word '{unknown}'", suggestion(unknown, _WORDS), n)
    orders = [word for word in further if word in ORDERS] or ["forwards"]
    if len(orders) > 1 or any(further.count(word) > 1 for word in (_COIN, _SHARED)):
        raise wrong(f"is {shown(text)} with several orders", _RIGHT, n)
    return orders[0]


def _fraction(text: str) -> float:
    fraction = parse(text)
    if isinstance(fraction, complex):
        raise NumberError("not a real number")
    return float(fraction)


def _entry(value: Any, info: pydantic.ValidationInfo) -> Any:
    """Stages that some texts stand for, or the entry of a scheme in a Python file."""
    if isinstance(value, dict) and "python" in value:
        return read_scheme(value, cast(Files, info.context))
    if not isinstance(value, list):
        raise wrong(f"is {shown(value)}", "must be a list of stages, as in [noise 1/2, drift 1, noise 1/2]")
    if len(value) > _MOST_STAGES:
        raise wrong(f"has {entries_in(len(value))}", f"must have at most {_MOST_STAGES}")
    stages = tuple(_stage(n, text) for n, text in enumerate(value))
    try:
        splitting(*stages)
    except ValueError as error:
        raise wrong("is not a whole step", f"{error}") from None
    return stages


def _labelled(entries: dict[str, Any]) -> dict[str, Any]:
    return {k: entry._replace(label=k) if isinstance(entry, Scheme) else entry for k, entry in entries.items()}


def _name(name: str) -> str:
    if not re.match(NAME, name):
        raise wrong("is not a valid name", "must consist of letters, digits and _")
    if name in SCHEMES or any(name.startswith(f"{scheme}_{of}_") for scheme in SCHEMES for of in _OF_VARIANTS):
        raise wrong("is the name of a scheme", "give the composition another name")
    return name


def weak_order(stages: CompositionKey, model: Any) -> float:
    """Weak order of stages: 2 where any two flows act in either order for one half of the step, otherwise 1.

    With noise it cannot be higher (Goldman and Kaper, SIAM Journal on Numerical Analysis 33, 1996), since noise has no
    negative fractions.  NaN without noise, where it can.  With loops it is 1: the mean of noise flows and loops
    together is that of the noise of the equation up to terms of order h^2 only.  So it is where a noise acts more than
    once with one increment, see docs/compositions.md.
    """
    if has_loops(stages):
        return 1.0
    if large(model):  # four of its hundreds of flows suffice
        model = MODELS["sine_euler"](sigma=tuple(1.0 if k < noises(model) else None for k in range(4)))
    if repeats_increments(stages, model):
        return 1.0
    if not noise_indices(model):
        return math.nan
    families = tuple(tuple(joined_noises(model, k)) for k in piece_indices(model))
    return _weak_order(compositions(stages, model), families)


@functools.lru_cache(maxsize=64)
def _weak_order(acting: Any, families: tuple[tuple[int, ...], ...]) -> float:
    """Order, where a piece and its noises commute."""
    words = words_of(acting, lambda part, k: True)
    family = {("noise", j): ("drift", k) for k, noises_of in enumerate(families) for j in noises_of}
    return float(order_of_words(words, commute=lambda a, b: family.get(a, a) == family.get(b, b)))


def _plain(entry: CompositionKey | Scheme) -> Any:
    """A scheme as all that decides its results, stages as one text each, whatever they were read from."""
    return plain_scheme(entry) if isinstance(entry, Scheme) else [_text(stage) for stage in entry]


def _text(stage: Flows) -> str:
    part = _NAMES[type(stage.part)]
    if part in _SUPPLYING:
        return part
    words = [_COIN] * (stage.coin is not None) + [_SHARED] * (stage.shared is not None)
    return " ".join([part, repr(stage.fraction), _NAMES[type(stage.order)], *words])


_Entry = Annotated[
    Any, PlainValidator(_entry, json_schema_input_type=list[str] | dict[str, Any]), PlainSerializer(_plain)
]
Compositions = Annotated[dict[Annotated[str, AfterValidator(_name)], _Entry], AfterValidator(_labelled)]
