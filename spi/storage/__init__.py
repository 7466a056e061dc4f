"""Files in and out: results, sums over paths, and where the numbers came from."""

from .provenance import check_replaceable, computed_by, finished, machine, provenance, spec_and_sources
from .records import INTERVAL, Group, Order, Part, Results
from .results import (
    StorageError,
    about_sums,
    check_writable,
    contents,
    read,
    read_sums,
    remove_leftovers,
    write,
    write_all,
    write_sums,
)

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
