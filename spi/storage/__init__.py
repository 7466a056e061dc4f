"""HDF5 in and out: results files, checkpoints, and where the numbers came from."""

from .checkpoints import read_checkpoint, write_checkpoint
from .files import StorageError, check_writable, write_all
from .provenance import provenance
from .results import check_same_spec, read, write

__all__ = [
    "StorageError",
    "check_same_spec",
    "check_writable",
    "provenance",
    "read",
    "read_checkpoint",
    "write",
    "write_all",
    "write_checkpoint",
]
