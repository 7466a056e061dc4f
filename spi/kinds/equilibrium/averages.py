"""Means over time with honest errors, autocorrelations, histograms and biases, from sums over paths."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from spi.statistics.correlation import Correlation, of_means
from spi.statistics.estimators import fit_order, group_counts, is_resolved, jackknife_stderr, mean_over_paths, student
from spi.storage.records import Order

from .recording import Paths, Recorder
from .references import Known, known_laws
from .results import BATCHES, LEAST_PATHS, Averages

# ---------------------------------------------------------------------------------------------------------------------
# Means over time with honest errors, autocorrelations, histograms and biases, from sums over paths.
# ---------------------------------------------------------------------------------------------------------------------

Array = np.ndarray


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
    references = known_laws(case, [_edges(recorder) for recorder in recorders])
    if (at_finest := references.at_finest).any():
        references.value[at_finest], references.error[at_finest] = (
            over["average"][-1, at_finest],
            _stderr(each[-1])[at_finest],
        )
    orders = [_order(case, references, each, f) for f in range(len(recorders[0].functions))]
    return Averages(
        functions=tuple(case.functions),
        texts=tuple(function.told for function in recorders[0].functions),
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


def _edges(recorder: Recorder) -> Array:
    """(F, bins + 1) the edges of the bins."""
    return recorder.low[:, np.newaxis] + np.outer(recorder.width, np.arange(recorder.bins + 1))


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
    """The order of the bias of a function in the step size, and C of bias = C h^p.

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
