"""Sums of powers of values over jackknife groups of paths, and the means that follow from them."""

import numpy as np

from ..ensemble.moments import add_moments
from ..numerics.rng import LANES
from .estimators import GROUPS, PARTS, ROUND


def with_powers(sums: np.ndarray, values: np.ndarray, first_block: int, samples: int) -> np.ndarray:
    """The sums (powers, ..., GROUPS) with the values (blocks, ..., LANES) and their powers added.

    One after the other, so that the bits do not depend on how blocks are divided into calls; paths from number
    `samples` on do not count.
    """
    blocks, before = len(values), first_block % ROUND
    rounds = -(-(before + blocks) // ROUND)
    counted = np.clip(samples - (first_block + np.arange(blocks)) * LANES, 0, LANES)
    values = np.where(np.arange(LANES) < counted.reshape(-1, *[1] * (values.ndim - 1)), values, 0.0)
    # (rounds, lanes of a part, ...): what is added to the sums of all groups at once
    ordered = np.zeros((rounds, LANES // PARTS, values[0, ..., 0].size, ROUND, PARTS))
    by_part = values.reshape(blocks, -1, LANES // PARTS, PARTS)
    for block, one in enumerate(by_part, before):
        ordered[block // ROUND, :, :, block % ROUND] = one.swapaxes(0, 1)
    added, power = np.empty_like(sums), np.ones_like(ordered)
    for k, sum_of_power in enumerate(sums):
        with np.errstate(all="ignore"):
            power = power * ordered
            rows = power.reshape(rounds * LANES // PARTS, -1)
            added[k] = np.add.reduce(np.vstack([sum_of_power.reshape(1, -1), rows])).reshape(sum_of_power.shape)
    return added


def add_values(values: np.ndarray, first: int, end: int, sums: np.ndarray) -> None:
    """Add values (blocks, T, columns, LANES) to the sums (2, T, columns, GROUPS) of them and of their squares.

    The first block is number `first`; paths from number `end` on do not count.
    """
    times, none = values.shape[1], np.zeros(0, int)
    add_moments(values, first, end, sums, none, none, np.zeros((1, times, 0, GROUPS)), (0, times))


def mean_over_paths(sums: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Means over all paths of sums (..., GROUPS), and the same without each group in turn, (groups with paths, ...)."""
    used = counts > 0
    sums, counts = sums[..., used], counts[used]
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        total = sums.sum(axis=-1)
        without = (total[..., np.newaxis] - sums) / (counts.sum() - counts)
        return total / counts.sum(), np.moveaxis(without, -1, 0)


def standard_deviation(mean: np.ndarray, mean_square: np.ndarray) -> np.ndarray:
    """The standard deviation of a quantity, from the means of it and of its square."""
    with np.errstate(invalid="ignore", over="ignore"):
        return np.sqrt(np.maximum(mean_square - mean**2, 0.0))


def kurtosis(powers: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """E (x - E x)^4 / variance^2 from the means (4, ...) of x, x^2, x^3 and x^4."""
    m1, m2, m3, m4 = powers
    with np.errstate(all="ignore"):
        return np.asarray((m4 - 4 * m1 * m3 + 6 * m1**2 * m2 - 3 * m1**4) / variance**2)
