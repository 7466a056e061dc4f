"""The paths of a multilevel estimator: which steps, reversals and schemes a sample of each level has."""

from typing import Any

import numpy as np

from spi.ensemble.areas import fourier_terms
from spi.ensemble.loop import AS_TOSSED, COINS_TURNED, PAIRS_REVERSED, grid
from spi.ensemble.points import points_of
from spi.ensemble.streams import RandomStream
from spi.kinds.samples import Sample
from spi.numerics.rng import LEVELS

#: The quantities of which a level has sums: DIFFERENCE, at the coarse step minus at the fine step; VALUE, at the fine
#: step; CONTROL, the difference of the control, and the PRODUCT of the two only with a control.  The last level, which
#: has one step size only, has phi with the antithetic path, phi without it, and phi of the control.
DIFFERENCE, VALUE, CONTROL, PRODUCT = range(4)


def levels_of(case: Any, scheme: Any, antithetic: bool, limit: tuple | None) -> tuple[Sample, ...]:
    """Level j compares the steps 2^(j+1) h_ref and 2^j h_ref, the last one has the largest step alone.

    `scheme` is the record of the scheme, `antithetic` says whether paths are antithetic, and `limit` is the record
    of the scheme that is the control, None without control.
    """
    count = round(np.log2(max(case.steps) / case.reference_step))
    differences = [_level(case, scheme, j, limit, *_two_steps(antithetic, limit)) for j in range(count)]
    last = _level(case, scheme, count, limit, *_one_step(antithetic, limit))
    if case.coarse == "quasi":
        points = points_of(case.seed, int(last.stream.stream), scheme, case.model, last.grid, case.construction)
        last = last._replace(stream=points)
    return *differences, last


def _two_steps(antithetic: bool, limit: tuple | None) -> tuple[dict[str, Any], list[list[float]]]:
    """The paths of a level, as words of :func:`spi.ensemble.loop.grid`, and their weights."""
    if antithetic:
        shape = {"doublings": (0, 0, 1, 1), "reversals": (AS_TOSSED, PAIRS_REVERSED, AS_TOSSED, COINS_TURNED)}
        return shape, [[-0.5, -0.5, 0.5, 0.5], [0.5, 0.5, 0.0, 0.0]]
    if limit is not None:
        shape = {"doublings": (0, 0, 1, 1), "by_reference": (0, 1, 0, 1)}
        return shape, [[-1.0, 0.0, 1.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 1.0]]
    return {"doublings": (0, 1)}, [[-1.0, 1.0], [1.0, 0.0]]


def _one_step(antithetic: bool, limit: tuple | None) -> tuple[dict[str, Any], list[list[float]]]:
    """The same for the last level."""
    if antithetic:
        return {"doublings": (0, 0), "reversals": (AS_TOSSED, COINS_TURNED)}, [[0.5, 0.5], [1.0, 0.0]]
    if limit is not None:
        return {"doublings": (0, 0), "by_reference": (0, 1)}, [[1.0, 0.0], [1.0, 0.0], [0.0, 1.0]]
    return {"doublings": (0,)}, [[1.0], [1.0]]


def _level(
    case: Any, scheme: Any, j: int, limit: tuple | None, shape: dict[str, Any], weights: list[list[float]]
) -> Sample:
    h = case.reference_step * 2.0**j
    steps = round(case.final_time / h)
    terms = fourier_terms(case.model, [scheme], h, areas=case.areas)
    times = grid(h, steps, truncate=case.truncate_noise, reference_scheme=limit, area_terms=terms, **shape)
    stream = RandomStream(np.uint64(case.seed), np.uint64(LEVELS + 2 * j))
    return Sample.of(times, stream, weights)
