"""spi: a laboratory for stochastic Poisson integrators.

    results = spi.run("rigid_body_strong", samples=1000)   # a spec file, an experiment by name, or a dict
    results["splitting"].error                             # an xarray.DataArray
    results.plot()                                         # the figure that `spi plot` draws

``spi.load`` reads results that are stored; ``spi.trajectory`` and ``spi.expectations`` give arrays at once.
"""

import atexit
import hashlib
import importlib
import os
import sys
import tempfile
from pathlib import Path

__version__ = "0.1.0"

#: What Python users are offered, name -> the module that has it; imported when it is first asked for.
_OFFERED = {
    **dict.fromkeys(("Results", "expectations", "experiments", "load", "run", "trajectory"), "api"),
    "SpecError": "specs",
    "StorageError": "storage",
}
__all__ = ["__version__", *_OFFERED]


def __getattr__(name):
    """One of the names in `_OFFERED`."""
    if name not in _OFFERED:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_OFFERED[name]}"), name)


def __dir__():
    return __all__


#: What :func:`source_digest` leaves out because it reads, keeps or shows: modules, and those of a kind of experiment.
_NOT_COMPUTING = {
    *("checks/compilable", "checks/differences", "checks/model_checks", "statistics/claims", "exact/__init__"),
    *("checks/__init__", "compiler/__init__", "ensemble/__init__", "numerics/__init__", "statistics/__init__"),
    *("specs", "storage/files", "storage/identity", "storage/provenance", "storage/results", "storage/sums"),
    *("storage/__init__", "drawing", "printing", "running", "api", "report", "cli", "experiments"),
}
_NOT_COMPUTING_IN_A_KIND = {"keys", "claims", "table", "figure", "comparisons"}


def computing_sources():
    """The files of this package on which compiled code and the numbers of a study depend, sorted."""
    package = Path(__file__).parent
    return [source for source in sorted(package.rglob("*.py")) if _computes(source.relative_to(package))]


def _computes(source):
    """Whether a file, named as seen from the package, belongs to :func:`computing_sources`."""
    names = source.with_suffix("").parts
    if names[0] == "kinds":
        return names[1] != "__init__" and not _NOT_COMPUTING_IN_A_KIND.intersection(names[2:])
    return not _NOT_COMPUTING.intersection((names[0], "/".join(names[:2])))


def source_digest():
    """A hash of :func:`computing_sources`, which no edit of a legend or of a message changes."""
    digest = hashlib.sha256()
    package = Path(__file__).parent
    for source in computing_sources():
        digest.update(str(source.relative_to(package)).encode())
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def _parent_of_caches():
    """The folder that the environment asks for; RuntimeError if there is neither such a wish nor a home folder."""
    if wish := os.environ.get("SPI_CACHE_DIR"):
        return wish
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "spi")


def modules_folder():
    """Where the source texts of stored modules lie (``spi.compiler.modules``): beside the compiled kernels."""
    return Path(_parent_of_caches(), "modules").absolute()


def _point_cache_at_sources():
    """Give Numba's disk cache a folder named by the hash of this package's sources.

    Numba notices an edit in the file of a kernel, not in the files of the functions that the kernel calls; with a new
    folder after any edit nothing stale can be found.  Must run before any kernel is declared.

    Where the folder cannot be written Numba would keep kernels beside the sources and find stale ones there after an
    edit.  Then a temporary folder, gone when the program ends, takes its place, also of that of stored modules; returns
    why, otherwise None.
    """
    digest, problem = source_digest(), None
    try:
        place = folder = Path(_parent_of_caches(), digest)
        folder.mkdir(parents=True, exist_ok=True)
        modules = modules_folder()
        for place in (folder, modules if modules.exists() else modules.parent):
            tempfile.TemporaryFile(dir=place).close()
    except (OSError, RuntimeError) as error:  # the latter if nothing tells the home folder
        problem = f"{place}: {error.strerror}" if isinstance(error, OSError) else str(error)
        temporary = tempfile.TemporaryDirectory(prefix="spi-")
        atexit.register(temporary.cleanup)
        os.environ["SPI_CACHE_DIR"] = temporary.name  # also for programs that this one starts
        folder = Path(temporary.name, digest)
    os.environ["NUMBA_CACHE_DIR"] = str(folder)
    if "numba" in sys.modules:
        sys.modules["numba"].config.CACHE_DIR = str(folder)
    return problem


#: Of the sources as they were when this process began to import them: with an edit later it computes nothing else.
SOURCE_DIGEST = source_digest()
#: Why compiled kernels cannot be kept for the next run; None where they are.
CACHE_PROBLEM = _point_cache_at_sources()
