"""Python code that is no part of this package: modules stored in the cache folder, and digests of foreign code.

A class that compiled kernels are given must be importable by its name in every process: the processes that compile,
the workers, and all that read Numba's index of compiled kernels.  A *stored module* is, whatever the origin of its
text.
"""

import functools
import hashlib
import importlib
import inspect
import os
import re
import sys
import tempfile
from pathlib import Path

from . import own

_ROOT = __name__.partition(".")[0]


def stored(stem, text):
    """Module with the Python source `text`, ``spi.compiler.own.<stem>_<first 16 hex digits of its SHA-256>``.

    The same text is the same module in every process, and an edited one is another.  Raises OSError if it cannot be
    written, and whatever the text raises while it is imported.
    """
    data = text.encode()
    name = re.sub(r"[^A-Za-z0-9_]", "_", stem)[:60]  # a part of a module's name, and of a file's on any system
    name = f"{name}_{hashlib.sha256(data).hexdigest()[:16]}"
    file = folder() / f"{name}.py"
    if not file.is_file() or file.read_bytes() != data:
        write(file, data)
        importlib.invalidate_caches()
    return importlib.import_module(f"{own.__name__}.{name}")


def folder():
    """Folder of stored modules."""
    return Path(own.__path__[0])


def is_stored(thing):
    """Whether a class or function is that of a stored module."""
    return thing.__module__.startswith(f"{own.__name__}.")


def source_name(thing):
    """Name of the file with the source of a class or function, of a stored module's without the hash."""
    name = Path(inspect.getfile(thing)).name
    return f"{name[: -len('_0123456789abcdef.py')]}.py" if is_stored(thing) else name


def text_of(thing):
    """Text of the stored module that a class or function is of."""
    return Path(sys.modules[thing.__module__].__file__).read_text(encoding="utf-8")


def is_foreign(thing):
    """Whether a class or function is defined outside the sources of this package; those of stored modules are."""
    return thing.__module__.partition(".")[0] != _ROOT or is_stored(thing)


def digest(thing):
    """A digest of the code of a foreign class or function; None for those of this package.

    For a stored module it is the digits of its name; for any other module the first 16 hex digits of the SHA-256 of all
    Python files of its top-level package, or of its file if it is in none.  It is "" where no file has the code of a
    name: in an interactive session and in a program's main file, whose classes are others in every process.
    """
    if not is_foreign(thing):
        return None
    module = thing.__module__
    return module.rpartition("_")[2] if is_stored(thing) else _digest_of_files(module.partition(".")[0])


@functools.cache
def _digest_of_files(package):
    """Digest of a module or package as it is on disk at the first call."""
    module = sys.modules[package]
    if folders := getattr(module, "__path__", None):
        files = [(file.relative_to(folder), file) for folder in folders for file in sorted(Path(folder).rglob("*.py"))]
    elif package != "__main__" and (file := getattr(module, "__file__", None)):
        files = [(Path(file).name, Path(file))]
    else:
        return ""
    total = hashlib.sha256()
    for name, file in files:
        total.update(str(name).encode())
        total.update(file.read_bytes())
    return total.hexdigest()[:16]


def write(file, data):
    """Replace a file at once, since other processes may read or write it."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.NamedTemporaryFile(dir=file.parent, prefix=file.stem, suffix=".new", delete=False) as aside:
        try:
            aside.write(data)
            aside.close()
            os.replace(aside.name, file)
        except BaseException:
            aside.close()  # Windows removes no file that is open
            Path(aside.name).unlink(missing_ok=True)
            raise
