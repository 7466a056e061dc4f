"""A parameter of the user's choice that may stand in numbers of a spec file, and its values.

    sweep: {s: [0.1, 1, 10]}
    model: {name: rigid_body, ..., sigma: [s, s, s/2]}

The parameter may stand in the model, in ``damping``, ``temperature``, ``initial`` and ``eps``.
"""

import re
from typing import Any, NamedTuple

from ..expressions.arithmetic import Numbers
from .keys import shown, wrong
from .models import SOURCES

PLACES = ("model", "damping", "temperature", "initial", "eps")


class Sweep(NamedTuple):
    """What ``sweep`` is turned into: the case with each value in place of the parameter."""

    word: str
    values: tuple[float, ...]
    cases: tuple

    def effective(self) -> dict[str, Any]:
        """What of it decides results, as plain data."""
        return {
            "word": self.word,
            "values": self.values,
            "points": [case.model_dump(include=set(PLACES)) for case in self.cases],
        }


def check(data: dict[str, Any]) -> None:
    """Raise the error about what is to be swept in `data`, if anything is wrong with it."""
    sweep = data["sweep"]
    if len(sweep) != 1:
        raise wrong(f"has {len(sweep)} parameters", "must have one and its values, as in sweep: {s: [0.1, 1, 10]}")
    (word,) = sweep
    if word in (*Numbers.functions, *Numbers.constants) or not re.match("^[A-Za-z_][A-Za-z0-9_]*$", word):
        raise wrong(f"{shown(word)} cannot be swept", "must be a name that is not a function or constant")
    if all(_replaced(data[key], word, "") == data[key] for key in PLACES if key in data):
        raise wrong(f"the parameter {shown(word)} is not used", f"use it in one of {', '.join(PLACES)}")


def versions(data: dict[str, Any]) -> list[dict[str, Any]]:
    """`data` with each of the values, which are texts, in place of the parameter."""
    ((word, values),) = data["sweep"].items()
    return [
        {key: _replaced(part, word, value) if key in PLACES else part for key, part in data.items()} for value in values
    ]


def _replaced(part: Any, word: str, value: str) -> Any:
    if isinstance(part, dict):
        return {key: inner if key in SOURCES else _replaced(inner, word, value) for key, inner in part.items()}
    if isinstance(part, list):
        return [_replaced(inner, word, value) for inner in part]
    if isinstance(part, str):
        return re.sub(rf"(?<![\w.]){re.escape(word)}(?!\w)", lambda _: f"({value})", part)
    return part
