"""Rows of matrices with few entries, by the numbers of their columns: which of these they link, and their span."""

from collections.abc import Iterable, Mapping
from typing import Any

import mpmath


def connected(links: Iterable[Iterable[int]]) -> list[set[int]]:
    """Numbers that are linked, directly or by others, together; in the order of their smallest."""
    groups: list[set[int]] = []
    for link in map(set, links):
        touching = [group for group in groups if group & link]
        groups = [group for group in groups if not group & link] + [link.union(*touching)]
    return sorted((group for group in groups if group), key=min)


def echelon(rows: Iterable[Mapping[int, Any]], tiny: mpmath.mpf) -> dict[int, dict[int, Any]]:
    """Span of rows by pivot, each row with 1 at its pivot, its largest entry (of equal ones the first).

    All other rows have 0 there; entries up to `tiny` are 0.
    """
    left = [dict(row) for row in rows]
    by_pivot: dict[int, dict[int, Any]] = {}
    while left := [row for row in left if any(abs(c) > tiny for c in row.values())]:
        row = left.pop(0)
        largest = max(abs(c) for c in row.values())
        pivot = min(i for i, c in row.items() if abs(c) > largest * (1 - mpmath.mpf(10) ** -9))
        row = {i: c / row[pivot] for i, c in row.items() if abs(c) > largest * tiny}
        row[pivot] = mpmath.mpf(1)
        left = [without(other, pivot, row, tiny) for other in left]
        by_pivot = {p: without(other, pivot, row, tiny) for p, other in by_pivot.items()}
        by_pivot[pivot] = row
    return by_pivot


def without(row: dict[int, Any], pivot: int, by: dict[int, Any], tiny: mpmath.mpf) -> dict[int, Any]:
    """A row minus the multiple of another one that makes its entry at the pivot 0."""
    factor = row.get(pivot)
    if not factor:
        return row
    new = {i: row.get(i, 0) - factor * by.get(i, 0) for i in sorted({*row, *by} - {pivot})}
    return {i: c for i, c in new.items() if abs(c) > tiny}
