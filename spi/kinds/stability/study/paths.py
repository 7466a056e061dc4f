"""The paths of a stability study: what is watched along them, and its summary for each value of the swept word."""

import math
import time
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from spi.ensemble import FinalStates, add_reports, empty_report, integrate, watch_casimirs
from spi.estimators import stderr_of_mean
from spi.expressions import as_numpy
from spi.fields import dot, scaled
from spi.kinds.plans import PathsPlan
from spi.lanes import load_lane
from spi.protocol import casimirs, observe, populations
from spi.rng import LANES

if TYPE_CHECKING:
    from . import StabilityPlan


class Extremes(NamedTuple):
    """What one batch of blocks meets; the reference, level 0, has nothing but its last states."""

    casimir: np.ndarray  #: (blocks, levels, C, LANES), the largest |C_c(y) - C_c(y_0)|
    square: np.ndarray  #: (blocks, levels, LANES), the largest |y|^2 / |y_0|^2
    least: np.ndarray  #: (blocks, levels, LANES), of populations the smallest component
    last: FinalStates
    initial_casimirs: tuple
    inverse: float  #: 1 / |y_0|

    def observe(observer, model, row, paths, level, n, y, reference):
        if level > 0:
            watch_casimirs(model, observer.casimir[row, level], observer.initial_casimirs, y)
            square, least = observer.square[row, level], observer.least[row, level]
            for lane in range(LANES):
                state = scaled(load_lane(model, y, lane), observer.inverse)
                size = dot(state, state)
                if not size <= square[lane]:
                    square[lane] = size
            if populations(model):
                for lane in range(LANES):
                    smallest = min(load_lane(model, y, lane))
                    if not smallest >= least[lane]:
                        least[lane] = smallest
        observe(observer.last, model, row, paths, level, n, y, reference)


class State(NamedTuple):
    """The first `done` values, and of the next one the first `blocks` blocks."""

    done: int
    blocks: int
    seconds: float
    casimir: np.ndarray  #: (levels, C, paths) of the value at hand, as the next three
    square: np.ndarray  #: (levels, paths)
    least: np.ndarray  #: (levels, paths)
    y: np.ndarray  #: (levels, d, paths)
    report: np.ndarray  #: (values, levels, columns)
    finite: np.ndarray  #: (values, levels - 1), from here on of all values; fraction of the paths
    casimir_worst: np.ndarray  #: (values, levels - 1, C), relative
    casimir_median: np.ndarray  #: (values, levels - 1, C)
    largest_norm: np.ndarray  #: (values, levels - 1), relative to |y_0|
    positive: np.ndarray  #: (values, levels - 1), fraction of the paths
    error: np.ndarray  #: (values, levels - 1), relative to |y_0|
    error_stderr: np.ndarray  #: (values, levels - 1)
    expectation: np.ndarray  #: (values, levels - 1, F), of the test functions
    expectation_stderr: np.ndarray  #: (values, levels - 1, F)
    truth: np.ndarray  #: (values, F), true expectations, NaN until they are known
    truth_bound: np.ndarray  #: (values, F), their numerical error


def paths_of_a_value(p: "StabilityPlan") -> dict[str, Any]:
    """The arrays of the value at hand before its first block, by name."""
    model, initial = p.first.model, p.first.initial
    paths = p.first.blocks * LANES
    return {
        "casimir": np.zeros((p.levels, len(casimirs(model, initial)), paths)),
        "square": np.zeros((p.levels, paths)),
        "least": np.full((p.levels, paths), np.inf),
        "y": np.zeros((p.levels, len(initial), paths)),
    }


def extremes_of(point: PathsPlan, rows: int) -> Extremes:
    """Empty extremes for `rows` blocks of the paths of `point`."""
    levels, known = len(point.steps), casimirs(point.model, point.initial)
    return Extremes(
        casimir=np.zeros((rows, levels, len(known), LANES)),
        square=np.zeros((rows, levels, LANES)),
        least=np.full((rows, levels, LANES), np.inf),
        last=FinalStates(np.empty((rows, levels, len(point.initial) * LANES)), point.steps),
        initial_casimirs=known,
        inverse=1.0 / math.hypot(*point.initial),
    )


