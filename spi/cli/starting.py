"""The commands with which a person begins: list, new, doctor."""

import importlib.metadata
import os
import re
import shlex
import shutil
import time
from collections.abc import Iterator, Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import typer

from .. import CACHE_PROBLEM, KERNEL_DIGEST, __version__, kernels_folder, modules_folder, scratch_folder, storage
from ..checks.compilable import CompilationError
from ..compiler import rounding
from ..ensemble.loop import thread_count
from ..running.compiling import physical_memory, processors
from ..running.run import NOBODY, Watch, load, run
from ..schemes import typical_ns
from ..storage.records import Group
from .options import FAILED, INVALID, SPECS, complete_spec, end
from .terminal import tell

# ---------------------------------------------------------------------------------------------------------------------
# Whether this installation works: what it runs with, where compiled kernels are kept, and a small run.
# ---------------------------------------------------------------------------------------------------------------------

_PACKAGES = ("numba", "llvmlite", "numpy", "scipy", "h5py")

#: The quick profile of the experiment rigid_body_strong for one scheme, and its strong errors, which depend on the
#: processor in their last bits only, where it has no fused operations.
_SPEC = """\
title: a small run whose numbers are known
kind: strong
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1, 1, 1]}
initial: [cos(1.1), 0, sin(1.1)]
final_time: 1
steps: 2^-4 .. 2^-7
reference_step: 2^-10
schemes: [splitting]
truncate_noise: true
samples: 64
seed: 1
"""
_ERRORS = (0.0476422936517553, 0.03143293830482381, 0.02082162363269886, 0.013498335308160655)
_TOLERANCE = 1e-9  #: relative
_DRIFT = 1e-12  #: of the Casimir function, which the scheme keeps but for rounding

_SLOW = 5.0  #: how many times longer than typical a step may take before that is worth a warning
_LEAST_MEMORY, _LEAST_ROOM = 2e9, 1e9  #: bytes, of the machine and on the disk of the cache


class Finding(NamedTuple):
    """What was found, and what to do about it; printed as one line."""

    what: str
    found: str
    remedy: str = ""  #: nothing if all is well
    sound: bool = True  #: whether the program can be used all the same

    def __str__(self) -> str:
        verdict = "ok" if not self.remedy else "warning" if self.sound else "wrong"
        return f"{verdict:<8} {self.what:<9} {self.found}" + (f": {self.remedy}" if self.remedy else "")


def findings(watch: Watch = NOBODY) -> Iterator[Finding]:
    """What there is to say of this installation, the quick things first; `watch` is told how far the small run is."""
    about = storage.provenance()
    yield Finding("spi", f"{__version__}, Python {about['machine_python']} on {about['machine_platform']}")
    yield _packages()
    yield _vectors(about["machine_processor"])
    yield _threads()
    yield _memory()
    yield _cache()
    yield from _small_run(watch)


def _packages() -> Finding:
    found, missing = [], []
    for package in _PACKAGES:
        try:
            found.append(f"{package} {importlib.metadata.version(package)}")
        except (ImportError, OSError):
            missing.append(package)
    remedy = f"{', '.join(missing)} should be there too, install spi again" if missing else ""
    return Finding("packages", ", ".join(found), remedy)


def _vectors(processor: str) -> Finding:
    """For which vectors kernels are compiled, and whether results are those of other processors."""
    found = f"{processor}, {rounding.instruction_set()}: vectors of {rounding.vector_bits()} bits"
    remedy = "" if rounding.is_fused() else "it has no fused operations, so that last digits differ from other machines"
    return Finding("processor", found, remedy)


def _threads() -> Finding:
    threads, count = thread_count(), processors()
    remedy = "" if threads == count else "NUMBA_NUM_THREADS in the environment says how many are used"
    return Finding("threads", f"{threads}, for {count} processors", remedy)


