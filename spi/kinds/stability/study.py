"""Stability: properties of the equation that schemes preserve where steps are large or parameters extreme.

For each value of the parameter the same Brownian paths are run at all step sizes.  Of every path the study stores the
largest relative error of each Casimir and the largest |y| over all times, and the last state; from these come the
fraction of paths that stay finite, the distance from the scheme's own path at the reference step, and, where there are
test functions and the law of the equation is known without sampling, the distance of expectations from the truth.
"""

import functools
import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from spi.ensemble.loop import Grid, thread_count
from spi.ensemble.observer import path_observer
from spi.ensemble.protocol import casimirs, dimension, populations
from spi.ensemble.random_states import RandomState
from spi.ensemble.scheme_protocol import REPORT
from spi.exact.kolmogorov import SOLVING, can_solve_equation, exact_expectations, seconds_of_equation
from spi.exact.work import work
from spi.expressions import as_numpy, canonical, functions_of
from spi.kinds.blocks import BlocksPlan, lanes_of, reported
from spi.kinds.plans import Cost, Done, KernelCall, Plan, State, reference_grid
from spi.schemes import typical_ns
from spi.statistics.accumulators import Array, Sums, joined, reports
from spi.statistics.estimators import stderr_of_mean
from spi.statistics.tallies import Chunk, PathSet
from spi.storage.records import Part
from spi.storage.stored import Description

from .results import CasimirErrors, Law, Stability

# ---------------------------------------------------------------------------------------------------------------------
# The paths of a stability study for one value of the swept parameter: extremes along them, and their summary.
# ---------------------------------------------------------------------------------------------------------------------


class Paths(Sums):
    """Extremes and last states of some paths for one value of the swept parameter, path by path."""

    casimir: Array = joined("level casimir")
    square: Array = joined("level")
    smallest: Array = joined("level")
    y: Array = joined("level component")
    report: Array = reports("level")


@dataclass(frozen=True, kw_only=True)
class ValuePlan(BlocksPlan):
    """The paths of one scheme for one value of the swept parameter."""

    sums = Paths

    @functools.cached_property
    def grid(self) -> Grid:
        """The step sizes of the case and the reference, on the same Brownian paths."""
        return reference_grid(self.case, self.part, self.case.steps)

    def deciding(self, number: int | None) -> dict[str, Any]:
        """Neither other values, nor the test functions, which are functions of the last states."""
        without = ("sweep", "functions")
        return {key: value for key, value in super().deciding(number).items() if key not in without}

    def lengths(self, number: int) -> dict[str, int]:
        """The lengths of the axes of the sums."""
        conserved = len(casimirs(self.model, self.initial))
        return {"level": len(self.steps), "casimir": conserved, "component": len(self.initial)}

    def observe(self, number: int, first: int, blocks: int, end: int) -> dict[str, Array]:
        """The contributions of some blocks."""
        observer = path_observer(self.model, self.initial, self.grid, blocks, sizes=True)
        states, report = self.integrated(first, blocks, end, observer)
        extremes = observer.extremes
        watched = {"casimir": extremes[:, :, :-2], "square": extremes[:, :, -2], "smallest": extremes[:, :, -1]}
        return watched | {"y": lanes_of(states, len(self.initial)), "report": report}

    def summary(self, paths: Paths) -> dict[str, np.ndarray]:
        """Statistics over all paths: by the name of a quantity its values at each step (S, ...)."""
        n, first = self.samples, np.abs(self.initial_casimirs(0, self.blocks))[:, : self.samples]
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
        expectation, expectation_stderr = _expectations(self.case.expressions, y)
        return {
            "finite": np.isfinite(y).all(axis=1).mean(axis=1),
            "casimir_worst": worse.max(axis=2, initial=0.0),
            "casimir_median": median,
            "largest_norm": norm.max(axis=1),
            "positive": (paths.smallest[:-1] > 0.0).mean(axis=1),
            "error": error,
            "error_stderr": np.where((error == 0.0) & (n > 1), 0.0, stderr),
            "expectation": expectation,
            "expectation_stderr": expectation_stderr,
            "report": paths.report[:-1],
        }


