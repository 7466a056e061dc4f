"""Spec files: YAML in, typed records out; every error names the file, the line and the key.

Later layers override earlier ones, key by key (and a model parameter by parameter, unless it names another model):

    the file < a case of ``cases:`` < the profile < ``cases:`` of the profile < ``--set``

so that a profile or ``--set`` has the last word in every case.  Another mapping, ``functions``, is replaced whole.  All
profiles of a file are checked, whichever is asked for.
"""

import difflib
import hashlib
import json
import re
from functools import reduce
from operator import getitem
from pathlib import Path
from typing import NamedTuple

import yaml
from pydantic import ValidationError
from pydantic_core import PydanticCustomError

from . import sweep
from .cases import Case
from .keys import entries_in, shown, suggestion
from .kinds import KINDS, StrongCase, WeakCase
from .layers import FILE, LAYERS, PROFILES, json_schema

__all__ = ["KINDS", "PROFILES", "Case", "Experiment", "SpecError", "StrongCase", "WeakCase", "json_schema", "load"]

_MOST_ENTRIES = 10_000  # aliases of aliases could multiply without bound
_MERGE = "tag:yaml.org,2002:merge"


class SpecError(ValueError):
    """An invalid spec: one line ``path:line: key: what is wrong; what would be right``."""

    def __init__(self, message):
        super().__init__("".join(c if c.isprintable() else " " for c in message))


class Experiment(NamedTuple):
    """A valid spec file under one profile."""

    path: Path
    name: str  #: of the file, without its ending
    title: str
    figure: int | None  #: of the paper
    kind: str
    profile: str
    cases: tuple[Case, ...]
    text: str  #: the file as it stands
    hash: str  #: SHA-256 of `effective` as canonical JSON
    effective: dict  #: all that decides the results, so without titles and figure; can be written as JSON