def advance_state(p: "StabilityPlan", state: State, blocks: int) -> State:
    """The state after the next `blocks` blocks of the value at hand."""
    began = time.perf_counter()
    point = p.points[state.done]
    found, report = extremes_of(point, blocks), empty_report(blocks, p.levels)
    what = point.scheme, point.model, point.initial, point.grid, point.stream
    integrate(*what, found, report, state.blocks, blocks, point.samples)
    at = slice(state.blocks * LANES, (state.blocks + blocks) * LANES)
    state = state._replace(
        blocks=state.blocks + blocks,
        casimir=_put(state.casimir, at, found.casimir),
        square=_put(state.square, at, found.square),
        least=_put(state.least, at, found.least),
        y=_put(state.y, at, found.last.y.reshape(blocks, p.levels, -1, LANES)),
        report=_set(state.report, state.done, add_reports(state.report[state.done], report)),
    )
    if state.blocks == point.blocks:
        told = summary(point, p.functions, state)
        new: dict[str, Any] = {name: _set(getattr(state, name), state.done, value) for name, value in told.items()}
        state = state._replace(done=state.done + 1, blocks=0, **paths_of_a_value(p), **new)
    return state._replace(seconds=state.seconds + time.perf_counter() - began)


def _put(kept: np.ndarray, at: slice, found: np.ndarray) -> np.ndarray:
    """`kept` (..., paths) with the paths `at` from `found` (blocks, ..., LANES)."""
    kept = kept.copy()
    kept[..., at] = np.moveaxis(found, 0, -2).reshape(*kept.shape[:-1], at.stop - at.start)
    return kept


def _set(kept: np.ndarray, i: int, value: Any) -> np.ndarray:
    """`kept` with another row i."""
    kept = kept.copy()
    kept[i] = value
    return kept


def summary(point: PathsPlan, functions: tuple, state: State) -> dict[str, np.ndarray]:
    """What the paths of the value at hand, `point`, tell: by the name of a field its row (levels - 1, ...)."""
    n, size = point.samples, math.hypot(*point.initial)
    known = np.abs(casimirs(point.model, point.initial))
    scale = np.where(known > 0, known, 1.0).reshape(1, -1, 1) if len(known) else 1.0
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        worse = np.nan_to_num(state.casimir[1:, :, :n] / scale, nan=np.inf, posinf=np.inf)
        median = np.median(worse, axis=2) if worse.size else worse.max(axis=2, initial=0.0)
        norm = np.nan_to_num(np.sqrt(state.square[1:, :n]), nan=np.inf, posinf=np.inf)
        y, reference = state.y[1:, :, :n], state.y[:1, :, :n]
        squares = np.nan_to_num((((y - reference) / size) ** 2).sum(axis=1), nan=np.inf, posinf=np.inf)
        mean = squares.mean(axis=1)
        error = np.sqrt(mean)
        stderr = stderr_of_mean(squares) / (2 * error)
    expectation, expectation_stderr = _expectations(functions, y)
    return {
        "finite": np.isfinite(y).all(axis=1).mean(axis=1),
        "casimir_worst": worse.max(axis=2, initial=0.0),
        "casimir_median": median,
        "largest_norm": norm.max(axis=1),
        "positive": (state.least[1:, :n] > 0.0).mean(axis=1),
        "error": error,
        "error_stderr": np.where((error == 0.0) & (n > 1), 0.0, stderr),
        "expectation": expectation,
        "expectation_stderr": expectation_stderr,
    }


def _expectations(functions: tuple, y: np.ndarray) -> np.ndarray:
    """Means of the test functions over the states y (levels, d, paths), and their standard errors, (levels, F)."""
    found = np.empty((2, len(y), len(functions)))
    for f, tree in enumerate(functions):
        with np.errstate(all="ignore"):
            values = np.broadcast_to(as_numpy(tree)(np.moveaxis(y, 1, 0)), y[:, 0].shape)
            found[:, :, f] = values.mean(axis=1), stderr_of_mean(values)
    return found
