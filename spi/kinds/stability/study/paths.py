"""The paths of a stability study: what is watched along them, and its summary for each value of the swept parameter."""

import math
from typing import Any, NamedTuple

import numpy as np

from spi.ensemble.fields import scaled_square, smallest_component
from spi.ensemble.invariants import watch_casimirs, watched_casimirs
from spi.ensemble.lanes import load_lane
from spi.ensemble.loop import FinalStates, add_reports, empty_report, integrate, step_sizes_of
from spi.ensemble.protocol import casimirs, conserved, observe, populations
from spi.expressions import as_numpy
from spi.kinds.plans import PathsPlan
from spi.numerics.rng import LANES
from spi.statistics.estimators import stderr_of_mean


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
            watch_casimirs(model, observer.casimir[row, level], observer.initial_casimirs, level, n, paths, y)
            square, least = observer.square[row, level], observer.least[row, level]
            for lane in range(LANES):
                size = scaled_square(load_lane(model, y, lane), observer.inverse)
                if not size <= square[lane]:
                    square[lane] = size
            if populations(model):
                for lane in range(LANES):
                    smallest = smallest_component(load_lane(model, y, lane))
                    if not smallest >= least[lane]:
                        least[lane] = smallest
        observe(observer.last, model, row, paths, level, n, y, reference)


class Paths(NamedTuple):
    """What is known of some paths for one value of the swept parameter; the paths stand along the last axes."""

    paths: int
    seconds: float  #: wall clock
    cpu_seconds: float
    casimir: np.ndarray  #: (levels, C, paths)
    square: np.ndarray  #: (levels, paths)
    least: np.ndarray  #: (levels, paths)
    y: np.ndarray  #: (levels, d, paths)
    report: np.ndarray  #: (levels, columns)

    def plus(self, later: "Paths") -> "Paths":
        """These paths and some later ones."""
        joined: dict[str, Any] = {
            name: np.concatenate((getattr(self, name), getattr(later, name)), axis=-1) for name in _OF_PATHS
        }
        return Paths(
            paths=self.paths + later.paths,
            seconds=self.seconds + later.seconds,
            cpu_seconds=self.cpu_seconds + later.cpu_seconds,
            report=add_reports(self.report, later.report[np.newaxis]),
            **joined,
        )


_OF_PATHS = ("casimir", "square", "least", "y")


class Rows(NamedTuple):
    """What some blocks contribute, a row for each."""

    found: Extremes
    report: np.ndarray  #: (blocks, levels, columns)


def no_paths(point: PathsPlan) -> Paths:
    """No paths of `point`."""
    levels = len(point.steps)
    return Paths(
        paths=0,
        seconds=0.0,
        cpu_seconds=0.0,
        casimir=np.zeros((levels, len(casimirs(point.model, point.initial)), 0)),
        square=np.zeros((levels, 0)),
        least=np.zeros((levels, 0)),
        y=np.zeros((levels, len(point.initial), 0)),
        report=empty_report(1, levels)[0],
    )


def extremes_of(point: PathsPlan, rows: int) -> Extremes:
    """Empty extremes for `rows` blocks of the paths of `point`."""
    levels = len(point.steps)
    return Extremes(
        casimir=np.zeros((rows, levels, conserved(point.model), LANES)),
        square=np.zeros((rows, levels, LANES)),
        least=np.full((rows, levels, LANES), np.inf),
        last=FinalStates(np.empty((rows, levels, len(point.initial) * LANES)), point.steps),
        initial_casimirs=watched_casimirs(point.model, point.initial, step_sizes_of(point.grid)),
        inverse=1.0 / math.hypot(*point.initial),
    )


def rows_of(point: PathsPlan, first: int, blocks: int, end: int) -> Rows:
    """Integrate the blocks from block `first` on; paths from number `end` on are idle."""
    rows = Rows(extremes_of(point, blocks), empty_report(blocks, len(point.steps)))
    what = point.scheme, point.model, point.initial, point.grid, point.stream
    integrate(*what, rows.found, rows.report, first, blocks, end)
    return rows


def added(known: Paths, rows: Rows, at: slice, first: int, end: int) -> Paths:
    """The paths known and those of the rows `at`, of which the first is that of block `first`."""
    found, levels = rows.found, rows.report.shape[1]
    states = found.last.y.reshape(len(rows.report), levels, -1, LANES)
    arrays = {"casimir": found.casimir, "square": found.square, "least": found.least, "y": states}
    joined: dict[str, Any] = {}
    for name, values in arrays.items():
        lanes = np.moveaxis(values[at], 0, -2)
        paths = lanes.reshape(*lanes.shape[:-2], lanes.shape[-2] * LANES)[..., : end - first * LANES]
        joined[name] = np.concatenate((getattr(known, name), paths), axis=-1)
    return known._replace(report=add_reports(known.report, rows.report[at]), **joined)


def summary(point: PathsPlan, functions: tuple, known: Paths) -> dict[str, np.ndarray]:
    """What all paths for one value, `point`, tell: by the name of a quantity its values (levels - 1, ...)."""
    n, size = point.samples, math.hypot(*point.initial)
    first = np.abs(casimirs(point.model, point.initial))
    scale = np.where(first > 0, first, 1.0).reshape(1, -1, 1) if len(first) else 1.0
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        worse = np.nan_to_num(known.casimir[1:] / scale, nan=np.inf, posinf=np.inf)
        median = np.median(worse, axis=2) if worse.size else worse.max(axis=2, initial=0.0)
        norm = np.nan_to_num(np.sqrt(known.square[1:]), nan=np.inf, posinf=np.inf)
        y, reference = known.y[1:], known.y[:1]
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
        "positive": (known.least[1:] > 0.0).mean(axis=1),
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
