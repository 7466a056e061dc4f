"""spi: a laboratory for stochastic Poisson integrators."""

import hashlib
import os
import sys
from pathlib import Path

__version__ = "0.1.0"


def source_digest():
    """A hash of the sources of this package."""
    digest = hashlib.sha256()
    package = Path(__file__).parent
    for source in sorted(package.rglob("*.py")):
        digest.update(str(source.relative_to(package)).encode())
        digest.update(source.read_bytes())
    return digest.hexdigest()[:16]


def _point_cache_at_sources():
    """Give Numba's disk cache a folder named by the hash of this package's sources.

    Numba notices an edit in the file of a kernel, not in the files of the functions that the kernel calls; with a new
    folder after any edit nothing stale can be found.  Must run before any kernel is declared.
    """
    parent = os.environ.get("SPI_CACHE_DIR") or Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "spi")
    folder = str(Path(parent, source_digest()))
    os.environ["NUMBA_CACHE_DIR"] = folder
    if "numba" in sys.modules:
        sys.modules["numba"].config.CACHE_DIR = folder


def kernels_are_cached():
    """Whether kernels of these sources have been compiled on this machine before."""
    return any(Path(os.environ["NUMBA_CACHE_DIR"]).glob("*/*.nbi"))


_point_cache_at_sources()
