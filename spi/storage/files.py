"""Files that are written aside and moved into place: a reader or a crash never meets half a file."""

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

import h5py

#: HDF5 reports damage in a file by any of these.
DAMAGE = (OSError, KeyError, RuntimeError, ValueError, TypeError, IndexError)


class StorageError(Exception):
    """A file that cannot be read, written or used here: one line with the path and the remedy."""


def check_writable(path: str | Path) -> None:
    """Tell before a long run that ``path`` could not be written at its end; creates its folder."""
    path = Path(path)
    if path.is_dir():
        raise StorageError(f"cannot write {path}: it is a folder; move it away or choose another folder with --out")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path.parent):  # permissions alone do not tell, least of all the superuser
            pass
    except OSError as error:
        folder = error.filename or path.parent
        raise StorageError(
            f"cannot write {path}: {folder}: {reason(error)}; choose a folder you can write to with --out"
        ) from None


@contextlib.contextmanager
def aside(path: str | Path) -> Iterator[Path]:
    """A temporary path beside ``path``, moved into its place if the block ends well and removed if not."""
    path = Path(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        os.replace(temporary, path)
    except OSError as error:
        raise StorageError(
            f"cannot write {path}: {reason(error)}; choose a folder you can write to, with room, with --out"
        ) from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()


def create(path: str | Path) -> h5py.File:
    # Files are replaced whole and never changed, so locks would guard nothing and fail on some network file systems.
    return h5py.File(path, "w", locking=False, track_order=True)


def reason(error: OSError) -> str:
    return os.strerror(error.errno).lower() if error.errno else str(error).splitlines()[0]
