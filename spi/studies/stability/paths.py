"""The paths of a stability study: what is watched along them, and its summary for each value of the swept word."""

import math
import time
from functools import partial
from typing import NamedTuple

import numpy as np

from ...dispatch import constant, means, record_class
from ...ensemble import FinalStates, Grid, Noise, add_reports, empty_report, in_batches, integrate, watch_casimirs
from ...estimators import stderr_of_mean
from ...expressions import as_numpy
from ...fields import dot, scaled
from ...lanes import load
from ...protocol import REPORT, casimirs, observe
from ...rng import LANES

_MOST_BLOCKS = 64


class Extremes(NamedTuple):
    """What one batch of blocks meets; the reference, level 0, has nothing but its last states."""

    casimir: np.ndarray  #: (blocks, levels, C, LANES), the largest |C_c(y) - C_c(y_0)|
    square: np.ndarray  #: (blocks, levels, LANES), the largest |y|^2 / |y_0|^2
    least: np.ndarray  #: (blocks, levels, LANES), of populations the smallest component
    last: FinalStates
    initial_casimirs: tuple
    inverse: float  #: 1 / |y_0|


@constant
def _populations(model):
    cls = record_class(model) or type(model)
    return int(getattr(cls, "populations", False))


@means(observe, Extremes)
def _(observer, model, row, paths, level, n, y, reference):
    if level > 0:
        watch_casimirs(model, observer.casimir[row, level], observer.initial_casimirs, y)
        square, least = observer.square[row, level], observer.least[row, level]
        for lane in range(LANES):
            state = scaled(load(model, y, lane), observer.inverse)
            size = dot(state, state)
            if not size <= square[lane]:
                square[lane] = size
        if _populations(model) == 1:
            for lane in range(LANES):
                smallest = min(load(model, y, lane))
                if not smallest >= least[lane]:
                    least[lane] = smallest
    observe(observer.last, model, row, paths, level, n, y, reference)


class Plan(NamedTuple):
    """A case turned into what the ensemble needs."""

    scheme: NamedTuple
    points: tuple  #: (model, y_0, eps) for each value
    grid: Grid
    noise: Noise
    steps: np.ndarray  #: (levels,)
    samples: int
    functions: tuple  #: trees of the test functions

    @property
    def blocks(self):
        return -(-self.samples // LANES)


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
    casimir_median: np.ndarray
    largest_norm: np.ndarray  #: (values, levels - 1), relative to |y_0|
    positive: np.ndarray  #: (values, levels - 1), fraction of the paths
    error: np.ndarray  #: (values, levels - 1), relative to |y_0|
    error_stderr: np.ndarray
    expectation: np.ndarray  #: (values, levels - 1, F), of the test functions
    expectation_stderr: np.ndarray


def arrays_of(p):
    """All arrays of the state before anything is done, in the order of its fields."""
    model, initial, _ = p.points[0]
    values, levels = len(p.points), len(p.steps)
    found = np.zeros((values, levels - 1))
    by_casimir = np.zeros((values, levels - 1, len(casimirs(model, initial))))
    by_function = np.zeros((values, levels - 1, len(p.functions)))
    return (
        *_of_paths(p),
        np.zeros((values, levels, len(REPORT))),
        *(found, by_casimir, by_casimir, found, found, found, found, by_function, by_function),
    )


def _of_paths(p):
    """The arrays of the value at hand before its first block."""
    model, initial, _ = p.points[0]
    levels, paths = len(p.steps), p.blocks * LANES
    return (
        np.zeros((levels, len(casimirs(model, initial)), paths)),
        np.zeros((levels, paths)),
        np.full((levels, paths), np.inf),
        np.zeros((levels, len(initial), paths)),
    )


def start(p):
    """The state before the first block."""
    return State(0, 0, 0.0, *arrays_of(p))


def advance_state(p, state, blocks):
    """The state after the next `blocks` blocks of the value at hand."""
    began = time.perf_counter()
    model, initial, eps = p.points[state.done]
    scheme, times = _with_eps(p.scheme, eps), p.grid._replace(reference_scheme=_with_eps(p.grid.reference_scheme, eps))
    levels, d = len(p.steps), len(initial)
    known = casimirs(model, initial)
    found = Extremes(
        np.zeros((blocks, levels, len(known), LANES)),
        np.zeros((blocks, levels, LANES)),
        np.full((blocks, levels, LANES), np.inf),
        FinalStates(np.empty((blocks, levels, d * LANES)), p.steps),
        known,
        1.0 / math.hypot(*initial),
    )
    report = empty_report(blocks, levels)
    integrate(scheme, model, initial, times, p.noise, found, report, state.blocks, blocks, p.samples)
    at = slice(state.blocks * LANES, (state.blocks + blocks) * LANES)
    state = state._replace(
        blocks=state.blocks + blocks,
        casimir=_put(state.casimir, at, found.casimir),
        square=_put(state.square, at, found.square),
        least=_put(state.least, at, found.least),
        y=_put(state.y, at, found.last.y.reshape(blocks, levels, d, LANES)),
        report=_set(state.report, state.done, add_reports(state.report[state.done], report)),
    )
    if state.blocks == p.blocks:
        state = _summed_up(p, state)
    return state._replace(seconds=state.seconds + time.perf_counter() - began)


def _with_eps(scheme, eps):
    """The scheme, for the multiscale system with this eps."""
    return scheme._replace(eps=eps) if eps is not None and hasattr(scheme, "eps") else scheme


def _put(kept, at, found):
    """`kept` (..., paths) with the paths `at` from `found` (blocks, ..., LANES)."""
    kept = kept.copy()
    kept[..., at] = np.moveaxis(found, 0, -2).reshape(*kept.shape[:-1], at.stop - at.start)
    return kept


def _set(kept, i, value):
    kept = kept.copy()
    kept[i] = value
    return kept


def _summed_up(p, state):
    """The state in which the value at hand is done."""
    i, n = state.done, p.samples
    model, initial, _ = p.points[i]
    size = math.hypot(*initial)
    known = np.abs(casimirs(model, initial))
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
    new = {
        "finite": np.isfinite(y).all(axis=1).mean(axis=1),
        "casimir_worst": worse.max(axis=2, initial=0.0),
        "casimir_median": median,
        "largest_norm": norm.max(axis=1),
        "positive": (state.least[1:, :n] > 0.0).mean(axis=1),
        "error": error,
        "error_stderr": np.where((error == 0.0) & (n > 1), 0.0, stderr),
    }
    new["expectation"], new["expectation_stderr"] = _expectations(p.functions, y)
    fresh = dict(zip(("casimir", "square", "least", "y"), _of_paths(p), strict=True))
    done = {name: _set(getattr(state, name), i, value) for name, value in new.items()}
    return state._replace(done=i + 1, blocks=0, **fresh, **done)


def _expectations(functions, y):
    """Means of the test functions over the states y (levels, d, paths), and their standard errors, (levels, F)."""
    found = np.empty((2, len(y), len(functions)))
    for f, tree in enumerate(functions):
        with np.errstate(all="ignore"):
            values = np.broadcast_to(as_numpy(tree)(np.moveaxis(y, 1, 0)), y[:, 0].shape)
            found[:, :, f] = values.mean(axis=1), stderr_of_mean(values)
    return found


def batches(p, state):
    """Run all values that are left; yields the state after each batch of about half a second."""

    def left(state):
        return p.blocks - state.blocks if state.done < len(p.points) else 0

    return in_batches(state, partial(advance_state, p), left, _MOST_BLOCKS)
