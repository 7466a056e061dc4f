"""Values of the test functions at the end of paths, which all estimators that sample share."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from spi.ensemble.loop import Grid, integrated
from spi.expressions import as_numpy
from spi.kinds.plans import PartPlan
from spi.numerics.rng import LANES


def values_of_blocks(
    p: PartPlan, grid: Grid, stream: Any, first_block: int, blocks: int, samples: int
) -> tuple[np.ndarray, np.ndarray]:
    """Integrate blocks; the values of the test functions at the end (blocks, paths, F, LANES), and the report."""
    states, report = integrated(p.scheme, p.model, p.initial, grid, stream, first_block, blocks, samples)
    return function_values([as_numpy(tree) for tree in p.case.expressions], states, len(p.initial)), report


def function_values(functions: Sequence[Callable], states: np.ndarray, d: int) -> np.ndarray:
    """The values (blocks, paths, F, LANES) of functions of states (d, ...), of (blocks, paths, d * LANES or more)."""
    y = states[..., : d * LANES].reshape(*states.shape[:2], d, LANES)
    values = np.empty((*y.shape[:2], len(functions), LANES))
    with np.errstate(all="ignore"):
        for f, phi in enumerate(functions):
            values[:, :, f] = phi(np.moveaxis(y, 2, 0))
    return values
