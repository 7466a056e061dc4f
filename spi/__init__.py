"""spi: a laboratory for stochastic Poisson integrators.

    results = spi.run("rigid_body_strong", samples=1000)   # a spec file, an experiment by name, or a dict
    results["splitting"].error                             # an xarray.DataArray
    results.plot()                                         # the figure that `spi plot` draws

``spi.load`` reads results that are stored; ``spi.trajectory`` and ``spi.expectations`` give arrays at once.
"""

import atexit
import contextlib
import errno
import hashlib
import importlib
import os
import shutil
import tempfile
import time
from pathlib import Path

try:
    import fcntl
except ImportError:  # not on Windows
    fcntl = None

# Threads that wait sleep: where other programs use the processors, too, busy waiting takes up to ten times as long
# for a small lattice.  Must be said before OpenMP is loaded.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

__version__ = "0.2.0"
#: What `pip` installs; a package called `spi` on the index is another program.
DISTRIBUTION = "stochastic-poisson-integrators"

#: What Python users are offered, name -> the module that has it; imported when it is first asked for.
_OFFERED = {
    **dict.fromkeys(
        ("Integrator", "Results", "expectations", "experiments", "increments", "load", "run", "trajectory"),
        "api",
    ),
    "SpecError": "specs",
    "StorageError": "storage",
}
__all__ = ["__version__", *_OFFERED]


def __getattr__(name):
    """One of the names in `_OFFERED`, or of those that plug-ins offer."""
    if name in _OFFERED:
        return getattr(importlib.import_module(f"{__name__}.{_OFFERED[name]}"), name)
    plugins = importlib.import_module(f"{__name__}.plugins")
    if name.startswith("_") or name not in plugins.offers("offered"):
        remedy = plugins.lacking("offered", name)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}" + (f"; {remedy}" if remedy else ""))
    return plugins.imported(plugins.offers("offered")[name])


def __dir__():
    return [*__all__, *importlib.import_module(f"{__name__}.plugins").offers("offered")]


#: The rooms whose code kernels contain, and files there that only name and list what is compiled.
_COMPILED = ("compiler", "numerics", "ensemble", "models", "schemes")
_LISTS = {"models/__init__.py", "schemes/__init__.py", "schemes/table.py"}
#: The other rooms that what computes imports, and rooms and files that only show what was computed: constants in keys
#: and records decide numbers as much as studies do.
_COMPUTING = ("checks", "exact", "expressions", "kinds", "plugins", "printing", "specs", "statistics", "storage")
_SHOWING = {"api", "api.py", "cli", "command.py", "drawing", "figure.py", "film.py", "views"}


def sources(*rooms):
    """Python files of some rooms as paths within the package, sorted; ``*`` is any folder."""
    package = Path(__file__).parent
    return sorted(file.relative_to(package) for room in rooms for of in package.glob(room) for file in of.rglob("*.py"))


def kernel_sources():
    """Files whose code is compiled, in rooms of these names of the core and of plug-ins."""
    rooms = [place for room in _COMPILED for place in (room, f"plugins/*/{room}")]
    return [file for file in sources(*rooms) if file.as_posix() not in _LISTS]


def number_sources():
    """Files that decide the numbers of sums and results: the plans of kinds and all that these import."""
    return [*sources(*_COMPILED), *(file for file in sources(*_COMPUTING) if _SHOWING.isdisjoint(file.parts))]


def digest_of(files):
    """A hash of files of the package as they are now, 16 hex digits."""
    digest, package = hashlib.sha256(), Path(__file__).parent
    for file in files:
        digest.update(file.as_posix().encode())
        digest.update((package / file).read_bytes().replace(b"\r\n", b"\n"))  # a checkout on Windows may have these
    return digest.hexdigest()[:16]


def _parent_of_caches():
    """Folder that the environment asks for; RuntimeError if there is neither such a wish nor a home folder."""
    if wish := os.environ.get("SPI_CACHE_DIR"):
        return wish
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "spi")


