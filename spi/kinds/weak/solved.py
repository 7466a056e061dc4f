"""Expectations without sampling for a case, where there is a solver: their demands, and themselves.

They are cached, as layers of a file, and controls of several eps, are alike.
"""

import functools
import time
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from spi.exact.expectations import Demands, Expectations, demands, expectations
from spi.expressions import as_numpy
from spi.schemes.stages import compositions, has_loops, has_shared
from spi.specs.keys import wrong


def check_demands(case: Any, estimator: str, multiscale: bool) -> None:
    """Raise the error about schemes that cannot be solved, of the multiscale system about the limit, their control."""
    for name, need in demands_of_schemes(case, multiscale):
        if need.obstacle:
            its = f" for '{name}'" if multiscale else ""
            raise wrong(f"has '{estimator}', whose solver{its} {need.obstacle}", need.remedy, "estimators")


def demands_of_schemes(case: Any, multiscale: bool) -> Iterator[tuple[str, Demands]]:
    """Schemes of a case that are solved without sampling, with their demands."""
    for name in case.schemes:
        row = case.row(name)
        rows = row.composition
        if rows is not None and row.multiscale == multiscale and not (has_loops(rows) or has_shared(rows)):
            yield name, demands_of(case, rows, case.steps)


def demands_of(case: Any, rows: tuple, steps: Iterable[float]) -> Demands:
    """Demands of a composition of flows for a case."""
    return _demands(*question(case, rows, steps))


def question(case: Any, rows: tuple, steps: Iterable[float]) -> tuple:
    """Arguments of the solvers about a composition of flows, hashable, so that results can be cached."""
    acting = compositions(rows, case.model)
    return case.model, acting, case.initial, case.final_time, tuple(map(float, steps)), case.expressions, case.accuracy


@functools.lru_cache(maxsize=256, typed=True)  # as models of two classes may be equal tuples
def _demands(
    model: Any, acting: tuple, initial: tuple, final_time: float, steps: tuple, functions: tuple, accuracy: float | None
) -> Demands:
    return demands(model, acting, initial, final_time, steps, [*map(as_numpy, functions)], accuracy)


def solution(case: Any, rows: tuple, steps: Iterable[float]) -> tuple[Expectations, float]:
    """Expectations of a composition of flows for a case at some step sizes, and the processor seconds they took."""
    return _solution(*question(case, rows, steps))


@functools.lru_cache(maxsize=8, typed=True)
def _solution(
    model: Any, acting: tuple, initial: tuple, final_time: float, steps: tuple, functions: tuple, accuracy: float | None
) -> tuple[Expectations, float]:
    callables, began = [*map(as_numpy, functions)], time.process_time()
    found = expectations(model, acting, initial, final_time, np.array(steps), callables, accuracy)
    return found, time.process_time() - began
