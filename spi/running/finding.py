"""Which results file is meant, by a name and the options of a run, by a spec file, or by its path."""

import difflib
import shlex
from pathlib import Path
from typing import NamedTuple

from ..kinds import KINDS
from ..specs.document import SpecError, text_of
from ..specs.keys import suggestion
from ..specs.layers import PROFILES
from ..specs.naming import of_kind, results_name
from ..storage import StorageError
from ..storage.results import read_root
from . import shipped
from .load import STORED, load_any

#: The endings of spec files.
SPECS = (".yaml", ".yml")


class Wanted(NamedTuple):
    """The options that choose among the results of an experiment: those with which it was run."""

    profile: str = "laptop"
    overrides: tuple[str, ...] = ()  #: such as "seed=2", or "--seed=2" from an option of its own
    kind: str | None = None  #: to which it was converted

    @property
    def options(self) -> list[str]:
        """The same as words of a command line."""
        words = [] if self.kind is None else ["--as", self.kind]
        words += [] if self.profile == "laptop" else ["--profile", self.profile]
        for one in self.overrides:
            words += one.split("=", 1) if one.startswith("--") else ["--set", one]
        return words

    def name(self, experiment: str) -> str:
        """What the results of an experiment are called; SpecError if there is no such profile or kind."""
        if self.profile not in PROFILES:
            raise SpecError(f"--profile: '{self.profile}' is not a known profile; {suggestion(self.profile, PROFILES)}")
        if self.kind is not None and self.kind not in KINDS:
            raise SpecError(f"--as: '{self.kind}' is not a kind of experiment; {suggestion(self.kind, KINDS)}")
        return results_name(of_kind(experiment, self.kind), self.profile, self.overrides)


PLAIN = Wanted()


def found(source: Path, folder: Path, wanted: Wanted = PLAIN) -> Path:
    """The results file that is meant: `source`, or for a spec file or the name of an experiment that in `folder`.

    A file in the current folder that is called as the experiment goes first.  StorageError if there is none, or if it
    is of another spec than the spec file; SpecError if no such results can be.
    """
    if source.suffix in SPECS:
        return results_of(source, folder, wanted)
    path = folder / f"{wanted.name(str(source))}.h5"
    is_name = source.name == str(source) and source.suffix not in STORED and not source.is_file()
    if is_name and (path.is_file() or not source.is_dir()):
        return _there(path, source.name, str(source), folder, wanted)
    if wanted != PLAIN:
        options = shlex.join(wanted.options)
        raise SpecError(f"{source}: is a file; leave out {options}, which chooses among the results of a name")
    return source


def every(folder: Path, wanted: Wanted = PLAIN) -> list[Path]:
    """All results files in a folder, or those of runs with some options; StorageError if there are none."""
    paths = sorted(folder.glob("*.h5"))
    if wanted != PLAIN:
        paths = [path for path in paths if _is_of(path, wanted)]
    if not paths:
        such = f" of runs with {shlex.join(wanted.options)}" if wanted != PLAIN else ""
        what = "run an experiment first, or name the folder with --results"
        raise StorageError(f"{folder}: no results{such} here; {what}")
    return paths


def _is_of(path: Path, wanted: Wanted) -> bool:
    experiment = read_root(path).get("experiment", "")
    kind = "" if wanted.kind is None else f".{wanted.kind}"
    return experiment.endswith(kind) and path.stem == wanted.name(experiment.removesuffix(kind))


class Listed(NamedTuple):
    """What a list of results says of a file."""

    name: str
    kind: str
    samples: tuple[int, ...]  #: of each case, 0 where there is none
    created: str
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
            readable.append(Listed(path.stem, told[0], tuple(stored["samples"]), told[1], shlex.join(how), told[2]))
        except StorageError as error:
            problems.append(str(error))
        except (KeyError, TypeError, ValueError, AttributeError):
            problems.append(f"{path}: does not tell its spec; run the experiment again with --fresh")
    return readable, problems


def results_of(spec: str | Path, folder: str | Path = "results", wanted: Wanted = PLAIN) -> Path:
    """The results file of a spec file; StorageError if there is none or if it was made from another spec.

    Results with another number of samples, title or claims count as those of the spec file.
    """
    spec, folder = Path(spec), Path(folder)
    path = _there(folder / f"{wanted.name(spec.stem)}.h5", spec.stem, str(spec), folder, wanted)
    stored = read_root(path)
    if wanted.kind or "model_sources" in stored or stored["spec"] != text_of(spec):
        how = stored["profile"], tuple(stored["overrides"])
        now = load_any(spec, *how, wanted.kind)
        if now.hash != stored["spec_hash"]:
            again = shlex.join(["spi", "run", str(spec), *wanted.options])
            raise StorageError(f"{path}: holds results of another spec than {spec}; run `{again}` first")
    return path


def _there(path: Path, name: str, called: str, folder: Path, wanted: Wanted) -> Path:
    """The path, if there is such a file; StorageError with what to do if there is none."""
    if path.is_file():
        return path
    every = sorted(file.stem for file in folder.glob("*.h5"))
    others = [other for other in every if other == name or other.startswith(f"{name}.")]
    told = [f"`{shlex.join(['spi', 'run', called, *wanted.options])}` writes it"] * (
        name in shipped.names() or Path(called).is_file()
    )
    if others:
        told.append(f"there {'is' if len(others) == 1 else 'are'} {', '.join(others[:5])}{', ...' * (len(others) > 5)}")
    elif not told:
        near = difflib.get_close_matches(name, [*every, *shipped.names()], 1)
        told.append(f"did you mean {near[0]}?" if near else "give a file of results, or a name that `spi list` shows")
    raise StorageError(f"{path}: no such file; {'; '.join(told)}")
