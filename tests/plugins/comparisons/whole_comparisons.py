"""Whole results of each kind of comparison, made from their records."""

from filled_results import filled

from spi.storage import StoredResults

WHOLE = {
    kind: StoredResults({"kind": kind, "title": kind}, (filled(kind), filled(kind, "midpoint")))
    for kind in ("work_precision", "stability")
}
