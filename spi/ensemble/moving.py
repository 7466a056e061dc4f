"""Steps of many paths from compiled code: what a program of somebody else's own, compiled by Numba, can call."""

import numpy as np

from ..compiler.dispatch import kernel
from ..numerics.rng import LANES
from .given import Given
from .lanes import aligned
from .loop import Grid, integrate_block
from .scheme_protocol import REPORT, substeps


@kernel
def move(records, y, dW, areas, coins):
    """Move states `y` (paths, d) on in place, along the noise of a :class:`~spi.ensemble.given.Given`, on one thread.

    `records` = (scheme, model, grid, observer), the grid being that of one step.
    """
    scheme, model, grid, observer = records
    paths, d = y.shape
    steps = len(dW) // substeps(scheme)
    times = Grid(grid.reference_step, steps, *grid[2:])
    states, report = aligned(d * LANES).reshape(1, -1), np.zeros((1, len(REPORT)))
    noise = Given(dW, areas, coins, 0)
    for block in range(-(-paths // LANES)):
        first = block * LANES
        for lane in range(LANES):
            for i in range(d):
                states[0, i * LANES + lane] = y[min(first + lane, paths - 1), i]
        integrate_block(scheme, model, states, times, noise, observer, report, block, 0, min(LANES, paths - first))
        for lane in range(min(LANES, paths - first)):
            for i in range(d):
                y[first + lane, i] = states[0, i * LANES + lane]
