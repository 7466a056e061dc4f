"""State of one lattice and its parts, the lanes of a block: copied from one to the other."""

import numpy as np
from numba import prange

from spi.compiler.dispatch import kernel
from spi.numerics.rng import LANES


@kernel(parallel=True)
def copy_parts(sites, state, block, into_block):
    """Copy a state (3 sites,) into a block of its parts, or the block into the state; `sites` as in ``whole.Whole``."""
    for i in prange(len(sites)):
        for a in range(3):
            row = (3 * i + a) * LANES
            for lane in range(LANES):
                if into_block:
                    block[row + lane] = state[3 * np.int64(sites[i, lane]) + a]
                else:
                    state[3 * np.int64(sites[i, lane]) + a] = block[row + lane]
