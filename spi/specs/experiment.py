"""A spec file as an experiment: its layers laid over one another, read and checked.

Later layers override earlier ones, key by key (and a model parameter by parameter, unless it names another model):

    the file < a case of ``cases:`` < the profile < ``cases:`` of the profile < ``--set``

so that a profile or ``--set`` has the last word in every case.  ``expect`` is overridden claim by claim, see
:mod:`spi.specs.expect`; other mappings are replaced whole, since another ``initial`` has nothing of the former.  Only
``--set a.b=...`` names one entry and leaves what else the mapping ``a`` has, but for ``functions`` and
``compositions``, which together say what comes out.  All profiles of a file are checked, whichever is asked for.
"""

import difflib
import hashlib
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, NoReturn, get_type_hints

import pydantic
from annotated_types import Ge, MinLen
from pydantic import ValidationError, create_model
from pydantic_core import PydanticCustomError

from ..statistics import claims
from . import expect, sweep
from .cases import BaseCase
from .document import Document, Location, SpecError, about, override, text_of
from .figures import FIGURE_KEYS, read_figure
from .files import Files
from .initial import INITIAL
from .keys import ABSENT, CaseName, Keys, attempt, check_here, key_of, one_of, shown, suggestion, wrong
from .models import ModelPart, check_overrides, is_another, overridden, source_of
from .naming import results_name

__all__ = ["PROFILES", "BaseCase", "Experiment", "Layers", "SpecError", "load", "text_of"]

# ---------------------------------------------------------------------------------------------------------------------
# What pydantic reads, and the JSON Schema of that
# ---------------------------------------------------------------------------------------------------------------------

#: ``laptop`` is the file itself; so are the others where the file does not define them.
PROFILES = ("laptop", "paper", "quick")

#: The keys of a file that are none of its cases.
ONLY_IN_FILES = ("kind", "group", "asks", "figure", "cases", "profiles")


def _chosen(name: str) -> Any:
    """Annotation of a key of ``figure``, whose value stays as it is written."""

    def check(value: Any) -> Any:
        try:
            FIGURE_KEYS[name].read(value)
        except ValueError as error:
            fault, _, right = str(error).partition("; ")
            raise wrong(fault, right) from None
        return value

    return Annotated[Any, pydantic.AfterValidator(check), pydantic.Field(description=FIGURE_KEYS[name].text)]


_IN_FIGURE: dict[str, Any] = {name: (_chosen(name), ABSENT) for name in FIGURE_KEYS if name != "panels"}
_PaperNumber = key_of(Annotated[int, Ge(1)] | None, "number of the figure of the paper")
_FigureKeys: Any = create_model("figure", __base__=Keys, number=(_PaperNumber, None), **_IN_FIGURE)
_FigureKeys.elsewhere = {"panels": "it stands outside of figure, where each case can have its own"}
#: The annotation of ``figure``: a number, or what is chosen of the figure.
_Figure = Annotated[
    Annotated[_PaperNumber, pydantic.Tag("number")] | Annotated[_FigureKeys, pydantic.Tag("keys")],
    pydantic.Discriminator(lambda value: "keys" if isinstance(value, dict) else "number"),
    pydantic.Field(description="number of the figure of the paper, or what is chosen of the figure, as in {log: y}"),
]

#: Values of one layer are not read: another layer may change their meaning.
_LATER = pydantic.WrapValidator(lambda value, read: value)

#: Says in the schema what panels are in a sweep.
_OF_SWEEPS = pydantic.Field(description="of a sweep its quantities")


