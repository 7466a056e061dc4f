"""Files of sums over paths, from which results are made and unfinished runs are continued.

HDF5 with the checksum of results files: the texts ``about`` and ``parts``, JSON in which arrays stand as numbers, and
the group ``arrays`` with each of them by its number.
"""

import contextlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from .files import DAMAGE, MOST_BYTES, aside, checksum_holds, contents, create, opened
from .results import read_array

#: Increased where the layout changes, or the division into chunks: runs continue with chunks of the same size only.
VERSION = 6

#: The ending of the files.
SUFFIX = ".sums"

#: The errors that reading a damaged file, or one of another layout, may raise.
_DAMAGE = (*DAMAGE, ArithmeticError, MemoryError)


def write_sums(path: Path, about: dict[str, Any], parts: dict[str, Any]) -> None:
    """Write `parts`, name -> dicts, lists, arrays, numbers and texts, and `about`, which can be read without them."""
    with aside(path) as temporary, create(temporary) as file:
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


def read_sums(path: Path) -> tuple[dict[str, Any], dict[str, Any]] | None:
    """(about, parts) of the file; None if there is no such file or it is damaged."""
    with contextlib.suppress(*_DAMAGE), _opened(path) as file:

        def value(entry: dict[str, Any]) -> Any:
            return read_array(file["arrays"][entry["array"]]) if set(entry) == {"array"} else entry

        return _about(file), json.loads(file["parts"].asstr()[()], object_hook=value)
    return None


def about_sums(path: Path, any_version: bool = False) -> dict[str, Any] | None:
    """The attributes ``about`` the sums, read without these; None if there is no such file or it is damaged.

    A file of another version of the layout counts as damaged, unless any version will do.
    """
    with contextlib.suppress(*_DAMAGE), _opened(path) as file:
        return _about(file, any_version)
    return None


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[h5py.File]:
    """The file, open for reading; ValueError if its checksum is wrong."""
    data = contents(path, MOST_BYTES)
    if not checksum_holds(data):
        raise ValueError("damaged")
    with opened(data) as file:
        yield file


def _about(file: h5py.File, any_version: bool = False) -> dict[str, Any]:
    """The attributes ``about`` the sums; ValueError if their layout is that of another version."""
    about = dict(json.loads(file["about"].asstr()[()]))
    if about["version"] != VERSION and not any_version:
        raise ValueError(f"written in version {about['version']}")
    return about
