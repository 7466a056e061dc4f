"""What is summed up of paths."""

from typing import NamedTuple

import numpy as np

from spi.statistics.tallies import sum_of_fields


class Sums(NamedTuple):
    """Of F functions and further columns at T times, over some paths."""

    paths: int
    seconds: float
    cpu_seconds: float
    values: np.ndarray  #: (2, T, columns, GROUPS) sums of values and of their squares
    products: np.ndarray  #: (1, T, P, GROUPS) sums of products of pairs of columns
    counts: np.ndarray  #: (T, F, 2 + bins) int64: below all bins, in each, and above all or NaN
    cells: np.ndarray  #: (maps, 1, 2 + cells) int64: outside of all cells, in each, and NaN
    nonfinite: int
    report: np.ndarray  #: (SUMMED,) what steps report that is summed up

    def plus(self, later: "Sums") -> "Sums":
        """These paths and some later ones."""
        return sum_of_fields(self, later)


class Rows(NamedTuple):
    """What some blocks contribute."""

    states: np.ndarray  #: (blocks, levels * stored, d * LANES), level after level
    report: np.ndarray  #: (blocks, SUMMED)

    def at(self, some: slice) -> "Rows":
        """Those of some of the blocks."""
        return Rows(*(each[some] for each in self))
