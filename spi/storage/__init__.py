"""Files in and out: results, sums over paths, and where the numbers came from."""

from .provenance import FORMER, computed_by, finished, former, keys_needed, machine, make_room, provenance
from .records import INTERVAL, Group, Order, Part, StoredResults
from .results import StorageError, check_writable, contents, read, remove_leftovers, write, write_all
from .sums import Store

__all__ = [
    "FORMER",
    "INTERVAL",
    "Group",
    "Order",
    "Part",
    "StorageError",
    "Store",
    "StoredResults",
    "check_writable",
    "computed_by",
    "contents",
    "finished",
    "former",
    "keys_needed",
    "machine",
    "make_room",
    "provenance",
    "read",
    "remove_leftovers",
    "write",
    "write_all",
]
