"""Spec files: YAML in, typed records out; every error names the file, the line and the key.

A file is read into entries, values that know where they stand.  Later layers override earlier ones, key by key (and a
model parameter by parameter, unless it names another model):

    the file < a case of ``cases:`` < the profile < ``cases:`` of the profile < ``--set``

so that a profile or ``--set`` has the last word in every case.  Then the entries are read as the annotations of the
records ask, and the record of the kind checks what concerns several keys at once.  All profiles of a file are checked,
whichever is asked for.
"""

import difflib
import hashlib
import json
import re
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import yaml
from annotated_types import Ge

from ..entries import Entry, SpecError, fail, fail_missing, mapping, read, read_fields, suggestion
from ..models import MODELS
from .kinds import CASE_NAME, KINDS, PROFILES, ModelName, StrongCase, json_schema, keys

__all__ = ["KINDS", "PROFILES", "Experiment", "SpecError", "StrongCase", "json_schema", "load"]

_MOST_ENTRIES = 10_000  # aliases of aliases could multiply without bound
_FILE_KEYS = ("title", "figure", "kind", "cases", "profiles")
_CASE_KEYS = ("name", "title")
_Figure = Annotated[int, Ge(1), "number of the figure of the paper"] | None


class Experiment(NamedTuple):
    """A valid spec file under one profile."""

    path: Path
    name: str  #: of the file, without its ending
    title: str
    figure: int | None  #: of the paper
    kind: str
    profile: str
    cases: tuple[StrongCase, ...]
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
    root = _Composer(lambda line: f"{path}:{line}:").compose(text, Entry(None, f"{path}:1:", ""))
    kind, record = _kind(root)
    title = read(str, root.value["title"]) if "title" in root.value else Path(path).stem
    figure = read(_Figure, root.value["figure"]) if "figure" in root.value else None
    owners = _owners(root, record)
    layers = {"laptop": [], **_profiles(root, record, owners)}
    built = {name: _cases(root, record, owners, layers[name], title) for name in layers}
    profile_in_file = profile if profile in layers else "laptop"
    cases = built[profile_in_file]
    if overrides:
        last = [_layer(_override(path, text), record, owners) for text in overrides]
        cases = _cases(root, record, owners, layers[profile_in_file] + last, title)
    effective = {"kind": kind, "cases": {case.name: _without_titles(case) for case in cases}}
    canonical = json.dumps(effective, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return Experiment(
        path=Path(path),
        name=Path(path).stem,
        title=title,
        figure=figure,
        kind=kind,
        profile=profile,
        cases=cases,
        text=text,
        hash=hashlib.sha256(canonical.encode()).hexdigest(),
        effective=json.loads(canonical),
    )


def _without_titles(case):
    rest = {k: v for k, v in case._asdict().items() if k not in ("name", "title", "model_name")}
    return {**rest, "model": {"name": case.model_name, **case.model._asdict()}}


# ---------------------------------------------------------------------------------------------------------------------
# Entries from files and overrides
# ---------------------------------------------------------------------------------------------------------------------


class _Composer:
    """YAML to entries; nothing else is ever constructed.  `place` maps a line to the place of an entry."""

    def __init__(self, place):
        self.place = place
        self.left = _MOST_ENTRIES

    def compose(self, text, blank):
        """The entry `blank` with the value that a YAML text has."""
        try:
            node = yaml.compose(text, Loader=yaml.SafeLoader)
            return blank if node is None else self.entry(node, blank, ())
        except SpecError:
            raise
        except yaml.MarkedYAMLError as error:
            mark = error.problem_mark or error.context_mark
            place, what = self.at(mark), ", ".join(part for part in (error.context, error.problem) if part)
        except yaml.reader.ReaderError as error:
            place = self.place(text.count("\n", 0, error.position) + 1)
            what = f"has the character U+{error.character:04X}"
        except RecursionError:
            place, what = blank.place, "is too deeply nested"
        except (ValueError, OverflowError):
            place, what = blank.place, "has an escape that stands for no character"
        fail(Entry(None, place, blank.key or "YAML"), what, "check brackets, quotes, colons and indentation here")

    def at(self, mark):
        return self.place(mark.line + 1)

    def entry(self, node, blank, around):
        """`blank` with the value of a node; `around` are the nodes that contain it."""
        self.left -= 1
        if self.left < 0 or node in around:
            fail(blank, "is too long or contains itself", f"a file may have {_MOST_ENTRIES} entries, aliases included")
        if not node.tag.startswith("tag:yaml.org,2002:"):
            fail(blank, f"has the tag {node.tag}", "remove the tag")
        if isinstance(node, yaml.MappingNode):
            value = self.pairs(node, blank, (*around, node))
        elif isinstance(node, yaml.SequenceNode):
            value = []
            for number, item in enumerate(node.value, 1):
                blank_item = Entry(None, self.at(item.start_mark), blank.key, f"entry {number} ")
                value.append(self.entry(item, blank_item, (*around, node)))
        elif node.tag.endswith(":null"):
            value = None
        elif node.tag.endswith(":bool"):
            value = node.value.lower() in ("true", "yes", "on")
        else:
            value = node.value
        return blank._replace(value=value)

    def pairs(self, node, blank, around):
        """name -> entry; what ``<<`` merges in is overridden by the mapping's own keys."""
        merged, own = {}, {}
        for key, value in node.value:
            if not isinstance(key, yaml.ScalarNode):
                fail(blank, "has a list or mapping as a key", "keys must be words")
            entry = Entry(None, self.at(key.start_mark), blank.inner(key.value))
            if key.tag == "tag:yaml.org,2002:merge":
                sources = value.value if isinstance(value, yaml.SequenceNode) else [value]
                for source in reversed(sources):
                    merged |= mapping(self.entry(source, entry._replace(key=blank.key or "<<"), around))
            elif key.value in own:
                fail(entry, "is given twice", "remove one")
            else:
                own[key.value] = self.entry(value, entry, around)
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
    """The mapping that "a.b=value" stands for."""
    key, equals, value = text.partition("=")
    key, place = key.strip(), f"{path}: --set"
    if not key or not equals:
        raise SpecError(f"{place} {text}: is no assignment; write --set key=value")
    entry = _Composer(lambda line: place).compose(value, Entry(None, place, key))
    around = key
    while around:
        around, _, name = around.rpartition(".")
        entry = Entry({name: entry}, place, around)
    return entry


# ---------------------------------------------------------------------------------------------------------------------
# Layers: which entry holds in which case
# ---------------------------------------------------------------------------------------------------------------------


def _kind(root):
    """(kind, record) of a file, whose keys are checked."""
    if root.value is None:
        fail(root, "the file is empty", "start with a line kind: " + " or ".join(KINDS))
    if "kind" not in mapping(root):
        mapping(root, [*_FILE_KEYS, *(key for record in KINDS.values() for key in keys(record))])
        fail_missing(root, "kind", " or ".join(KINDS))
    kind = read(Literal[tuple(KINDS)], root.value["kind"])
    mapping(root, [*_FILE_KEYS, *keys(KINDS[kind])])
    return kind, KINDS[kind]


def _owners(root, record):
    """name of a case -> its entry in ``cases:``, or the file itself, as case "main", if there are none."""
    if "cases" not in root.value:
        return {"main": root}
    entry, owners = root.value["cases"], {}
    if not isinstance(entry.value, list) or not entry.value:
        fail(entry, f"is {entry.shown()}", "must be a list of mappings, each with a name")
    for case in entry.value:
        if "name" not in mapping(case, [*_CASE_KEYS, *keys(record)]):
            fail_missing(case, "name", "letters, digits, _ and -")
        named = case.value["name"]
        name = read(str, named)
        if not re.fullmatch(CASE_NAME, name):
            fail(named, f"is {named.shown()}", "must consist of letters, digits, _ and -")
        if name in owners:
            fail(named, f"is {named.shown()} in two cases", "names must differ")
        owners[name] = case
    return owners


def _profiles(root, record, owners):
    """name of a profile -> list of its layer."""
    if "profiles" not in root.value:
        return {}
    profiles = mapping(root.value["profiles"], PROFILES[1:], "profile besides laptop, the file itself")
    return {name: [_layer(entry, record, owners)] for name, entry in profiles.items()}


def _layer(entry, record, owners):
    """What a profile or an override says: a pair (key -> entry, name of a case -> key -> entry)."""
    common = dict(mapping(entry, [*keys(record), "cases"]))
    cases = common.pop("cases", None)
    by_name = mapping(cases, list(owners), "case") if cases else {}
    return common, {name: mapping(case, keys(record)) for name, case in by_name.items()}


def _overridden(below, above):
    """The entries `below` with those of `above` in their place."""
    result = below | above
    if "model" in below and "model" in above:
        old, new = mapping(below["model"]), mapping(above["model"])
        if "name" not in new or ("name" in old and new["name"].value == old["name"].value):
            result["model"] = below["model"]._replace(value=old | new)
    return result


def _cases(root, record, owners, layers, title):
    """The records of all cases, with these layers above the file."""
    built = []
    for name, owner in owners.items():
        entries = {k: v for k, v in root.value.items() if k in keys(record)}
        if owner is not root:
            title = read(str, owner.value["title"]) if "title" in owner.value else name
            entries = _overridden(entries, {k: v for k, v in owner.value.items() if k in keys(record)})
        for common, by_name in layers:
            entries = _overridden(_overridden(entries, common), by_name.get(name, {}))
        built.append(_case(record, name, title, entries, owner))
    return tuple(built)


def _case(record, name, title, entries, owner):
    """The record of one case."""
    if "model" not in entries:
        fail_missing(owner, "model", f"a mapping with a name ({', '.join(MODELS)}) and parameters")
    model_name, model = _model(entries["model"])
    values = read_fields(record, [k for k in keys(record) if k != "model"], entries, owner)
    case = record(name=name, title=title, model=model, model_name=model_name, **values)
    return case.checked(lambda key, what, right: fail(entries.get(key, owner), what, right))


def _model(entry):
    """(name, record) of a model; a noise of strength 0 becomes None, so that it is left out of compiled code."""
    if "name" not in mapping(entry):
        fail_missing(entry, "name", " or ".join(MODELS))
    name = read(ModelName, entry.value["name"])
    cls = MODELS[name]
    mapping(entry, ["name", *cls._fields])
    model = cls(**read_fields(cls, cls._fields, entry.value, entry))
    return name, model._replace(sigma=tuple(s or None for s in model.sigma))
