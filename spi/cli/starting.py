"""The commands with which a person begins, new and doctor, and the cache."""

import contextlib
import re
import shlex
import shutil
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple, Self

import typer

from .. import KERNEL_DIGEST, kernels_folder, modules_folder
from .options import FAILED, INVALID, SPECS, complete_spec, end
from .terminal import tell

if TYPE_CHECKING:
    from ..running.load import StoredSpec

# ---------------------------------------------------------------------------------------------------------------------
# The folder of compiled kernels: what it holds, and the removal of kernels of sources that are no longer installed.
# ---------------------------------------------------------------------------------------------------------------------

_DIGEST = re.compile("[0-9a-f]{16}")


class Folder(NamedTuple):
    """One folder of the cache."""

    path: Path
    content: str
    files: int
    size: int  #: bytes
    written: float  #: the latest time at which a file was written, in seconds since 1970; 0 if there is none

    @classmethod
    def of(cls, path: Path, content: str) -> Self:
        """The folder at a path, from which other processes may remove files meanwhile."""
        files = []
        for file in path.rglob("*"):
            with contextlib.suppress(FileNotFoundError):
                if file.is_file():
                    files.append(file.stat())
        newest = max((file.st_mtime for file in files), default=0.0)
        return cls(path, content, len(files), sum(file.st_size for file in files), newest)

    def __str__(self) -> str:
        day = time.strftime("%Y-%m-%d", time.localtime(self.written)) if self.written else "never"
        amount = f"{self.files:>6} files {self.size / 1e6:>8.1f} MB"
        return f"{self.path.name:<16} {amount}  last written {day:<10}  {self.content}"


def cache(
    clear_old: Annotated[bool, typer.Option("--clear-old", help="Remove the kernels of other sources.")] = False,
) -> None:
    """Say what is kept of compiled kernels, and remove old ones."""
    parent, current, old = kernels_folder().parent, [], []
    for path in sorted(parent.iterdir()) if parent.is_dir() else ():
        if _DIGEST.fullmatch(path.name) and path.is_dir() and not path.is_symlink():  # all else there is not ours
            if path.name == KERNEL_DIGEST:
                current.append(Folder.of(path, "kernels of this version"))
            else:
                old.append(Folder.of(path, "kernels of other sources"))
    if modules_folder().is_dir():
        current.append(Folder.of(modules_folder(), "models and functions of specs, for kernels of all sources"))
    typer.echo(f"{parent} (SPI_CACHE_DIR chooses another)")
    for folder in (*current, *(folder for folder in old if folder.files)):  # every edit leaves an empty one
        typer.echo(f"  {folder}")
    if not current and not old:
        typer.echo("  nothing is kept yet")
    size = f"{sum(folder.size for folder in old) / 1e6:.1f} MB"
    if clear_old:
        for folder in old:
            shutil.rmtree(folder.path, ignore_errors=True)
            if folder.path.exists():
                end(FAILED, f"{folder.path} cannot be removed; see whose it is, or remove it yourself")
        typer.echo(f"{len(old)} old folders are removed, {size}")
    elif old:
        typer.echo(f"{len(old)} old folders, {size}: `spi cache --clear-old` removes them")


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
    from ..running import shipped

    if not Path(name).name or name.endswith("/") or not name.isprintable():
        end(INVALID, f"{name!r} is not a file name; run for example `spi new my_experiment`")
    target = Path(name) if Path(name).suffix in SPECS else Path(f"{name}.yaml")
    if source is not None and system:
        end(INVALID, "--from and --system exclude one another; give one of them")
    stored: StoredSpec | None = None
    if source is None:
        template = shipped.template("system" if system else "experiment")
        path = shlex.quote(target.as_posix())
        files = {target: template.replace("NAME.yaml", path).replace("NAME", target.stem).encode()}
    else:
        from ..running.load import STORED, stored_spec

        stored = stored_spec(source) if Path(source).suffix in STORED else None
        files = _copies(source, stored, target)
    written = _write(files, target)
    for file in written:
        tell(f"wrote {file}")
    if stored:  # whose Python code nobody here had before
        from ..running.load import code_of

        code = [file for name in code_of(stored) if (file := target.parent / name) in written]
        names, it = ", ".join(map(str, code)), "it" if len(code) == 1 else "them"
        if code:
            tell(
                f"spi: {names}: Python code that {source} held; whatever reads {target} runs {it} from now on, with "
                f"your rights: read {it} first"
            )
    quoted = shlex.quote(target.as_posix())
    tell(f"spi: edit it as you like; `spi check {quoted}` estimates the cost, `spi run {quoted}` runs it")


def _copies(source: str, stored: "StoredSpec | None", target: Path) -> dict[Path, bytes]:
    """An experiment, or the one `stored` in results, which is not run, and its files, by the paths of their copies."""
    from ..running.finding import Wanted
    from ..running.load import load
    from ..specs.files import content

    experiment = stored or load(source)
    if stored and (options := Wanted(stored.profile, stored.overrides).options):
        tell(f"spi: the results are those of `{shlex.join(['spi', 'run', target.as_posix(), *options])}`")
    copies = {target.parent / path: content(text) for path, text in experiment.files}
    return {target: experiment.text.encode(), **copies}


def _write(files: dict[Path, bytes], target: Path) -> list[Path]:
    """Write the files but overwrite none, all or nothing; the paths of those that did not exist already."""
    from ..storage import contents, write_all

    missing = dict(files)
    for path, data in files.items():
        with contextlib.suppress(OSError, ValueError):
            there = contents(path, 2 * len(data))
            if path != target and data in (there, there.replace(b"\r\n", b"\n")):
                del missing[path]
    folder = target.parent.resolve()
    for path in missing:
        if path != target and not path.resolve().is_relative_to(folder):
            end(INVALID, f"{path}: lies outside {folder}; copy that file there yourself, then run this again")
        if path.exists() or path.is_symlink():
            end(INVALID, f"{path}: already exists; choose another name or folder")
    write_all(missing)
    return list(missing)


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
