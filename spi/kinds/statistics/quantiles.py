"""Counts in bins of equal width, which add up exactly, and the quantiles and densities that follow from them."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from spi.statistics.cells import cells_around
from spi.storage.records import INTERVAL

from .results import Histogram, Quantiles


class Bins(NamedTuple):
    """Bins of equal width for each of F functions at each of T times."""

    low: np.ndarray  #: (T, F) the lower end of the first
    width: np.ndarray  #: (T, F)
    number: int

    @classmethod
    def around(cls, values: np.ndarray, number: int, margin: float = 0.5) -> "Bins":
        """Bins that hold values (T, F, paths), and beyond them on each side that share of their range."""
        return cls(*cells_around(values, number, margin), number)


def quantiles(counts: np.ndarray, bins: Bins, of_values: Sequence[bool], levels: tuple[float, ...]) -> Quantiles:
    """Quantiles from counts; their intervals are those of ranks, which are binomial, and one bin wider.

    NaN where a function has no values but 0 and 1, which `of_values` says.
    """
    counts, bins = _some(counts, bins, of_values)
    n = counts[0, 0].sum()
    level = np.array(levels)
    spread = INTERVAL * np.sqrt(level * (1 - level) / n)
    ends = [np.moveaxis(_quantile(counts, bins, at), 0, 1) for at in (level, level - spread, level + spread)]
    width = bins.width.T[..., np.newaxis]
    found = ends[0], ends[1] - width, ends[2] + width
    quantile, low, high = (_all(values, of_values) for values in found)
    return Quantiles(level=level, quantile=quantile, quantile_low=low, quantile_high=high)


def _some(counts: np.ndarray, bins: Bins, of_values: Sequence[bool]) -> tuple[np.ndarray, Bins]:
    chosen = np.flatnonzero(of_values)
    return counts[:, chosen], Bins(bins.low[:, chosen], bins.width[:, chosen], bins.number)


def _all(values: np.ndarray, of_values: Sequence[bool]) -> np.ndarray:
    """Values of some functions as those of all, NaN of the others."""
    found = np.full((len(of_values), *values.shape[1:]), np.nan)
    found[np.array(of_values)] = values
    return found


def _quantile(counts: np.ndarray, bins: Bins, level: np.ndarray) -> np.ndarray:
    """(T, F, levels) where the distribution function, linear in each bin, has these values, or +-inf."""
    below = np.cumsum(counts, axis=-1)  # of the number of paths up to the upper end of each bin
    wanted = np.clip(level, 0.0, 1.0) * below[..., -1:]
    edges = bins.low[..., np.newaxis] + bins.width[..., np.newaxis] * np.arange(bins.number + 1)
    found = np.empty((*counts.shape[:2], len(level)))
    for place in np.ndindex(*counts.shape[:2]):
        inner = below[place][:-1]
        found[place] = np.interp(wanted[place], inner, edges[place])
        found[place][wanted[place] < inner[0]] = -np.inf
        found[place][wanted[place] > inner[-1]] = np.inf
    return found


def histogram(counts: np.ndarray, bins: Bins, of_values: Sequence[bool], number: int) -> Histogram:
    """Densities in `number` bins, which divides that of the counts; NaN as for :func:`quantiles`."""
    counts, bins = _some(counts, bins, of_values)
    times, functions = bins.low.shape
    n = counts[0, 0].sum()
    inner = counts[..., 1:-1].reshape(times, functions, number, -1).sum(axis=-1)
    width = bins.width * (bins.number // number)
    share = np.moveaxis(inner / n, 0, 1)
    scale = 1 / width.T[..., np.newaxis]
    found = {
        "bin_low": bins.low.T,
        "bin_width": width.T,
        "density": share * scale,
        "density_stderr": np.sqrt(share * (1 - share) / n) * scale,
        "outside": ((counts[..., 0] + counts[..., -1]) / n).T,
    }
    return Histogram(**{name: _all(values, of_values) for name, values in found.items()})
