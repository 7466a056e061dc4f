"""Counts in bins and cells of equal size, which add up exactly: quantiles, histograms and maps of densities."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from spi.compiler.dispatch import answers
from spi.ensemble.protocol import dimension, structure
from spi.ensemble.random_states import RandomState
from spi.ensemble.special import frozen
from spi.kinds.functions import path_function
from spi.models.delegation import undamped
from spi.statistics.cells import cells_around, places_in_cells
from spi.statistics.intervals import order_statistics, student_of_paths, zero_share_bound

from .results import DensityMap, Histogram, Quantiles


class Bins(NamedTuple):
    """Bins of equal width for each of F functions at each of T times."""

    low: np.ndarray  #: (T, F) the lower end of the first
    width: np.ndarray  #: (T, F)
    number: int

    @classmethod
    def around(cls, values: np.ndarray, number: int, margin: float = 0.5) -> "Bins":
        """Bins that hold values (T, F, paths), and beyond them on each side that share of their range."""
        return cls(*cells_around(values, number, margin), number)


def quantiles(
    counts: np.ndarray, lost: np.ndarray, bins: Bins, of_values: Sequence[bool], levels: tuple[float, ...]
) -> Quantiles:
    """Quantiles from counts, of which `lost` (T, F, 2) are of minus infinity, and of infinity or NaN.

    Their intervals are those of ranks, which are binomial, with all of the bins at their ends.  NaN where a function
    has no values but 0 and 1, which `of_values` says, and where no value is finite.
    """
    counts, bins = _some(counts, bins, of_values)
    counts[..., [0, -1]] -= lost[:, np.flatnonzero(of_values)]
    n = counts.sum(axis=-1)
    ranks = {size: [order_statistics(size, level) for level in levels] for size in np.unique(n).tolist()}
    each = np.array([ranks[size] for size in n.ravel().tolist()], int).reshape(*n.shape, len(levels), 2)
    ends = [_quantile(counts, bins, n[..., np.newaxis] * np.array(levels))]
    ends += [_end(counts, bins, each[..., side], side) for side in (0, 1)]
    for end in ends:
        end[n == 0] = np.nan
    found = (np.moveaxis(end, 0, 1) for end in ends)
    quantile, low, high = (_all(values, of_values) for values in found)
    return Quantiles(level=np.array(levels), quantile=quantile, quantile_low=low, quantile_high=high)


def _some(counts: np.ndarray, bins: Bins, of_values: Sequence[bool]) -> tuple[np.ndarray, Bins]:
    chosen = np.flatnonzero(of_values)
    return counts[:, chosen], Bins(bins.low[:, chosen], bins.width[:, chosen], bins.number)


def _all(values: np.ndarray, of_values: Sequence[bool]) -> np.ndarray:
    """Values of some functions as those of all, NaN of the others."""
    found = np.full((len(of_values), *values.shape[1:]), np.nan)
    found[np.array(of_values)] = values
    return found


def _end(counts: np.ndarray, bins: Bins, rank: np.ndarray, side: int) -> np.ndarray:
    """(T, F, levels) the lower end (side 0) or upper end (1) of the bin that holds the value of a rank, or +-inf."""
    found = np.empty(rank.shape)
    for place in np.ndindex(*counts.shape[:2]):
        with np.errstate(invalid="ignore", over="ignore"):
            edges = bins.low[place] + bins.width[place] * np.arange(bins.number + 1)
        ends = np.concatenate(([-np.inf], edges, [np.inf]))
        below = np.cumsum(counts[place])
        cell = np.searchsorted(below, np.minimum(rank[place], below[-1]))  # 0: below all bins
        beyond = (rank[place] < 1) if side == 0 else (rank[place] > below[-1])
        found[place] = np.where(beyond, ends[-side], ends[cell + side])
    return found


def _quantile(counts: np.ndarray, bins: Bins, wanted: np.ndarray) -> np.ndarray:
    """(T, F, levels) where the distribution function, linear in each bin, has so many paths below, or +-inf."""
    below = np.cumsum(counts, axis=-1)  # of the number of paths up to the upper end of each bin
    with np.errstate(invalid="ignore", over="ignore"):
        edges = bins.low[..., np.newaxis] + bins.width[..., np.newaxis] * np.arange(bins.number + 1)
    found = np.empty(wanted.shape)
    for place in np.ndindex(*counts.shape[:2]):
        inner = below[place][:-1]
        found[place] = np.interp(wanted[place], inner, edges[place])
        found[place][wanted[place] < inner[0]] = -np.inf
        found[place][wanted[place] > inner[-1]] = np.inf
    return found


def share_stderr(share: np.ndarray, samples: int) -> np.ndarray:
    """Standard error of a share of independent paths; of none or all of them by the rule of three."""
    unseen = zero_share_bound(samples) / student_of_paths(samples)
    return np.where((share > 0) & (share < 1), np.sqrt(share * (1 - share) / samples), unseen)


def histogram(counts: np.ndarray, samples: int, bins: Bins, of_values: Sequence[bool], number: int) -> Histogram:
    """Densities in `number` bins, which divides that of the counts; NaN as for :func:`quantiles`."""
    counts, bins = _some(counts, bins, of_values)
    times, functions = bins.low.shape
    inner = counts[..., 1:-1].reshape(times, functions, number, bins.number // number).sum(axis=-1)
    width = bins.width * (bins.number // number)
    share = np.moveaxis(inner / samples, 0, 1)
    scale = 1 / width.T[..., np.newaxis]
    found = {
        "bin_low": bins.low.T,
        "bin_width": width.T,
        "density": share * scale,
        "density_stderr": share_stderr(share, samples) * scale,
        "outside": ((counts[..., 0] + counts[..., -1]) / samples).T,
    }
    return Histogram(**{name: _all(values, of_values) for name, values in found.items()})


SPHERE = "sphere"
_POINTS = 5  # at which B(y) y is looked at
_MARGIN = 0.125  # of the range of the first paths on each side
_WITHIN = 8  # points on a side of a cell, in whose middles a density is known


def on_sphere(model: Any) -> bool:
    """Whether |y|^2 is a Casimir function of three components: B(y) y = 0."""
    if dimension(model) != 3:
        return False
    y = np.random.default_rng(1).standard_normal((_POINTS, 3))
    return all(np.abs(structure(model, tuple(one), tuple(one))).max() < 1e-12 for one in y)


class Cells(NamedTuple):
    """Cells of equal size at some times, by two sides."""

    low: np.ndarray  #: (times, 2)
    width: np.ndarray  #: (times, 2)
    number: tuple[int, int]
    pair: tuple[int, ...]  #: the functions of the sides; () for the sphere

    @classmethod
    def of_sphere(cls, times: int, number: tuple[int, int]) -> "Cells":
        """Bands of equal height in cells of equal width."""
        low = np.tile([-1.0, -np.pi], (times, 1))
        return cls(low, -2 * low / number, number, ())

    @classmethod
    def around(cls, values: np.ndarray, pair: tuple[int, ...], number: tuple[int, int]) -> "Cells":
        """Cells that hold the values (times, 2, paths) of two functions, and an eighth of their range on each side."""
        return cls(*cells_around(values, number[0], _MARGIN), number, pair)

    def places(self, states: np.ndarray, values: np.ndarray) -> np.ndarray:
        """(blocks, times, 1, LANES) the number of the cell, and a half; -1 for what is outside, NaN for what is lost.

        Of states (3, blocks, times, LANES) or of the values (2, blocks, times, LANES) of two functions.
        """
        sides = values if self.pair else _directions(states)
        return places_in_cells(sides, self.low, self.width, self.number, closed=not self.pair)

    def gibbs(self, model: Any, initial: Any, temperature: float) -> np.ndarray | None:
        """The density of exp(-H/T) in the cells of the sphere through `initial`; None if that is not known."""
        of_law = initial.law.surface if isinstance(initial, RandomState) else initial
        if self.pair or not np.isfinite(temperature) or of_law is None or answers(frozen, undamped(model)):
            return None
        fine = [(np.arange(_WITHIN * n) + 0.5) / (_WITHIN * n) for n in self.number]
        z, longitude = np.meshgrid(2 * fine[0] - 1, np.pi * (2 * fine[1] - 1), indexing="ij")
        across = np.sqrt(1 - z**2)
        y = np.linalg.norm(initial) * np.array([across * np.cos(longitude), across * np.sin(longitude), z])
        exponent = -path_function(model, (), "H").values(y) / temperature
        weight = np.exp(exponent - exponent.max())
        rows, columns = self.number
        return weight.reshape(rows, _WITHIN, columns, _WITHIN).mean(axis=(1, 3)) / (4 * np.pi * weight.mean())

    def densities(
        self, counts: np.ndarray, t: np.ndarray, names: tuple[str, ...], origins: np.ndarray, law: Any
    ) -> DensityMap:
        """What follows from counts (times, 1, 2 + cells); functions have been counted less their `origins` (2,)."""
        n = counts[0, 0].sum()
        share = counts[:, 0, 1:-1].reshape(-1, *self.number) / n
        area = self.width.prod(axis=1)[:, np.newaxis, np.newaxis]
        return DensityMap(
            sides=names,
            t=t,
            low=self.low + origins,
            width=self.width,
            density=share / area,
            stderr=share_stderr(share, n) / area,
            outside=(counts[:, 0, 0] + counts[:, 0, -1]) / n,
            law=law,
        )


def _directions(y: np.ndarray) -> np.ndarray:
    """y_3 / |y| and the longitude (2, ...) of states (3, ...)."""
    with np.errstate(all="ignore"):
        return np.array([y[2] / np.sqrt((y**2).sum(axis=0)), np.arctan2(y[1], y[0])])
