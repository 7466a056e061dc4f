"""Blocks of paths: LANES states in one array, component i of lane l at [i * LANES + l].

Loops over lanes that load a tuple, compute and store it become vector instructions.
"""

import functools

import numpy as np

from ..compiler.dispatch import device, intrinsic, looped
from ..compiler.instructions import load_strided, store_strided
from ..compiler.records import is_array
from ..numerics.rng import LANES
from .protocol import dimension, large

LINE = 8  #: floats in a line of the cache

#: ``@over_lanes("b[n] = c * a[n]")``: a function of arrays that does so for the lanes n of a block.
over_lanes = functools.partial(looped, ("for n in range(LANES)",), LANES=LANES)


@device
def aligned(size):
    """An empty array of `size` floats that begins where a line of the cache does.

    A vector of 512 bits is as long as a line; NumPy's and Numba's arrays begin at any multiple of 16 or 32 bytes, and
    then every load and store would touch two lines.
    """
    array = np.empty(size + LINE)
    first = (-array.ctypes.data % (8 * LINE)) // 8
    return array[first : first + size]


def load_lane(model, y, lane):
    """State of one lane as a tuple of ``dimension(model)`` floats; of an array-state model a view of the block."""
    if large(model):
        return y[lane : dimension(model) * LANES : LANES]
    return tuple(float(y[i * LANES + lane]) for i in range(dimension(model)))


def store_lane(y, lane, state):
    """Put a tuple of floats into one lane; of an array-state model an array."""
    for i in range(len(state)):
        y[i * LANES + lane] = state[i]


@intrinsic(load_lane)
def _(model, y, lane):
    if large(model):
        return lambda model, y, lane: y[lane : dimension(model) * LANES : LANES]
    return load_strided(dimension(model), LANES, model, y, lane)


@intrinsic(store_lane)
def _(y, lane, state):
    return store_lane if is_array(state) else store_strided(LANES, y, lane, state)