def load(path, profile="laptop", overrides=()):
    """The experiment in the file `path`; `overrides` are texts "key=value" such as "model.sigma=[1, 0, 0]".

    Raises SpecError if anything is wrong with the file, the profile or an override.
    """
    if profile not in PROFILES:
        raise SpecError(f"{path}: --profile: '{profile}' is no known profile; {suggestion(profile, PROFILES)}")
    text = _text(path)
    document = Document(text, lambda line: f"{path}:{line}:")
    if document.data is None:
        document.fail((), f"the file is empty; start with a line kind: {' or '.join(KINDS)}")
    file = _valid(FILE.validate_python, document.data, [(document, ())])
    title = file.title or Path(path).stem
    owners = _owners(document, file, title)
    profiles = {name: [(document, ("profiles", name))] for name in document.data.get("profiles", {})}
    for above in ([], *profiles.values()):
        _cases(file.kind, document, owners, above)
    last = [(_override(path, override), ()) for override in overrides]
    for layer in last:
        _valid(LAYERS[file.kind][0].model_validate, layer[0].data, [layer])
    cases = _cases(file.kind, document, owners, profiles.get(profile, []) + last)
    effective = {"kind": file.kind, "cases": {c.name: c.model_dump(exclude={"name", "title"}) for c in cases}}
    canonical = json.dumps(effective, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return Experiment(
        path=Path(path),
        name=Path(path).stem,
        title=title,
        figure=file.figure,
        kind=file.kind,
        profile=profile,
        cases=cases,
        text=text,
        hash=hashlib.sha256(canonical.encode()).hexdigest(),
        effective=json.loads(canonical),
    )


# ---------------------------------------------------------------------------------------------------------------------
# YAML as plain data that knows where it stands
# ---------------------------------------------------------------------------------------------------------------------


class Document:
    """A YAML text as dicts, lists, texts (numbers too), True, False and None.

    A location is a tuple of keys and of indices of lists.  `place` says how a line is named in messages; `top` is the
    location at which the text stands, so that an override is a document as well.
    """

    def __init__(self, text, place, top=()):
        self.place, self.left = place, _MOST_ENTRIES
        self.places = {top[:n]: place(1) for n in range(len(top) + 1)}
        self.data = self._compose(text, top)
        for key in reversed(top):
            self.data = {key: self.data}

    def at(self, loc):
        """The value at a location."""
        return reduce(getitem, loc, self.data)

    def depth(self, loc):
        """How far a location can be followed."""
        return next(n for n in range(len(loc), -1, -1) if loc[:n] in self.places)

    def fail(self, loc, message):
        """Raise the SpecError about a location; a key that is missing is reported where its mapping starts."""
        key = ".".join(name for name in loc if isinstance(name, str))
        item = f"entry {loc[-1] + 1} " if loc and isinstance(loc[-1], int) else ""
        raise SpecError(f"{self.places[loc[: self.depth(loc)]]} {key}{': ' if key else ''}{item}{message}")

    def _compose(self, text, top):
        try:
            node = yaml.compose(text, Loader=yaml.SafeLoader)
            return None if node is None else self._value(node, top, ())
        except SpecError:
            raise
        except yaml.MarkedYAMLError as error:
            line = (error.problem_mark or error.context_mark).line + 1
            what = ", ".join(part for part in (error.context, error.problem) if part)
        except yaml.reader.ReaderError as error:
            line, what = text.count("\n", 0, error.position) + 1, f"has the character U+{error.character:04X}"
        except RecursionError:
            line, what = 1, "is too deeply nested"
        except (ValueError, OverflowError):
            line, what = 1, "has an escape that stands for no character"
        top = top or ("YAML",)
        self.places[top] = self.place(line)
        self.fail(top, f"{what}; check brackets, quotes, colons and indentation here")

    def _value(self, node, loc, around):
        """The value of a node at a location; `around` are the nodes that contain it."""
        self.left -= 1
        if self.left < 0 or node in around:
            self.fail(loc, f"is too long or contains itself; a file may have {_MOST_ENTRIES} entries, aliases included")
        if not node.tag.startswith("tag:yaml.org,2002:"):
            self.fail(loc, f"has the tag {node.tag}; remove the tag")
        if isinstance(node, yaml.MappingNode):
            return self._mapping(node, loc, (*around, node))
        if isinstance(node, yaml.SequenceNode):
            for n, item in enumerate(node.value):
                self.places[*loc, n] = self.place(item.start_mark.line + 1)
            return [self._value(item, (*loc, n), (*around, node)) for n, item in enumerate(node.value)]
        if node.tag.endswith(":bool"):
            return node.value.lower() in ("true", "yes", "on")
        return None if node.tag.endswith(":null") else node.value

    def _mapping(self, node, loc, around):
        """A dict; what ``<<`` merges in is overridden by the mapping's own keys."""
        merged, own = {}, {}
        # What is merged in comes first, so that the mapping's own keys have the last word on places too.
        for key, value in sorted(node.value, key=lambda pair: pair[0].tag != _MERGE):
            if not isinstance(key, yaml.ScalarNode):
                self.fail(loc, "has a list or mapping as a key; keys must be words")
            inner = (*loc, key.value)
            self.places[inner] = self.place(key.start_mark.line + 1)
            if key.tag == _MERGE:
                for source in reversed(value.value if isinstance(value, yaml.SequenceNode) else [value]):
                    if not isinstance(source, yaml.MappingNode):
                        self.fail(inner, "is no mapping; give the alias of one, as in <<: *name")
                    merged |= self._value(source, loc, around)
                continue
            if key.value in own:
                self.fail(inner, "is given twice; remove one")
            own[key.value] = self._value(value, inner, around)
        return {**merged, **own}


def _text(path):
    """The text of a file."""
    try:
        data = Path(path).read_bytes()
    except FileNotFoundError:
        near = difflib.get_close_matches(Path(path).name, [p.name for p in Path(path).parent.glob("*.yaml")], 1)
        right = f"did you mean {Path(path).with_name(near[0])}?" if near else "give the path of a YAML file"
        raise SpecError(f"{path}: no such file; {right}") from None
    except (OSError, ValueError) as error:
        reason = (getattr(error, "strerror", None) or str(error)).lower()
        raise SpecError(f"{path}: cannot be read ({reason}); give the path of a YAML file") from None
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise SpecError(f"{path}:{line}: encoding: is not UTF-8; save the file as UTF-8") from None


def _override(path, text):
    """The document that "a.b=value" stands for."""
    key, equals, value = text.partition("=")
    if not key.strip() or not equals:
        raise SpecError(f"{path}: --set {text}: is no assignment; write --set key=value")
    return Document(value, lambda line: f"{path}: --set", tuple(key.strip().split(".")))


# ---------------------------------------------------------------------------------------------------------------------
# Layers: pairs of a document and the location of a mapping in it, from low to high
# ---------------------------------------------------------------------------------------------------------------------


def _owners(document, file, title):
    """name of a case -> (its location, its title); the file itself is case "main" if there is no other."""
    owners = {}
    for n, case in enumerate(file.cases or ()):
        if case.name in owners:
            document.fail(("cases", n, "name"), f"is '{case.name}' in two cases; names must differ")
        owners[case.name] = ("cases", n), case.title or case.name
    return owners or {"main": ((), title)}


def _cases(kind, file, owners, above):
    """The records of all cases of a file, with the layers `above`."""
    built = []
    for name, (owner, title) in owners.items():
        layers = [(file, ()), (file, owner)]
        for document, loc in above:
            by_name = document.at(loc).get("cases", {})
            if other := next((other for other in by_name if other not in owners), None):
                document.fail((*loc, "cases", other), f"is no known case; {suggestion(other, owners)}")
            layers += [(document, loc), *([(document, (*loc, "cases", name))] if name in by_name else [])]
        data = reduce(_overridden, (document.at(loc) for document, loc in layers), {})
        data = {k: v for k, v in data.items() if k in KINDS[kind].model_fields} | {"name": name, "title": title}
        built.append(_swept(kind, data, layers) or _valid(KINDS[kind].model_validate, data, layers))
    return tuple(built)


def _swept(kind, data, layers):
    """The record of a case in which a word is swept, with those of all values in it; None if there is none."""
    if not isinstance(data.get("sweep"), dict):
        return None
    document, top = next(layer for layer in reversed(layers) if "sweep" in layer[0].at(layer[1]))
    try:
        sweep.check(data)
    except PydanticCustomError as error:
        document.fail((*top, "sweep"), error.message())
    found = [_valid(KINDS[kind].model_validate, version, layers) for version in sweep.versions(data)]
    ((word, values),) = found[0].sweep.items()
    return found[0].model_copy(update={"sweep": sweep.Sweep(word, values, tuple(found))})


def _overridden(below, above):
    """The mapping `below` with what `above` has in its place."""
    result = {**below, **above}
    if "model" in below and "model" in above:
        old, new = below["model"], above["model"]
        if "name" not in new or new["name"] == old.get("name"):
            result["model"] = {**old, **new}
    return result


# ---------------------------------------------------------------------------------------------------------------------
# Errors
# ---------------------------------------------------------------------------------------------------------------------

#: type of an error of pydantic -> what would be right, where its own words are not those of a spec file
_RIGHT = {
    "bool_type": "must be true or false",
    "string_type": "must be text",
    "string_pattern_mismatch": "must consist of letters, digits, _ and -",
    **dict.fromkeys(("tuple_type", "list_type"), "must be a list in square brackets"),
    **dict.fromkeys(("dict_type", "model_type", "model_attributes_type"), "must be a mapping, lines of key: value"),
}


def _valid(read, data, layers):
    """What pydantic reads from `data`, which the layers together make up; SpecError for the first thing wrong."""
    try:
        return read(data)
    except ValidationError as invalid:
        errors = invalid.errors(include_url=False)
    kind, context, loc, value = errors[0]["type"], errors[0].get("ctx", {}), (), data
    keys = context.get("keys") or (context.get("discriminator", "").strip("'"),)
    for step in (*errors[0]["loc"], *keys):
        if step in (value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()):
            loc, value = (*loc, step), value[step]  # else it is the name of a class, or missing
    if kind == "spec":
        message = errors[0]["msg"]
        loc += tuple(key for key in keys[-1:] if key and isinstance(value, dict) and loc[-1:] != (key,))
    elif kind in ("literal_error", "union_tag_invalid"):
        known = re.findall("'(.*?)'", context.get("expected") or context["expected_tags"])
        message = f"is {shown(value)}; {suggestion(value, known)}"
    elif kind in ("missing", "too_long"):
        right = context["max_length"] if context else 1 + max(e["loc"][-1] for e in errors if e["type"] == "missing")
        message = f"has {entries_in(len(value))}; must have {right}"
    else:
        right = re.sub(r"^\w+ should (.*?)( after validation.*)?$", r"must \1", errors[0]["msg"])
        right = right.replace("greater than or equal to", "at least").replace("less than or equal to", "at most")
        message = f"is {shown(value)}; {_RIGHT.get(kind, right)}"
    document, top = max(reversed(layers), key=lambda layer: layer[0].depth(layer[1] + loc) - len(layer[1]))
    document.fail(top + loc, message)
