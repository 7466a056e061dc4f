"""The commands with which a person begins: list, new, doctor."""

import re
import shlex
import shutil
import time
from collections.abc import Iterator, Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from .. import KERNEL_DIGEST, kernels_folder, modules_folder
from .options import FAILED, INVALID, SPECS, complete_spec, end
from .terminal import tell

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
    from .doctor import findings
    from .progress import ProgressLine

    sound = True
    with ProgressLine("doctor") as line:
        for finding in findings(line.watch):
            typer.echo(printable(finding))
            sound &= finding.sound
    if not sound:
        end(FAILED, "a test failed, see above")