def _memory() -> Finding:
    size = physical_memory()
    if size is None:
        return Finding("memory", "of unknown size")
    remedy = "" if size >= _LEAST_MEMORY else "see what `spi check` says an experiment needs"
    return Finding("memory", f"{size / 1e9:.1f} GB", remedy)


def _cache() -> Finding:
    """Where compiled kernels are kept, how many there are and whether there is room for more."""
    if CACHE_PROBLEM:
        remedy = "every run compiles anew; set SPI_CACHE_DIR to a folder that you can write to"
        return Finding("kernels", CACHE_PROBLEM, remedy)
    kernels = len(list(kernels_folder().rglob("*.nbc")))
    folder = modules_folder().parent
    size, free = sum(path.stat().st_size for path in folder.rglob("*")), shutil.disk_usage(folder).free
    found = f"{kernels} compiled; {folder} has {size / 1e6:.0f} MB and room for {free / 1e9:.1f} GB"
    return Finding("kernels", found, "" if free >= _LEAST_ROOM else "free some, or set SPI_CACHE_DIR to another folder")


def _small_run(watch: Watch) -> Iterator[Finding]:
    """Whether a strong study gives the numbers that it should, and how long a step takes."""
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        yield Finding("compiler", "off, by NUMBA_DISABLE_JIT", "unset it, or runs take hundreds of times as long")
        return
    experiment = load("doctor", text=_SPEC)
    try:
        with scratch_folder() as folder:
            (group,) = storage.read(run(experiment, folder, watch=watch)).groups
    except (CompilationError, OSError, storage.StorageError) as error:
        yield Finding("numbers", f"the small run failed ({error})", "install spi again, in a new environment", False)
        return
    yield _numbers(group)
    (case,) = experiment.cases
    yield _speed(float(np.min(group.arrays["ns_per_step"])), typical_ns(case.row("splitting"), case.model))


def _numbers(group: Group) -> Finding:
    """Whether the results of the small run are those that are known."""
    off = float(np.max(np.abs(group.arrays["error"] / np.array(_ERRORS) - 1)))
    drift = float(np.max(group.arrays["casimir_drift"]))
    right = off < _TOLERANCE and drift < _DRIFT
    near = f"to {off:.0e}" if off else "to the last bit"
    found = f"strong errors as known, {near}; Casimir drift {drift:.0e}"
    return Finding("numbers", found, "" if right else "too much, so do not trust what spi computes here", sound=right)


def _speed(ns: float, typical: float) -> Finding:
    found = f"{ns:.3g} ns a step and path; {typical:.2g} ns with vectors of 8 at 4 GHz"
    return Finding("speed", found, "" if ns < _SLOW * typical else "other programs are busy, or vectors are narrow")


# ---------------------------------------------------------------------------------------------------------------------
# The folder of compiled kernels: what it holds, and the removal of kernels of sources that are no longer installed.
# ---------------------------------------------------------------------------------------------------------------------

_DIGEST = re.compile("[0-9a-f]{16}")


class Kept(NamedTuple):
    """One folder of the cache."""

    folder: Path
    what: str
    files: int
    size: int  #: bytes
    written: float  #: when something was last written there, in seconds since 1970; 0 if it is empty

    def __str__(self) -> str:
        day = time.strftime("%Y-%m-%d", time.localtime(self.written)) if self.written else "never"
        amount = f"{self.files:>6} files {self.size / 1e6:>8.1f} MB"
        return f"{self.folder.name:<16} {amount}  last written {day:<10}  {self.what}"


def kept() -> tuple[list[Kept], list[Kept]]:
    """What belongs to the sources that run, and those of other sources: of other versions, or before an edit."""
    current, old = [], []
    for path in sorted(_folders_of_kernels(kernels_folder().parent)):
        if path.name == KERNEL_DIGEST:
            current.append(_look_at(path, "kernels of this version"))
        else:
            old.append(_look_at(path, "kernels of other sources"))
    if modules_folder().is_dir():
        current.append(_look_at(modules_folder(), "models and functions of specs, for kernels of all sources"))
    return current, old


