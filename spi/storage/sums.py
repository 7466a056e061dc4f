"""Files of sums over paths, from which results are made and unfinished runs are continued.

NumPy's npz, a zip archive with a checksum for each member: ``about`` and, for each part, a structure as JSON in which
the arrays stand as numbers, and the arrays one behind the other.
"""

import contextlib
import hashlib
import io
import json
import os
import struct
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from .files import MOST_BYTES, aside, contents, write_bytes
from .records import check_fact

#: Increased where the layout changes, or the division into chunks: runs continue with chunks of the same size only.
VERSION = 4

#: The types of the entries of ``about``.
_ABOUT: dict[str, Any] = {
    **dict.fromkeys(("paths_hash", "spec_hash", "source_digest", "spi_version"), str | None),
    "machines": tuple[str, ...] | None,
    **{"samples": int | None, "finished": bool | None, "parts": tuple[str, ...]},
}

#: The errors that reading a damaged file may raise.
_DAMAGE = (
    *(OSError, EOFError, zipfile.BadZipFile, zlib.error, struct.error),
    *(ArithmeticError, AttributeError, LookupError, MemoryError, RuntimeError, TypeError, ValueError),
)


def write_sums(path: Path, about: dict[str, Any], parts: dict[str, Any]) -> None:
    """Write `parts`, name -> dicts, lists, arrays, numbers and texts, and `about`, which can be read without them.

    The file that was there becomes the previous one.
    """
    members: dict[str, Any] = {"about": _text({"version": VERSION, "parts": list(parts), **about})}
    for number, part in enumerate(parts.values()):
        arrays = io.BytesIO()
        members[f"structure_{number}"] = _text(_without_arrays(part, arrays))
        members[f"arrays_{number}"] = np.frombuffer(arrays.getvalue(), np.uint8)
    members["digests"] = _text({name: _digest(member) for name, member in members.items()})
    archive = io.BytesIO()
    np.savez(archive, **members)
    with aside(path) as temporary:
        write_bytes(temporary, archive.getvalue())
        with contextlib.suppress(FileNotFoundError):
            os.replace(path, previous(path))


def read_sums(path: Path) -> tuple[dict[str, Any], dict[str, Any]] | None:
    """(about, parts) of the file, or of the previous one where that is damaged; None if neither can be read."""
    for candidate in (path, previous(path)):
        with contextlib.suppress(*_DAMAGE), _opened(candidate) as file:
            about = _about(file)
            parts = {}
            for number, name in enumerate(about["parts"]):
                data = _member(file, f"arrays_{number}").tobytes()
                parts[name] = _with_arrays(json.loads(_member(file, f"structure_{number}").tobytes()), data)
            return about, parts
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


def previous(path: Path) -> Path:
    """The path of the file before this one."""
    return path.with_name(path.name + ".previous")


@contextlib.contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """The archive in a file, whose members are read on access; NumPy leaves a damaged one open."""
    with np.load(io.BytesIO(contents(path, MOST_BYTES)), allow_pickle=False) as archive:
        yield archive


def _about(file: Any, any_version: bool = False) -> dict[str, Any]:
    about = dict(json.loads((file["about"] if any_version else _member(file, "about")).tobytes()))
    if about["version"] != VERSION and not any_version:
        raise ValueError(f"written in version {about['version']}")
    for name, hint in _ABOUT.items():
        check_fact(name, about.get(name), hint)
    return about


def _member(file: Any, name: str) -> np.ndarray:
    """The member of the archive with a name; ValueError if it is not as it was written."""
    member: np.ndarray = file[name]
    if json.loads(file["digests"].tobytes())[name] != _digest(member):
        raise ValueError(f"{name} was edited")
    return member


def _digest(member: np.ndarray) -> str:
    return hashlib.sha256(member.tobytes()).hexdigest()


def _text(value: Any) -> np.ndarray:
    return np.frombuffer(json.dumps(value).encode(), np.uint8)


def _without_arrays(value: Any, arrays: io.BytesIO) -> Any:
    """`value` as JSON, its arrays as {"array": [dtype, shape, first byte]}; writes them to `arrays`."""
    if isinstance(value, dict):
        return {key: _without_arrays(entry, arrays) for key, entry in value.items()}
    if isinstance(value, list):
        return [_without_arrays(entry, arrays) for entry in value]
    if isinstance(value, np.generic):
        return value.item()
    if not isinstance(value, np.ndarray):
        return value
    first = arrays.tell()
    arrays.write(value.tobytes())
    return {"array": [value.dtype.str, value.shape, first]}


def _with_arrays(value: Any, data: bytes) -> Any:
    """The inverse of :func:`_without_arrays`."""
    if isinstance(value, list):
        return [_with_arrays(entry, data) for entry in value]
    if not isinstance(value, dict):
        return value
    if set(value) != {"array"}:
        return {key: _with_arrays(entry, data) for key, entry in value.items()}
    dtype, shape, first = value["array"]
    count = int(np.prod(shape))
    return np.frombuffer(data, dtype, count, first).reshape(shape).copy() if count else np.zeros(shape, dtype)
