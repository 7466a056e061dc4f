"""Before any test file is imported: where Numba keeps what the tests compile."""

import hashlib
import os
from pathlib import Path

import spi

# The package names its cache by its own sources, and compiled kernels also contain what tests/helpers.py says: without
# this an edit there would go unnoticed.  Programs that tests start inherit the folder.
_digest = hashlib.sha256(Path(__file__).with_name("helpers.py").read_bytes()).hexdigest()[:16]
_folder = Path(os.environ["NUMBA_CACHE_DIR"]).parent
if _folder.name != f"tests-{_digest}":  # one of several processes that share the tests inherits it
    _folder /= f"tests-{_digest}"
os.environ["SPI_CACHE_DIR"] = str(_folder)
spi._point_cache_at_sources()
# Numba's index of compiled kernels names the records of helpers.py, which those programs must be able to import.
_paths = [str(Path(__file__).parent), *filter(None, [os.environ.get("PYTHONPATH")])]
os.environ["PYTHONPATH"] = os.pathsep.join(_paths)
