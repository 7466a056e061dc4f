"""Which results file is meant, by a name and the options of a run, by a spec file, or by its path."""

import contextlib
import difflib
import re
import shlex
from pathlib import Path
from typing import Any, NamedTuple

from .. import storage
from ..specs.document import SpecError, text_of
from ..specs.experiment import PROFILES
from ..specs.keys import suggestion
from ..specs.naming import results_name
from ..storage import StorageError
from ..storage.results import read_root
from ..storage.sums import SUFFIX
from . import shipped
from .load import STORED, SUMS, load

#: What in the name of a file of sums follows that of the experiment.
_OF_SUMS = re.compile(r"-[0-9a-f]{12}-.*[.]sums$")
#: The endings of spec files.
SPECS = (".yaml", ".yml")


class Wanted(NamedTuple):
    """The options that choose among the results of an experiment: those with which it was run."""

    profile: str = "laptop"
    overrides: tuple[str, ...] = ()  #: such as "seed=2", or "--seed=2" from an option of its own

    @property
    def options(self) -> list[str]:
        """The same as words of a command line."""
        words = [] if self.profile == "laptop" else ["--profile", self.profile]
        for one in self.overrides:
            words += one.split("=", 1) if one.startswith("--") else ["--set", one]
        return words

    def name(self, experiment: str) -> str:
        """What the results of an experiment are called; SpecError if there is no such profile."""
        if self.profile not in PROFILES:
            raise SpecError(f"--profile: '{self.profile}' is not a known profile; {suggestion(self.profile, PROFILES)}")
        return results_name(experiment, self.profile, self.overrides)


PLAIN = Wanted()


def found(source: Path, folder: Path, wanted: Wanted = PLAIN, unfinished: bool = False) -> Path:
    """The results file that is meant: `source`, or for a spec file or the name of an experiment that in `folder`.

    A file in the current folder that is called as the experiment goes first.  Where there are no results, `unfinished`
    ones will do: then the path is that of the sums of a run, which ``spi.running.so_far`` reads.

    StorageError if there is none, or if it is of another spec than the spec file; SpecError if no such results can be.
    """
    if source.suffix in SPECS:
        return results_of(source, folder, wanted, unfinished)
    path = folder / f"{wanted.name(str(source))}.h5"
    is_name = source.name == str(source) and source.suffix not in (*STORED, *SUMS) and not source.is_file()
    if is_name and (path.is_file() or not source.is_dir()):
        return _there(path, source.name, str(source), folder, wanted, unfinished)
    if wanted != PLAIN:
        options = shlex.join(wanted.options)
        raise SpecError(f"{source}: is a file; leave out {options}, which chooses among the results of a name")
    return source


def every(folder: Path, wanted: Wanted = PLAIN) -> list[Path]:
    """All results files in a folder, or those of runs with some options; StorageError if there are none."""
    paths = sorted(folder.glob("*.h5"))
    if wanted != PLAIN:
        wanted.name("")  # so that a wrong profile is said before any file is read
        paths = [path for path in paths if _is_of(path, wanted)]
    if not paths:
        such = f" of runs with {shlex.join(wanted.options)}" if wanted != PLAIN else ""
        what = "run an experiment first, or name the folder with --results"
        raise StorageError(f"{folder}: no results{such} here; {what}")
    return paths


def _is_of(path: Path, wanted: Wanted) -> bool:
    try:
        experiment = str(read_root(path).get("experiment", ""))
    except StorageError:
        return False  # of which nobody knows what it is; `spi show` lists it
    return path.stem == wanted.name(experiment)


class Listed(NamedTuple):
    """What a list of results says of a file."""

    name: str
    kind: str
    samples: tuple[int, ...]  #: of each case, 0 where there is none
    created: str  #: when, or how much of it is there
    how: str  #: the options with which it was run
    title: str


def listed(folder: Path) -> tuple[list[Listed], list[str]]:
    """What there is to be said of the results in a folder, and what is wrong with files that cannot be read."""
    readable, problems = [], []
    for path in sorted(folder.glob("*.h5")):
        try:
            stored = read_root(path)
            how = Wanted(stored["profile"], tuple(stored["overrides"])).options
            told = [str(stored.get(key, "")) for key in ("kind", "created", "title")]
            created, samples = told[1][:16].replace("T", " "), tuple(map(int, stored["samples"]))
            readable.append(Listed(path.stem, told[0], samples, created, shlex.join(how), told[2]))
        except StorageError as error:
            problems.append(str(error))
        except Exception:  # of whatever kind, since the others can be listed
            problems.append(f"{path}: does not tell its spec; run the experiment again with --fresh")
    for one in {one.name: one for one in _unfinished(folder)}.values():
        run = one.about["run"]
        try:
            options = shlex.join(Wanted(run["profile"], tuple(run["overrides"])).options)
            unfinished = f"unfinished: {one.about['progress']}"
            readable.append(Listed(one.name, str(run["kind"]), (), unfinished, options, str(run["title"])))
        except Exception:
            problems.append(f"{one.path}: does not tell its run; it is computed from nothing when it is run again")
    return readable, problems