def _layers(kind: str, case_class: type[BaseCase]) -> tuple[type[Keys], type[Keys]]:
    """Classes of a profile and of a file; their keys need not be complete, since other layers may have the rest."""
    hints = get_type_hints(case_class, include_extras=True)
    if case_class.sweeps_quantities and "panels" in hints:
        hints["panels"] |= Annotated[list[Literal[tuple(case_class.quantities)]], _OF_SWEEPS]  # type: ignore[misc]
    keys = [k for k in case_class.model_fields if k not in ("name", "title")]
    read = {k: Annotated[hints[k], _LATER] for k in keys} | {"model": ModelPart, "sweep": hints["sweep"]}
    optional: dict[str, Any] = {k: (hint, ABSENT) for k, hint in read.items()}
    name = (key_of(CaseName, "letters, digits, _ and -"), ...)
    title = (key_of(str, "title of tables and figures; default: the name"), ABSENT)
    part = create_model(f"{kind}_part", __base__=Keys, **optional)
    part.elsewhere = case_class.elsewhere
    case = create_model(f"{kind}_case", __base__=part, name=name, title=title)
    profile = create_model(f"{kind}_profile", __base__=part, cases=(dict[str, part], ABSENT))
    by_name: dict[str, Any] = dict.fromkeys(PROFILES[1:], (profile, ABSENT))
    profiles = create_model(f"{kind}_profiles", __base__=Keys, **by_name)
    whole: dict[str, Any] = {
        "kind": (Literal[kind], ...),
        "title": title,
        "group": (key_of(str | None, "the group in which `spi list` shows it; default: that of its kind"), None),
        "asks": (key_of(str | None, "what the experiment asks, a sentence for reports"), None),
        "figure": (_Figure, None),
        "cases": (key_of(Annotated[list[case], MinLen(1)], "panels, each overriding some keys"), ABSENT),
        "profiles": (key_of(profiles, "paper and quick, mappings of keys that override those of the file"), ABSENT),
    }
    file = create_model(kind, __base__=part, __doc__=case_class.__doc__, **whole)
    return profile, file


class Layers:
    """Readers of the layers of spec files, by kind of experiment, each made when a file of its kind is read."""

    def __init__(self, kinds: Mapping[str, Any]) -> None:
        self.kinds = kinds  #: name -> folder of the kind, whose ``keys.Case`` is the class of a complete case
        self._made: dict[str, tuple[type[Keys], type[Keys]]] = {}

    def case(self, kind: str) -> type[BaseCase]:
        """Class of a complete case."""
        case: type[BaseCase] = self.kinds[kind].keys.Case
        return case

    def _of(self, kind: str) -> tuple[type[Keys], type[Keys]]:
        if kind not in self._made:
            self._made[kind] = _layers(kind, self.case(kind))
        return self._made[kind]

    def profile(self, kind: str) -> type[Keys]:
        """Class of a profile or an override."""
        return self._of(kind)[0]

    def read(self, data: Any) -> Any:
        """A whole file, given as plain data; ``pydantic.ValidationError`` if it is not valid."""
        kind: Any = data.get("kind") if isinstance(data, dict) else None
        here = isinstance(kind, str) and kind in self.kinds
        return self._of(kind)[1].model_validate(data) if here else self._any.validate_python(data)

    @property
    def _any(self) -> pydantic.TypeAdapter:
        """Reader of a file of any kind."""
        files: Any = one_of([self._of(kind)[1] for kind in self.kinds], "kind", self.kinds)

        def check(data: Any) -> Any:
            if isinstance(data, dict):
                check_here("kinds", data.get("kind"), "kind")
            return data

        whole: Any = Annotated[files, pydantic.BeforeValidator(check)]
        return pydantic.TypeAdapter(whole)

    def json_schema(self) -> dict[str, Any]:
        """JSON Schema (draft 2020-12) of spec files, for editors; it knows no conditions between keys."""
        schema = {"$schema": "https://json-schema.org/draft/2020-12/schema", **self._any.json_schema()}
        return {**schema, "title": "An experiment of spi"}


