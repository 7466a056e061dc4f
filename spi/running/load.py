"""From a spec file to the plans of its parts."""

import contextlib
import functools
import inspect
import json
import platform
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from .. import specs, storage
from ..kinds import KINDS
from ..kinds.plans import Plan
from ..models.delegation import undamped
from ..specs.document import Document, override, text_of
from ..specs.experiment import Heading, heading
from ..specs.files import Files, UntrustedCode
from ..storage.results import read_root
from . import shipped

#: The endings of files of results.
STORED = (".h5",)


@functools.cache
def layers() -> specs.Layers:
    """Layers of spec files of all kinds."""
    return specs.Layers(KINDS)


def load(
    path: str | Path,
    profile: str = "laptop",
    overrides: Iterable[str] = (),
    text: str | None = None,
    files: Iterable[tuple[str, str]] | None = None,
    added: Iterable[tuple[str, str]] = (),
) -> specs.Experiment:
    """Experiment in a spec file, or in `text` and `files`; SpecError if anything is wrong, see spi.specs.load.

    The files that are `added` stand in the place of those of their names.

    `path` may also be the name of an experiment that comes with the program, such as "rigid_body_strong", by which it
    is then called in messages.
    """
    called = None
    if text is None:
        given, path = path, shipped.path_of(path)
        called = None if path == Path(given) else str(given)
        text = text_of(path, shipped.names())
    return specs.load(path, layers(), profile, overrides, text, files, called, added=added)


def load_any(
    path: str | Path,
    profile: str | None = None,
    overrides: Iterable[str] = (),
    added: Iterable[tuple[str, str]] = (),
    trust_code: bool = False,
) -> specs.Experiment:
    """Experiment that a person means: a spec file, a name, or results, whose spec and options then count.

    `profile` takes the place of that of the results, and `overrides` are added to theirs.
    SpecError and StorageError as for the functions below.
    """
    if Path(path).suffix in STORED:
        return load_stored(path, trust_code, overrides, profile, added)
    return load(path, profile or "laptop", overrides, added=added)


#: The text of a spec about an experiment, given the overrides.
SpecAbout = Callable[[specs.Experiment, Sequence[str]], str]


def load_about(
    path: str | Path,
    kind: str,
    asked: SpecAbout,
    profile: str | None = None,
    overrides: Sequence[str] = (),
    trust_code: bool = False,
) -> specs.Experiment:
    """An experiment of a kind about the system of what ``load_any`` reads, called ``<name>.<kind>``.

    One of this kind is itself meant.  SpecError as for ``load_any``, and if the kind cannot do with what is integrated.
    """
    if Path(path).suffix in STORED:
        return load_stored(path, trust_code, overrides, profile, about=(kind, asked))
    source, profile = load(path), profile or "laptop"
    target = source.path.with_name(f"{source.name}.{kind}.yaml")
    if source.kind == kind:
        return load(path, profile, overrides)._replace(name=target.stem)
    named = Path(source.called) != source.path
    called = target.stem if named else f"{source.called} ({kind})"  # for there is no file of this spec
    return specs.load(target, layers(), profile, overrides, asked(source, overrides), called=called)


def load_stored(
    path: str | Path,
    trust_code: bool = False,
    overrides: Iterable[str] = (),
    profile: str | None = None,
    added: Iterable[tuple[str, str]] = (),
    about: tuple[str, SpecAbout] | None = None,
) -> specs.Experiment:
    """Experiment whose results are in a file, as it was run, with further `overrides`.

    Another `profile` takes the place of that of the run, and files can be `added`.  `about` is a kind, and what makes
    a spec of that kind about the system, as for ``load_about``.

    This alone decides whether Python code that a results file holds is run: with `trust_code`, or where the person has
    a file with the same text at the path that the spec names, seen from the current folder or from ./experiments.
    StorageError if the file cannot be read, and before any such code is run if it may not be; SpecError as for load.
    """
    stored = stored_spec(path)
    as_run = profile or stored.profile, (*stored.overrides, *overrides)
    read = functools.partial(
        specs.load,
        Path(path).with_name(f"{stored.name}.yaml"),
        layers(),
        files=[*stored.files, *added],
        called=str(path),
        title=stored.title,
        trusts=lambda name, text: trust_code or _is_here(name, text),
    )
    try:
        if about is None:
            return read(*as_run, stored.text)
        kind, asked = about
        source = read(text=stored.text)
        text = source.text if source.kind == kind else asked(source, as_run[1])
        return read(*as_run, text)._replace(name=f"{stored.name}.{kind}")
    except UntrustedCode as error:
        raise storage.StorageError(
            f"{path}: holds Python code, {error}, that equals no file of that path here; read it first "
            "(`spi report` shows it), then --trust-code runs it"
        ) from None


