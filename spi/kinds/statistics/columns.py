"""What is summed up: functions of the state or of the path, and what else stands beside them, column by column.

The functions of the case; for each passage those that look at fewer times; for each autocorrelation the value at its
first time; and differences from finer paths on the same noise.
"""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from spi.ensemble.loop import thread_count
from spi.kinds.functions import PathFunction, origin_of
from spi.numerics.rng import LANES

from .estimates import COARSER

Map = Callable[..., Iterator[Any]]  #: as the function ``map``


@contextmanager
def in_threads() -> Iterator[Map]:
    """Within it a map whose calls are made by all threads."""
    if thread_count() == 1:
        yield map
    else:
        with ThreadPoolExecutor(thread_count()) as threads:
            yield threads.map


class Columns(NamedTuple):
    """The columns of a case."""

    functions: tuple[PathFunction, ...]  #: those of the case, and for each passage those that look at fewer times
    origins: np.ndarray  #: (F, 1) what they are at t = 0: values are less that, so that variances do not cancel
    since: list[tuple[int, int]]  #: the functions with autocorrelations, and the times from which these count
    compared: list[int]  #: the functions whose means are compared with those of finer paths
    places: np.ndarray  #: (T,) which of the stored states have statistics
    between: float  #: the time between two stored states
    levels: int  #: 2 with finer paths, which come first
    stored: int  #: states of a level, with the initial one

    @classmethod
    def of(cls, case: Any, levels: int) -> "Columns":
        """Those of a case."""
        found, names = case.path_functions, list(case.functions)
        passages = [one for one in found if one.functional == "passage"]
        functions = *found, *(one._replace(every=every) for every in COARSER for one in passages)
        return cls(
            functions=functions,
            origins=np.array([[origin_of(function, case.initial)] for function in functions]),
            since=[(names.index(name), case.place(t)) for name, t in case.autocorrelation.items()],
            compared=[f for f, name in enumerate(names) if case.reference_step and name not in case.reference],
            places=case.places,
            between=case.stride * case.step,
            levels=levels,
            stored=round(case.final_time / case.step) // case.stride + 1,
        )

    @property
    def number(self) -> int:
        """How many columns there are."""
        return len(self.functions) + len(self.since) + len(self.compared)

    def states(self, y: np.ndarray, level: int = -1) -> np.ndarray:
        """States (d, blocks, stored, LANES) of a level among all of blocks, (blocks, levels * stored, d * LANES)."""
        return np.moveaxis(y.reshape(len(y), self.levels, self.stored, -1, LANES)[:, level], 2, 0)

    def evaluate(self, each: Map, y: np.ndarray, values: np.ndarray) -> None:
        """Put the columns of the states y of blocks, less their origins, into values (blocks, T, columns, LANES)."""
        size = -(-len(y) // thread_count())
        pieces = [slice(begin, begin + size) for begin in range(0, len(y), size)]
        list(each(lambda piece: self._evaluate(y[piece], values[piece]), pieces))

    def _evaluate(self, y: np.ndarray, values: np.ndarray) -> None:
        count, own, finer = len(self.functions), self.states(y), self.states(y, 0)
        for f, origin in enumerate(self.origins):
            np.subtract(self._along(f, own), origin, out=values[:, :, f])
        for column, (f, place) in enumerate(self.since, count):
            values[:, :, column] = values[:, place : place + 1, f]
        for column, f in enumerate(self.compared, count + len(self.since)):
            np.subtract(self._along(f, own), self._along(f, finer), out=values[:, :, column])

    def _along(self, f: int, states: np.ndarray) -> np.ndarray:
        """A function at the times of the statistics, (blocks, T, LANES)."""
        function, every = self.functions[f], len(self.places) == self.stored
        with np.errstate(all="ignore"):
            if not function.functional:
                return function.values(states if every else states[:, :, self.places])
            found = np.broadcast_to(function.values(states), states.shape[1:])
            return function.along(found, self.between)[:, self.places]
