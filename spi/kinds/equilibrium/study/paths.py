"""The paths of a study of long times: what is kept of them, and growth, bias and law that follow."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from spi.ensemble.loop import add_reports
from spi.exact.sphere_law import BINS, SphereLaw
from spi.statistics.estimators import fit_order, stderr_of_mean

from ..results import Law


class Paths(NamedTuple):
    """What is known of the paths of some blocks, which stand along the last axes, after `n` steps of one step size.

    Until all steps are done there is nothing to say of whole paths, and `paths` is 0.
    """

    paths: int
    seconds: float  #: wall clock
    n: int
    y: np.ndarray  #: (blocks, d * LANES + memory), no blocks once all steps are done
    casimir: np.ndarray  #: (records, C, paths), relative error
    report: np.ndarray  #: (len(REPORT),)
    nonfinite: int  #: of the paths
    snapshots: int  #: how many count for the law
    moments: np.ndarray  #: (moments, paths), sums over snapshots
    counts: np.ndarray  #: (variables, bins, paths)
    stretch: np.ndarray  #: (F, blocks, LANES, 2 L) the last values of functions, until all steps are done
    batches: np.ndarray  #: (F, blocks, LANES, BATCHES) sums of values over the batches of time, until then
    values: np.ndarray  #: (COLUMNS, F, GROUPS) sums over paths
    lagged: np.ndarray  #: (F, L, GROUPS) sums of products of values at each lag
    ends: np.ndarray  #: (F, L, GROUPS) sums of both values of all pairs at that lag
    cells: np.ndarray  #: (F, bins + 2, GROUPS) int64: values below all bins or NaN, in each, and above all

    def plus(self, later: "Paths") -> "Paths":
        """These paths and some later ones, all steps done."""
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
        """With one more snapshot in the sums, of states (d, paths)."""
        counts, moments = self.counts.copy(), self.moments + law.moments_of(states)
        law.count(states, counts)
        return self._replace(moments=moments, counts=counts, snapshots=self.snapshots + 1)


OF_PATHS = ("casimir", "moments", "counts")  #: the fields in which the paths stand along the last axis
ADDED = ("values", "lagged", "ends", "cells")  #: those that are sums over paths

#: What is recorded of no functions.
NOTHING: dict[str, Any] = {
    "stretch": np.zeros((0, 0, 0, 0)),
    "batches": np.zeros((0, 0, 0, 0)),
    **{name: np.zeros((0, 0, 0)) for name in ("values", "lagged", "ends")},
    "cells": np.zeros((0, 0, 0), np.int64),
}


_FIT_FROM = 2**12  # steps, before which rounding errors are too few to fit their growth


def casimir_errors(n: np.ndarray, casimir: np.ndarray) -> dict[str, Any]:
    """What becomes of the relative errors of the Casimirs over time, from those of each path after n (records,) steps.

    The errors (levels, records, C, paths) themselves, the exponent with which they grow, with its 95 % interval, and
    their bias in a step.
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
    moments = np.array([of_one.moments for of_one in totals]) / snapshots
    fractions = np.array([of_one.counts for of_one in totals]) / snapshots
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
