"""Cells of equal size that hold values, and shares of paths in them."""

import numpy as np

from spi.numerics.types import Array
from spi.plugins.dynamics.ensemble.counting import count_values
from spi.statistics.intervals import student_of_paths, zero_share_bound
from spi.statistics.tallies import Batch


def range_of(values: Array) -> tuple[Array, Array]:
    """(lowest, highest) of values (..., n), of which those that are not finite do not count; 0 if there are none."""
    finite = np.where(np.isfinite(values), values, np.nan)
    with np.errstate(all="ignore"):
        low, high = (np.nan_to_num(end(finite, axis=-1)) for end in (np.fmin.reduce, np.fmax.reduce))
    return low, high


def cells_around(values: Array, number: int | tuple[int, ...], margin: float) -> tuple[Array, Array]:
    """(begin, width), (...,) each, of `number` cells over the range of values (..., n), a share `margin` of it wider.

    The share is added at both ends, so that no value lies at the edge of a cell.
    """
    low, high = range_of(values)
    with np.errstate(over="ignore", invalid="ignore"):
        beyond = np.maximum(margin * (high - low), 1e-9 * np.maximum(1.0, np.abs(high)))
        return low - beyond, (high - low + 2 * beyond) / number


def places_in_cells(sides: Array, low: Array, width: Array, number: tuple[int, int], closed: bool) -> Array:
    """(blocks, T, 1, LANES): the number of the cell, row by row, plus 1/2; -1 outside, NaN where a path diverged.

    `sides` are values (2, blocks, T, LANES); the cells begin at `low` and are `width` wide, (T, 2) each.  With `closed`
    no place is outside: values beyond the ends are there by rounding only.
    """
    low, width = (each.T[:, np.newaxis, :, np.newaxis] for each in (low, width))
    rows, columns = number
    with np.errstate(all="ignore"):
        row, column = np.floor((sides - low) / width)
        if closed:
            row, column = np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)
        outside = (row < 0) | (row >= rows) | (column < 0) | (column >= columns)
    return np.where(outside, -1.0, row * columns + column + 0.5)[:, :, np.newaxis]


def count_places(places: Array, batch: Batch, cells: Array) -> None:
    """Add places (blocks, T, 1, LANES) of a batch to the counts (T, 1, 2 + cells): outside, in each cell, lost."""
    begin = np.zeros((places.shape[1], 1))
    count_values(places, batch.first, batch.end, begin, begin + 1, cells, (0, places.shape[1]))


def share_stderr(share: np.ndarray, samples: int) -> np.ndarray:
    """Standard error of a share of independent paths; of none or all of them by the rule of three."""
    unseen = zero_share_bound(samples) / student_of_paths(samples)
    return np.where((share > 0) & (share < 1), np.sqrt(share * (1 - share) / samples), unseen)
