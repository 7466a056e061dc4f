"""Means over time: functions recorded along paths, autocorrelations and histograms, and their estimates with errors."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from spi.kinds.functions import PathFunction, evaluated, origin_of
from spi.numerics.rng import LANES, STEPS_PER_TOSS
from spi.plugins.dynamics.kinds.long_paths.paths import LongPaths
from spi.plugins.dynamics.statistics import correlation
from spi.plugins.dynamics.statistics.cells import range_of
from spi.specs.names import numbers_of
from spi.statistics import estimators
from spi.statistics.accumulators import Array, Batch, added, of_first
from spi.statistics.rounding import is_rounding, size_of_values, with_rounding
from spi.storage.records import Order, student

from .references import FunctionReferences, derived_quantity, known_laws
from .results import FEW, LEAST_PATHS, Averages, DerivedQuantities, batches_of

_MOST_LAGS = 512  # at which autocovariances are computed
_MOST_BYTES = 2**24  # of states that are recorded at a time


class RecordedPaths(LongPaths):
    """Also values of functions along the paths, until all steps are done, and then sums over them."""

    stretch: Array = of_first("function block lane stretch")  #: the last values of functions
    batches: Array = of_first("function block lane batch")  #: sums of values over the batches of time
    squares: Array = of_first("function block lane batch")  #: the same of their squares
    series: Array = of_first("function kept")  #: all values along one long path, whose bins are known at its end
    mean: Array = added("function group")  #: of the mean over time of each path
    mean_square: Array = added("function group")
    drift: Array = added("function group")  #: of the mean over the second half of the time less that over the first
    drift_square: Array = added("function group")
    batch_square: Array = added("function group")  #: of the squares of the means over batches of time
    by_batch: Array = added("function batch")  #: of means over each batch, and
    square_by_batch: Array = added("function batch")  #: of means of squares over each
    lagged: Array = added("function lag group")  #: of products of values at each lag
    ends: Array = added("function lag group")  #: of both values of all pairs at that lag
    cells: Array = added("function cell group", int)  #: values below all bins or NaN, in each, and above all


class SnapshotSeries(NamedTuple):
    """Snapshots of the paths of one step size at which functions are evaluated."""

    stride: int  #: steps from one to the next
    total: int  #: their number
    used: int  #: number of those that count, the last ones

    @classmethod
    def of(cls, case: Any, number: int) -> "SnapshotSeries":
        """Snapshots at step size number `number` of a case."""
        total = round(case.final_time / case.between)
        left = max(0, total - math.ceil(case.burnt / case.between - 1e-9))
        return cls(round(case.between / case.steps[number]), total, left // batches_of(left) * batches_of(left))

    @property
    def first(self) -> int:
        """Number of those that do not count, the first ones."""
        return self.total - self.used

    @property
    def batches(self) -> int:
        """Number of batches of time."""
        return batches_of(self.used)

    @property
    def lags(self) -> int:
        """Number of lags of autocovariances: about a tenth of `used`, a power of two, 0 and 1 at least."""
        return min(1 << max(1, math.ceil(math.log2(self.used / 10))), _MOST_LAGS)

    def piece(self, dimension: int, blocks: int) -> int:
        """Number of steps, in whole tosses, whose states may be recorded at a time for `blocks` blocks."""
        each = 8 * LANES * dimension * blocks * STEPS_PER_TOSS // self.stride + 1
        return STEPS_PER_TOSS << max(0, (_MOST_BYTES // each).bit_length() - 1)


class FunctionRecorder(NamedTuple):
    """Records F functions along the paths of one step size."""

    functions: tuple[PathFunction, ...]
    origins: Array  #: (F,) subtracted from values, so that variances do not cancel
    series: SnapshotSeries
    low: Array  #: (F,) where the first bin begins
    width: Array  #: (F,) of a bin; NaN where bins are made of all values at the end
    bins: int

    @classmethod
    def of(cls, case: Any, number: int, bins: Any = (np.nan, np.nan)) -> "FunctionRecorder":
        """Recorder at step size number `number` of a case, with `bins` (low, width), or such of all values."""
        functions = case.path_functions
        origins = np.array([origin_of(function, case.initial) for function in functions])
        low, width = (np.broadcast_to(each, len(functions)) for each in bins)
        return cls(functions, origins, SnapshotSeries.of(case, number), low, width, case.bins)

    @property
    def keeps(self) -> bool:
        """Whether all values are kept."""
        return bool(np.isnan(self.width).any())

    def with_bins_of(self, series: Array) -> "FunctionRecorder":
        """Recorder with bins around all values (F, kept), the recorder itself where it has bins."""
        if not self.keeps:
            return self
        low, width = bins_around(series + self.origins[:, np.newaxis], self.bins)
        return self._replace(low=low, width=width)

    @property
    def edges(self) -> Array:
        """(F, bins + 1) the edges of the bins."""
        return self.low[:, np.newaxis] + np.outer(self.width, np.arange(self.bins + 1))

    @property
    def lengths(self) -> dict[str, int]:
        """Lengths of the axes of the fields of :class:`RecordedPaths` about functions."""
        kept = self.series.used if self.keeps else 0
        return {"function": len(self.functions), "lag": self.series.lags, "cell": self.bins + 2, "kept": kept}

    def values(self, y: Array, n: int, lanes: int = LANES) -> Array:
        """(F, blocks, LANES, K): the functions, less their origins, of those of recorded states that count.

        The states (blocks, 1 + recorded, d * lanes) are those recorded after step n; the first has no meaning.  Those
        of one lane stand for all.
        """
        begin = 1 + max(0, self.series.first - n // self.series.stride)
        end = 1 + max(0, self.series.total - n // self.series.stride)
        states = np.moveaxis(y.reshape(*y.shape[:2], -1, lanes)[:, begin:end], 2, 0)
        values = evaluated(self.functions, states)
        values -= self.origins.reshape(-1, 1, 1, 1)
        values = np.swapaxes(values, 2, 3)
        return np.ascontiguousarray(np.broadcast_to(values, (*values.shape[:2], LANES, values.shape[3])))

    def counts_at(self, n: int) -> bool:
        """Whether a state after n steps is one of those that count."""
        number, rest = divmod(n, self.series.stride)
        return rest == 0 and self.series.first < number <= self.series.total

    def values_of(self, state: Array) -> Array:
        """(F,): the functions of a state, less their origins."""
        return evaluated(self.functions, state[:, np.newaxis])[:, 0] - self.origins

    def recorded(self, paths: RecordedPaths, values: Array, n: int, batch: Batch) -> RecordedPaths:
        """Paths of a batch, after n steps, with further values (F, blocks, LANES, K)."""
        begin: int = max(0, n // self.series.stride - self.series.first)
        count: int = values.shape[-1]
        if not count:
            return paths
        copied = {
            name: getattr(paths, name).copy()
            for name in ("stretch", "batches", "squares", "lagged", "ends", "cells", "series")
        }
        paths, lags = paths._replace(**copied), self.series.lags
        size = self.series.used // self.series.batches
        for i in range(begin // size, -(-(begin + count) // size)):
            some = values[..., max(0, i * size - begin) : (i + 1) * size - begin]
            paths.batches[..., i] += some.sum(axis=-1)
            paths.squares[..., i] += (some**2).sum(axis=-1)
        if self.keeps:
            paths.series[:, begin : begin + count] = values[:, 0, 0]
        else:
            self._count_all(paths.cells, values, batch)
        while count:
            place = begin % lags
            taken = min(count, lags - place)
            paths.stretch[..., lags + place : lags + place + taken] = values[..., :taken]
            begin, count, values = begin + taken, count - taken, values[..., taken:]
            if begin % lags == 0:
                self._correlate(paths, begin == lags, batch)
        return paths

    def _count_all(self, cells: Array, values: Array, batch: Batch) -> None:
        """Count values (F, blocks, LANES, K) in cells (F, ...)."""
        for f in range(len(values)):
            self._count(cells[f], values[f], f, batch)

    def _count(self, cells: Array, values: Array, f: int, batch: Batch) -> None:
        """Count values of a function in its cells: below all bins or NaN, in each, and above all."""
        with np.errstate(all="ignore"):
            places = values * (1 / self.width[f])
            places += 1 - (self.low[f] - self.origins[f]) / self.width[f]
            places = np.fmin(np.fmax(places, 0, out=places), self.bins + 1, out=places).astype(np.int64)
        size = self.bins + 2
        places += size * np.arange(LANES)[:, np.newaxis]
        counts = np.array([np.bincount(row.ravel(), minlength=size * LANES) for row in places])
        cells += estimators.by_group(counts.reshape(-1, LANES, size), batch)

    def _correlate(self, paths: RecordedPaths, is_first: bool, batch: Batch) -> None:
        """Add the products of a full stretch with itself and with the one before it, which it then replaces."""
        lags = self.series.lags
        for f, both in enumerate(paths.stretch):
            spectrum = estimators.by_group(correlation.lagged_products(both[..., :lags], both[..., lags:]), batch)
            paths.lagged[f] += np.moveaxis(correlation.lagged_sums(np.moveaxis(spectrum, -1, 0)), 0, -1)
            if is_first:
                paths.ends[f, 1:] -= estimators.by_group(np.cumsum(both[..., lags : 2 * lags - 1], axis=-1), batch)
        paths.stretch[..., :lags] = paths.stretch[..., lags:]
        paths.stretch[..., lags:] = 0.0

    def finished(self, paths: RecordedPaths, batch: Batch) -> dict[str, Any]:
        """The fields of :class:`RecordedPaths` with sums over groups alone, once all steps are done."""
        lags, used = self.series.lags, self.series.used
        paths = paths._replace(**{name: getattr(paths, name).copy() for name in ("stretch", "lagged", "ends", "cells")})
        if self.keeps:
            kept = np.broadcast_to(paths.series[:, np.newaxis, np.newaxis], (len(self.functions), 1, LANES, used))
            self.with_bins_of(paths.series)._count_all(paths.cells, kept, batch)
        over = used % lags
        last = paths.stretch[..., over : over + lags].copy()  # the last ones, the latest at the end
        if over:
            self._correlate(paths, False, batch)
        of_batches = paths.batches / (used // self.series.batches)
        mean = of_batches.mean(axis=-1)
        half = self.series.batches // 2
        drift = of_batches[..., half:].mean(axis=-1) - of_batches[..., :half].mean(axis=-1)
        for f in range(len(self.functions)):
            ending = np.cumsum(last[f, ..., :0:-1], axis=-1)
            paths.ends[f] += 2 * used * estimators.by_group(mean[f], batch)
            paths.ends[f, 1:] -= estimators.by_group(ending, batch)
        of_paths = {
            "mean": mean,
            "mean_square": mean**2,
            "drift": drift,
            "drift_square": drift**2,
            "batch_square": (of_batches**2).sum(axis=-1),
        }
        of_time = {"by_batch": of_batches, "square_by_batch": paths.squares / (used // self.series.batches)}
        return (
            {name: _summed(values, batch) for name, values in of_paths.items()}
            | {name: _summed(values, batch).sum(axis=-1) for name, values in of_time.items()}
            | {name: getattr(paths, name) for name in ("lagged", "ends", "cells")}
        )


def _summed(values: Array, batch: Batch) -> Array:
    """(F, ..., GROUPS): sums over groups of values (F, blocks, LANES, ...)."""
    return np.array([estimators.by_group(each, batch) for each in values])


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


def with_bins(recorders: Sequence[FunctionRecorder], totals: Sequence[RecordedPaths]) -> list[FunctionRecorder]:
    """Recorders with the bins of the sums over the paths of each step size."""
    return [recorder.with_bins_of(paths.series) for recorder, paths in zip(recorders, totals, strict=True)]


def references_of(recorders: Sequence[FunctionRecorder], case: Any) -> FunctionReferences:
    """References of the functions of a case, and of the bins of recorders."""
    return known_laws(case, [recorder.edges for recorder in recorders])


def averages(
    recorders: Sequence[FunctionRecorder], case: Any, totals: Sequence[RecordedPaths], known: Mapping[str, Any] | None
) -> Averages:
    """Record of the functions of a case, from the sums over the paths of each step size.

    The fields of `known` are those of :func:`references_of`, None where no reference takes a computation.
    """
    recorders = with_bins(recorders, totals)
    each = [_estimates(recorder, paths, case) for recorder, paths in zip(recorders, totals, strict=True)]
    fields = {name: np.array([at_h[name] for at_h in each]) for name in each[0]}
    without, average = fields.pop("without"), fields["average"]
    stderr = np.where(np.isfinite(fields["stderr_paths"]), fields["stderr_paths"], fields["stderr_tau"])
    if known is None:
        references = references_of(recorders, case)
    else:
        references = FunctionReferences(*(known[name] for name in FunctionReferences._fields))
    own, series = references.at_finest, recorders[0].series
    references = references._replace(
        value=np.where(own, average[-1], references.value), error=np.where(own, stderr[-1], references.error)
    )
    error = np.hypot(stderr, references.error)
    orders = [
        _order(case, bool(own[f]), float(references.value[f]), average[:, f], without[..., f].T, error[:, f])
        for f in range(len(case.functions))
    ]
    return Averages(
        functions=tuple(case.functions),
        texts=tuple(function.label for function in recorders[0].functions),
        temperature=case.temperature,
        spacing=case.between,
        kept=series.used,
        **fields,
        reference=references.value,
        reference_stderr=references.error,
        reference_variance=references.variance,
        quantities=_derived(recorders, case, totals) if case.derived else None,
        order=tuple(order for order, _ in orders),
        constant=np.array([constant for _, constant in orders]),
        lag=case.between * np.arange(series.lags),
        density_exact=references.shares / fields["cell_width"][..., np.newaxis],
    )


def _estimates(recorder: FunctionRecorder, paths: RecordedPaths, case: Any) -> dict[str, Array]:
    """Fields of :class:`Averages` at one step size, and ``without``, (groups, F), the averages without each group."""
    samples, used, spacing, parted = case.samples, recorder.series.used, case.between, recorder.series.batches
    counts = estimators.group_counts(samples)
    with np.errstate(all="ignore"):
        (mean, without), (square, square_without), (drift, _), (drift_square, _), (batches, _) = (
            estimators.mean_over_paths(sums, counts)
            for sums in (paths.mean, paths.mean_square, paths.drift, paths.drift_square, paths.batch_square)
        )
        sizes = (used - np.arange(recorder.series.lags))[:, np.newaxis]
        products, each_product = estimators.mean_over_paths(paths.lagged / sizes, counts)
        ends, each_end = estimators.mean_over_paths(paths.ends / sizes, counts)
        covariance = products - mean[:, np.newaxis] * ends + mean[:, np.newaxis] ** 2
        m = without[:, :, np.newaxis]
        left_out = each_product - m * each_end + m**2
        of = np.sqrt(np.maximum(covariance[:, 0], 0)), *_sizes(recorder, mean, case)
        exact = is_rounding(*of)
        independent = np.where(_are_equal(mean, without, *of[1:]) & ~exact, 1, samples)  # number of paths
        total = independent * used
        covariance, integrated = correlation.of_means(covariance, total)
        time = correlation.resolved_times(integrated, total)
        enough = independent >= LEAST_PATHS
        of_tau = np.sqrt(2 * time.least * covariance[:, 0] / total)
        of_paths = np.where(enough, np.sqrt(np.maximum(square - mean**2, 0) / (samples - 1)), np.nan)
        tails = estimators.kurtosis_of_groups(square - mean**2, square_without - without**2, counts)
        freedom = np.where(enough, samples - 1, total / (2 * integrated.window + 1))
        of_drift = np.sqrt(np.maximum(drift_square - drift**2, 0) / (samples - 1))
        spread = np.where(enough, of_drift, 2 * of_tau)
        of_batches = np.sqrt(np.maximum(batches - mean**2 * parted, 0) / parted / (independent * parted - 1))
        scale = used * recorder.width[:, np.newaxis]
        density, density_without = estimators.mean_over_paths(paths.cells[:, 1:-1] / scale[..., np.newaxis], counts)
        rho, rho_without = covariance / covariance[:, :1], left_out / left_out[..., :1]
        known = np.where(exact, np.nan, 1.0)  # what follows from how the values vary
        of_tau, of_batches = (with_rounding(each, *of) for each in (of_tau, of_batches))
        of_paths = np.where(enough, with_rounding(of_paths, *of), np.nan)
        half = student(freedom) * np.where(enough, of_paths, of_tau)
        few = ~enough & (used < FEW)  # too few values to know their autocorrelations
        half = np.where(few, np.fmax(half, student(independent * parted - 1) * of_batches), half)
        return {
            "average": mean + recorder.origins,
            "average_half": half,
            "without": without + recorder.origins,
            "stderr_paths": of_paths,
            "stderr_tau": of_tau,
            "stderr_batches": of_batches,
            "kurtosis": np.where(enough & ~exact, tails, np.nan),
            "halves": np.where(spread > 0, known * drift / spread, np.nan),
            "tau": known * spacing * time.tau,
            "tau_stderr": known * spacing * time.stderr,
            "window": np.where(integrated.closed, known * spacing * integrated.window, np.nan),
            "variance": covariance[:, 0],
            "variance_stderr": _stderr_of_variance(covariance[:, 0], left_out[..., 0], counts, paths, enough),
            "correlation": known[:, np.newaxis] * rho,
            "correlation_stderr": known[:, np.newaxis] * estimators.jackknife_stderr(rho, rho_without, counts),
            "cell_low": recorder.low,
            "cell_width": recorder.width,
            "density": density,
            "density_stderr": estimators.jackknife_stderr(density, density_without, counts),
        }


def _stderr_of_variance(variance: Array, without: Array, counts: Array, paths: RecordedPaths, enough: Array) -> Array:
    """(F,) from the leave-one-out values of the groups of paths; of few paths from those of the batches of time."""
    samples = int(counts.sum())
    (mean, without_mean), (square, without_square) = (
        _without_batches(sums, samples) for sums in (paths.by_batch, paths.square_by_batch)
    )
    of_time = estimators.jackknife_stderr(
        square - mean**2, (without_square - without_mean**2).T, np.ones(without_mean.shape[-1])
    )
    return np.where(enough, estimators.jackknife_stderr(variance, without, counts), of_time)


def _without_batches(sums: Array, samples: int) -> tuple[Array, Array]:
    """Means (F,) from sums over paths by batches of time (F, batches), and (F, batches) without each batch."""
    each = sums / samples
    return each.mean(axis=-1), (each.sum(axis=-1, keepdims=True) - each) / (each.shape[-1] - 1)


def _sizes(recorder: FunctionRecorder, mean: Array, case: Any) -> tuple[Array, int]:
    """Sizes (F,) of functions for rounding, and the steps."""
    at_start = [size_of_values(function.values, case.initial) for function in recorder.functions]
    return np.maximum(at_start, np.abs(mean + recorder.origins)), recorder.series.total * recorder.series.stride


def _are_equal(mean: Array, without: Array, size: Array, steps: int) -> Array:
    """(F,) whether means (F,) are the same without any of the groups (groups, F): paths that all tell what one does."""
    return is_rounding(np.abs(without - mean).max(axis=0), size, steps)


def _of_columns(formula: Callable[[Array, float], Array], case: Any) -> Callable[[Array], Array]:
    """A formula as a function of means (F, n)."""
    return lambda means: formula(means.T, case.temperature)


def _derived(recorders: Sequence[FunctionRecorder], case: Any, totals: Sequence[RecordedPaths]) -> DerivedQuantities:
    """Quantities that follow from means, with the jackknife over groups of paths, of few or equal ones over batches."""
    names, found = tuple(case.functions), []
    formulas = [derived_quantity(text, names, numbers_of(case)) for text in case.derived.values()]
    for recorder, paths in zip(recorders, totals, strict=True):
        counts = estimators.group_counts(case.samples)
        mean, without = estimators.mean_over_paths(paths.mean, counts)
        sizes, steps = _sizes(recorder, mean, case)
        if case.samples < LEAST_PATHS or _are_equal(mean, without, sizes, steps).all():
            mean, left_out = _without_batches(paths.by_batch, case.samples)
            counts, without = np.ones(recorder.series.batches), left_out.T
        value, left_out = (
            np.array([formula(means + recorder.origins, case.temperature) for formula in formulas])
            for means in (mean, without)
        )
        change = np.abs(left_out - value[:, np.newaxis]).max(axis=1)
        size = [size_of_values(_of_columns(each, case), mean + recorder.origins) for each in formulas]
        stderr = with_rounding(estimators.jackknife_stderr(value, left_out.T, counts), change, size, steps)
        found.append((value, np.where(change == 0, 0.0, stderr)))
    value, stderr = (np.array(each) for each in zip(*found, strict=True))
    names, texts = tuple(case.derived), tuple(case.derived.values())
    return DerivedQuantities(quantities=names, formulas=texts, value=value, stderr=stderr)


def _order(case: Any, own: bool, reference: float, average: Array, without: Array, error: Array) -> tuple[Order, float]:
    """Order p of the bias of a function in the step size, and C of bias = C h^p.

    Averages and errors are (S,), and `without` (groups, S) averages without each group.  With `own` the reference
    is the mean at the smallest step size, which is left out.
    """
    none, left = (Order(np.nan, np.nan, np.nan, 0), np.nan), len(case.steps) - own
    if left < 3 or not np.isfinite(reference) or case.samples < LEAST_PATHS:
        return none
    h, bias, error = np.array(case.steps)[:left], (average - reference)[:left], error[:left]
    value, left_out = np.abs(bias), np.abs(without - (without[:, -1:] if own else reference))[:, :left]
    resolved = estimators.is_resolved(value, error)
    lacking, fit, counts = np.ones_like(value), none[0], estimators.group_counts(case.samples)
    with np.errstate(all="ignore"):
        for _ in range(4 if own else 1):  # C (h^p - h_0^p) in place of C h^p
            fit = estimators.fit_order(h, value / lacking, left_out / lacking, counts, resolved, stderr=error / lacking)
            if not math.isfinite(fit.order):
                return fit, np.nan
            lacking = 1 - (case.steps[-1] / h) ** max(fit.order, 0.1) if own else lacking
        weights = np.where(resolved, value / error, 0) ** 2
        logarithm = np.log(np.where(resolved, value / lacking / h**fit.order, 1.0))
        sign = np.sign((weights * bias).sum())
        return fit, float(sign * np.exp((weights * logarithm).sum() / weights.sum()))
