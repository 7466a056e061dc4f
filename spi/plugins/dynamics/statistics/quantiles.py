"""Quantiles from counts in bins that suit any law: fixed by the first values, so that counts add up in any order.

The edges of the bins are order statistics of the first values, evenly spread and denser towards both tails, so that a
bin holds a share of a few thousandths of the values whatever their law is.  Beyond the first values edges stand at
distances from their median that grow by the factor 2^(1/8), then ever faster, up to the largest numbers; towards 0,
where the first values have one sign, at multiples of the smallest that fall likewise.  A value that several of the
first ones have stands in a bin of its own.
"""

from typing import NamedTuple

import numpy as np

from spi.numerics.types import Array
from spi.statistics.intervals import order_statistics

EDGES = 1023  #: one less than a power of two, so that a search has as many steps for each value

_LEVELS, _STEEP = 320, 7.0  # of each sort of levels, and the logit of the outermost ones
_ATOMS = 48  # values with a bin of their own
_FINE, _COARSE = 64, 32  # edges of a ladder that grows by 2^(1/8), and of the rest


def _levels() -> Array:
    """Probabilities, half of them evenly spread and half evenly in their logit."""
    even = np.arange(1, _LEVELS) / _LEVELS
    steep = 1.0 / (1.0 + np.exp(-np.linspace(-_STEEP, _STEEP, _LEVELS)))
    return np.union1d(even, steep)


#: Factors from 2^(1/8) to beyond the largest number.
_LADDER = np.concatenate(
    [np.arange(1, _FINE + 1) / 8, _FINE / 8 + np.cumsum(2.0 * np.arange(1, _COARSE + 1))]
)  # as powers of 2


def edges_around(values: Array) -> Array:
    """(..., EDGES) ascending, from first values (..., n), of which those that are not finite do not count."""
    levels = _levels()
    rows = [_edges(row[np.isfinite(row)], levels) for row in values.reshape(-1, values.shape[-1])]
    return np.array(rows).reshape(*values.shape[:-1], EDGES)


def _edges(x: Array, levels: Array) -> Array:
    x = np.sort(x) if len(x) else np.zeros(1)
    lowest, median, highest = (float(x[i]) for i in (0, len(x) // 2, -1))
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        least = 2.0**-30 * max(abs(lowest), abs(highest), 2.0**-900)
        ladder = 2.0**_LADDER
        inner = np.interp(levels * (len(x) - 1), np.arange(len(x)), x)
        parts = [inner, x[:1], np.nextafter(x[-1:], np.inf)]
        parts += [median + max(highest - median, least) * ladder, median - max(median - lowest, least) * ladder]
        if lowest > 0.0 or highest < 0.0:
            parts += [np.append((lowest if lowest > 0.0 else highest) / ladder, 0.0)]
    several, count = np.unique(x, return_counts=True)
    atoms = np.sort(several[np.argsort(-count, kind="stable")[:_ATOMS]][: np.count_nonzero(count > 1)])
    edges = np.unique(np.concatenate([*parts, atoms, np.nextafter(atoms, np.inf)]))
    edges = edges[np.isfinite(edges)]
    return np.append(edges, np.full(EDGES - len(edges), np.inf))


class Ranked(NamedTuple):
    """Quantiles with the ends of their 95 % intervals, (levels,) each."""

    value: Array
    low: Array
    high: Array


def quantiles_of(counts: Array, edges: Array, levels: tuple[float, ...]) -> Ranked:
    """Quantiles from the counts (EDGES + 1,) of finite values below all edges, between them, and from the last one on.

    Intervals are those of ranks, which are binomial, with all of the bins at their ends.  Within a bin the distribution
    function is linear; a bin between two neighbouring floats holds one number.  NaN without values.
    """
    below, found = np.cumsum(counts), np.full((3, len(levels)), np.nan)
    n = int(below[-1])
    if not n:
        return Ranked(*found)
    begin, end = np.append(-np.inf, edges), np.append(edges, np.inf)
    one = end <= np.nextafter(begin, np.inf)
    for i, level in enumerate(levels):
        at = int(np.searchsorted(below, level * n))  # as many or more are below its end
        share = (level * n - (below[at] - counts[at])) / counts[at]
        inside = begin[at] if one[at] or not np.isfinite(end[at]) else end[at] if not np.isfinite(begin[at]) else None
        found[0, i] = begin[at] + share * (end[at] - begin[at]) if inside is None else inside
        low, high = order_statistics(n, level)
        first, last = (int(np.searchsorted(below, rank)) for rank in (low, high))
        found[1, i] = begin[first] if low > 0 else -np.inf
        found[2, i] = np.inf if high > n else begin[last] if one[last] else end[last]
    return Ranked(*found)
