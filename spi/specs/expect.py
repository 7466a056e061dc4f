"""Key ``expect``: claims about the results.

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
from collections.abc import Iterable
from typing import Annotated, Any, NamedTuple

from pydantic import PlainValidator

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


def _read(value: Any, path: tuple[str, ...] = ()) -> tuple[tuple[tuple[str, ...], Stated], ...]:
    """(keys that lead to it, number) of each number in the value of ``expect`` to which `path` leads."""
    if isinstance(value, dict):
        return tuple(leaf for key, inner in value.items() for leaf in _read(inner, (*path, key)))
    if value is None:
        return ()
    if not path:
        raise wrong(f"is {shown(value)}", "must be a mapping, lines of key: value")
    return ((path, _stated(value, path)),)


def _stated(value: Any, path: tuple[str, ...]) -> Stated:
    """Number that a text stands for."""
    parts = _LEAF.fullmatch(value) if isinstance(value, str) else None
    sense, number, tolerance = parts.groups() if parts else (None, "", None)
    try:
        text = f"{number} ± {tolerance}" if tolerance else number
        stated = Stated(sense, _number(number), _number(tolerance or "0"), text)
    except NumberError as error:
        reason = f" ({error})" if isinstance(value, str) else ""
        raise wrong(f"is {shown(value)}{reason}", _RIGHT, "expect", *path) from None
    if stated.tolerance < 0 or (sense and tolerance):
        raise wrong(f"is {shown(value)}", _RIGHT, "expect", *path)
    return stated


_Number = float | str | dict[str, Any] | None
Expect = Annotated[Any, PlainValidator(_read, json_schema_input_type=dict[str, dict[str, _Number] | None] | None)]


def merged(below: Any, above: Any) -> Any:
    """An ``expect`` that stands `below` with the layer `above`."""
    if not isinstance(below, dict) or not isinstance(above, dict):
        return above
    return {**below, **{key: merged(below.get(key), value) for key, value in above.items()}}


def without(expect: Any, names: Iterable[str]) -> Any:
    """An ``expect`` without the claims about any of these names."""
    if not isinstance(expect, dict):
        return expect
    return {key: without(value, names) for key, value in expect.items() if key not in names}


def names_in(key: str, listed: Any) -> set[str]:
    """Names, as claims have them, of the entries that a spec has under one of the keys :data:`NAMING`."""
    if isinstance(listed, str) and key != "extrapolate":
        return {"phi"}
    entries = [listed] if isinstance(listed, str) else listed if isinstance(listed, list | dict) else []
    return {f"{key} {entry}" if key == "extrapolate" else entry for entry in entries if isinstance(entry, str)}


def claims(case: Any) -> tuple[Claim, ...]:
    """Claims of a case; raises the error about the first that is wrong."""
    if case.expect and not case.quantities:
        raise wrong(
            "is not possible for this kind of experiment, which has no quantities to judge", "remove it", "expect"
        )
    return tuple(_claim(case, path, stated) for path, stated in case.expect)


def _claim(case: Any, path: tuple[str, ...], stated: Stated) -> Claim:
    """A claim, to which `path` leads: scheme, scopes and limits, quantity."""
    scheme, name = path[0], path[-1]
    if scheme not in case.schemes:
        raise wrong("is not a known scheme", suggestion(scheme, case.schemes), "expect", scheme)
    if len(path) == 1:
        right = f"must be a mapping of quantities, as in {scheme}: {{{next(iter(case.quantities))}: 1/2}}"
        raise wrong(f"is {shown(stated.text)}", right, "expect", scheme)
    within = case.scopes
    scopes, limits, text = [], [], stated.text
    for n, key in enumerate(path[1:], 2):
        place = "expect", *path[:n]
        if key in case.quantities:
            if n < len(path):
                raise wrong("is a mapping", _RIGHT, *place)
        elif limit := _UP_TO.fullmatch(key):
            limits.append(_limit(case, limit, place))
            text += f" up to {limits[-1][0]} = {limit[2]}"
        elif key in within:
            scopes.append(key)
        else:
            raise wrong("is not a known quantity", suggestion(key, (*case.quantities, *within)), *place)
    if name not in case.quantities:
        raise wrong(f"is {shown(stated.text)}", "must be a mapping of quantities", *place)
    quantity = case.quantities[name]
    if "h" in dict(limits) and not quantity.per_step:
        raise wrong("is not known for each step size", "state it outside of 'up to'", *place)
    sense = stated.sense or quantity.sense
    if stated.tolerance and sense != EQUAL:
        raise wrong(f"is {shown(stated.text)}", f"has no tolerance, because it is judged as {sense}", *place)
    return Claim(case.owner, scheme, name, sense, stated.number, stated.tolerance, text, tuple(scopes), tuple(limits))


def _limit(case: Any, limit: re.Match[str], place: tuple[str, ...]) -> tuple[str, float]:
    """(name, largest value) of a limit."""
    name = limit[1] or "h"
    if name not in case.limiting:
        raise wrong(f"has no limit {shown(name)}", suggestion(name, case.limiting), *place)
    try:
        return name, _number(limit[2])
    except NumberError as error:
        raise wrong(f"has no number ({error})", "must be like up to 2^-3 or eps up to 0.01", *place) from None
