"""Files that are written aside and moved into place: a reader or a crash never meets half a file.

HDF5 files of ours end with a checksum, a line of text after the part that HDF5 reads.  It is looked at before HDF5 is
given the file, because a damaged file can make HDF5 itself crash.
"""

import contextlib
import hashlib
import os
import platform
import re
import stat
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import h5py

try:
    import fcntl
except ImportError:  # where it does not exist, as on Windows
    fcntl = None  # type: ignore[assignment]

#: HDF5 reports damage in a file by any of these.
DAMAGE = (OSError, KeyError, RuntimeError, ValueError, TypeError, IndexError, AttributeError)

#: The largest size of a file of results or sums, which are read whole: more than any experiment writes.
MOST_BYTES = 10**10

_CHECKSUM = b"\nspi sha256 "  # then 64 digits and the end of the line


class StorageError(Exception):
    """A file cannot be read, written or used here: one line with the path and the remedy."""


def contents(path: str | Path, most: int) -> bytes:
    """The bytes of a regular file of at most `most` bytes.

    Raises OSError if it cannot be read, ValueError if it is something else, such as a pipe or a device, which might
    never come to an end, or if it is larger.
    """
    about = os.stat(path)
    if not (stat.S_ISREG(about.st_mode) or stat.S_ISDIR(about.st_mode)):  # of a folder Python says so itself
        raise ValueError("no regular file")
    with open(path, "rb") as file:
        data = file.read(min(most, about.st_size + 2**20) + 1)
    if len(data) > most:
        raise ValueError(f"more than {most // 1000} kB" if most < 10**9 else f"more than {most // 10**9} GB")
    return data


def check_writable(path: str | Path) -> None:
    """Raise StorageError before a long run if ``path`` could not be written at its end; creates its folder."""
    path = Path(path)
    if path.is_dir():
        raise StorageError(f"cannot write {path}: it is a folder; move it away or choose another folder with --out")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path.parent):  # permissions alone say little, least of all to the superuser
            pass
        temporary_beside(path).touch()  # nor does a writable folder mean that the name is not too long
        temporary_beside(path).unlink()  # when it is closed: Windows removes no file that is open
    except OSError as error:
        folder = error.filename or path.parent
        raise StorageError(
            f"cannot write {path}: {folder}: {reason(error)}; choose a folder you can write to with --out"
        ) from None


@contextlib.contextmanager
def aside(
    path: str | Path,
    remedy: str = "choose a folder you can write to, with room, with --out",
    check: Callable[[], None] = lambda: None,
) -> Iterator[Path]:
    """A temporary path beside ``path``, moved into its place if the block ends well and removed if not.

    Raises StorageError, with `remedy`, if it cannot be written, and whatever `check` raises.  `check` is called just
    before the move, while no other program moves a file in this folder, so that what it saw there still holds.
    """
    path = Path(path)
    temporary = temporary_beside(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        remove_leftovers(path)
        yield temporary
        with _alone_in(path.parent):
            check()
            os.replace(temporary, path)
    except OSError as error:
        raise StorageError(f"cannot write {path}: {reason(error)}; {remedy}") from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()


def temporary_beside(path: Path) -> Path:
    """The path under which this process writes ``path`` before it is moved into place."""
    return path.with_name(f".{path.name}.{_host()}.{os.getpid()}.tmp")


def _host() -> str:
    """The name of this machine, as it may stand in the name of a file."""
    return re.sub(r"[^A-Za-z0-9-]", "-", platform.node())[:40] or "host"


@contextlib.contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """Hold the lock of a folder among the programs of this machine; does nothing where it cannot be locked."""
    with contextlib.ExitStack() as stack:
        if "flock" in dir(fcntl):
            with contextlib.suppress(OSError):
                handle = os.open(folder, os.O_RDONLY)
                stack.callback(os.close, handle)  # which ends the lock
                fcntl.flock(handle, fcntl.LOCK_EX)
        yield


def remove_leftovers(path: Path) -> None:
    """Remove temporary files of processes of this machine that were killed while they wrote ``path``."""
    if os.name != "posix":  # elsewhere there is no harmless way to ask whether a process lives
        return
    name = re.compile(re.escape(f".{path.name}.{_host()}.") + r"(\d+)\.tmp")
    for entry in os.listdir(path.parent) if path.parent.is_dir() else ():
        if match := name.fullmatch(entry):
            with contextlib.suppress(OSError):  # such as: it lives, and belongs to somebody else
                try:
                    os.kill(int(match[1]), 0)
                except (ProcessLookupError, OverflowError):
                    path.with_name(entry).unlink()


@contextlib.contextmanager
def create(path: str | Path) -> Iterator[h5py.File]:
    """A new HDF5 file, written to ``path`` with its checksum if the block ends well.

    It is built in memory: HDF5 crashes when it closes a file that it could not write, for instance on a full disk.
    """
    # HDF5's own memory, not a BytesIO: a signal while HDF5 calls Python would get lost or become another error.
    with h5py.File(str(path), "w", driver="core", backing_store=False, track_order=True) as file:
        yield file
        file.flush()
        data = file.id.get_file_image()
    write_bytes(path, with_checksum(data))


def write_bytes(path: str | Path, data: bytes) -> None:
    """Write a file and wait until the disk has it."""
    with open(path, "wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def write_all(files: Mapping[Path, bytes]) -> None:
    """Write several files that belong together: each is moved into its place when all of them are on the disk.

    Raises StorageError, which names no option: each command that writes files has its own.
    """
    remedy = "choose another folder, that you can write to, with room"
    for path in files:
        if path.is_dir():
            raise StorageError(f"cannot write {path}: it is a folder; move it away or choose another name")
    with contextlib.ExitStack() as stack:
        for path, data in files.items():
            write_bytes(stack.enter_context(aside(path, remedy)), data)


def with_checksum(data: bytes) -> bytes:
    """The bytes of an HDF5 file, followed by their checksum."""
    return data + _CHECKSUM + hashlib.sha256(data).hexdigest().encode() + b"\n"


def checksum_holds(data: bytes) -> bool | None:
    """Whether the bytes of a file are those that were written; None if they do not end with a checksum."""
    content, mark, digest = data.rpartition(_CHECKSUM)
    if not mark or not re.fullmatch(rb"[0-9a-f]{64}\n", digest):
        return None
    return hashlib.sha256(content).hexdigest().encode() == digest[:-1]


@contextlib.contextmanager
def opened(data: bytes) -> Iterator[h5py.File]:
    """The HDF5 file with these bytes, open for reading.

    HDF5 refuses to open a path that something else in the same process, such as xarray, holds open in another way.
    """
    with h5py.File(h5py.h5f.open_file_image(data)) as file:
        yield file


def reason(error: OSError) -> str:
    """The message of the operating system, in small letters."""
    return os.strerror(error.errno).lower() if error.errno else (str(error) or type(error).__name__).splitlines()[0]