def results_of(
    spec: str | Path, folder: str | Path = "results", wanted: Wanted = PLAIN, unfinished: bool = False
) -> Path:
    """The results file of a spec file; StorageError if there is none or if it was made from another spec.

    Results with another number of samples, title or claims count as those of the spec file.
    """
    spec, folder = Path(spec), Path(folder)
    path = _there(folder / f"{wanted.name(spec.stem)}.h5", spec.stem, spec.as_posix(), folder, wanted, unfinished)
    if path.suffix in SUMS:
        return path
    stored = read_root(path)
    if "model_sources" in stored or stored["spec"] != text_of(spec):
        now = load(spec, stored["profile"], tuple(stored["overrides"]))
        if now.hash != stored["spec_hash"]:
            again = shlex.join(["spi", "run", spec.as_posix(), *wanted.options])
            raise StorageError(f"{path}: holds results of another spec than {spec}; run `{again}` first")
    return path


def _there(path: Path, name: str, called: str, folder: Path, wanted: Wanted, unfinished: bool) -> Path:
    """The path, if there is such a file, or that of sums if they will do; StorageError with what to do if not."""
    if path.is_file():
        return path
    sums = unfinished_run(folder, path.stem)
    if unfinished and sums is not None:
        return sums
    names = sorted(file.stem for file in folder.glob("*.h5"))
    others = [other for other in names if other == name or other.startswith(f"{name}.")]
    told = [f"`{shlex.join(['spi', 'run', called, *wanted.options])}` writes it"] * (
        name in shipped.names() or Path(called).is_file()
    )
    if others:
        told.append(f"there {'is' if len(others) == 1 else 'are'} {', '.join(others[:5])}{', ...' * (len(others) > 5)}")
    elif not told:
        near = difflib.get_close_matches(name, [*names, *shipped.names()], 1)
        told.append(f"did you mean {near[0]}?" if near else "give a file of results, or a name that `spi list` shows")
    if sums is not None:
        told.insert(0, f"its run is unfinished, {sums} has what is there so far")
    raise StorageError(f"{path}: no such file; {'; '.join(told)}")


def unfinished_run(folder: Path, name: str) -> Path | None:
    """The sums of the latest run that is not finished and whose results would have this name; None if there is none."""
    return {one.name: one.path for one in _unfinished(folder, name)}.get(name)


def place_of_figures(path: Path) -> tuple[Path, str]:
    """Into which folder figures of results go unless told otherwise, and what they are called without an ending."""
    if path.suffix not in SUMS:
        return path.parent, path.stem
    run = _unfinished_in(path)
    return path.parent.parent, f"{run.name if run else path.stem}_unfinished"


def _written(path: Path) -> float:
    """When a file was written; one that a run is just replacing is as old as can be."""
    try:
        return path.stat().st_mtime
    except OSError:
        return 0.0


class Unfinished(NamedTuple):
    """A run that is not finished."""

    name: str  #: what its results would be called
    path: Path  #: of its sums
    about: dict[str, Any]  #: what they tell of it


def _unfinished(folder: Path, name: str | None = None) -> list[Unfinished]:
    """The runs of a folder that are not finished, from the earliest to the latest; those that a name could be of."""
    runs = []
    for path in sorted((folder / "sums").glob(f"*{SUFFIX}"), key=lambda path: (_written(path), path)):
        experiment = _OF_SUMS.sub("", path.name)
        if name is not None and name != experiment and not name.startswith(f"{experiment}."):
            continue  # sums can be large
        if run := _unfinished_in(path):
            runs.append(run)
    return runs


def _unfinished_in(path: Path) -> Unfinished | None:
    """The run whose sums a file holds; None if it is finished, or cannot be read."""
    about = storage.about_sums(path) or {}
    with contextlib.suppress(KeyError, TypeError, ValueError, AttributeError):
        run = about["run"]
        if not about["finished"]:
            return Unfinished(results_name(run["experiment"], run["profile"], run["overrides"]), path, about)
    return None
