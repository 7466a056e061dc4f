"""Results files by a name and the options of a run, by a spec file, or by their paths."""

import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from ..specs.document import SpecError, nearest, text_of
from ..specs.experiment import PROFILES, Experiment
from ..specs.keys import suggestion
from ..specs.naming import results_in
from ..storage import FORMER, StorageError
from ..storage.records import StoredResults
from ..storage.results import read, read_root
from . import shipped
from .checkpoint import NOTE, read_note
from .load import STORED, load
from .looks import relooked

#: The endings of spec files.
SPECS = (".yaml", ".yml")


class Wanted(NamedTuple):
    """Options that choose among the results of an experiment: those with which it was run."""

    profile: str = "laptop"
    overrides: tuple[str, ...] = ()  #: such as "seed=2", or "--seed=2" from an option of its own

    @property
    def options(self) -> list[str]:
        """The same as words of a command line."""
        words = [] if self.profile == "laptop" else ["--profile", self.profile]
        for override in self.overrides:
            words += override.split("=", 1) if override.startswith("--") else ["--set", override]
        return words

    def path(self, folder: str | Path, experiment: str) -> Path:
        """File of the results of an experiment in a folder; SpecError if there is no such profile."""
        if self.profile not in PROFILES:
            raise SpecError(f"--profile: '{self.profile}' is not a known profile; {suggestion(self.profile, PROFILES)}")
        return results_in(folder, experiment, self.profile, self.overrides)


PLAIN = Wanted()


class Found(NamedTuple):
    """Results that a person means."""

    path: Path
    edited: Experiment | None = None  #: of a spec file that was edited since, if only in its looks

    def read(self) -> StoredResults:
        """Results, with the looks that their spec file has now."""
        results = read(self.path)
        return results if self.edited is None else relooked(results, self.edited)


def found(source: Path, folder: Path, wanted: Wanted = PLAIN) -> Found:
    """Results that are meant: `source`, or for a spec file or the name of an experiment those in `folder`.

    A file in the current folder that is called as the experiment goes first.
    StorageError if there is none, or if it is of another spec than the spec file; SpecError if no such results can be.
    """
    if source.suffix in SPECS:
        return _of_spec(source, folder, wanted)
    path = wanted.path(folder, str(source))
    is_name = source.name == str(source) and source.suffix not in STORED and not source.is_file()
    if is_name and (path.is_file() or not source.is_dir()):
        return Found(_existing(path, source.name, str(source), wanted))
    if wanted != PLAIN:
        options = shlex.join(wanted.options)
        raise SpecError(f"{source}: is a file; leave out {options}, which chooses among the results of a name")
    return Found(source)


def results_file(source: Path, folder: Path, wanted: Wanted = PLAIN) -> Path:
    """File of the results that :func:`found` finds."""
    return found(source, folder, wanted).path


def every(folder: Path, wanted: Wanted = PLAIN) -> list[Path]:
    """All results files in a folder, or those of runs with some options; StorageError if there are none."""
    paths = sorted(set(folder.glob("*.h5")) - set(folder.glob(f"*{FORMER}.h5")))
    if wanted != PLAIN:
        wanted.path(folder, "")  # so that a wrong profile is said before any file is read
        paths = [path for path in paths if _is_of(path, wanted)]
    if not paths:
        runs = f" of runs with {shlex.join(wanted.options)}" if wanted != PLAIN else ""
        remedy = "run an experiment first, or name the folder with --results"
        raise StorageError(f"{folder}: no results{runs} here; {remedy}")
    return paths


def _is_of(path: Path, wanted: Wanted) -> bool:
    try:
        return path == wanted.path(path.parent, str(read_root(path).get("experiment", "")))
    except StorageError:
        return False  # `spi show` lists it with what is wrong


class ListedResult(NamedTuple):
    """A line in a list of results."""

    name: str
    kind: str
    samples: tuple[int, ...]  #: of each case, 0 where there is none
    created: str  #: when, or the progress of an unfinished run
    how: str  #: the options with which it was run
    title: str

    @classmethod
    def of(cls, name: str, run: dict[str, Any], samples: Sequence[int], created: str) -> "ListedResult":
        """Line on results of a run with these root attributes; KeyError or another error if some are missing."""
        how = shlex.join(Wanted(run["profile"], tuple(run["overrides"])).options)
        title = str(run.get("title", ""))
        return cls(name, str(run.get("kind", "")), tuple(map(int, samples)), created, how, title)


def listed(folder: Path) -> tuple[list[ListedResult], list[str]]:
    """A line for each of the results in a folder, and one on each file that cannot be read."""
    lines, problems = [], []
    for path in sorted(folder.glob("*.h5")):
        try:
            root = read_root(path)
            created = str(root.get("created", ""))[:16].replace("T", " ")
            lines.append(ListedResult.of(path.stem, root, root["samples"], created))
        except StorageError as error:
            problems.append(str(error))
        except Exception:  # of whatever kind, since the others can be listed
            problems.append(f"{path}: does not tell its spec; run the experiment again with --fresh")
    for path in sorted((folder / "sums").glob(f"*.{NOTE}")):
        if about := read_note(path):
            name = results_in(folder, about["experiment"], about["profile"], about["overrides"]).stem
            lines.append(ListedResult.of(name, about, (), f"unfinished: {about['progress']}"))
    return lines, problems


def results_of(spec: str | Path, folder: str | Path = "results", wanted: Wanted = PLAIN) -> Path:
    """Results file of a spec file; StorageError if there is none or if it was made from another spec.

    Results with other looks or claims count as those of the spec file.
    """
    return _of_spec(Path(spec), folder, wanted).path


def _of_spec(spec: Path, folder: str | Path, wanted: Wanted) -> Found:
    """Results of a spec file."""
    path = _existing(wanted.path(folder, spec.stem), spec.stem, spec.as_posix(), wanted)
    stored = read_root(path)
    if "model_sources" in stored or stored["spec"] != text_of(spec):
        now = load(spec, stored["profile"], tuple(stored["overrides"]))
        if now.hash != stored["spec_hash"]:
            again = shlex.join(["spi", "run", spec.as_posix(), *wanted.options])
            raise StorageError(f"{path}: holds results of another spec than {spec}; run `{again}` first")
        return Found(path, now)
    return Found(path)


def _existing(path: Path, name: str, called: str, wanted: Wanted) -> Path:
    """Path, if there is such a file; StorageError with the remedy if not."""
    if path.is_file():
        return path
    names = sorted(file.stem for file in path.parent.glob("*.h5"))
    others = [other for other in names if other == name or other.startswith(f"{name}.")]
    remedies = []
    if name in shipped.names() or Path(called).is_file():
        remedies.append(f"`{shlex.join(['spi', 'run', called, *wanted.options])}` writes it")
    elif not others:
        meant = nearest(name, names) or nearest(name, shipped.names())
        remedies.append(
            f"did you mean {meant}?" if meant else "give a file of results, or a name that `spi list` shows"
        )
    if others:
        verb, more = "is" if len(others) == 1 else "are", ", ..." if len(others) > 5 else ""
        remedies.append(f"there {verb} {', '.join(others[:5])}{more}, see `spi list results`")
    raise StorageError(f"{path}: no such file; {'; '.join(remedies)}")
