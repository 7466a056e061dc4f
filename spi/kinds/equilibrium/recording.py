"""The paths of a study of long times: sums over them, and growth, bias and law that follow."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from spi.ensemble.loop import add_reports
from spi.exact.sphere_law import BINS, SphereLaw
from spi.kinds.functions import PathFunction, origin_of
from spi.numerics.rng import LANES, STEPS_PER_TOSS
from spi.statistics.cells import range_of
from spi.statistics.correlation import by_group, lagged_products, lagged_sums
from spi.statistics.estimators import GROUPS, fit_order, stderr_of_mean

from .results import BATCHES, Law

# ---------------------------------------------------------------------------------------------------------------------
# The paths of a study of long times: sums over them, and growth, bias and law that follow.
# ---------------------------------------------------------------------------------------------------------------------


class Paths(NamedTuple):
    """Values of the paths of some blocks, along the last axes, and sums over them, after `n` steps of one step size.

    Until all steps are done no path is whole, and `paths` is 0.
    """

    paths: int
    seconds: float  #: wall clock
    n: int
    y: np.ndarray  #: (blocks, d * LANES + memory), no blocks once all steps are done
    casimir: np.ndarray  #: (records, C, paths), relative error
    report: np.ndarray  #: (len(REPORT),)
    nonfinite: int  #: of the paths
    snapshots: int  #: number that counts for the law
    moments: np.ndarray  #: (moments, paths), sums over snapshots
    counts: np.ndarray  #: (variables, bins, paths)
    stretch: np.ndarray  #: (F, blocks, LANES, 2 L) the last values of functions, until all steps are done
    batches: np.ndarray  #: (F, blocks, LANES, BATCHES) sums of values over the batches of time, until then
    values: np.ndarray  #: (COLUMNS, F, GROUPS) sums over paths
    lagged: np.ndarray  #: (F, L, GROUPS) sums of products of values at each lag
    ends: np.ndarray  #: (F, L, GROUPS) sums of both values of all pairs at that lag
    cells: np.ndarray  #: (F, bins + 2, GROUPS) int64: values below all bins or NaN, in each, and above all

    def plus(self, later: "Paths") -> "Paths":
        """The record of these paths and some later ones, all steps done."""
        joined: dict[str, Any] = {
            name: np.concatenate((getattr(self, name), getattr(later, name)), axis=-1) for name in OF_PATHS
        }
        return self._replace(
            paths=self.paths + later.paths,
            seconds=self.seconds + later.seconds,
            report=add_reports(self.report[np.newaxis], later.report[np.newaxis, np.newaxis])[0],
            nonfinite=self.nonfinite + later.nonfinite,
            **{name: getattr(self, name) + getattr(later, name) for name in ADDED},
            **joined,
        )

    def counted(self, law: SphereLaw, states: np.ndarray) -> "Paths":
        """The record with one more snapshot, of states (d, paths), in the sums."""
        counts, moments = self.counts.copy(), self.moments + law.moments_of(states)
        law.count(states, counts)
        return self._replace(moments=moments, counts=counts, snapshots=self.snapshots + 1)


OF_PATHS = ("casimir", "moments", "counts")  #: the fields in which the paths stand along the last axis
ADDED = ("values", "lagged", "ends", "cells")  #: those that are sums over paths

#: The fields of :class:`Paths` about functions where there are none.
NOTHING: dict[str, Any] = {
    "stretch": np.zeros((0, 0, 0, 0)),
    "batches": np.zeros((0, 0, 0, 0)),
    **{name: np.zeros((0, 0, 0)) for name in ("values", "lagged", "ends")},
    "cells": np.zeros((0, 0, 0), np.int64),
}


_FIT_FROM = 2**12  # steps, before which rounding errors are too few to fit their growth


def casimir_errors(n: np.ndarray, casimir: np.ndarray) -> dict[str, Any]:
    """Statistics over paths of the relative errors (levels, records, C, paths) of Casimirs after n (records,) steps.

    Mean, root mean square and largest errors, those of path 0, the exponent with which they grow, with its 95 %
    interval, and their bias in a step.
    """
    levels, _, conserved, _ = casimir.shape
    growth, low, high = (np.full((levels, conserved), np.nan) for _ in range(3))
    with np.errstate(all="ignore"):
        for i, c in np.ndindex(levels, conserved):
            growth[i, c], low[i, c], high[i, c] = _exponent(n, casimir[i, :, c])
        in_a_step = casimir[:, -1] / n[-1]
        return {
            "casimir_mean": casimir.mean(axis=3),
            "casimir_rms": np.sqrt((casimir**2).mean(axis=3)),
            "casimir_worst": np.abs(casimir).max(axis=3, initial=0.0),
            "casimir_one": casimir[..., 0],
            "growth": growth,
            "growth_low": low,
            "growth_high": high,
            "bias": in_a_step.mean(axis=2),
            "bias_stderr": stderr_of_mean(in_a_step),
        }


def _exponent(n: np.ndarray, error: np.ndarray) -> tuple[float, float, float]:
    """p of (mean of error^2)^(1/2) = C n^p with its 95 % interval, from errors (records, paths)."""
    paths = error.shape[1]
    squares = (error**2).T
    value = np.sqrt(squares.mean(axis=0))
    use = (n >= _FIT_FROM) & np.isfinite(value) & (value > 0.0)
    if paths < 2 or use.sum() < 3:
        return np.nan, np.nan, np.nan
    without = np.sqrt(np.maximum(squares.sum(axis=0) - squares, 0.0) / (paths - 1))
    # in 1/n, because where the points bend, those of the largest steps are left out: here those of early times
    order = fit_order(1.0 / n, value, without, np.ones(paths), use)
    return -order.order, -order.high, -order.low


def law_of_states(law: SphereLaw, totals: Sequence[Paths]) -> Law:
    """Means and fractions in bins against their exact values, from the paths of each step size."""
    snapshots = max(totals[0].snapshots, 1)
    moments = np.array([paths.moments for paths in totals]) / snapshots
    fractions = np.array([paths.counts for paths in totals]) / snapshots
    below = np.cumsum(fractions, axis=2)[:, :, :-1]
    away = np.abs(below.mean(axis=3) - np.arange(1, BINS) / BINS)
    farthest = away.argmax(axis=2)[..., None]
    return Law(
        variables=tuple(law.variables),
        moments=tuple(law.moments),
        mean=moments.mean(axis=2),
        mean_stderr=stderr_of_mean(moments),
        mean_exact=np.array(list(law.moments.values())),
        fraction=fractions.mean(axis=3),
        fraction_stderr=stderr_of_mean(fractions),
        distance=np.take_along_axis(away, farthest, 2)[..., 0],
        distance_stderr=np.take_along_axis(stderr_of_mean(below), farthest, 2)[..., 0],
    )


# ---------------------------------------------------------------------------------------------------------------------
# Records of functions of the state along long paths: sums over time, and of these over jackknife groups.
# ---------------------------------------------------------------------------------------------------------------------

Array = np.ndarray

_MOST_LAGS = 512  # at which autocovariances are computed
_MOST_BYTES = 2**24  # of states that are recorded at a time

#: Sums over paths of each function: of its mean over time and the square of that, the difference of its means over both
#: halves of the time and the square of that, and the squares of its means over batches.
COLUMNS = 5


class Series(NamedTuple):
    """The snapshots of the paths of one step size at which functions are evaluated."""

    stride: int  #: steps from one to the next
    total: int  #: their number
    kept: int  #: number of those that count, the last ones

    @classmethod
    def of(cls, case: Any, number: int) -> "Series":
        """The snapshots at step size number `number` of a case."""
        total = round(case.final_time / case.between)
        burnt = math.ceil(case.burnt / case.between - 1e-9)
        return cls(round(case.between / case.steps[number]), total, max(0, total - burnt) // BATCHES * BATCHES)

    @property
    def first(self) -> int:
        """The number of those that do not count, the first ones."""
        return self.total - self.kept

    @property
    def lags(self) -> int:
        """The number of lags of autocovariances: about a tenth of `kept`, a power of two."""
        return min(1 << math.ceil(math.log2(self.kept / 10)), _MOST_LAGS)

    def piece(self, dimension: int, blocks: int) -> int:
        """Number of steps, in whole tosses, whose states may be recorded at a time for `blocks` blocks."""
        each = 8 * LANES * dimension * blocks * STEPS_PER_TOSS // self.stride + 1
        return STEPS_PER_TOSS << max(0, (_MOST_BYTES // each).bit_length() - 1)


class Recorder(NamedTuple):
    """Records F functions along the paths of one step size."""

    functions: tuple[PathFunction, ...]
    origins: Array  #: (F,) subtracted from values, so that variances do not cancel
    series: Series
    low: Array  #: (F,) where the first bin begins
    width: Array  #: (F,) of a bin
    bins: int

    @classmethod
    def of(cls, case: Any, number: int, bins: Any) -> "Recorder":
        """The recorder at step size number `number` of a case, with `bins` (low, width)."""
        functions = case.path_functions
        origins = np.array([origin_of(function, case.initial) for function in functions])
        low, width = bins
        return cls(functions, origins, Series.of(case, number), low, width, case.bins)

    def empty(self, blocks: int) -> dict[str, Any]:
        """The fields of :class:`Paths` about functions, of `blocks` blocks before the first step."""
        count, lags = len(self.functions), self.series.lags
        return {
            "stretch": np.zeros((count, blocks, LANES, 2 * lags)),
            "batches": np.zeros((count, blocks, LANES, BATCHES)),
            "values": np.zeros((COLUMNS, count, GROUPS)),
            "lagged": np.zeros((count, lags, GROUPS)),
            "ends": np.zeros((count, lags, GROUPS)),
            "cells": np.zeros((count, self.bins + 2, GROUPS), np.int64),
        }

    def values(self, y: Array, n: int) -> Array:
        """(F, blocks, LANES, K): the functions, less their origins, of those of recorded states that count.

        The states (blocks, 1 + recorded, d * LANES) are those recorded after step n; the first has no meaning.
        """
        begin = 1 + max(0, self.series.first - n // self.series.stride)
        end = 1 + max(0, self.series.total - n // self.series.stride)
        states = np.moveaxis(y.reshape(*y.shape[:2], -1, LANES)[:, begin:end], 2, 0)
        values = np.empty((len(self.functions), *states.shape[1:]))
        with np.errstate(all="ignore"):
            for f, function in enumerate(self.functions):
                values[f] = function.values(states) - self.origins[f]
        return np.ascontiguousarray(np.swapaxes(values, 2, 3))

    def recorded(self, paths: Paths, values: Array, n: int, first: int, end: int) -> Paths:
        """The paths, after n steps, with further values (F, blocks, LANES, K), the first block being number `first`."""
        begin: int = max(0, n // self.series.stride - self.series.first)
        count: int = values.shape[-1]
        if not count:
            return paths
        copied = {name: getattr(paths, name).copy() for name in ("stretch", "batches", "lagged", "ends", "cells")}
        paths, lags = paths._replace(**copied), self.series.lags
        size = self.series.kept // BATCHES
        for batch in range(begin // size, -(-(begin + count) // size)):
            some = values[..., max(0, batch * size - begin) : (batch + 1) * size - begin]
            paths.batches[..., batch] += some.sum(axis=-1)
        for f in range(len(values)):
            self._count(paths.cells[f], values[f], f, first, end)
        while count:
            place = begin % lags
            taken = min(count, lags - place)
            paths.stretch[..., lags + place : lags + place + taken] = values[..., :taken]
            begin, count, values = begin + taken, count - taken, values[..., taken:]
            if begin % lags == 0:
                self._correlate(paths, begin == lags, first, end)
        return paths

    def _count(self, cells: Array, values: Array, f: int, first: int, end: int) -> None:
        """Count values of a function in its cells: below all bins or NaN, in each, and above all."""
        with np.errstate(all="ignore"):
            places = values * (1 / self.width[f])
            places += 1 - (self.low[f] - self.origins[f]) / self.width[f]
            places = np.fmin(np.fmax(places, 0, out=places), self.bins + 1, out=places).astype(np.int64)
        size = self.bins + 2
        places += size * np.arange(LANES)[:, np.newaxis]
        counts = np.array([np.bincount(row.ravel(), minlength=size * LANES) for row in places])
        cells += by_group(counts.reshape(-1, LANES, size), first, end)

    def _correlate(self, paths: Paths, is_first: bool, first: int, end: int) -> None:
        """Add the products of a full stretch with itself and with the one before it, which it then replaces."""
        lags = self.series.lags
        for f, both in enumerate(paths.stretch):
            spectrum = by_group(lagged_products(both[..., :lags], both[..., lags:]), first, end)
            paths.lagged[f] += np.moveaxis(lagged_sums(np.moveaxis(spectrum, -1, 0)), 0, -1)
            if is_first:
                paths.ends[f, 1:] -= by_group(np.cumsum(both[..., lags : 2 * lags - 1], axis=-1), first, end)
        paths.stretch[..., :lags] = paths.stretch[..., lags:]
        paths.stretch[..., lags:] = 0.0

    def finished(self, paths: Paths, first: int, end: int) -> dict[str, Any]:
        """The fields of :class:`Paths` with sums over groups alone, once all steps are done."""
        lags, kept = self.series.lags, self.series.kept
        paths = paths._replace(**{name: getattr(paths, name).copy() for name in ("stretch", "lagged", "ends")})
        over = kept % lags
        last = paths.stretch[..., over : over + lags].copy()  # the last ones, the latest at the end
        if over:
            self._correlate(paths, False, first, end)
        of_batches = paths.batches / (kept // BATCHES)
        mean = of_batches.mean(axis=-1)
        half = BATCHES // 2
        drift = of_batches[..., half:].mean(axis=-1) - of_batches[..., :half].mean(axis=-1)
        columns = mean, mean**2, drift, drift**2, (of_batches**2).sum(axis=-1)
        for f in range(len(self.functions)):
            ending = np.cumsum(last[f, ..., :0:-1], axis=-1)
            paths.ends[f] += 2 * kept * by_group(mean[f], first, end)
            paths.ends[f, 1:] -= by_group(ending, first, end)
        values = np.array([[by_group(each, first, end) for each in column] for column in columns])
        begun = {"stretch": paths.stretch[:, :0], "batches": paths.batches[:, :0]}
        return {**begun, "values": values, "lagged": paths.lagged, "ends": paths.ends}


def bins_around(values: Array, bins: int) -> tuple[Array, Array]:
    """(low, width), (F,) each, of bins that cover values (F, n) with some room on both sides.

    Rounded to eighths of a power of two, so that step sizes and schemes of the same law mostly have the same bins.
    """
    low, high = range_of(values)
    unit = 2.0 ** np.ceil(np.log2(np.maximum(high - low, 1e-9 * np.maximum(1.0, np.abs(high))))) / 8
    low, high = unit * np.floor(low / unit - 0.25), unit * np.ceil(high / unit + 0.25)
    return low, (high - low) / bins
