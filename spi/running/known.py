"""What earlier runs know of the parts of an experiment: sums are found by the digest of what decides them.

Another scheme, another value of a swept parameter, another case or another claim changes no sum that is there, so that
a spec with more of them computes only what is new.
"""

import hashlib
import json
from collections.abc import Iterable
from typing import Any, NamedTuple

from ..kinds.plans import Plan


class Keys(NamedTuple):
    """Digests of what decides a part: its sums over the paths of each path set, and all else that is known of it."""

    extra: str
    path_sets: tuple[str, ...]

    @classmethod
    def of(cls, plan: Plan) -> "Keys":
        """Those of a plan."""
        numbers = range(len(plan.path_sets(plan.initial_extra())))
        return cls(_digest(plan.deciding(None)), tuple(_digest(plan.deciding(number)) for number in numbers))


def _digest(deciding: dict[str, Any]) -> str:
    """Of mappings in their order, since sums stand in the order of the functions that they are of."""
    text = json.dumps(deciding, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def sizes(plan: Plan, keys: Keys) -> dict[str, int]:
    """How much of the sums with each key a plan wants, as results tell it."""
    return dict(zip(keys.path_sets, plan.sizes(), strict=True))


class Kept:
    """A file of sums that has been read, by keys."""

    def __init__(self, about: dict[str, Any], parts: dict[str, Any]) -> None:
        self.parts, keys = parts, about["keys"]
        self.extras = {told["extra"]: part for part, told in keys.items()}
        self.places = {
            key: (part, number) for part, told in keys.items() for number, key in enumerate(told["path_sets"])
        }

    def of(self, keys: Keys) -> dict[str, Any]:
        """What is known of a part with these keys, as ``State.plain`` tells it; empty if that is nothing."""
        found: dict[str, Any] = {"path_sets": list(self._path_sets(keys))}
        if keys.extra in self.extras:
            found["extra"] = self.parts[self.extras[keys.extra]]["extra"]
        return found if found["path_sets"] or "extra" in found else {}

    def _path_sets(self, keys: Keys) -> Iterable[dict[str, Any]]:
        for number, key in enumerate(keys.path_sets):
            part, there = self.places.get(key, ("", 0))
            for one in self.parts[part]["path_sets"] if part else ():
                if one["number"] == there:
                    yield {**one, "number": number}
