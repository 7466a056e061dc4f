"""Fits to correlations in time, in closed form: rates per lag, exact for functions of the fitted form.

Both are smooth functions of the covariances, so that a jackknife gives their errors and takes away their bias of first
order in 1/paths.
"""

import numpy as np

from spi.numerics.types import Array

#: What may be fitted, with the function of t.
FITS = {"decay": "A exp(-rate t)", "oscillation": "exp(-rate t) (A cos(frequency t) + B sin(frequency t))"}


def decay(c: Array) -> Array:
    """(..., 1, F) the rate of covariances (..., F, lags).

    With the fall from the first value to the last, and the integral between them by the trapezoidal rule, their ratio
    is 2 tanh(rate / 2).  NaN where no rate has it.
    """
    fall, area = c[..., 0] - c[..., -1], (c[..., 1:] + c[..., :-1]).sum(axis=-1) / 2
    with np.errstate(all="ignore"):
        return 2.0 * np.arctanh(fall / area / 2)[..., np.newaxis, :]


def oscillation(c: Array, peaks: Array) -> Array:
    """(..., 2, F) the rates and angular frequencies of covariances (..., F, lags), by linear prediction.

    C(t + 2 s) = p C(t + s) - q C(t) by least squares, with p = 2 exp(-rate s) cos(frequency s), q = exp(-2 rate s),
    and s near a quarter of a period by the places `peaks` (F,) of the largest values of spectra.  NaN where nothing
    oscillates.
    """
    lags = c.shape[-1] - 1
    return np.stack(
        [_predicted(c[..., f, :], max(1, lags // (2 * max(peak, 2)))) for f, peak in enumerate(peaks)], axis=-1
    )


def _predicted(c: Array, s: int) -> Array:
    """(..., 2) the rate and the frequency of covariances (..., lags), from values s lags apart."""

    def dot(a: Array, b: Array) -> Array:
        return (a * b).sum(axis=-1)

    now, later, last = c[..., : -2 * s], c[..., s:-s], c[..., 2 * s :]
    with np.errstate(all="ignore"):
        determinant = dot(later, later) * dot(now, now) - dot(later, now) ** 2
        p = (dot(last, later) * dot(now, now) - dot(last, now) * dot(later, now)) / determinant
        q = (dot(last, later) * dot(later, now) - dot(last, now) * dot(later, later)) / determinant
        return np.stack([-np.log(q) / 2, np.arccos(p / np.sqrt(q) / 2)], axis=-1) / s
