"""The group of results of long times: growth and bias of errors of the Casimirs, and the law of the states."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from spi.ensemble.loop import report_columns, thread_count
from spi.exact.sphere_law import BINS, SphereLaw
from spi.kinds.plans import State
from spi.statistics.estimators import fit_order, stderr_of_mean
from spi.storage.records import Group, Variables

from .paths import Paths

if TYPE_CHECKING:
    from . import LongTimePlan

_FIT_FROM = 2**12  # steps, before which rounding errors are too few to fit their growth


def group(p: "LongTimePlan", state: State) -> Group:
    """The results of one scheme of a case, from its final state."""
    totals = [state.total(i) for i in range(len(p.case.steps))]
    casimir = np.array([of_one.casimir for of_one in totals])
    nonfinite = np.array([of_one.nonfinite for of_one in totals])
    report = np.array([of_one.report for of_one in totals])
    variables = {**_errors(casimir), **_growth(p, casimir), "nonfinite": (("h",), nonfinite)}
    variables |= {name: (("h",), values) for name, values in report_columns(report).items()}
    coordinates = {"h": np.array(p.case.steps), "n": p.records, "casimir": np.arange(casimir.shape[2])}
    if p.law:
        coordinates["variable"] = np.array(p.law.variables)
        coordinates["bin"] = np.arange(BINS)
        coordinates["moment"] = np.array(list(p.law.moments))
        variables |= _law(p.law, totals)
    return Group(
        p.case.name,
        p.part.variant,
        coordinates,
        variables,
        {
            **p.description(),
            "samples": p.samples,
            "steps_each": p.case.step_count,
            "snapshots": totals[0].snapshots,
            "panels": p.case.panels,
            "wall_seconds": state.seconds,
            "threads": thread_count(),
        },
    )


def _errors(casimir: np.ndarray) -> Variables:
    """Relative errors of the Casimirs over time, from those of each path (levels, records, C, paths)."""
    axes = ("h", "n", "casimir")
    with np.errstate(all="ignore"):
        return {
            "casimir_mean": (axes, casimir.mean(axis=3)),
            "casimir_rms": (axes, np.sqrt((casimir**2).mean(axis=3))),
            "casimir_worst": (axes, np.abs(casimir).max(axis=3, initial=0.0)),
            "casimir_one": (axes, casimir[..., 0]),
        }


def _growth(p: "LongTimePlan", casimir: np.ndarray) -> Variables:
    """The exponent with which errors of the Casimirs grow, with its 95 % interval, and their bias in a step."""
    levels, _, conserved, _ = casimir.shape
    axes = ("h", "casimir")
    growth, low, high = (np.full((levels, conserved), np.nan) for _ in range(3))
    with np.errstate(all="ignore"):
        for i, c in np.ndindex(levels, conserved):
            growth[i, c], low[i, c], high[i, c] = _exponent(p.records, casimir[i, :, c])
        in_a_step = casimir[:, -1] / p.case.step_count
        return {
            "growth": (axes, growth),
            "growth_low": (axes, low),
            "growth_high": (axes, high),
            "bias": (axes, in_a_step.mean(axis=2)),
            "bias_stderr": (axes, stderr_of_mean(in_a_step)),
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
    found = fit_order(1.0 / n, value, without, np.ones(paths), use)
    return -found.order, -found.high, -found.low


def _law(law: SphereLaw, totals: Sequence[Paths]) -> Variables:
    """Means and fractions in bins against their exact values, from the paths of each step size."""
    snapshots = max(totals[0].snapshots, 1)
    moments = np.array([of_one.moments for of_one in totals]) / snapshots
    fractions = np.array([of_one.counts for of_one in totals]) / snapshots
    below = np.cumsum(fractions, axis=2)[:, :, :-1]
    away = np.abs(below.mean(axis=3) - np.arange(1, BINS) / BINS)
    farthest = away.argmax(axis=2)[..., None]
    return {
        "mean": (("h", "moment"), moments.mean(axis=2)),
        "mean_stderr": (("h", "moment"), stderr_of_mean(moments)),
        "mean_exact": (("moment",), np.array(list(law.moments.values()))),
        "fraction": (("h", "variable", "bin"), fractions.mean(axis=3)),
        "fraction_stderr": (("h", "variable", "bin"), stderr_of_mean(fractions)),
        "law_distance": (("h", "variable"), np.take_along_axis(away, farthest, 2)[..., 0]),
        "law_distance_stderr": (("h", "variable"), np.take_along_axis(stderr_of_mean(below), farthest, 2)[..., 0]),
    }
