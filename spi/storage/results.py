"""Files of results, written aside and moved into place, as those of sums: nobody ever meets half a file.

HDF5 files of ours end with a checksum, a line of text after the part that HDF5 reads.  It is looked at before HDF5 is
given the file, because a damaged file can make HDF5 itself crash.

Results are HDF5 with one group ``/<case>/<variant>`` or ``/<case>/<variant>/<estimator>`` per part.

Every axis has a dimension scale, so that xarray and MATLAB open a file as it is.

Values are stored as follows: strings are UTF-8; arrays of bools are int8 with the attribute ``dtype = "bool"`` (netCDF
has no bool; xarray turns these back); a bool among the attributes is a uint8, which nothing else is; tuples are arrays;
an attribute that is None is left out, and a None inside a tuple of numbers (a noise that is off) becomes nan.
"""

import contextlib
import errno
import hashlib
import itertools
import os
import platform
import re
import stat
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO

import h5py
import numpy as np

from .records import Group, StoredResults

try:
    import fcntl
except ImportError:  # where it does not exist, as on Windows
    fcntl = None  # type: ignore[assignment]


#: HDF5 reports damage in a file by any of these.
DAMAGE = (OSError, KeyError, RuntimeError, ValueError, TypeError, IndexError, AttributeError)

#: The largest size of a file of results or sums, which are read whole: more than any experiment writes.
MOST_BYTES = 10**10

#: The bytes of arrays, or of a file, up to which a file is built, or read, in memory; larger ones stay on the disk.
LARGE = 2**22

_CHECKSUM = b"\nspi sha256 "  # then 64 digits and the end of the line
_END = len(_CHECKSUM) + 65  # bytes of the whole line
_AT_A_TIME = 2**20  # bytes that are read for a checksum
_BESIDES, _EACH = 2**20, 2**12  # bytes of a file besides its arrays, and of what HDF5 notes about each of these


class StorageError(Exception):
    """A file cannot be read, written or used here: one line with the path and the remedy."""


