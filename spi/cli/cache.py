"""The folder of compiled kernels: what it holds, and the removal of kernels of sources that are no longer installed."""

import re
import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from .. import KERNEL_DIGEST, kernels_folder, modules_folder
from .options import FAILED, end

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