def _expectations(functions: tuple, y: np.ndarray) -> np.ndarray:
    """Means of the test functions over the states y (levels, d, paths), and their standard errors, (levels, F)."""
    means = np.empty((2, len(y), len(functions)))
    for f, tree in enumerate(functions):
        with np.errstate(all="ignore"):
            values = np.broadcast_to(as_numpy(tree)(np.moveaxis(y, 1, 0)), y[:, 0].shape)
            means[:, :, f] = values.mean(axis=1), stderr_of_mean(values)
    return means


_PER_POINT = ("finite", "largest_norm", "error", "error_stderr")
_MOST_SECONDS = 60.0  # of solving for true expectations, which are left out where they take longer
_ACCURACY = 1e-3  # numerical error that they may have


@functools.lru_cache(maxsize=256, typed=True)
def _true_expectations(
    model: Any, initial: tuple[float, ...], final_time: float, functions: tuple[str, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """E phi(y(T)) and its numerical error, (F,) each.

    Cached, because it is the same for all schemes; typed, because models of two classes may be equal tuples.
    """
    phis = functions_of(functions, dimension(model))
    return exact_expectations(model, initial, final_time, phis, _ACCURACY, most_seconds=_MOST_SECONDS)


class Truth(NamedTuple):
    """True expectations of F test functions for each value."""

    seconds: float  #: wall clock
    truth: np.ndarray  #: (values, F), NaN until they are computed
    truth_bound: np.ndarray  #: (values, F), their numerical error

    def law(self, names: tuple[str, ...], mean: np.ndarray, stderr: np.ndarray) -> Law:
        """Expectations of the test functions, (values, levels, F), and their distances from the truth."""
        truth, bound = self.truth, self.truth_bound
        with np.errstate(invalid="ignore"):
            away = np.abs(mean - truth[:, None])
            away = np.where(np.isfinite(truth)[:, None] & np.isnan(away), np.inf, away)
        farthest = np.argmax(np.nan_to_num(away, nan=-1.0, posinf=np.inf), axis=2)[..., None]
        doubt = np.hypot(stderr, bound[:, None])
        return Law(
            names=names,
            expectation=mean,
            expectation_stderr=stderr,
            truth=truth,
            truth_bound=bound,
            distance=np.take_along_axis(away, farthest, 2)[..., 0],
            distance_stderr=np.take_along_axis(doubt, farthest, 2)[..., 0],
        )


def parts(case: Any) -> list[Part]:
    """The parts of a case: each scheme, of which eps may be the swept parameter."""
    return [Part(scheme) for scheme in case.schemes]


def plan(case: Any, part: Part) -> "StabilityPlan":
    """The plan for one scheme of a case."""
    multiscale = case.row(part.scheme).multiscale
    cases = case.sweep.cases  # one for each value
    points = [ValuePlan.of(each, Part(part.scheme, eps=each.eps[0] if multiscale else None)) for each in cases]
    return StabilityPlan(case=case, part=part, points=tuple(points))


@dataclass(frozen=True, kw_only=True)
class StabilityPlan(Plan):
    """One scheme at all step sizes for all values of the swept parameter; the case has the first value itself."""

    record = Stability

    points: tuple[ValuePlan, ...]  #: the paths for each value; only models, initial states and eps differ

    @property
    def first(self) -> ValuePlan:
        """The paths for the first value; step sizes and samples are the same for all values."""
        return self.points[0]

    @property
    def has_truth(self) -> bool:
        """Whether there are test functions, and their true expectations can be computed without a scheme."""
        if not self.case.functions or self.case.noise is not None or isinstance(self.initial, RandomState):
            return False
        return bool(can_solve_equation(self.model))

    def cost(self) -> Cost:
        """Steps of paths, seconds of one thread at typical speed, and bytes of memory."""
        steps = int(self.first.steps.sum()) * self.first.samples * len(self.points)
        seconds = steps * 1e-9 * typical_ns(self.first.row, self.model)
        if self.has_truth and self.part.scheme == self.case.schemes[0]:  # the other schemes have the same
            each = {(point.model, point.initial): point for point in self.points}.values()
            seconds += sum(map(self._seconds_of_truth, each)) * thread_count()
        of_a_path = len(self.first.steps) * (len(casimirs(self.model, self.initial)) + 2 + len(self.initial))
        return Cost(steps, seconds, 8 * of_a_path * self.first.samples * len(self.points))

    def _seconds_of_truth(self, point: ValuePlan) -> float:
        """The seconds that the true expectations for a value take, roughly."""
        phis, end = functions_of(map(canonical, self.case.expressions), dimension(point.model)), self.case.final_time
        return float(seconds_of_equation(point.model, point.initial, end, phis, most_seconds=_MOST_SECONDS))

    def deciding(self, number: int | None) -> dict[str, Any]:
        """See :meth:`Plan.deciding`; path set `number` has the paths for that value."""
        return super().deciding(None) if number is None else self.points[number].deciding(0)

    def initial_extra(self) -> Truth:
        """No expectation has been computed."""
        nothing = np.full((len(self.points), len(self.case.functions)), np.nan)
        return Truth(0.0, nothing, nothing)

    def path_sets(self, extra: Truth) -> Sequence[PathSet]:
        """All paths for each value."""
        return tuple(path_set for point in self.points for path_set in point.path_sets(extra))

    def empty(self, number: int) -> Paths:
        """No paths for a value."""
        return self.points[number].empty(0)

    def kernel_calls(self) -> list[KernelCall]:
        """One step of one block for each value."""
        return [call for point in self.points for call in point.kernel_calls()]

    def advance(self, chunks: Sequence[Chunk], started: Paths | None) -> Iterator[list[tuple[Chunk, Paths]]]:
        """Compute consecutive chunks of one value, see :class:`~spi.kinds.plans.Plan`."""
        return self.points[chunks[0].path_set].advance(chunks, started)

    def finalise(self, state: State) -> Iterator[Truth]:
        """Compute the true expectations for each value."""
        extra, functions = state.extra, tuple(map(canonical, self.case.expressions))
        left = np.flatnonzero(np.isnan(extra.truth).any(axis=1)) if self.has_truth else ()
        seconds = [self._seconds_of_truth(self.points[i]) for i in left]
        for n, i in enumerate(left):
            began, truth, bound = time.perf_counter(), extra.truth.copy(), extra.truth_bound.copy()
            model, initial = self.points[i].model, self.points[i].initial
            with work(SOLVING, sum(seconds[n:]), sum(seconds[:n])):
                truth[i], bound[i] = _true_expectations(model, initial, self.case.final_time, functions)
            extra = Truth(extra.seconds + time.perf_counter() - began, truth, bound)
            yield extra

    def progress(self, state: State) -> Done:
        """Paths done of all values, all of them, and no standard error."""
        done = sum(state.tally(i).paths for i in range(len(self.points)))
        return Done(done, len(self.points) * self.first.samples, float("nan"))

    def description(self) -> Description:
        """The description, without the facts that differ from value to value of the swept parameter."""
        first, *others = (point.description() for point in self.points)
        differing = {
            name: None
            for name in (field.name for field in first.described)
            if any(getattr(other, name) != getattr(first, name) for other in others)
        }
        alike = [item for item in first.parameters.items() if all(item in o.parameters.items() for o in others)]
        own = {"case": self.case.name, "variant": self.part.variant, "parameters": dict(alike)}
        return replace(
            first, **differing | own | {"truncate_noise": first.truncate_noise and "truncate_noise" not in differing}
        )

    def results(self, state: State) -> Stability:
        """The results of one scheme of a case, from its final state."""
        case, each = self.case, [point.summary(state.total(i)) for i, point in enumerate(self.points)]
        of = {name: np.array([summary[name] for summary in each]) for name in each[0]}
        fields = self.whole(state) | {name: of[name] for name in _PER_POINT} | reported(of["report"])
        fields |= {"values": np.array(case.sweep.values), "h": np.array(case.steps), "word": case.sweep.word}
        fields["functions"] = tuple(map(canonical, case.expressions))
        if populations(self.model):
            fields["positive"] = of["positive"]
        if of["casimir_worst"].shape[-1]:
            fields["casimirs"] = CasimirErrors(worst=of["casimir_worst"], median=of["casimir_median"])
        if self.first.row.composition is not None:  # its flows may rotate
            fields["largest_angle"] = of["report"][..., REPORT.index("largest_angle")]
        if case.functions:
            fields["law"] = state.extra.law(tuple(case.functions), of["expectation"], of["expectation_stderr"])
        return Stability(**fields)
