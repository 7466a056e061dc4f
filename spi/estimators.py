"""Means, standard errors and orders of convergence, from sums over groups of paths.

Paths fall into GROUPS groups (path p into group p mod GROUPS), of which only sums are kept, so that memory does not
grow with the number of paths.  Standard errors and intervals come from leaving out one group at a time (the jackknife),
which needs no assumption on how the errors at different step sizes depend on one another: they share their paths.
"""

from typing import NamedTuple

import numpy as np

#: Paths are summed up in this many groups.
GROUPS = 64
#: A value counts as resolved if it is at least this many standard errors.
RESOLVED = 4.0


class Order(NamedTuple):
    """A fitted order of convergence with its 95 % interval; NaN where fewer than three points are resolved."""

    order: float
    low: float
    high: float
    points: int  #: in the fit


def group_counts(samples):
    """How many of the paths 0, ..., samples - 1 each group has, shape (GROUPS,)."""
    return samples // GROUPS + (np.arange(GROUPS) < samples % GROUPS)


def root_mean_square(sums, counts):
    """Root of the mean and its leave-one-out values.

    `sums` (GROUPS, ...) are sums of squares, `counts` (GROUPS,) the numbers of paths.  Returns the root of total sum
    over total count, shape (...), and the same without each group in turn, shape (groups with paths, ...).
    """
    used = counts > 0
    sums, counts = sums[used], counts[used]
    total, n = sums.sum(axis=0), counts.sum()
    rest = (n - counts).reshape(-1, *[1] * total.ndim)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        # the difference of nearly equal sums may round to just below 0
        without = np.sqrt(np.maximum(total - sums, 0.0) / rest) if len(counts) > 1 else np.full_like(sums, np.nan)
        return np.sqrt(total / n), without


def jackknife_stderr(value, without, counts):
    """Standard error of `value` (...) from its leave-one-out values (groups, ...), for groups of unequal size.

    With weights w_g = n / n_g: sqrt(1/G sum_g (p_g - mean)^2 / (w_g - 1)) of the pseudo-values
    p_g = w_g value - (w_g - 1) without_g (Busing, Meijer and van der Leeden, Statistics and Computing 9, 1999).
    NaN for fewer than two groups; inf or NaN where a value is not finite.
    """
    counts = counts[counts > 0]
    if len(counts) < 2:
        return np.full(np.shape(value), np.nan)
    w = (counts.sum() / counts).reshape(-1, *[1] * np.ndim(value))
    with np.errstate(invalid="ignore", over="ignore"):
        pseudo = w * value - (w - 1.0) * without
        return np.sqrt(np.mean((pseudo - (pseudo / w).sum(axis=0)) ** 2 / (w - 1.0), axis=0))


def is_resolved(value, stderr):
    """Whether a value stands clear of its standard error."""
    with np.errstate(invalid="ignore"):
        return np.isfinite(value) & np.isfinite(stderr) & (value > 0.0) & (value >= RESOLVED * stderr)


def samples_needed(value, stderr, samples):
    """About how many samples would resolve a value that `samples` did not; NaN if that cannot be said."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return samples * (RESOLVED * stderr / value) ** 2


def fit_order(h, value, without, counts, use, reference_step=0.0):
    """Order p of value = C (h - h_ref)^p, by least squares in logarithms through the points `use`.

    Distances from a reference of the same scheme at step h_ref lack the reference's own error, which makes a plain
    slope over h too steep (for steps from 8 to 2048 h_ref by 0.01 for p = 1/2, by 0.02 for p = 1).  C (h - h_ref)^p is
    what is left when the two errors are independent and p = 1/2 (squares subtract), and when they are proportional
    along a path and p = 1.  The 95 % interval is Student's, from the jackknife.  `value` has shape (steps,), `without`
    (groups, steps).
    """
    n = int(np.count_nonzero(use))
    if n < 3:
        return Order(np.nan, np.nan, np.nan, n)
    from scipy.special import stdtrit  # not needed to start the program

    x = np.log(h[use] - reference_step)
    x -= x.mean()
    weights = x / (x @ x)
    slope = float(np.log(value[use]) @ weights)
    with np.errstate(divide="ignore", invalid="ignore"):
        stderr = float(jackknife_stderr(slope, np.log(without[:, use]) @ weights, counts))
    half = stderr * float(stdtrit(np.count_nonzero(counts) - 1, 0.975))
    return Order(slope, slope - half, slope + half, n)
