"""A word that may stand in numbers of a spec file, and the values that it takes in turn.

    sweep: {s: [0.1, 1, 10]}
    model: {name: rigid_body, ..., sigma: [s, s, s/2]}

The word may stand in the model, in ``initial`` and in ``eps``.
"""

import re
from typing import Any, NamedTuple

from ..numbers import Numbers
from .keys import shown, wrong

PLACES = ("model", "initial", "eps")


class Sweep(NamedTuple):
    """What ``sweep`` is turned into: the case with each value in the place of the word."""

    word: str
    values: tuple[float, ...]
    cases: tuple

    def effective(self):
        """What of it decides results, as plain data."""
        return {
            "word": self.word,
            "values": self.values,
            "points": [case.model_dump(include=set(PLACES)) for case in self.cases],
        }


def check(sweep):
    """Raise the error about a mapping {word: values} that cannot be swept."""
    if len(sweep) != 1:
        raise wrong(f"has {len(sweep)} words", "must have one word and its values, as in sweep: {s: [0.1, 1, 10]}")
    word = next(iter(sweep))
    if word in (*Numbers.functions, *Numbers.constants) or not re.match("^[A-Za-z_][A-Za-z0-9_]*$", word):
        raise wrong(f"{shown(word)} cannot be swept", "must be a word of letters that is no function or constant", word)
    if len(set(sweep[word])) < len(sweep[word]):
        raise wrong("has a value twice", "remove one", word)
    return sweep


def versions(data: dict[str, Any]):
    """`data` with each of the values, which are texts, in the place of the word; empty if nothing is swept."""
    sweep = data.get("sweep")
    if not isinstance(sweep, dict):
        return []
    word, values = next(iter(sweep.items()))
    return [
        {key: _replaced(part, word, value) if key in PLACES else part for key, part in data.items()} for value in values
    ]


def uses(data, word):
    """Whether the word stands anywhere where it may."""
    return any(_replaced(data[key], word, "") != data[key] for key in PLACES if key in data)


def _replaced(part, word, value):
    if isinstance(part, dict):
        return {key: _replaced(inner, word, value) for key, inner in part.items()}
    if isinstance(part, list):
        return [_replaced(inner, word, value) for inner in part]
    if isinstance(part, str):
        return re.sub(rf"(?<![\w.]){re.escape(word)}(?!\w)", lambda _: f"({value})", part)
    return part
