"""What a spec may expect of stability."""

from collections.abc import Iterable, Iterator

import numpy as np

from spi.statistics.claims import Quantity, each_step, lost_is_infinite

from .results import Stability


def quantities(readings: Iterable[Stability]) -> Iterator[Quantity]:
    """For each step size and value of the sweep what :class:`~.reading.Stability` has under the same names."""
    for one in readings:
        told = {"finite": one.finite, "largest_norm": lost_is_infinite(one.largest_norm)}
        if one.positive is not None:
            told["positive"] = one.positive
        if one.casimirs:
            told["casimir_worst"] = lost_is_infinite(one.casimirs.largest_worst)
            told["casimir_median"] = lost_is_infinite(one.casimirs.largest_median)
        if one.solver:
            told["failing_fraction"] = one.solver.failing_fraction
        for name, values in told.items():
            yield from _each(name, one, values)
        yield from _each("error", one, lost_is_infinite(one.error), one.error_stderr)
        if one.law:
            yield from _each("law_distance", one, one.law.distance, one.law.distance_stderr)


def _each(name: str, one: Stability, values: np.ndarray, stderr: np.ndarray | None = None) -> Iterator[Quantity]:
    """The quantities of `values` (V, S), with their standard errors if they have any."""
    for i, value in enumerate(one.values.tolist()):
        for found in each_step(name, one.about, one.h, values[i], None if stderr is None else stderr[i]):
            yield found._replace(swept=(one.word, value))
