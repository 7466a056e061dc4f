"""Files in and out: results, sums over paths, and where the numbers came from."""

from .files import StorageError, check_writable, contents, remove_leftovers, write_all
from .provenance import check_replaceable, computed_by, finished, machine, provenance, spec_and_sources
from .records import INTERVAL, Group, Order, Part, Results
from .results import read, write
from .sums import about_sums, read_sums, write_sums

__all__ = [
    "INTERVAL",
    "Group",
    "Order",
    "Part",
    "Results",
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
