"""Files of sums over paths, from which results are made and unfinished runs are continued.

HDF5 with the checksum of results files: the texts ``about`` and ``parts``, JSON in which arrays stand as numbers, and
the group ``arrays`` with each of them by its number.
"""

import contextlib
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from .files import DAMAGE, MOST_BYTES, aside, checksum_holds, contents, create, opened
from .records import check_fact
from .results import read_array

#: Increased where the layout changes, or the division into chunks: runs continue with chunks of the same size only.
VERSION = 5

#: The endings of the files of this layout, and of layouts before 5, which are not read any more.
SUFFIX, FORMER_SUFFIX = ".sums", ".npz"

#: The types of the entries of ``about``.
_ABOUT: dict[str, Any] = {
    **dict.fromkeys(("paths_hash", "spec_hash", "source_digest", "spi_version"), str | None),
    "machines": tuple[str, ...] | None,
    **{"samples": int | None, "finished": bool | None},
}

#: The errors that reading a damaged file, or one of another layout, may raise.
_DAMAGE = (*DAMAGE, ArithmeticError, MemoryError)


def write_sums(path: Path, about: dict[str, Any], parts: dict[str, Any]) -> None:
    """Write `parts`, name -> dicts, lists, arrays, numbers and texts, and `about`, which can be read without them.

    The file that was there becomes the previous one.
    """
    with aside(path) as temporary:
        with create(temporary) as file:
            arrays = file.create_group("arrays")

            def reference(value: Any) -> Any:
                """The JSON for what JSON has not: the number of an array, or of NumPy a number."""
                if isinstance(value, np.generic):
                    return value.item()
                number = str(len(arrays))
                arrays[number] = value
                return {"array": number}

            file["about"] = json.dumps({"version": VERSION, **about})
            file["parts"] = json.dumps(parts, default=reference)
        with contextlib.suppress(FileNotFoundError):
            os.replace(path, previous(path))


def read_sums(path: Path) -> tuple[dict[str, Any], dict[str, Any]] | None:
    """(about, parts) of the file, or of the previous one where that is damaged; None if neither can be read."""
    for candidate in (path, previous(path)):
        with contextlib.suppress(*_DAMAGE), _opened(candidate) as file:
            arrays = file["arrays"]

            def value(entry: dict[str, Any], arrays: Any = arrays) -> Any:
                return read_array(arrays[entry["array"]]) if set(entry) == {"array"} else entry

            return _about(file), json.loads(file["parts"].asstr()[()], object_hook=value)
    return None


def about_sums(path: Path, any_version: bool = False) -> dict[str, Any] | None:
    """The attributes ``about`` the sums, read without these; None if there is no such file or it is damaged.

    A file of another version of the layout counts as damaged, unless any version will do.
    """
    with contextlib.suppress(*_DAMAGE), _opened(path) as file:
        return _about(file, any_version)
    return None


def remove_sums(path: Path) -> None:
    """Remove the file and the previous one."""
    for file in (path, previous(path)):
        file.unlink(missing_ok=True)


def remove_previous(path: Path) -> None:
    """Remove the previous file, if there is a later one; left where it cannot be removed."""
    if path.exists():
        with contextlib.suppress(OSError):
            previous(path).unlink()


def previous(path: Path) -> Path:
    """The path of the file before this one."""
    return path.with_name(path.name + ".previous")


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[h5py.File]:
    """The file, open for reading; ValueError if its checksum is wrong."""
    data = contents(path, MOST_BYTES)
    if not checksum_holds(data):
        raise ValueError("damaged")
    with opened(data) as file:
        yield file


def _about(file: h5py.File, any_version: bool = False) -> dict[str, Any]:
    """The attributes ``about`` the sums; an error if one is not of its type."""
    about = dict(json.loads(file["about"].asstr()[()]))
    if about["version"] != VERSION and not any_version:
        raise ValueError(f"written in version {about['version']}")
    for name, hint in _ABOUT.items():
        check_fact(name, about.get(name), hint)
    return about