def laid_over(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    """Mapping `below` with what `above` has in its place."""
    result = {**below, **above}
    if "model" in below and "model" in above:
        old, new = below["model"], above["model"]
        if not is_another(new, old):
            result["model"] = overridden(old, new)
    if isinstance(below.get("sweep"), dict) and isinstance(above.get("sweep"), dict):
        result["sweep"] = sweep.laid_over(below["sweep"], above["sweep"])
    if "expect" in below:
        gone = {n for key in expect.NAMING if key in above for n in expect.names_in(key, below.get(key))}
        gone -= {n for key in expect.NAMING for n in expect.names_in(key, above.get(key))}
        result["expect"] = expect.without(below["expect"], gone)
        if "expect" in above:
            result["expect"] = expect.merged(result["expect"], above["expect"])
    return result


class Heading(NamedTuple):
    """Heading of an experiment."""

    title: str
    figure: int | None  #: of the paper
    kind: str
    group: str  #: in ``spi list``


def heading(path: str | Path, kinds: Layers) -> Heading | None:
    """Heading of the spec in the file `path`; None if the spec is not valid, which :func:`spi.specs.load` explains.

    Only its keys are looked at: models and initial states can take seconds.
    """
    try:
        file = kinds.read(Document(text_of(path), str).data)
    except (SpecError, ValidationError):
        return None
    group = file.group or kinds.case(file.kind).listed_under
    return Heading(file.title or Path(path).stem, _number_of(file.figure), file.kind, group)


def _number_of(figure: Any) -> int | None:
    """Number of the figure of the paper, by the key ``figure``."""
    number: int | None = getattr(figure, "number", figure)
    return number


# ---------------------------------------------------------------------------------------------------------------------
# A valid file
# ---------------------------------------------------------------------------------------------------------------------

Layer = tuple[Document, Location]  #: a mapping that overrides others: where it stands in a document
Owner = tuple[Location, str]  #: of a case: where it stands in the file, and its title


class Experiment(NamedTuple):
    """A valid spec file under one profile."""

    path: Path
    name: str  #: of the file, without its ending
    title: str
    asks: str | None  #: the question that the experiment answers; it decides nothing, just as the title
    figure: int | None  #: of the paper
    chosen: dict[str, Any]  #: of the figure, what its key has as it is written
    kind: str
    profile: str
    cases: tuple[BaseCase, ...]
    text: str  #: the file as it stands
    hash: str  #: SHA-256 of `effective` as canonical JSON
    effective: dict  #: all that decides the results, so without looks and claims; can be written as JSON
    overrides: tuple[str, ...] = ()  #: such as "samples=100"
    expect: str | None = (
        None  #: the claims of all cases, as ``spi.statistics.claims.of_text`` reads them; None if there are none
    )
    files: tuple[tuple[str, str], ...] = ()  #: (path as the file writes it, text) of the other files that belong to it
    called: str = ""  #: its name in messages and commands: its path, or the name of one that comes with the program

    @property
    def results_name(self) -> str:
        """Name of its results, see :mod:`spi.specs.naming`."""
        return results_name(self.name, self.profile, self.overrides)

    @property
    def samples(self) -> tuple[int, ...]:
        """Number of samples of each case, 0 where there is none."""
        return tuple(getattr(case, "samples", None) or 0 for case in self.cases)


def _canonical(value: Any) -> str:
    """As JSON, mappings in their order: that of ``functions`` is the order of the results."""
    return json.dumps(value, separators=(",", ":"), allow_nan=False)


def _hash(value: Any) -> str:
    return hashlib.sha256(_canonical(value).encode()).hexdigest()


def load(
    path: str | Path,
    kinds: Layers,
    profile: str = "laptop",
    overrides: Iterable[str] = (),
    text: str | None = None,
    files: Iterable[tuple[str, str]] | None = None,
    called: str | None = None,
    trusts: Callable[[str, str], bool] = lambda path, text: True,
    added: Iterable[tuple[str, str]] = (),
    title: str = "",
) -> Experiment:
    """Experiment in the file `path`; `kinds` are the :class:`Layers` of the kinds that it may be of.

    Messages begin with ``path:line:``, or with ``called: line n:`` if the file is `called` by a name.

    With `text`, that stands in the place of what is in the file, which is not read; with `files`, as in
    :class:`Experiment`, these stand in the place of the other files that it names; those `added` in that of their own.

    `overrides` are texts "key=value" such as "model.sigma=[1, 0, 0]"; one that comes from an option of its own may say
    so, as in "--samples=500".  Python code that a file holds is run only where `trusts(path, text)` is true; elsewhere
    UntrustedCode of :mod:`spi.specs.files` is raised.  A file without a title has `title`, or else its own name.

    Raises SpecError if anything is wrong with the file, the profile or an override.
    """
    place = f"{called}: line " if called else f"{path}:"
    called = called or str(path)
    if profile not in PROFILES:
        raise SpecError(f"{called}: --profile: '{profile}' is not a known profile; {suggestion(profile, PROFILES)}")
    text, overrides = text_of(path) if text is None else text, tuple(overrides)
    document = _document(path, text, kinds, place)
    named = Files(path, files, trusts, added)
    file: Any = _valid(kinds.read, document.data, [(document, ())])
    title = file.title or _printable(title or Path(path).stem)
    last: list[Layer] = [(override(called, text), ()) for text in overrides]
    for layer, _ in last:
        _valid(kinds.profile(file.kind).model_validate, layer.data, [(layer, ())])
    owners = _owners(document, title)
    cases = _chosen_cases(
        partial(_cases, kinds.case(file.kind), named, document, owners), document, owners, profile, last
    )
    chosen = file.figure.model_dump(exclude={"number"}, exclude_unset=True) if isinstance(file.figure, Keys) else {}
    _check_chosen(chosen, cases, document)
    effective = json.loads(_canonical({"kind": file.kind, "cases": _deciding(cases)}))
    return Experiment(
        path=Path(path),
        name=Path(path).stem,
        title=title,
        asks=file.asks,
        figure=_number_of(file.figure),
        chosen=chosen,
        kind=file.kind,
        profile=profile,
        cases=cases,
        text=text,
        hash=_hash(effective),
        effective=effective,
        overrides=overrides,
        expect=claims.as_text(dict.fromkeys(claim for case in cases for claim in case.claims)),
        files=tuple(sorted(named.texts.items())),
        called=called,
    )


def _check_chosen(chosen: dict[str, Any], cases: Sequence[BaseCase], document: Document) -> None:
    """Refuse what is chosen of the figure together, or by names that no case has."""
    try:
        read = read_figure(chosen)
    except ValueError as error:
        key, _, message = str(error).partition(": ")
        document.fail(("figure", key), message)
    swept = {word for case in cases if case.sweep for word in case.sweep.parameters}
    second = {word for case in cases if case.sweep for word in list(case.sweep.parameters)[1:]}
    if (over := read.get("overlay", "cases")) not in ("cases", *second):
        document.fail(("figure", "overlay"), f"is {shown(over)}; must be {' or '.join(['cases', *sorted(second)])}")
    named = dict.fromkeys(name for case in cases for name in (*case.scopes, *case.quantities, *swept))
    for key, names in (("labels", read.get("labels", ())), ("crossing", filter(None, [read.get("crossing")]))):
        for name in names:
            # one that is like none may be that of functions which an override replaced
            if name not in named and difflib.get_close_matches(name, named, 1, 0.8):
                document.fail(("figure", key), f"has {shown(name)}; {suggestion(name, named)}")


def _printable(stem: str) -> str:
    """Stem of a file name, which need not be Unicode."""
    return "".join(c if c.isprintable() else "?" for c in stem)


def _deciding(cases: Sequence[BaseCase]) -> dict[str, Any]:
    """Keys of each case that decide its results, by its name: neither looks nor claims, nor what is empty."""
    empty = [set() if case.compositions else {"compositions"} for case in cases]
    omitted = [{"name", "expect"} | case.looks | more for case, more in zip(cases, empty, strict=True)]
    return {case.name: case.model_dump(exclude=keys) for case, keys in zip(cases, omitted, strict=True)}


def _document(path: str | Path, text: str, kinds: Layers, place: str) -> Document:
    """Text of an experiment as plain data; `place` precedes the numbers of lines in messages."""
    document = Document(text, lambda line: f"{place}{line}:")
    if document.data is None:
        document.fail((), f"the file is empty; start with a line kind: {' or '.join(kinds.kinds)}")
    if isinstance(document.data, dict) and "kind" not in document.data:
        key = source_of(document.data).in_file
        if key and key not in document.data:
            document.fail((), f"is a {key}, no experiment; an experiment has it as model: {{{key}: {Path(path).name}}}")
    return document


# ---------------------------------------------------------------------------------------------------------------------
# Layers, from low to high
# ---------------------------------------------------------------------------------------------------------------------


#: The keys whose mappings a dotted ``--set`` replaces as well, and those that have rules of their own.
_WHOLE = ("functions", "compositions", "expect", "sweep", "cases")


def _with_others(below: dict[str, Any], above: dict[str, Any], path: Sequence[Any]) -> dict[str, Any]:
    """Mapping `above` of the one entry at `path`, and with what `below` has in the mappings on the way to it.

    A mapping of another kind, law or source has nothing of the former.
    """
    key, *inner = path
    old = below.get(key)
    if not inner or not isinstance(old, dict):
        return above
    word, new = inner[0], above[key]
    another = word in ("kind", "law") and old.get(word) != new[word]
    if another or (key == "initial" and word in INITIAL and word not in old):
        return above
    others = {} if key == "model" else old  # those of a model are laid over one another, unless it is another
    return {key: {**others, **_with_others(old, new, inner)}}


def _over(below: dict[str, Any], layer: Layer) -> dict[str, Any]:
    """Keys of a case with a layer over them."""
    document, loc = layer
    above, path = document.at(loc), document.top[len(loc) :]
    if path and document.top[: len(loc)] == loc and path[0] not in _WHOLE:
        above = _with_others(below, above, path)
    return laid_over(below, above)


def _owners(document: Document, title: str) -> dict[str, Owner]:
    """name of a case -> (its location, its title); the file itself is case "main" if there is no other."""
    owners: dict[str, Owner] = {}
    for n, case in enumerate(document.data.get("cases") or ()):
        if case["name"] in owners:
            document.fail(("cases", n, "name"), f"is '{case['name']}' in two cases; names must differ")
        owners[case["name"]] = ("cases", n), case.get("title") or case["name"]
    return owners or {"main": ((), title)}


def _cases(
    case_class: type[BaseCase],
    files: Files,
    file: Document,
    owners: dict[str, Owner],
    above: Sequence[Layer],
) -> tuple[BaseCase, ...]:
    """Records of all cases of a file, with the layers `above`."""
    built: list[BaseCase] = []
    for name, (_, title) in owners.items():
        layers = _layers_of(name, file, owners, above)
        merged: dict[str, Any] = {}
        for layer in layers:
            merged = _over(merged, layer)
        try:
            check_overrides(layers, merged, files)
        except PydanticCustomError as error:
            _report({tuple((error.context or {})["keys"]): error.message()}, layers)
        data = {k: v for k, v in merged.items() if k not in ONLY_IN_FILES} | {"name": name, "title": title}
        read = partial(case_class.model_validate, context=files)
        swept = isinstance(data.get("sweep"), dict)
        built += _swept(case_class, read, files, data, layers) if swept else [_valid(read, data, layers)]
    if len({case.sweep is None for case in built}) > 1:
        name = next(case.name for case in built if case.sweep is None)
        file.fail(("cases",), f"has '{name}' without sweep beside others with one; sweep all of them, or none")
    return tuple(built)


def _layers_of(name: str, file: Document, owners: dict[str, Owner], above: Sequence[Layer]) -> list[Layer]:
    """Layers of a case, from low to high: the file, its own keys, and the same of those `above`."""
    layers: list[Layer] = [(file, ()), (file, owners[name][0])]
    for document, loc in above:
        by_name = document.at(loc).get("cases", {})
        if other := next((other for other in by_name if other not in owners), None):
            document.fail((*loc, "cases", other), f"is not a known case; {suggestion(other, owners)}")
        layers += [(document, loc), *([(document, (*loc, "cases", name))] if name in by_name else [])]
    return layers


def _chosen_cases(
    read: Callable[[Sequence[Layer]], tuple[BaseCase, ...]],
    document: Document,
    owners: dict[str, Owner],
    profile: str,
    last: list[Layer],
) -> tuple[BaseCase, ...]:
    """Cases that `read` makes of the file with a profile and the overrides `last`.

    SpecError about any profile, be it chosen or not, and about compositions that none uses.
    """
    profiles: dict[str, list[Layer]] = {
        name: [(document, ("profiles", name))] for name in document.data.get("profiles", {})
    }
    each = {name: read(above) for name, above in {"": [], **profiles}.items()}
    cases = read(profiles.get(profile, []) + last) if last else each[profile if profile in profiles else ""]
    used = {name for built in (*each.values(), cases) for case in built for name in case.schemes_used}
    within: list[Layer] = [(document, owner) for owner, _ in owners.values()]
    _check_used(used, [(document, ()), *within, *chain.from_iterable(profiles.values()), *last])
    return cases


def _check_used(used: set[str], layers: Iterable[Layer]) -> None:
    """A composition that no case uses, under any profile, is a mistake."""
    for document, loc in layers:
        cases = document.at(loc).get("cases", {})
        within = [(*loc, "cases", name) for name in cases] if isinstance(cases, dict) else []
        for place in (loc, *within):
            for name in document.at(place).get("compositions", {}):
                if name not in used:
                    document.fail((*place, "compositions", name), "is used nowhere; list it under schemes or remove it")


def _swept(
    case_class: type[BaseCase],
    read: Callable[[Any], BaseCase],
    files: Files,
    data: dict[str, Any],
    layers: Sequence[Layer],
) -> list[BaseCase]:
    """Cases that a swept parameter makes of one."""
    last = max(n for n, (document, loc) in enumerate(layers) if "sweep" in document.at(loc))
    document, top = layers[last]
    try:
        keys = [key for key in case_class.swept_in if key in case_class.model_fields]
        versions = sweep.versions(data, keys, files, most=case_class.most_swept)
    except PydanticCustomError as error:
        # a parameter may not be used because a higher layer put something wrong in its place
        _, mistakes = attempt(read, {**data, "sweep": None})
        higher = layers[last + 1 :]
        there = {loc for loc in mistakes for over, at in higher if over.depth(at + loc) == len(at + loc)}
        if there:
            _report({loc: told for loc, told in mistakes.items() if loc in there}, layers)
        document.fail((*top, "sweep"), error.message())
    attempts = {at: attempt(read, version) for at, version in versions.items()}
    wrong = {at: mistakes for at, (_, mistakes) in attempts.items() if mistakes}
    for at, mistakes in wrong.items():
        if all(wrong.get(other) == mistakes for other in attempts):  # whatever the value
            _report(mistakes, layers)
        word = next(word for word in data["sweep"] if word != "of")
        document.fail((*top, "sweep", word), f"with {at}: {about(*next(iter(mistakes.items())))}")
    return sweep.apart([case for case, _ in attempts.values()])


# ---------------------------------------------------------------------------------------------------------------------
# Errors
# ---------------------------------------------------------------------------------------------------------------------


def _valid(read: Callable[[Any], Any], data: Any, layers: Sequence[Layer]) -> Any:
    """Record that pydantic reads from `data`, which the layers together make up; SpecError if it is wrong."""
    record, mistakes = attempt(read, data)
    return _report(mistakes, layers) if mistakes else record


def _report(mistakes: dict[Location, str], layers: Sequence[Layer]) -> NoReturn:
    """Raise the SpecError about mistakes in the mapping that the layers together make up."""
    messages = []
    for loc, message in mistakes.items():
        document, top = max(reversed(layers), key=lambda layer: layer[0].depth(layer[1] + loc) - len(layer[1]))
        messages.append(document.message(top + loc, message))
    raise SpecError(*messages)