def _folders_of_kernels(folder: Path) -> Iterator[Path]:
    """Folders that are named by a digest; whatever else a person keeps there is none of ours."""
    if folder.is_dir():
        for path in folder.iterdir():
            if _DIGEST.fullmatch(path.name) and path.is_dir() and not path.is_symlink():
                yield path


def _look_at(folder: Path, what: str) -> Kept:
    """Other processes may remove files meanwhile."""
    found = []
    for path in folder.rglob("*"):
        try:
            if path.is_file():
                found.append(path.stat())
        except FileNotFoundError:
            continue
    newest = max((one.st_mtime for one in found), default=0.0)
    return Kept(folder, what, len(found), sum(one.st_size for one in found), newest)


def cache(
    clear_old: Annotated[bool, typer.Option("--clear-old", help="Remove the kernels of other sources.")] = False,
) -> None:
    """Say what is kept of compiled kernels, and remove old ones."""
    current, old = kept()
    typer.echo(f"{kernels_folder().parent} (SPI_CACHE_DIR chooses another)")
    for one in (*current, *(one for one in old if one.files)):  # every edit leaves an empty one
        typer.echo(f"  {one}")
    if not current and not old:
        typer.echo("  nothing is kept yet")
    size = f"{sum(one.size for one in old) / 1e6:.1f} MB"
    if clear_old:
        for one in old:
            shutil.rmtree(one.folder, ignore_errors=True)
        left = [one for one in old if one.folder.exists()]
        if left:
            end(FAILED, f"{left[0].folder} cannot be removed; see whose it is, or remove it yourself")
        typer.echo(f"{len(old)} old folders are removed, {size}")
    elif old:
        typer.echo(f"{len(old)} old folders, {size}: `spi cache --clear-old` removes them")


class Listed(StrEnum):
    models = "models"
    schemes = "schemes"
    experiments = "experiments"


def list_(
    what: Annotated[Listed | None, typer.Argument(metavar="models|schemes|experiments", help="Only these.")] = None,
    folder: Annotated[Path, typer.Option("--experiments", help="Folder with your experiments.")] = Path("experiments"),
) -> None:
    """List models, schemes and experiments.

    The experiments are those that come with spi, and those in ./experiments if that folder exists.
    """
    from ..printing import print_models, print_schemes

    invalid: list[str] = []
    if what in (None, Listed.models):
        from ..models import MODELS

        print_models(MODELS)
    if what in (None, Listed.schemes):
        from ..schemes import SCHEMES

        print_schemes(SCHEMES)
    if what in (None, Listed.experiments):
        invalid = _list_experiments(folder)
    for problem in invalid:
        tell(f"spi: {problem}")
    if invalid:
        raise typer.Exit(INVALID)


def _list_experiments(folder: Path) -> list[str]:
    """Print the experiments that come with spi and those in a folder; what is wrong with those of the latter."""
    from ..printing import print_experiments
    from ..running import shipped
    from ..running.run import headings

    found, _ = headings(map(shipped.path_of, shipped.names()))
    print_experiments("experiments that come with spi: spi run NAME", {path.stem: one for path, one in found.items()})
    if not folder.is_dir() or folder.samefile(shipped.folder()):
        return []
    found, problems = headings(sorted(folder.glob("*.yaml")))
    if found:
        print_experiments(f"experiments in {folder}", {str(path): one for path, one in found.items()})
    return problems