def contents(path: str | Path, most: int) -> bytes:
    """Bytes of a regular file of at most `most` bytes.

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
    """Path under which this process writes ``path`` before it is moved into place."""
    return path.with_name(f".{path.name}.{_host()}.{os.getpid()}.tmp")


def _host() -> str:
    """Name of this machine, as it may stand in the name of a file."""
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
    """Remove temporary files of killed processes of this machine that wrote ``path``, or files in that folder."""
    if os.name != "posix":  # elsewhere there is no harmless way to ask whether a process lives
        return
    folder, written = (path, ".+") if path.is_dir() else (path.parent, re.escape(path.name))
    name = re.compile(rf"\.{written}\.{re.escape(_host())}\.(\d+)\.tmp")
    for entry in os.listdir(folder) if folder.is_dir() else ():
        if match := name.fullmatch(entry):
            with contextlib.suppress(OSError):  # such as: it lives, and belongs to somebody else
                try:
                    os.kill(int(match[1]), 0)
                except (ProcessLookupError, OverflowError):
                    Path(folder, entry).unlink()


@contextlib.contextmanager
def create(path: str | Path, size: int = 0) -> Iterator[h5py.File]:
    """A new HDF5 file, written to ``path`` with its checksum if the block ends well.

    HDF5 crashes when it closes a file that it could not write, for instance on a full disk.  So a file with arrays of
    `size` bytes is built in memory; if they are large, on the disk, where there is room for them before HDF5 begins.
    """
    # HDF5's own memory, not a BytesIO: a signal while HDF5 calls Python would get lost or become another error.
    with h5py.File(str(path), "w", driver="core", backing_store=False, track_order=True) as file:
        if size <= LARGE:
            yield file
        file.flush()
        data = file.id.get_file_image()
    if size <= LARGE:
        write_bytes(path, data, checksum_of(data))
        return
    write_bytes(path, data)
    with open(path, "r+b") as on_disk:
        _reserve(on_disk, size + _BESIDES)
    with h5py.File(path, "r+", locking=False) as file:
        yield file
    with open(path, "r+b") as on_disk:
        digest = _digest(on_disk, os.fstat(on_disk.fileno()).st_size)
        on_disk.write(_CHECKSUM + digest + b"\n")
        on_disk.flush()
        os.fsync(on_disk.fileno())


def _reserve(file: BinaryIO, size: int) -> None:
    """Make a file `size` bytes long, and have the disk keep room for them."""
    with contextlib.suppress(AttributeError):  # where it does not exist, as on Windows and macOS
        try:
            os.posix_fallocate(file.fileno(), 0, size)
            return
        except OSError as error:
            if error.errno not in (errno.EINVAL, errno.EOPNOTSUPP):  # file systems that cannot do it
                raise
    end = file.seek(0, os.SEEK_END)
    for begin in range(end, size, _AT_A_TIME):
        file.write(bytes(min(_AT_A_TIME, size - begin)))


def _digest(file: BinaryIO, size: int) -> bytes:
    """Hexadecimal digits of the checksum of the first `size` bytes of a file, which is then read to there."""
    digest, left = hashlib.sha256(), size
    file.seek(0)
    while left and (data := file.read(min(left, _AT_A_TIME))):
        digest.update(data)
        left -= len(data)
    return digest.hexdigest().encode()


def write_bytes(path: str | Path, *parts: bytes) -> None:
    """Write a file of these parts and wait until the disk has it."""
    with open(path, "wb") as file:
        for part in parts:
            file.write(part)
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


def checksum_of(data: bytes) -> bytes:
    """Checksum that follows the bytes of an HDF5 file."""
    return _CHECKSUM + hashlib.sha256(data).hexdigest().encode() + b"\n"


def checksum_holds(data: bytes) -> bool | None:
    """Whether the bytes of a file are those that were written; None if they do not end with a checksum."""
    end = data.rfind(_CHECKSUM)
    digest = data[max(end, 0) + len(_CHECKSUM) :]
    if end < 0 or not re.fullmatch(rb"[0-9a-f]{64}\n", digest):
        return None
    return hashlib.sha256(memoryview(data)[:end]).hexdigest().encode() == digest[:-1]


def checked(path: str | Path) -> tuple[bytes | os.stat_result, bool | None]:
    """(the bytes of an HDF5 file, or what is known of a large one; whether its checksum holds), for :func:`opened`.

    Errors are those of :func:`contents`.
    """
    about = os.stat(path)
    if not stat.S_ISREG(about.st_mode) or not LARGE < about.st_size <= MOST_BYTES:
        data = contents(path, MOST_BYTES)
        return data, checksum_holds(data)
    with open(path, "rb") as file:
        about = os.fstat(file.fileno())
        digest = _digest(file, max(about.st_size - _END, 0))
        end = file.read()
    if checksum_holds(end) is None:
        return about, None
    return about, end == _CHECKSUM + digest + b"\n"


@contextlib.contextmanager
def opened(path: str | Path, data: bytes | os.stat_result) -> Iterator[h5py.File]:
    """HDF5 file of :func:`checked`, open for reading.

    HDF5 refuses to open a path that something else in the same process, such as xarray, holds open in another way.  So
    the bytes of a file are read first, of a large one only if HDF5 does refuse.
    """
    if isinstance(data, bytes):
        with h5py.File(h5py.h5f.open_file_image(data)) as file:
            yield file
        return
    with contextlib.ExitStack() as stack:
        try:
            file = stack.enter_context(h5py.File(path, "r", locking=False))
            now = os.fstat(file.id.get_vfd_handle())
        except OSError:
            now, image = os.stat(path), contents(path, MOST_BYTES)
            file = stack.enter_context(h5py.File(h5py.h5f.open_file_image(image)))
        if (now.st_ino, now.st_size, now.st_mtime_ns) != (data.st_ino, data.st_size, data.st_mtime_ns):
            raise OSError("another program replaced it meanwhile")
        yield file


def reason(error: OSError) -> str:
    """Message of the operating system, in small letters."""
    return os.strerror(error.errno).lower() if error.errno else (str(error) or type(error).__name__).splitlines()[0]


#: The root attribute that marks a results file, and the version of its layout.
MARK, VERSION = "spi_results", 4

#: The attributes of an array.
_NOTES = ("long_name", "formula", "units")

#: The dataset of ``Results.chunks``, beside the groups of the cases; a case has another name, for lack of a space.
_CHUNKS = "digests of chunks"

_DAMAGED = "the results file is damaged; delete it and run the experiment again"


def write(path: str | Path, results: StoredResults, check: Callable[[], None] = lambda: None) -> None:
    """Write ``results`` to ``path``; the folder is made if need be, an older file is replaced whole.

    `check` raises an error if the file must not be replaced; see :func:`~spi.storage.results.aside`.
    """
    arrays = itertools.chain.from_iterable(map(_arrays, results.groups))
    with aside(path, check=check) as temporary, create(temporary, size_of(arrays)) as file:
        file.attrs[MARK] = VERSION
        _write_attributes(file, results.attributes)
        for group in results.groups:
            _write_group(file, group)
        _write_array(file, _CHUNKS, np.array(results.chunks, dtype=str)).make_scale(_CHUNKS)


def read(path: str | Path) -> StoredResults:
    """:class:`~spi.storage.records.StoredResults` in ``path``; the groups of one case stand together."""
    path = Path(path)
    with _open_results(path) as file:
        try:
            groups: list[Group] = []
            for case, variants in file.items():
                for variant, source in variants.items() if case != _CHUNKS else ():
                    if isinstance(next(iter(source.values()), None), h5py.Group):
                        groups += (_read_group(case, variant, name, estimator) for name, estimator in source.items())
                    else:
                        groups.append(_read_group(case, variant, "", source))
            return StoredResults(_read_attributes(file), tuple(groups), tuple(read_array(file[_CHUNKS]).tolist()))
        except (*DAMAGE, MemoryError, StopIteration) as error:
            raise StorageError(f"{path}: {_DAMAGED}") from error


def read_root(path: str | Path) -> dict[str, Any]:
    """Attributes of the whole file, without any results."""
    with _open_results(Path(path)) as file:
        try:
            return _read_attributes(file)
        except DAMAGE as error:
            raise StorageError(f"{path}: {_DAMAGED}") from error


def size_of(arrays: Iterable[Any]) -> int:
    """Bytes of a file with these arrays, about."""
    return sum(np.asarray(values).nbytes + _EACH for values in arrays)


def _arrays(group: Group) -> Iterator[Any]:
    """Arrays of a group."""
    yield from group.coordinates.values()
    yield from (values for _, values in group.variables.values())


def _made_group(file: h5py.File, group: Group) -> h5py.Group:
    """Empty group in a file; StorageError of a name that a file cannot have."""
    for kind, name in (("case", group.case), ("variant", group.variant), ("estimator", group.estimator or "none")):
        if not name or name.startswith(".") or "/" in name:
            raise StorageError(f"the {kind} name {name!r} cannot be stored: choose one without '/' and leading '.'")
    case = file.get(group.case) or file.create_group(group.case, track_order=True)
    target = case.get(group.variant) or case.create_group(group.variant, track_order=True)
    if group.estimator:
        target = target.create_group(group.estimator, track_order=True)
    return target


def _write_group(file: h5py.File, group: Group) -> None:
    target = _made_group(file, group)
    _write_attributes(target, group.attributes)
    for name, values in group.coordinates.items():
        _write_array(target, name, values).make_scale(name)
    for name, (axes, values) in group.variables.items():
        dataset = _write_array(target, name, values)
        if len(axes) != dataset.ndim or not set(axes) <= set(group.coordinates):
            raise ValueError(f"{name}: the axes {axes} do not fit shape {dataset.shape} and {list(group.coordinates)}")
        for i, axis in enumerate(axes):
            dataset.dims[i].attach_scale(target[axis])
    for name, notes in group.notes.items():
        target[name].attrs.update(notes)


def _read_group(case: str, variant: str, estimator: str, source: h5py.Group) -> Group:
    coordinates, variables, notes = {}, {}, {}
    for name, dataset in source.items():
        notes[name] = {key: _decode(dataset.attrs[key]) for key in _NOTES if key in dataset.attrs}
        if dataset.is_scale:
            coordinates[name] = read_array(dataset)
        else:
            axes = tuple(_axis(dataset, i) for i in range(dataset.ndim))
            variables[name] = (axes, read_array(dataset))
    return Group(case, variant, coordinates, variables, _read_attributes(source), estimator, notes)


def _axis(dataset: h5py.Dataset, i: int) -> str:
    """Name of axis i, as its scale was made; the name in the file would be searched in all groups before it."""
    name = h5py.h5ds.get_scale_name(dataset.dims[i][0].id)
    return str(name.decode() if isinstance(name, bytes) else name)


def _write_array(target: h5py.Group, name: str, values: Any) -> h5py.Dataset:
    values = np.asarray(values)
    if values.dtype.kind == "b":
        dataset = target.create_dataset(name, data=values.astype(np.int8))
        dataset.attrs["dtype"] = "bool"
        return dataset
    if values.dtype.kind == "U":
        return target.create_dataset(name, data=values.astype(object), dtype=h5py.string_dtype())
    if values.dtype.kind not in "iuf":
        raise TypeError(f"{name}: arrays of {values.dtype} cannot be stored")
    return target.create_dataset(name, data=values)


def read_array(dataset: h5py.Dataset) -> np.ndarray:
    """Array of a dataset, texts and bools as such."""
    if dataset.nbytes > dataset.file.id.get_filesize():  # ours lie in the file as they are
        raise ValueError(f"{dataset.name} is larger than its file")
    if h5py.check_string_dtype(dataset.dtype):
        return np.asarray(dataset.asstr()[()], dtype=str)
    values = np.asarray(dataset[()])
    return _bools(values) if dataset.attrs.get("dtype") == "bool" else values


def _bools(values: np.ndarray) -> np.ndarray:
    """Bools stored as 0 and 1; ValueError if there is any other value, which is never written."""
    if not np.isin(values, (0, 1)).all():
        raise ValueError("a bool that is neither 0 nor 1")
    return values.astype(bool)


def _write_attributes(target: h5py.Group, attributes: dict[str, Any]) -> None:
    for name, value in attributes.items():
        if value is not None:
            target.attrs[name] = _encode(name, value)


def _read_attributes(source: h5py.Group) -> dict[str, Any]:
    return {name: _decode(value) for name, value in source.attrs.items() if name != MARK}


def _encode(name: str, value: Any) -> Any:
    if isinstance(value, str):
        return value
    values = np.asarray(value)
    if values.dtype.kind == "U":
        return values.astype(h5py.string_dtype())
    if values.dtype == object and all(isinstance(v, int | float | None) for v in values.flat):
        values = values.astype(float)  # None becomes nan
    if values.dtype.kind not in "biuf":
        raise TypeError(f"attribute {name}: {value!r} cannot be stored")
    if values.dtype.kind == "b":
        return values.astype(np.uint8)
    return values.astype(np.int64) if values.dtype.kind in "iu" and values.dtype != np.uint64 else values


def _decode(value: Any) -> Any:
    """Inverse of :func:`_encode`; UnicodeEncodeError of a text that is no UTF-8, which is never written."""
    values = np.asarray(value)
    for text in values.flat if values.dtype.kind in "OU" else ():
        str(text).encode()  # h5py gives bytes that mean nothing as surrogates
    if isinstance(value, str):
        return value
    return _tuples((_bools(values) if values.dtype == np.uint8 else values).tolist())


def _tuples(value: Any) -> Any:
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


@contextlib.contextmanager
def _open_results(path: Path) -> Iterator[h5py.File]:
    """Results file, open for reading; StorageError if its checksum or the version of its layout is wrong."""
    try:
        data, sound = checked(path)
    except FileNotFoundError:
        raise StorageError(f"{path}: no such file; `spi run` writes one") from None
    except (OSError, ValueError) as error:  # a path with a zero in it is a ValueError
        why = reason(error) if isinstance(error, OSError) else str(error)
        raise StorageError(f"{path}: {why}; give a results file (.h5) that you can read") from error
    if sound is False:
        raise StorageError(f"{path}: {_DAMAGED}")
    with contextlib.ExitStack() as stack:
        try:
            file = stack.enter_context(opened(path, data))
            version = _version(file)
        except DAMAGE as error:
            raise StorageError(f"{path}: not a whole HDF5 file; give a results file written by `spi run`") from error
        if version is None:
            raise StorageError(f"{path}: an HDF5 file, but not of ours; give a results file written by `spi run`")
        if version != VERSION:
            whose = "an earlier" if version < VERSION else "a later"
            problem = f"was written by {whose} version of spi (layout {version}, this one reads {VERSION})"
            right = ("run the experiment again with --fresh", "update spi, or move the file away")[version > VERSION]
            raise StorageError(f"{path}: {problem}; {right}")
        if sound is None:
            raise StorageError(f"{path}: has no checksum, so it was changed or is of an earlier spi, or {_DAMAGED}")
        yield file


def _version(file: h5py.File) -> int | None:
    """Version of the layout; None if the file is not of ours."""
    version = np.asarray(file.attrs.get(MARK))
    return int(version) if version.shape == () and version.dtype.kind in "iu" else None
