"""Stability: properties of the equation that schemes preserve where steps are large or parameters extreme.

For each value of the parameter the same Brownian paths are run at all step sizes.  Of every path the study stores the
largest relative error of each Casimir and the largest |y| over all times, and the last state; from these come the
fraction of paths that stay finite, the distance from the scheme's own path at the reference step, and, where there are
test functions and the law of the equation is known without sampling, the distance of expectations from the truth.
A plan has the paths for one value; :func:`spi.storage.stored.gathered` makes one record of those of all values.
"""

import functools
import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from spi.ensemble.loop import TimeGrid, thread_count
from spi.ensemble.observer import path_observer
from spi.ensemble.protocol import casimirs, populations
from spi.ensemble.random_states import RandomState
from spi.ensemble.scheme_protocol import REPORT
from spi.exact.expectations import can_solve_equation, exact_expectations, seconds_of_equation
from spi.expressions import as_numpy, canonical
from spi.kinds.blocks import SampledPlan, lanes_of, reported
from spi.kinds.plans import PartCost, State, Task, each_scheme, reference_grid
from spi.statistics.accumulators import Array, Batch, Sums, joined, reports
from spi.statistics.estimators import stderr_of_mean
from spi.statistics.rounding import size_of_values, with_rounding
from spi.storage.stored import Description

from .results import CasimirErrors, ExpectationErrors, Stability


class PathExtremes(Sums):
    """Extremes and last states of some paths for one value of the swept parameter, path by path."""

    casimir: Array = joined("level casimir")
    square: Array = joined("level")
    smallest: Array = joined("level")
    y: Array = joined("level component")
    report: Array = reports("level")


def _expectations(functions: tuple, y: np.ndarray) -> np.ndarray:
    """Means of the test functions over the states y (levels, d, paths), and their standard errors, (levels, F)."""
    means = np.empty((2, len(y), len(functions)))
    for f, tree in enumerate(functions):
        with np.errstate(all="ignore"):
            values = np.broadcast_to(as_numpy(tree)(np.moveaxis(y, 1, 0)), y[:, 0].shape)
            means[:, :, f] = values.mean(axis=1), stderr_of_mean(values)
    return means


_MOST_SECONDS = 60.0  # of solving for true expectations, which are left out where they take longer
_ACCURACY = 1e-3  # numerical error that they may have
_TRUTH = "true expectations"  # the name of the task


@functools.lru_cache(maxsize=256, typed=True)
def _true_expectations(
    model: Any, initial: tuple[float, ...], final_time: float, functions: tuple
) -> tuple[np.ndarray, np.ndarray]:
    """E phi(y(T)) and its numerical error, (F,) each.

    Cached, because it is the same for all schemes; typed, because models of two classes may be equal tuples.
    """
    phis = [*map(as_numpy, functions)]
    return exact_expectations(model, initial, final_time, phis, _ACCURACY, most_seconds=_MOST_SECONDS)


def _law(
    names: tuple[str, ...],
    truth: np.ndarray,
    bound: np.ndarray,
    mean: np.ndarray,
    stderr: np.ndarray,
    sizes: np.ndarray,
    steps: np.ndarray,
) -> ExpectationErrors:
    """Expectations of F test functions, (levels, F), and their distances from the truth (F,) with its numerical error.

    For :mod:`spi.statistics.rounding` the `sizes` (F,) of the functions, and the `steps` (levels,).
    """
    with np.errstate(invalid="ignore"):
        away = np.abs(mean - truth)
        away = np.where(np.isfinite(truth) & np.isnan(away), np.inf, away)
    farthest = np.argmax(np.nan_to_num(away, nan=-1.0, posinf=np.inf), axis=1)[:, None]
    error = with_rounding(np.hypot(stderr, bound), away, sizes, steps[:, np.newaxis])
    return ExpectationErrors(
        names=names,
        expectation=mean,
        expectation_stderr=stderr,
        truth=truth,
        truth_bound=bound,
        distance=np.take_along_axis(away, farthest, 1)[:, 0],
        distance_stderr=np.take_along_axis(error, farthest, 1)[:, 0],
    )


parts = each_scheme