def modules_folder():
    """Where the source texts of stored modules lie (``spi.compiler.modules``): beside the compiled kernels."""
    return Path(_parent_of_caches(), "modules").absolute()


def kernels_folder():
    """Where kernels that are declared from now on are kept."""
    return _kernels_folder


_LOCK, _NEW = ".spi-lock", 60.0  # the file, and the seconds after which its process must have locked it


@contextlib.contextmanager
def scratch_folder():
    """Path of a temporary folder that is gone when the block ends; those that killed processes left go first.

    A process holds a lock on a file in its folder as long as it lives, which tells one kind from the other.
    """
    for folder in Path(tempfile.gettempdir()).glob("spi-*"):
        _remove_if_left(folder)
    with (
        tempfile.TemporaryDirectory(prefix="spi-", ignore_cleanup_errors=True) as folder,
        open(Path(folder, _LOCK), "wb") as lock,
    ):
        if fcntl:
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield folder


def _remove_if_left(folder):
    """Remove a folder of ours, if it is one, whose process is gone; not a new one, which may not be locked yet."""
    with contextlib.suppress(OSError):
        about = os.lstat(folder / _LOCK)
        if fcntl and about.st_uid == os.geteuid() and time.time() - about.st_mtime > _NEW:
            with open(folder / _LOCK, "rb") as lock:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(folder)


def _check_ours(folder):
    """OSError if a folder is another user's, or if others can change what is in it."""
    if hasattr(os, "geteuid"):
        about = os.stat(folder)
        if about.st_uid != os.geteuid():
            raise PermissionError(errno.EPERM, "belongs to another user, who could have any code run here")
        if about.st_mode & 0o022:
            raise PermissionError(errno.EPERM, "others can write to it and could have any code run here (chmod go-w)")


def _point_cache_at_sources():
    """Keep compiled kernels in a folder named by the hash of the sources whose code is compiled.

    Numba notices an edit in the file of a kernel, not in the files of the functions that the kernel calls; with a new
    folder after any edit nothing stale can be found.  Must run before any kernel is declared.  Numba's own settings,
    which are those of the whole process, stay as they are: ``spi.compiler.caching`` asks for this folder.

    Whoever can write there can have any code run, so no folder is used that belongs to another user or that others can
    change.  Where the folder cannot be written Numba would keep kernels beside the sources and find stale ones there
    after an edit.  In both cases a temporary folder, gone when the program ends, takes its place, also of that of
    stored modules; returns why, otherwise None.
    """
    digest, problem = KERNEL_DIGEST, None
    try:
        place = parent = Path(_parent_of_caches())
        for place in (parent, folder := parent / digest, modules_folder()):
            place.mkdir(mode=0o700, parents=True, exist_ok=True)
            _check_ours(place)
            if place != parent:
                tempfile.TemporaryFile(dir=place).close()
    except (OSError, RuntimeError) as error:  # the latter if nothing tells the home folder
        problem = f"{place}: {error.strerror}" if isinstance(error, OSError) else str(error)
        temporary = contextlib.ExitStack()
        atexit.register(temporary.close)
        # also for programs that this one starts
        os.environ["SPI_CACHE_DIR"] = temporary.enter_context(scratch_folder())
        folder = Path(os.environ["SPI_CACHE_DIR"], digest)
    global _kernels_folder
    _kernels_folder = folder.absolute()
    return problem


# Of the sources as they were when this process began to import them: with an edit later it computes nothing else.
KERNEL_DIGEST = digest_of(kernel_sources())  #: names the cache of compiled kernels
NUMBERS_DIGEST = digest_of(number_sources())  #: marks sums over paths and results
_kernels_folder = None
#: Why compiled kernels cannot be kept for the next run; None where they are.
CACHE_PROBLEM = _point_cache_at_sources()