def new(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the new experiment.")],
    source: Annotated[
        str | None,
        typer.Option(
            "--from",
            metavar="EXPERIMENT",
            help="Copy this experiment, also that behind a file of results, and the files it refers to.",
            autocompletion=complete_spec,
        ),
    ] = None,
    system: Annotated[bool, typer.Option("--system", help="For a custom system, written in YAML.")] = False,
) -> None:
    """Write a commented experiment as a starting point: NAME.yaml.

    It can be run unchanged.  Existing files are never overwritten.
    """
    if not Path(name).name or name.endswith("/") or not name.isprintable():
        end(INVALID, f"{name!r} is not a file name; run for example `spi new my_experiment`")
    target = Path(name) if Path(name).suffix in SPECS else Path(f"{name}.yaml")
    if source is not None and system:
        end(INVALID, "--from and --system exclude one another; give one of them")
    which = "system" if system else "experiment"
    files = _template(which, target) if source is None else _copies(source, target)
    written = _write(files, target)
    for path in written:
        tell(f"wrote {path}")
    _tell_of_code(source, target, written)
    file = shlex.quote(target.as_posix())
    tell(f"spi: edit it as you like; `spi check {file}` estimates the cost, `spi run {file}` runs it")


def _template(which: str, target: Path) -> dict[Path, bytes]:
    """The text that a new experiment begins with, by the path at which it is to stand."""
    from ..running import shipped

    text = shipped.template(which).replace("NAME.yaml", shlex.quote(target.as_posix())).replace("NAME", target.stem)
    return {target: text.encode()}


def _copies(source: str, target: Path) -> dict[Path, bytes]:
    """An experiment and the files that it names, by the paths at which copies are to stand."""
    from ..running.load import STORED, load
    from ..specs.files import content

    if Path(source).suffix in STORED:
        text, files = _from_results(source, target)
    else:
        experiment = load(source)
        text, files = experiment.text, experiment.files
    return {target: text.encode(), **{target.parent / path: content(text) for path, text in files}}


def _from_results(source: str, target: Path) -> tuple[str, Sequence[tuple[str, str]]]:
    """The spec and the files in a file of results, which are not run; says with which options they were."""
    from ..running.finding import Wanted
    from ..running.load import stored_spec

    stored = stored_spec(source)
    options = Wanted(stored.profile, stored.overrides).options
    if options:
        tell(f"spi: the results are those of `{shlex.join(['spi', 'run', target.as_posix(), *options])}`")
    return stored.text, stored.files


def _tell_of_code(source: str | None, target: Path, written: Sequence[Path]) -> None:
    """Say which of the files that came out of results are Python code, which nobody here had before."""
    from ..running.load import STORED, code_of, stored_spec

    if source is not None and Path(source).suffix in STORED:
        code = [path for name in code_of(stored_spec(source)) if (path := target.parent / name) in written]
        if code:
            names, one = ", ".join(map(str, code)), len(code) == 1
            tell(
                f"spi: {names}: Python code that {source} held; whatever reads {target} runs {'it' if one else 'them'} "
                f"from now on, with your rights: read {'it' if one else 'them'} first"
            )


def _write(files: dict[Path, bytes], target: Path) -> list[Path]:
    """Write the files but overwrite none, all or nothing; which ones: others than `target` may exist already."""
    from ..storage import write_all

    missing = {path: data for path, data in files.items() if path == target or not _holds(path, data)}
    folder = target.parent.resolve()
    for path in missing:
        if path != target and not path.resolve().is_relative_to(folder):
            end(INVALID, f"{path}: lies outside {folder}; copy that file there yourself, then run this again")
        if path.exists() or path.is_symlink():
            end(INVALID, f"{path}: already exists; choose another name or folder")
    write_all(missing)
    return list(missing)


def _holds(path: Path, data: bytes) -> bool:
    """Whether a file has this content."""
    from ..storage import contents

    try:
        found = contents(path, 2 * len(data))
    except (OSError, ValueError):
        return False
    return data in (found, found.replace(b"\r\n", b"\n"))


def doctor() -> None:
    """Test the installation, including a small run with known results.

    The first time a kernel is compiled, which takes some seconds.  Exit code 1 if a test fails.
    """
    from ..printing.text import printable

    pass  # MERGED
    from .terminal import ProgressLine

    sound = True
    with ProgressLine("doctor") as line:
        for finding in findings(line.watch):
            typer.echo(printable(finding))
            sound &= finding.sound
    if not sound:
        end(FAILED, "a test failed, see above")
