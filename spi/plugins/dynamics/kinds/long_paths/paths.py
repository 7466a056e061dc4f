"""Sums over long paths, and the growth of the errors of their Casimir functions."""

from typing import Any

import numpy as np

from spi.statistics import estimators
from spi.statistics.accumulators import Array, Sums, added, joined, of_first, reports
from spi.statistics.rounding import is_rounding, with_rounding


class LongPaths(Sums):
    """Values of the paths of some blocks and sums over them, after `n` steps of one step size.

    Until all steps are done no path is whole, and `paths` is 0.  Then no blocks of states are left.
    """

    n: Array = of_first(dtype=int)
    wanted: Array = of_first(dtype=int)  #: paths whose values are summed up, 0 once all steps are done
    y: Array = of_first("block state")
    casimir: Array = joined("record casimir")  #: relative errors
    report: Array = reports("level")
    nonfinite: Array = added(dtype=int)  #: number of paths


_FIT_FROM = 2**12  # steps, before which rounding errors are too few to fit their growth


def casimir_errors(n: np.ndarray, casimir: np.ndarray, sizes: np.ndarray | None = None) -> dict[str, Any]:
    """Statistics over paths of the relative errors (levels, records, C, paths) of Casimirs after n (records,) steps.

    Mean, root mean square and largest errors, those of path 0, the exponent with which they grow, with its 95 %
    interval, and their bias in a step.  With `sizes` (C,), those of the Casimirs relative to themselves, errors that
    are rounding tell of no bias.
    """
    levels, _, conserved, _ = casimir.shape
    growth, low, high = (np.full((levels, conserved), np.nan) for _ in range(3))
    with np.errstate(all="ignore"):
        for i, c in np.ndindex(levels, conserved):
            growth[i, c], low[i, c], high[i, c] = _exponent(n, casimir[i, :, c])
        in_a_step = casimir[:, -1] / n[-1]
        farthest, stderr = np.abs(in_a_step).max(axis=2, initial=0.0), estimators.stderr_of_mean(in_a_step)
        exact = np.zeros_like(farthest, bool)
        if sizes is not None:
            of = sizes / n[-1], n[-1]
            exact, stderr = is_rounding(farthest, *of), with_rounding(stderr, farthest, *of)
        return {
            "casimir_mean": casimir.mean(axis=3),
            "casimir_rms": np.sqrt((casimir**2).mean(axis=3)),
            "casimir_worst": np.abs(casimir).max(axis=3, initial=0.0),
            "casimir_one": casimir[..., 0],
            "growth": growth,
            "growth_low": low,
            "growth_high": high,
            "bias": in_a_step.mean(axis=2),
            "bias_stderr": stderr,
            "rounding": np.where(exact, farthest * n[-1], np.nan) if exact.any() else None,
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
    order = estimators.fit_order(1.0 / n, value, without, np.ones(paths), use)
    return -order.order, -order.high, -order.low
