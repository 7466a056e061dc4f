"""The layers of a spec file, as pydantic reads them, and their JSON Schema."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, get_type_hints

import pydantic
from annotated_types import Ge, MinLen
from pydantic import ValidationError, create_model

from ..models import MODELS
from . import expect, sweep
from .cases import BaseCase
from .document import Document, SpecError, text_of
from .keys import ABSENT, CaseName, Keys, key_of, needed_keys, one_of
from .models import COMPLETE, ModelPart, is_another, overridden

#: ``laptop`` is the file itself; so are the others where the file does not define them.
PROFILES = ("laptop", "paper", "quick")

#: The keys of a file that are none of its cases.
ONLY_IN_FILES = ("kind", "asks", "figure", "cases", "profiles")


#: The kind of what names an accuracy in place of how it is to be reached.
ANSWER = "answer"

#: The context in which a word may stand for a number: that can be read only together with its values.
SWEPT = "swept"
_UNLESS_SWEPT = pydantic.WrapValidator(lambda value, read, info: value if info.context == SWEPT else read(value))


def _layers(kind: str, case_class: type[BaseCase]) -> tuple[type[Keys], type[Keys]]:
    """The classes of a profile and of a file; their keys need not be complete, since other layers may have the rest."""
    hints = get_type_hints(case_class, include_extras=True)
    keys = [k for k in case_class.model_fields if k not in ("name", "title")]
    swept = case_class.swept_in
    read = {k: Annotated[hints[k], _UNLESS_SWEPT] if k in swept else hints[k] for k in keys} | {"model": ModelPart}
    optional: dict[str, Any] = {k: (hint, ABSENT) for k, hint in read.items()}
    name = (key_of(CaseName, "letters, digits, _ and -"), ...)
    title = (key_of(str, "title of tables and figures; default: the name"), ABSENT)
    part = create_model(f"{kind}_part", __base__=Keys, **optional)
    case = create_model(f"{kind}_case", __base__=part, name=name, title=title)
    profile = create_model(f"{kind}_profile", __base__=part, cases=(dict[str, part], ABSENT))
    by_name: dict[str, Any] = dict.fromkeys(PROFILES[1:], (profile, ABSENT))
    profiles = create_model(f"{kind}_profiles", __base__=Keys, **by_name)
    classes = zip(MODELS, COMPLETE, strict=True)
    models = [{"properties": {"name": {"const": n}}, "required": list(needed_keys(cls))} for n, cls in classes]
    models += [{"required": keys} for keys in (["system"], ["algebra"], ["bracket"], ["python", "name"])]
    enough = [] if case_class.unless_asked is None else [{"required": ["accuracy"]}]
    alone = {"required": [k for k in keys if k in needed_keys(case_class)], "properties": {"model": {"anyOf": models}}}
    whole: dict[str, Any] = {
        "kind": (Literal[kind], ...),
        "title": title,
        "asks": (key_of(str | None, "what the experiment asks, a sentence for reports"), None),
        "figure": (key_of(Annotated[int, Ge(1)] | None, "number of the figure of the paper"), None),
        "cases": (key_of(Annotated[list[case], MinLen(1)], "panels, each overriding some keys"), ABSENT),
        "profiles": (key_of(profiles, "paper and quick, mappings of keys that override those of the file"), ABSENT),
    }
    extra = {"json_schema_extra": {"anyOf": [{"required": ["cases"]}, alone, *enough]}}
    file = create_model(kind, __base__=part, __doc__=case_class.__doc__, __cls_kwargs__=extra, **whole)
    return profile, file


class Layers(NamedTuple):
    """How the layers of spec files of some kinds of experiment are read."""

    cases: dict[str, type[BaseCase]]  #: kind -> class of a complete case
    profiles: dict[str, type[Keys]]  #: kind -> class of a profile or an override
    file: Any  #: a ``pydantic.TypeAdapter`` for a whole file

    @classmethod
    def of(cls, cases: Mapping[str, type[BaseCase]]) -> "Layers":
        """The layers of the kinds whose classes of cases are given by name."""
        both = {kind: _layers(kind, case_class) for kind, case_class in cases.items()}
        file = pydantic.TypeAdapter(one_of([file for _, file in both.values()], "kind", cases))
        return cls(dict(cases), {kind: profile for kind, (profile, _) in both.items()}, file)

    def asked(self, document: Document) -> Any:
        """What a file holds, of kind answer where it names an accuracy and not how it is to be reached.

        SpecError where it names half of that."""
        data = document.data
        of_file = data if isinstance(data, dict) else {}
        case_class = self.cases.get(str(of_file.get("kind")))
        if case_class is None or case_class.unless_asked is None:
            return data
        cases = of_file.get("cases")
        within = [case for case in (cases if isinstance(cases, list) else ()) if isinstance(case, dict)]
        named = {*of_file}.union(*within)
        if "accuracy" not in named:
            return data
        if beside := ", ".join(named.intersection(case_class.unless_asked)):
            if "steps" not in named:
                right = f"leave out {beside}, and steps and samples are chosen, or add steps and reference_step"
                document.fail(("accuracy",), f"is beside {beside}, but without steps; {right}")
            return data
        answer = self.cases[ANSWER].model_fields
        if lost := ", ".join(key for key in of_file if key in case_class.model_fields and key not in answer):
            what = "asks for an answer, whose scheme, steps and samples are chosen"
            document.fail(("accuracy",), f"{what}; leave out {lost}, or accuracy")
        return {**data, "kind": ANSWER}

    def context(self, data: Any, overrides: Iterable[str] = ()) -> str | None:
        """In which the layers of a file are read: SWEPT where words may stand for numbers."""
        case_class = self.cases.get(str(data.get("kind"))) if isinstance(data, dict) else None
        needed = case_class is not None and case_class.model_fields["sweep"].is_required()
        return SWEPT if needed or sweep.is_in(data, overrides) else None

    def json_schema(self) -> dict[str, Any]:
        """The JSON Schema (draft 2020-12) of spec files, for editors; it knows few of the conditions between keys."""
        schema = {"$schema": "https://json-schema.org/draft/2020-12/schema", **self.file.json_schema()}
        return {**schema, "title": "An experiment of spi"}


def laid_over(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    """The mapping `below` with what `above` has in its place."""
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
    """What stands over an experiment."""

    title: str
    figure: int | None  #: of the paper
    kind: str


def heading(path: str | Path, kinds: Layers) -> Heading | None:
    """The heading of the spec in the file `path`; None if the spec is not valid, which :func:`spi.specs.load` explains.

    Models, initial states and what depends on several keys are not looked at: that can take seconds for one file.
    """
    try:
        data = kinds.asked(Document(text_of(path), str))
        file = kinds.file.validate_python(data, context=kinds.context(data))
    except (SpecError, ValidationError):
        return None
    return Heading(file.title or Path(path).stem, file.figure, file.kind)
