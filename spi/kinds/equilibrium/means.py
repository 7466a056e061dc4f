"""Means over time: records of functions along long paths, sums over jackknife groups, and estimates with errors."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from spi.kinds.functions import PathFunction, origin_of
from spi.numerics.rng import LANES, STEPS_PER_TOSS
from spi.statistics.accumulators import Array
from spi.statistics.cells import range_of
from spi.statistics.correlation import Correlation, by_group, lagged_products, lagged_sums, of_means
from spi.statistics.estimators import (
    fit_order,
    group_counts,
    is_resolved,
    jackknife_stderr,
    mean_over_paths,
    student,
)
from spi.storage.records import Order

from .growth import Paths
from .references import Known, known_laws
from .results import BATCHES, LEAST_PATHS, Averages

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

    @property
    def edges(self) -> Array:
        """(F, bins + 1) the edges of the bins."""
        return self.low[:, np.newaxis] + np.outer(self.width, np.arange(self.bins + 1))

    @property
    def lengths(self) -> dict[str, int]:
        """The lengths of the axes of the fields of :class:`Paths` about functions."""
        return {"function": len(self.functions), "lag": self.series.lags, "cell": self.bins + 2}

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
        return {"values": values, "lagged": paths.lagged, "ends": paths.ends}


def bins_around(values: Array, bins: int) -> tuple[Array, Array]:
    """(low, width), (F,) each, of bins that cover values (F, n) with some room on both sides.

    Rounded to eighths of a power of two, so that step sizes and schemes of the same law mostly have the same bins.
    """
    low, high = range_of(values)
    unit = 2.0 ** np.ceil(np.log2(np.maximum(high - low, 1e-9 * np.maximum(1.0, np.abs(high))))) / 8
    low, high = unit * np.floor(low / unit - 0.25), unit * np.ceil(high / unit + 0.25)
    return low, (high - low) / bins


# ---------------------------------------------------------------------------------------------------------------------
# Estimates from these sums.
# ---------------------------------------------------------------------------------------------------------------------


class _Estimates(NamedTuple):
    """Estimates at one step size, of F functions, from G groups of paths, at L lags."""

    average: Array  #: (F,)
    without: Array  #: (G, F) the averages without each group
    stderr_paths: Array
    stderr_tau: Array
    stderr_batches: Array
    half: Array  #: half of the 95 % interval of the average
    halves: Array
    covariance: Array  #: (F, L)
    correlation: Correlation
    correlation_stderr: Array  #: (F, L)
    variance_stderr: Array


def averages(recorders: Sequence[Recorder], case: Any, totals: Sequence[Paths]) -> Averages:
    """The record of the functions of a case, from the sums over the paths of each step size."""
    each = [_estimates(recorder, paths, case.samples) for recorder, paths in zip(recorders, totals, strict=True)]
    series, spacing = recorders[0].series, case.between
    over = {name: np.array([getattr(at_h, name) for at_h in each]) for name in _Estimates._fields[:7]}
    tau, window, closed = (np.array(rows) for rows in zip(*(at_h.correlation for at_h in each), strict=True))
    covariance = np.array([at_h.covariance for at_h in each])
    count = case.samples * series.kept
    with np.errstate(all="ignore"):
        correlation = covariance / covariance[..., :1]
        tau_stderr = tau * np.sqrt(2 * (2 * window + 1) / count)
    references = known_laws(case, [recorder.edges for recorder in recorders])
    if (at_finest := references.at_finest).any():
        references.value[at_finest], references.error[at_finest] = (
            over["average"][-1, at_finest],
            _stderr(each[-1])[at_finest],
        )
    orders = [_order(case, references, each, f) for f in range(len(recorders[0].functions))]
    return Averages(
        functions=tuple(case.functions),
        texts=tuple(function.label for function in recorders[0].functions),
        temperature=case.temperature,
        spacing=spacing,
        kept=series.kept,
        average=over["average"],
        average_half=np.array([at_h.half for at_h in each]),
        **{name: over[name] for name in ("stderr_paths", "stderr_tau", "stderr_batches", "halves")},
        tau=spacing * tau,
        tau_stderr=spacing * tau_stderr,
        window=np.where(closed, spacing * window, np.nan),
        variance=covariance[..., 0],
        variance_stderr=np.array([at_h.variance_stderr for at_h in each]),
        reference=references.value,
        reference_stderr=references.error,
        reference_variance=references.variance,
        order=tuple(order for order, _ in orders),
        constant=np.array([constant for _, constant in orders]),
        lag=spacing * np.arange(series.lags),
        correlation=correlation,
        correlation_stderr=np.array([at_h.correlation_stderr for at_h in each]),
        cell_low=np.array([recorder.low for recorder in recorders]),
        cell_width=np.array([recorder.width for recorder in recorders]),
        **_histogram(recorders, totals, case.samples),
        density_exact=references.shares / np.array([recorder.width for recorder in recorders])[..., np.newaxis],
    )


def _stderr(estimates: _Estimates) -> Array:
    return np.where(np.isfinite(estimates.stderr_paths), estimates.stderr_paths, estimates.stderr_tau)


def _estimates(recorder: Recorder, paths: Paths, samples: int) -> _Estimates:
    """The estimates from the sums over the paths of one step size."""
    counts, kept = group_counts(samples), recorder.series.kept
    with np.errstate(all="ignore"):
        (mean, square, drift, drift_square, batches), without = mean_over_paths(paths.values, counts)
        sizes = kept - np.arange(recorder.series.lags)
        products, each_product = mean_over_paths(paths.lagged / sizes[:, np.newaxis], counts)
        ends, each_end = mean_over_paths(paths.ends / sizes[:, np.newaxis], counts)
        covariance = products - mean[:, np.newaxis] * ends + mean[:, np.newaxis] ** 2
        m = without[:, 0, :, np.newaxis]
        covariance_without = each_product - m * each_end + m**2
        covariance, correlation = of_means(covariance, samples * kept)
        enough = samples >= LEAST_PATHS
        of_mean = np.full((3, len(mean)), np.nan)
        if enough:
            of_mean[0] = np.sqrt(np.maximum(square - mean**2, 0) / (samples - 1))
        tau = np.maximum(correlation.tau, 0)
        of_mean[1] = np.sqrt(2 * tau * covariance[:, 0] / (samples * kept))
        of_mean[2] = np.sqrt(np.maximum(batches - mean**2 * BATCHES, 0) / BATCHES / (samples * BATCHES - 1))
        freedom = samples - 1 if enough else samples * kept / (2 * correlation.window + 1)
        spread = np.sqrt(np.maximum(drift_square - drift**2, 0) / (samples - 1)) if enough else 2 * of_mean[1]
        return _Estimates(
            average=mean + recorder.origins,
            without=without[:, 0] + recorder.origins,
            stderr_paths=of_mean[0],
            stderr_tau=of_mean[1],
            stderr_batches=of_mean[2],
            half=student(freedom) * of_mean[0 if enough else 1],
            halves=drift / spread,
            covariance=covariance,
            correlation=correlation,
            correlation_stderr=jackknife_stderr(
                covariance / covariance[:, :1], covariance_without / covariance_without[..., :1], counts
            ),
            variance_stderr=jackknife_stderr(covariance[:, 0], covariance_without[..., 0], counts),
        )


def _order(case: Any, references: Known, each: Sequence[_Estimates], f: int) -> tuple[Order, float]:
    """The order p of the bias of a function in the step size, and C of bias = C h^p.

    Where the reference is the mean at the smallest step size, that step size is left out.
    """
    h, none = np.array(case.steps), (Order(np.nan, np.nan, np.nan, 0), np.nan)
    own = bool(references.at_finest[f])
    if len(h) - own < 3 or not np.isfinite(references.value[f]) or case.samples < LEAST_PATHS:
        return none
    used, without = slice(0, len(h) - own), np.array([at_h.without[:, f] for at_h in each]).T
    reference = without[:, -1:] if own else references.value[f]
    bias = np.array([at_h.average[f] for at_h in each]) - references.value[f]
    error = np.hypot([_stderr(at_h)[f] for at_h in each], references.error[f])
    value, left_out = np.abs(bias[used]), np.abs((without - reference)[:, used])
    resolved = is_resolved(value, error[used])
    lacking, fit = np.ones_like(value), none[0]
    with np.errstate(all="ignore"):
        for _ in range(4 if own else 1):  # C (h^p - h_0^p) in place of C h^p
            fit = fit_order(
                h[used],
                value / lacking,
                left_out / lacking,
                group_counts(case.samples),
                resolved,
                stderr=error[used] / lacking,
            )
            if not math.isfinite(fit.order):
                return fit, np.nan
            lacking = 1 - (h[-1] / h[used]) ** max(fit.order, 0.1) if own else lacking
        weights = np.where(resolved, value / error[used], 0) ** 2
        logarithm = np.log(np.where(resolved, value / lacking / h[used] ** fit.order, 1.0))
        sign = np.sign((weights * bias[used]).sum())
        return fit, float(sign * np.exp((weights * logarithm).sum() / weights.sum()))


def _histogram(recorders: Sequence[Recorder], totals: Sequence[Paths], samples: int) -> dict[str, Array]:
    """Densities in cells and their standard errors, (S, F, cells)."""
    counts, pairs = group_counts(samples), []
    for recorder, paths in zip(recorders, totals, strict=True):
        scale = recorder.series.kept * recorder.width[:, np.newaxis]
        share, without = mean_over_paths(paths.cells[:, 1:-1] / scale[..., np.newaxis], counts)
        pairs.append((share, jackknife_stderr(share, without, counts)))
    density, stderr = (np.array(rows) for rows in zip(*pairs, strict=True))
    return {"density": density, "density_stderr": stderr}
