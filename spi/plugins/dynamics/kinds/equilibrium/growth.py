"""The paths of a study of long times: sums over them, the growth of errors of Casimirs, and the law of the states."""

from collections.abc import Sequence
from typing import Any, Self

import numpy as np

from spi.plugins.dynamics.exact.sphere_law import BINS, SphereLaw
from spi.statistics import estimators
from spi.statistics.accumulators import Array, Sums, added, joined, of_first, reports
from spi.statistics.rounding import is_rounding, with_rounding

from .results import Law


class Paths(Sums):
    """Values of the paths of some blocks and sums over them, after `n` steps of one step size.

    Until all steps are done no path is whole, and `paths` is 0.  Then no blocks of states are left.
    """

    n: Array = of_first(dtype=int)
    wanted: Array = of_first(dtype=int)  #: paths whose values are summed up, 0 once all steps are done
    y: Array = of_first("block state")
    casimir: Array = joined("record casimir")  #: relative errors
    report: Array = reports("level")
    nonfinite: Array = added(dtype=int)  #: number of paths
    snapshots: Array = of_first(dtype=int)  #: number that counts for the law
    moments: Array = joined("moment")  #: sums over snapshots
    counts: Array = joined("variable bin")
    stretch: Array = of_first("function block lane stretch")  #: the last values of functions
    batches: Array = of_first("function block lane batch")  #: sums of values over the batches of time
    squares: Array = of_first("function block lane batch")  #: the same of their squares
    series: Array = of_first("function kept")  #: all values along one long path, whose bins are known at its end
    values: Array = added("column function group")  #: sums over paths, see :data:`COLUMNS`
    by_batch: Array = added("function power batch")  #: sums over paths of means over each batch, and of squares
    lagged: Array = added("function lag group")  #: sums of products of values at each lag
    ends: Array = added("function lag group")  #: sums of both values of all pairs at that lag
    cells: Array = added("function cell group", int)  #: values below all bins or NaN, in each, and above all

    def counted(self, law: SphereLaw, states: np.ndarray) -> Self:
        """The record with one more snapshot, of states (d, paths), in the sums."""
        counts, moments = self.counts.copy(), self.moments + law.moments_of(states)
        law.count(states, counts)
        return self._replace(moments=moments, counts=counts, snapshots=self.snapshots + 1)


OF_PATHS = ("casimir", "moments", "counts")  #: the fields in which the paths stand along the last axis


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
        mean_stderr=estimators.stderr_of_mean(moments),
        mean_exact=np.array(list(law.moments.values())),
        fraction=fractions.mean(axis=3),
        fraction_stderr=estimators.stderr_of_mean(fractions),
        distance=np.take_along_axis(away, farthest, 2)[..., 0],
        distance_stderr=np.take_along_axis(estimators.stderr_of_mean(below), farthest, 2)[..., 0],
    )