class StoredSpec(NamedTuple):
    """Spec behind results, and the options of its run."""

    name: str  #: of the experiment
    profile: str
    overrides: tuple[str, ...]
    text: str
    files: tuple[tuple[str, str], ...]
    title: str  #: of the run, which a spec without one has of the name of its file


def stored_spec(path: str | Path) -> StoredSpec:
    """Spec in a file of results, which is not read; StorageError if the file cannot be read."""
    stored = read_root(path)
    try:
        files = [(str(name), str(text)) for name, text in json.loads(stored.get("model_sources") or "{}").items()]
        name = str(stored.get("experiment", ""))
        if Path(name).name != name or not name.isprintable() or name.startswith(".") or not name:
            name = Path(path).stem  # since it becomes the name of a file
        options = stored["profile"], tuple(stored["overrides"])
        return StoredSpec(name, *options, str(stored["spec"]), tuple(files), str(stored.get("title", "")))
    except (KeyError, TypeError, ValueError, AttributeError):
        raise storage.StorageError(f"{path}: does not tell its spec; run the experiment again with --fresh") from None


def code_of(stored: StoredSpec) -> list[str]:
    """Names of those of its files that are run as Python code where the spec is read; none of a damaged spec."""
    with contextlib.suppress(specs.SpecError):
        parts = [Document(stored.text, str), *(override("", text) for text in stored.overrides)]
        named = {name for part in parts for name in _python_files(part.data)}
        return [name for name, _ in stored.files if name in named]
    return []


def _python_files(data: Any) -> Iterator[str]:
    """Values under ``python`` anywhere in a spec."""
    for key, value in data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ():
        if key == "python" and isinstance(value, str):
            yield value
        yield from _python_files(value)


def means_another(path: str | Path, experiment: specs.Experiment) -> bool:
    """Whether the spec in a file of results means something else than when they were computed."""
    return Path(path).suffix in STORED and read_root(path).get("spec_hash") != experiment.hash


def _is_here(name: str, text: str) -> bool:
    """Whether a file of this name, seen from where a person keeps specs, has this text."""
    for folder in (Path(), Path("experiments"), shipped.folder()):
        with contextlib.suppress(ValueError):
            if Files(folder / "spec.yaml").text(name, "python") == text:
                return True
    return False


def headings(paths: Iterable[Path]) -> tuple[dict[Path, Heading], list[str]]:
    """Headings of the valid ones among spec files, and the mistakes in the others; see spi.specs.experiment."""
    valid: dict[Path, Heading] = {}
    problems: list[str] = []
    for path in paths:
        if of_file := heading(path, layers()):
            valid[path] = of_file
        else:
            try:
                load(path)
            except specs.SpecError as error:
                problems += error.messages
    return valid, problems


def plans(experiment: specs.Experiment) -> list[Plan]:
    """Plans of all parts of all cases, in the order in which they are run."""
    study = KINDS[experiment.kind].study
    return [study.plan(case, part) for case in experiment.cases for part in study.parts(case)]


def name_of(plan: Plan) -> str:
    """Name of a plan among those of its experiment."""
    return f"{plan.case.name}/{plan.part.name}"


class SpecSource(NamedTuple):
    """All that another process needs to make the plans of an experiment."""

    path: str  #: for messages
    text: str
    profile: str
    overrides: tuple[str, ...]
    files: tuple[tuple[str, str], ...]
    hash: str  #: of the spec, so that a process in which it means something else computes nothing

    @classmethod
    def of(cls, experiment: specs.Experiment) -> "SpecSource":
        """Source of an experiment."""
        path, files = experiment.called, experiment.files
        return cls(path, experiment.text, experiment.profile, experiment.overrides, files, experiment.hash)


@functools.lru_cache(maxsize=4)
def plans_of(source: SpecSource) -> list[Plan]:
    """Plans of an experiment, in another process; kept, as there are many chunks to a plan.

    SpecError if the spec means something else here, as where another version of a package of models is installed.
    """
    experiment = load(source.path, source.profile, source.overrides, source.text, source.files)
    if experiment.hash != source.hash:
        where = f"to a worker on {platform.node()}"
        raise specs.SpecError(f"{source.path}: means something else {where}; install the same versions everywhere")
    return plans(experiment)


def sources(experiment: specs.Experiment) -> list[str]:
    """Python modules in which the models of an experiment are defined, each once."""
    modules = dict.fromkeys(sys.modules[type(undamped(case.model)).__module__] for case in experiment.cases)
    return [inspect.getsource(module) for module in modules]
