"""The key ``expect``: what must come out.

    expect:
      splitting: {order: 1/2, casimir_drift: 1e-12}
      euler_maruyama: {order: 1/2 +- 0.05, casimir_drift: at least 0.1}

Under a scheme stand quantities, and mappings of quantities that hold for one estimator or test function, by its name,
for so many levels of extrapolation (``extrapolate 1``), or up to a step size (``up to 2^-3``), an eps (``eps up to
0.01``) or a value of the swept parameter.  Layers override it
claim by claim: a claim that is empty (``order: null``) is dropped, and a layer that names fewer schemes, estimators or
test functions drops the claims about the others.
"""

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Annotated, Any, NamedTuple

from pydantic import BeforeValidator

from ..expressions.arithmetic import NumberError, parse
from ..statistics.claims import EQUAL, Claim
from .keys import shown, suggestion, wrong

#: The keys of a spec whose entries claims may be about.
NAMING = ("schemes", "estimators", "functions", "extrapolate")

_LEAF = re.compile(r"(at most|at least)?\s*(.*?)\s*(?:(?:\+-|±)\s*(.*))?")
_UP_TO = re.compile(r"(?:(\w+) )?up to (.*)")
_RIGHT = "must be a number such as 1/2, a number with a tolerance such as 1/2 +- 0.05, at most 1e-12 or at least 1"


class Stated(NamedTuple):
    """A number as it is claimed."""

    sense: str | None  #: None where the quantity decides
    number: float
    tolerance: float
    text: str


def _number(text: str) -> float:
    number = parse(text)
    if isinstance(number, complex) or not math.isfinite(number):
        raise NumberError("not a real number")
    return float(number)


def _read(value: Any, path: tuple[str, ...] = ()) -> Any:
    """What stands under ``expect`` with its numbers read and without its empty entries; `path` leads to it."""
    if not isinstance(value, dict):
        return _stated(value, path) if path else {} if value is None else value
    return {key: _read(inner, (*path, key)) for key, inner in value.items() if inner is not None}


def _stated(value: Any, path: tuple[str, ...]) -> Stated:
    """The number that a text stands for."""
    parts = _LEAF.fullmatch(value) if isinstance(value, str) else None
    sense, number, tolerance = parts.groups() if parts else (None, "", None)
    try:
        stated = Stated(sense, _number(number), _number(tolerance or "0"), number + f" ± {tolerance}" * bool(tolerance))
    except NumberError as error:
        reason = f" ({error})" if isinstance(value, str) else ""
        raise wrong(f"is {shown(value)}{reason}", _RIGHT, "expect", *path) from None
    if stated.tolerance < 0 or (sense and tolerance):
        raise wrong(f"is {shown(value)}", _RIGHT, "expect", *path)
    return stated


Expect = Annotated[
    dict[str, Any],
    BeforeValidator(
        _read, json_schema_input_type=dict[str, dict[str, float | str | dict[str, Any] | None] | None] | None
    ),
]


def merged(below: Any, above: Any) -> Any:
    """What the layer `above` makes of an ``expect`` that stands `below`."""
    if not isinstance(below, dict) or not isinstance(above, dict):
        return above
    return {**below, **{key: merged(below.get(key), value) for key, value in above.items()}}


def without(expect: Any, names: Iterable[str]) -> Any:
    """An ``expect`` without the claims about any of these names."""
    if not isinstance(expect, dict):
        return expect
    return {key: without(value, names) for key, value in expect.items() if key not in names}


def names_in(key: str, listed: Any) -> set[str]:
    """The names, as claims have them, in what a spec has under one of the keys :data:`NAMING`."""
    if key == "extrapolate":
        return {f"{key} {levels}" for levels in ([listed] if isinstance(listed, str) else listed or ())}
    return {"phi"} if isinstance(listed, str) else set(listed or ())


class _Place(NamedTuple):
    """Where in an ``expect`` a mapping of quantities stands."""

    path: tuple[str, ...]
    scopes: tuple[str, ...] = ()
    limits: tuple[tuple[str, float], ...] = ()
    text: str = ""  #: of the limits


def claims(case: Any) -> tuple[Claim, ...]:
    """The claims of a case; raises the error about the first that is wrong."""
    if case.expect and not case.quantities:
        raise wrong(
            "is not possible for this kind of experiment, which has no quantities to judge", "remove it", "expect"
        )
    return tuple(claim for scheme, stated in case.expect.items() for claim in _of_scheme(case, scheme, stated))


def _of_scheme(case: Any, scheme: str, stated: Any) -> Iterator[Claim]:
    place = _Place(("expect", scheme))
    if scheme not in case.schemes:
        raise wrong("is not a known scheme", suggestion(scheme, case.schemes), *place.path)
    right = f"must be a mapping of quantities, as in {scheme}: {{{next(iter(case.quantities))}: 1/2}}"
    return _claims(case, scheme, _mapping(stated, right, place), place)


def _claims(case: Any, scheme: str, stated: Mapping[str, Any], place: _Place) -> Iterator[Claim]:
    scopes = [name for key in case.scoping for name in getattr(case, key)]
    scopes += [f"extrapolate {levels}" for levels in getattr(case, "extrapolate", ())]
    for key, value in stated.items():
        here = place._replace(path=(*place.path, key))
        if key in case.quantities:
            yield _claim(case, scheme, key, value, here)
        else:
            inside = _inside(case, key, scopes, here)
            yield from _claims(case, scheme, _mapping(value, "must be a mapping of quantities", here), inside)


def _inside(case: Any, key: str, scopes: Sequence[str], place: _Place) -> _Place:
    """The place with the scope or the limit that `key` adds."""
    limit = _UP_TO.fullmatch(key)
    if limit:
        name, largest = _limit(case, limit, place.path)
        text = f"{place.text} up to {name} = {limit[2]}"
        return place._replace(limits=(*place.limits, (name, largest)), text=text)
    if key not in scopes:
        right = suggestion(key, (*case.quantities, *scopes))
        raise wrong("is not a known quantity", right, *place.path)
    return place._replace(scopes=(*place.scopes, key))


def _mapping(value: Any, right: str, place: _Place) -> Mapping[str, Any]:
    """What stands at a place, if that is a mapping."""
    if not isinstance(value, dict):
        raise wrong(f"is {shown(value.text)}", right, *place.path)
    return value


def _claim(case: Any, scheme: str, name: str, value: Any, place: _Place) -> Claim:
    sort = case.quantities[name]
    if isinstance(value, dict):
        raise wrong(f"is {shown(value)}", _RIGHT, *place.path)
    if "h" in dict(place.limits) and not sort.per_step:
        raise wrong("is not known for each step size", "state it outside of 'up to'", *place.path)
    sense = value.sense or sort.sense
    if value.tolerance and sense != EQUAL:
        raise wrong(f"is {shown(value.text)}", f"has no tolerance, because it is judged as {sense}", *place.path)
    text = value.text + place.text
    return Claim(case.owner, scheme, name, sense, value.number, value.tolerance, text, place.scopes, place.limits)


def _limit(case: Any, limit: re.Match[str], path: tuple[str, ...]) -> tuple[str, float]:
    """What must not exceed which number."""
    name = limit[1] or "h"
    if name not in case.limiting:
        raise wrong(f"has no limit {shown(name)}", suggestion(name, case.limiting), *path)
    try:
        return name, _number(limit[2])
    except NumberError as error:
        raise wrong(f"has no number ({error})", "must be like up to 2^-3 or eps up to 0.01", *path) from None
