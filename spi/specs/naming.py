"""What results are called: one name for each experiment, kind, profile and set of overrides.

    rigid_body_strong                            the spec as it stands
    rigid_body_strong.quick                      --profile quick
    rigid_body_strong.weak                       --as weak
    rigid_body_strong.seed=2                     --seed 2, or --set seed=2
    rigid_body_strong.quick.steps=2_-3-1f0c9a    --profile quick --set 'steps=[2^-3]'

What changes no path is no part of the name: with other `samples` a run goes on in the same file, and titles and claims
are written anew.  A name follows from the options alone, so that results are found where their spec is not.
"""

import hashlib
import re
from collections.abc import Iterable

#: Keys that decide no path.
_NEUTRAL = ("samples", "title", "asks", "figure", "expect")
#: Letters that a value keeps; capital letters are told apart by a digest, since some disks take them for small ones.
_PLAIN = re.compile(r"[a-z0-9_+,-]+(?:[.][a-z0-9_+,-]+)*")
#: Letters of a value, and of all overrides, that can still be read at a glance.
_VALUE, _ALL = 24, 64


def of_kind(name: str, kind: str | None) -> str:
    """The name of an experiment made into one of another kind."""
    return f"{name}.{kind}" if kind else name


def results_name(name: str, profile: str = "laptop", overrides: Iterable[str] = ()) -> str:
    """What the results of the experiment `name` are called; `overrides` are texts as ``spi.specs.load`` takes them."""
    last = {}
    for one in overrides:
        key, _, value = one.partition("=")
        last[key.strip().removeprefix("--")] = "".join(value.split())
    tags = [_tag(key, last[key]) for key in sorted(last) if not _is_neutral(key)]
    if len(".".join(tags)) > _ALL:
        tags = [f"set-{_digest('.'.join(tags))}"]
    return ".".join([name, *([] if profile == "laptop" else [profile]), *tags])


def _is_neutral(key: str) -> bool:
    words = key.split(".")
    return words[2 if words[0] == "cases" and len(words) > 2 else 0] in _NEUTRAL


def _tag(key: str, value: str) -> str:
    """``key=value``; with a digest where letters that stand in no name of a file were left out."""
    text = value.removeprefix("[").removesuffix("]")
    if _PLAIN.fullmatch(text) and len(text) <= _VALUE and re.fullmatch("[a-z0-9_.]+", key):
        return f"{key}={text}"
    short = re.sub("[^A-Za-z0-9_+-]+", "_", text)[:_VALUE].strip("_")
    return f"{re.sub('[^A-Za-z0-9_.]+', '_', key)}={short}-{_digest(f'{key}={value}')}"


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode(errors="surrogateescape")).hexdigest()[:6]