@dataclass(frozen=True, kw_only=True)
class StabilityPlan(SampledPlan):
    """Paths of one scheme at all step sizes, for one value of the swept parameter."""

    record, sums = Stability, PathExtremes

    @functools.cached_property
    def grid(self) -> TimeGrid:
        """Step sizes of the case and the reference, on the same Brownian paths."""
        return reference_grid(self.case, self.part, self.case.steps)

    @property
    def has_truth(self) -> bool:
        """Whether there are test functions, and their true expectations can be computed without a scheme."""
        if not self.case.functions or self.case.noise is not None or isinstance(self.initial, RandomState):
            return False
        return bool(can_solve_equation(self.model))

    def cost(self) -> PartCost:
        """Steps of paths, seconds of one thread at typical speed, and bytes of memory."""
        cost, values = super().cost(), math.prod(map(len, self.case.sweep.parameters.values()))
        if self.has_truth and self.part.scheme == self.case.schemes[0]:  # the other schemes have the same
            cost = cost._replace(seconds=cost.seconds + self.seconds_of_truth * thread_count())
        states = self.blocks * self.sums.bytes_of_a_block(self.lengths(0))  # kept of all values until the end
        return cost._replace(bytes=cost.bytes + states * values)

    @property
    def seconds_of_truth(self) -> float:
        """Seconds that the true expectations take, roughly."""
        end = self.case.final_time
        return float(seconds_of_equation(self.model, self.initial, end, self.phis, most_seconds=_MOST_SECONDS))

    def deciding(self, number: int | None) -> dict[str, Any]:
        """Of paths without the test functions, which are functions of the last states."""
        deciding = super().deciding(number)
        return deciding if number is None else deciding | {"functions": None}

    def lengths(self, number: int) -> dict[str, int]:
        conserved = len(casimirs(self.model, self.initial))
        return {"level": len(self.steps), "casimir": conserved, "component": len(self.initial)}

    def observe(self, batch: Batch) -> dict[str, Array]:
        """Contributions of a batch."""
        observer = path_observer(self.model, self.initial, self.grid, batch.blocks, sizes=True)
        states, report = self.integrated(batch, observer)
        extremes = observer.extremes
        watched = {"casimir": extremes[:, :, :-2], "square": extremes[:, :, -2], "smallest": extremes[:, :, -1]}
        return watched | {"y": lanes_of(states, len(self.initial)), "report": report}

    def tasks(self, state: State) -> list[Task]:
        """True expectations."""
        return [Task(_TRUTH, self._truth)] if self.has_truth else []

    def _truth(self) -> dict[str, Any]:
        value, bound = _true_expectations(self.model, self.initial, self.case.final_time, self.case.expressions)
        return {"value": value, "bound": bound}

    def description(self) -> Description:
        """Description, with the name of the scheme alone for a variant: its eps may be the swept parameter."""
        return replace(super().description(), variant=self.part.scheme)

    def results(self, state: State) -> Stability:
        """Results for the value, all arrays without its axis."""
        case, paths, n = self.case, state.total(), self.samples
        ((word, value),) = case.sweep.places.items()
        first = np.abs(self.initial_casimirs(0, self.blocks))[:, :n]
        scale = np.where(first > 0, first, 1.0)
        size = np.array([math.hypot(*y) for y in self.initial_states(0, self.blocks).T.tolist()[:n]])
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            worse = np.nan_to_num(paths.casimir[:-1] / scale, nan=np.inf, posinf=np.inf)
            median = np.median(worse, axis=2) if worse.size else worse.max(axis=2, initial=0.0)
            norm = np.nan_to_num(np.sqrt(paths.square[:-1]), nan=np.inf, posinf=np.inf)
            y, reference = paths.y[:-1], paths.y[-1:]
            squares = np.nan_to_num((((y - reference) / size) ** 2).sum(axis=1), nan=np.inf, posinf=np.inf)
            error = np.sqrt(squares.mean(axis=1))
            stderr = stderr_of_mean(squares) / (2 * error)
        fields = self.whole(state) | reported(paths.report[:-1])
        fields |= {
            "values": value,
            "h": np.array(case.steps),
            "word": word,
            "functions": tuple(map(canonical, case.expressions)),
            "finite": np.isfinite(y).all(axis=1).mean(axis=1),
            "largest_norm": norm.max(axis=1),
            "error": error,
            "error_stderr": with_rounding(np.where((error == 0.0) & (n > 1), 0.0, stderr), error, 1.0, self.steps[-1]),
        }
        if populations(self.model):
            fields["positive"] = (paths.smallest[:-1] > 0.0).mean(axis=1)
        if worse.shape[1]:
            fields["casimirs"] = CasimirErrors(worst=worse.max(axis=2), median=median)
        if self.row.composition is not None:  # its flows may rotate
            fields["largest_angle"] = paths.report[:-1, REPORT.index("largest_angle")]
        if case.functions:
            sizes = np.array([size_of_values(as_numpy(tree), self.initial) for tree in case.expressions])
            mean, mean_stderr = _expectations(case.expressions, y)
            unknown = np.full(len(sizes), np.nan)
            truth = state.answers.get(_TRUTH, {"value": unknown, "bound": unknown})
            names, known = tuple(case.functions), (truth["value"], truth["bound"])
            fields["law"] = _law(names, *known, mean, mean_stderr, sizes, self.steps[:-1])
        return Stability(**fields)


plan = StabilityPlan.of
