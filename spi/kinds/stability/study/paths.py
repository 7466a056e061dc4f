"""The paths of a stability study for one value of the swept parameter: what is watched along them, and its summary."""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from spi.ensemble.loop import add_reports, empty_report, integrated, paths_of
from spi.ensemble.observer import path_observer
from spi.ensemble.protocol import casimirs
from spi.expressions import as_numpy
from spi.kinds.blocks import BlocksPlan
from spi.kinds.plans import DOWN
from spi.numerics.rng import LANES
from spi.statistics.estimators import stderr_of_mean

_MOST_BLOCKS = 64  # of a batch, because of memory


class Paths(NamedTuple):
    """What is known of some paths for one value of the swept parameter; the paths stand along the last axes."""

    paths: int
    seconds: float  #: wall clock
    cpu_seconds: float
    casimir: np.ndarray  #: (levels, C, paths)
    square: np.ndarray  #: (levels, paths)
    smallest: np.ndarray  #: (levels, paths)
    y: np.ndarray  #: (levels, d, paths)
    report: np.ndarray  #: (levels, columns)

    def plus(self, later: "Paths") -> "Paths":
        """These paths and some later ones."""
        return Paths(
            paths=self.paths + later.paths,
            seconds=self.seconds + later.seconds,
            cpu_seconds=self.cpu_seconds + later.cpu_seconds,
            report=add_reports(self.report, later.report[np.newaxis]),
            **_joined(self, {name: getattr(later, name) for name in _OF_PATHS}),
        )


_OF_PATHS = ("casimir", "square", "smallest", "y")


def _joined(paths: Paths, later: dict[str, np.ndarray]) -> dict[str, Any]:
    """The fields of the paths with those of later ones, by name, behind them."""
    return {name: np.concatenate((getattr(paths, name), values), axis=-1) for name, values in later.items()}


class Rows(NamedTuple):
    """What some blocks contribute, a row for each."""

    extremes: np.ndarray  #: (blocks, levels, C + 2, LANES)
    states: np.ndarray  #: (blocks, levels, d * LANES or more)
    report: np.ndarray  #: (blocks, levels, columns)


@dataclass(frozen=True, kw_only=True)
class ValuePlan(BlocksPlan):
    """The paths of one scheme for one value of the swept parameter."""

    def deciding(self, number: int | None) -> dict[str, Any]:
        """Neither other values, nor the test functions, which are functions of the last states."""
        found = super().deciding(number)
        return {key: value for key, value in found.items() if key not in ("sweep", "functions")}

    def empty(self, number: int) -> Paths:
        """No paths."""
        levels = len(self.steps)
        return Paths(
            paths=0,
            seconds=0.0,
            cpu_seconds=0.0,
            casimir=np.zeros((levels, len(casimirs(self.model, self.initial)), 0)),
            square=np.zeros((levels, 0)),
            smallest=np.zeros((levels, 0)),
            y=np.zeros((levels, len(self.initial), 0)),
            report=empty_report(1, levels)[0],
        )

    def most_blocks(self, number: int) -> int:
        """How many blocks a batch may have, because of memory."""
        return _MOST_BLOCKS

    def rows(self, number: int, first: int, blocks: int, end: int) -> Rows:
        """Integrate the blocks from block `first` on; paths from number `end` on are idle."""
        observer = path_observer(self.model, self.initial, self.grid, blocks, sizes=True)
        what = self.scheme, self.model, self.initial, self.grid, self.stream
        states, report = integrated(*what, first, blocks, end, observer)
        return Rows(observer.extremes, states, report)

    def added(self, sums: Paths, rows: Rows, at: slice, first: int, end: int) -> Paths:
        """The paths and those of the rows `at`, of which the first is that of block `first`."""
        extremes, count = rows.extremes[at], end - first * LANES
        lanes = np.moveaxis(extremes, 0, -2).reshape(*extremes.shape[1:3], -1)[..., :count]
        y = paths_of(rows.states[at], len(self.initial))[..., :count]
        later = {"casimir": lanes[:, :-2], "square": lanes[:, -2], "smallest": lanes[:, -1], "y": y}
        return sums._replace(report=add_reports(sums.report, rows.report[at]), **_joined(sums, later))

    def summary(self, paths: Paths) -> dict[str, np.ndarray]:
        """What all paths tell: by the name of a quantity its values at each step (S, ...)."""
        n, first = self.samples, np.abs(self.initial_casimirs(0, self.blocks))[:, : self.samples]
        scale = np.where(first > 0, first, 1.0)
        size = np.array([math.hypot(*y) for y in self.initial_states(0, self.blocks).T.tolist()[:n]])
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            worse = np.nan_to_num(paths.casimir[DOWN] / scale, nan=np.inf, posinf=np.inf)
            median = np.median(worse, axis=2) if worse.size else worse.max(axis=2, initial=0.0)
            norm = np.nan_to_num(np.sqrt(paths.square[DOWN]), nan=np.inf, posinf=np.inf)
            y, reference = paths.y[DOWN], paths.y[:1]
            squares = np.nan_to_num((((y - reference) / size) ** 2).sum(axis=1), nan=np.inf, posinf=np.inf)
            error = np.sqrt(squares.mean(axis=1))
            stderr = stderr_of_mean(squares) / (2 * error)
        expectation, expectation_stderr = _expectations(self.case.expressions, y)
        return {
            "finite": np.isfinite(y).all(axis=1).mean(axis=1),
            "casimir_worst": worse.max(axis=2, initial=0.0),
            "casimir_median": median,
            "largest_norm": norm.max(axis=1),
            "positive": (paths.smallest[DOWN] > 0.0).mean(axis=1),
            "error": error,
            "error_stderr": np.where((error == 0.0) & (n > 1), 0.0, stderr),
            "expectation": expectation,
            "expectation_stderr": expectation_stderr,
        }


def _expectations(functions: tuple, y: np.ndarray) -> np.ndarray:
    """Means of the test functions over the states y (levels, d, paths), and their standard errors, (levels, F)."""
    means = np.empty((2, len(y), len(functions)))
    for f, tree in enumerate(functions):
        with np.errstate(all="ignore"):
            values = np.broadcast_to(as_numpy(tree)(np.moveaxis(y, 1, 0)), y[:, 0].shape)
            means[:, :, f] = values.mean(axis=1), stderr_of_mean(values)
    return means
