"""Files in and out: results, sums over paths, and where the numbers came from."""

from .files import StorageError, check_writable, contents, remove_leftovers, write_all
from .provenance import check_replaceable, computed_by, finished, machine, provenance, spec_and_sources
from .results import about_sums, read, read_sums, write, write_sums

__all__ = [
    "StorageError",
    "about_sums",
    "check_replaceable",
    "check_writable",
    "computed_by",
    "contents",
    "finished",
    "machine",
    "provenance",
    "read",
    "read_sums",
    "remove_leftovers",
    "spec_and_sources",
    "write",
    "write_all",
    "write_sums",
]
