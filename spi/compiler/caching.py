"""Numba's disk cache of compiled kernels, for several processes at once and for classes from elsewhere.

A cache locator, which Numba lets a program bring along (NUMBA_CACHE_LOCATOR_CLASSES), cannot do this: it is called
once for each function, while the place of a compiled version depends on the types of its arguments.  Nor are that
variable and NUMBA_CACHE_DIR set or read: they belong to the program that imports this package.
"""

import contextlib
import copy
import hashlib
import inspect
import io
import os
import sys
from pathlib import Path

from numba import config
from numba.core.caching import (
    CompileResultCacheImpl,
    FunctionCache,
    IndexDataCacheFile,
    UserProvidedCacheLocator,
)

from .. import kernels_folder
from . import modules, processor
from .private import VARIABLE, left_out
from .records import record_classes

try:
    import fcntl
except ImportError:  # not on Windows
    fcntl = None  # type: ignore[assignment]


class _OurFolder(UserProvidedCacheLocator):
    """Names and stamps as where NUMBA_CACHE_DIR is set, but in the folder of this package's kernels."""

    def __init__(self, function, file):
        super().__init__(function, file)
        self._cache_path = str(kernels_folder() / self.get_suitable_cache_subpath(file))


class _FilesOfFunction(CompileResultCacheImpl):
    """Numba's cache files of a function, in our folder; RuntimeError, as in Numba, if it has no source file."""

    def __init__(self, function):
        file = inspect.getfile(function)
        if not Path(file).exists():
            raise RuntimeError(f"{function.__qualname__} has no place in the cache: there is no file {file}")
        self._lineno, self._locator = function.__code__.co_firstlineno, _OurFolder(function, file)
        self._filename_base = self.get_filename_base(
            f"{Path(file).stem}.{function.__qualname__}", getattr(sys, "abiflags", "")
        )


class _WithDigest(IndexDataCacheFile):
    """Files that end with their SHA-256.  A damaged one counts as missing: its functions are compiled anew."""

    @contextlib.contextmanager
    def _open_for_write(self, filepath):
        memory = io.BytesIO()
        yield memory
        data = memory.getvalue()
        with super()._open_for_write(filepath) as file:
            file.write(data + hashlib.sha256(data).digest())

    def _load_index(self):
        return super()._load_index() if _is_whole(self._index_path) else {}

    def _load_data(self, name):
        if not _is_whole(path := self._data_path(name)):
            raise OSError(f"{path} is damaged")  # which Numba takes for a file that is missing
        return super()._load_data(name)


def _is_whole(path):
    try:
        data = Path(path).read_bytes()
    except OSError:
        return False
    return hashlib.sha256(data[:-32]).digest() == data[-32:]


class SharedCache(FunctionCache):
    """Numba's disk cache of the compiled versions of one function, into which several processes may write at once.

    Numba reads an index, chooses the next free file name and writes both.  Two processes that do so at once choose the
    same name, and one kernel would be loaded as the other.

    The index names the classes of all records with which the function was called, and every process that reads it must
    be able to import them.  Versions for classes that are no part of this package therefore lie in a separate folder,
    named by their modules and by the digests of their code: no other process opens it, and an edit leads to another
    folder.
    """

    _impl_class = _FilesOfFunction
    _warned = False  #: whether the message that kernels cannot be saved has been printed

    def __init__(self, function):
        super().__init__(function)
        self._cache_file = self._files()

    def load_overload(self, types, context):
        place = self._place(types)
        return None if place is None else super(SharedCache, place).load_overload(types, context)

    def save_overload(self, types, result):
        """Save a compiled version; where that is impossible, as on a full disk, print so once and go on without."""
        if (place := self._place(types)) is not None:
            try:
                with _alone_in(Path(place.cache_path)):
                    super(SharedCache, place).save_overload(types, result)
            except OSError as error:
                if not SharedCache._warned:
                    why = os.strerror(error.errno).lower() if error.errno else error
                    print(f"spi: {kernels_folder()}: {why}; compiled kernels cannot be saved", file=sys.stderr)
                SharedCache._warned = True

    def holds(self, dispatcher, types):
        """Whether there is an entry for these types of arguments."""
        place, key = self._place(types), self._index_key(types, dispatcher.targetctx.codegen())
        return place is not None and key in place._cache_file._load_index()

    def _place(self, types):
        """Cache of the versions that depend on the same foreign code; None if nothing identifies that code."""
        things = {self._py_func}.union(*map(record_classes, types))
        foreign = {(thing.__module__, modules.digest(thing)) for thing in things if modules.is_foreign(thing)}
        foreign |= {(VARIABLE, part) for part in left_out()}
        if processor.WISH != processor.USUAL:
            foreign.add((processor.VARIABLE, processor.WISH))
        if config.BOUNDSCHECK:
            foreign.add(("NUMBA_BOUNDSCHECK", "1"))  # Numba's own key does not have it
        if not foreign:
            return self
        if not all(digest for _, digest in foreign):
            return None
        place, name = copy.copy(self), hashlib.sha256(repr(sorted(foreign)).encode()).hexdigest()[:16]
        place._cache_path = str(Path(self.cache_path, f"own_{name}"))
        place._cache_file = place._files()
        return place

    def _files(self):
        return _WithDigest(self._cache_path, self._impl.filename_base, self._impl.locator.get_source_stamp())


@contextlib.contextmanager
def _alone_in(folder):
    """Lock the folder against other processes within the block; without effect where the system has no such locks."""
    folder.mkdir(parents=True, exist_ok=True)
    with open(folder / "lock", "wb") as file:
        if fcntl:
            fcntl.flock(file, fcntl.LOCK_EX)
        yield  # closing the file releases the lock, and so does the end of the process
