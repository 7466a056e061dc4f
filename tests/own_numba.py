"""Numba code that calls a compiled function of another program."""

import numpy as np
from numba import njit


@njit
def highest(move, records, y, dW, areas, coins):
    """The largest first component of each path, the states moved on step by step."""
    found = y[:, 0].copy()
    for n in range(len(dW)):
        move(records, y, dW[n : n + 1], areas[n : n + 1], coins[n : n + 1])
        found = np.maximum(found, y[:, 0])
    return found
