"""Autocorrelations of stationary series, and the errors of means that follow from them.

The integrated autocorrelation time is tau = 1/2 + sum_(l >= 1) rho(l), so that a mean of n values has the variance
2 tau sigma^2 / n.  The sum ends at Sokal's window, the first W >= 5 with W >= 5 tau(W) (Madras and Sokal, J. Stat.
Phys. 50, 1988).
"""

from typing import NamedTuple

import numpy as np

from spi.numerics.types import Array
from spi.storage.records import INTERVAL

#: The window is at least this many tau long, and this many values: the latter matters where correlations change sign.
WINDOW = 5


def lagged_products(earlier: Array, later: Array) -> Array:
    """Spectrum (..., L + 1) which, added up over paths, :func:`lagged_sums` turns into sums of products.

    `earlier` and `later` (..., L) are a stretch of a series and the next one.
    """
    from scipy.fft import rfft  # not needed to start the program

    size = 2 * later.shape[-1]
    before, now = rfft(earlier, size), rfft(later, size)
    shifted = now * (1 - 2 * (np.arange(now.shape[-1]) % 2))  # by half of the size
    return np.conj(now) * (before + shifted)


def lagged_sums(spectrum: Array) -> Array:
    """(..., L): sums over t of x_t x_(t-l) for l = 0, ..., L - 1 with t in the later stretch."""
    from scipy.fft import irfft

    lags = spectrum.shape[-1] - 1
    return np.asarray(irfft(spectrum, 2 * lags))[..., lags - np.arange(lags)]


class Correlation(NamedTuple):
    """Integrated autocorrelation times of some series, (...), in values."""

    tau: Array
    window: Array  #: W
    closed: Array  #: whether W >= 5 tau(W) holds for a W within the lags


def integrated(covariance: Array) -> Correlation:
    """Integrated autocorrelation times from autocovariances (..., L) at lags 0, ..., L - 1."""
    with np.errstate(all="ignore"):
        each = 0.5 + np.cumsum(covariance[..., 1:] / covariance[..., :1], axis=-1)
    wide = np.arange(1, covariance.shape[-1]) >= WINDOW * np.maximum(each, 1)  # false for NaN
    closed = np.asarray(wide.any(axis=-1))
    place = np.where(closed, wide.argmax(axis=-1), wide.shape[-1] - 1)
    return Correlation(np.take_along_axis(each, place[..., np.newaxis], -1)[..., 0], place + 1, closed)


def of_means(covariance: Array, count: Array | int) -> tuple[Array, Correlation]:
    """Unbiased autocovariances (..., L), and their integrated times, from deviations from a mean over `count` values.

    These deviations make the covariances too small by the variance of the mean, which is added (Wolff, Comput. Phys.
    Commun. 156, 2004).
    """
    biased = integrated(covariance)
    lacking = 2 * np.maximum(biased.tau, 0) * covariance[..., 0] / count
    covariance = covariance + np.where(np.isfinite(lacking), lacking, 0.0)[..., np.newaxis]
    return covariance, integrated(covariance)


class CorrelationTimes(NamedTuple):
    """Integrated autocorrelation times of some series, (...), in values."""

    tau: Array  #: not below 0
    stderr: Array  #: that of independent values at least
    least: Array  #: for errors of means: 1/2, as of independent values, where few values do not tell that it is less


def resolved_times(correlation: Correlation, count: Array | int) -> CorrelationTimes:
    """Times of correlations that were estimated from `count` values, with what these tell of them.

    A time below 1/2 is that of values that tend to alternate, or an accident of few values, which may make it negative.
    """
    spread = np.sqrt(2 * (2 * correlation.window + 1) / count)
    stderr = spread * np.maximum(correlation.tau, 0.5)
    lost = ~(correlation.tau > INTERVAL * stderr)  # true for NaN
    return CorrelationTimes(
        tau=np.maximum(correlation.tau, 0.0),
        stderr=stderr,
        least=np.where(lost, np.maximum(correlation.tau, 0.5), correlation.tau),
    )
