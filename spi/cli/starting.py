"""Commands with which a person begins, new and doctor, and the cache."""

import contextlib
import re
import shlex
import shutil
from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .. import KERNEL_DIGEST, kernels_folder, modules_folder
from ..plugins import imported, lacking, offers
from .options import FAILED, INVALID, SPECS, complete_spec, end, template_options
from .terminal import tell

if TYPE_CHECKING:
    from ..running.load import StoredSpec

_DIGEST = re.compile("[0-9a-f]{16}")


def cache(
    clear_old: Annotated[bool, typer.Option("--clear-old", help="Remove the kernels of other sources.")] = False,
) -> None:
    """Count the compiled kernels in the cache, and remove old ones."""
    parent = kernels_folder().parent
    folders = sorted(parent.iterdir()) if parent.is_dir() else []
    ours = [path for path in folders if _DIGEST.fullmatch(path.name) and path.is_dir() and not path.is_symlink()]
    old = [path for path in ours if path.name != KERNEL_DIGEST]
    typer.echo(f"{parent} (SPI_CACHE_DIR chooses another)")
    typer.echo(f"  {_amount([kernels_folder()])}: kernels of this version")
    typer.echo(f"  {_amount([modules_folder()])}: models and functions of specs")
    typer.echo(f"  {_amount(old)}: kernels of other sources, which `spi cache --clear-old` removes")
    for folder in old if clear_old else ():
        shutil.rmtree(folder, ignore_errors=True)
        if folder.exists():
            end(FAILED, f"{folder} cannot be removed; see whose it is, or remove it yourself")
    if clear_old:
        typer.echo(f"{len(old)} old folders are removed")


def _amount(folders: list[Path]) -> str:
    """Number and size of the files in folders, from which other processes may remove files meanwhile."""
    sizes = []
    for file in (file for folder in folders for file in folder.rglob("*")):
        with contextlib.suppress(FileNotFoundError):
            if file.is_file():
                sizes.append(file.stat().st_size)
    return f"{len(sizes)} files, {sum(sizes) / 1e6:.1f} MB"


@template_options
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
    kind: Annotated[
        str | None, typer.Option(help="Of this kind, as `spi list kinds` shows them, about the rigid body.")
    ] = None,
    *,
    templates: dict[str, bool],
) -> None:
    """Write a commented experiment as a starting point: NAME.yaml.

    It can be run unchanged.  Existing files are never overwritten.
    """
    if not Path(name).name or name.endswith("/") or not name.isprintable():
        end(INVALID, f"{name!r} is not a file name; run for example `spi new my_experiment`")
    target = Path(name) if Path(name).suffix in SPECS else Path(f"{name}.yaml")
    if len(given := [*["from"] * (source is not None), *["kind"] * (kind is not None), *templates]) > 1:
        end(INVALID, f"{' and '.join(f'--{word}' for word in given)} exclude one another; give one of them")
    stored: StoredSpec | None = None
    if source is None:
        template = imported(offers("templates")[next(iter(templates))]) if templates else _template(kind)
        path = shlex.quote(target.as_posix())
        files = {target: template.replace("NAME.yaml", path).replace("NAME", target.stem).encode()}
    else:
        from ..running.load import STORED, stored_spec

        stored = stored_spec(source) if Path(source).suffix in STORED else None
        files = _copies(source, stored, target)
    written = _write(files, target)
    for file in written:
        tell(f"wrote {file}")
    if stored:
        _warn_of_code(source, stored, target, written)
    quoted = shlex.quote(target.as_posix())
    tell(f"spi: edit it as you like; `spi check {quoted}` estimates the cost, `spi run {quoted}` runs it")


def _template(kind: str | None) -> str:
    """Text of a new experiment, of a kind."""
    from ..kinds import KINDS
    from ..running import shipped
    from ..specs.keys import suggestion

    if kind in (None, "strong"):
        return shipped.template()
    if kind not in KINDS:
        right = lacking("kinds", kind) or suggestion(kind, KINDS)
        end(INVALID, f"--kind: '{kind}' is not a kind of experiment here; {right}")
    return shipped.example(kind, KINDS[kind].keys.Case)


def _warn_of_code(source: str | None, stored: "StoredSpec", target: Path, written: Collection[Path]) -> None:
    """Say which files hold Python code of results, which nobody here had before."""
    from ..running.load import code_of

    code = [file for name in code_of(stored) if (file := target.parent / name) in written]
    names, it = ", ".join(map(str, code)), "it" if len(code) == 1 else "them"
    if code:
        tell(
            f"spi: {names}: Python code that {source} held; whatever reads {target} runs {it} from now on, with "
            f"your rights: read {it} first"
        )


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
