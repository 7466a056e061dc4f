"""The scratch of a flow, and what its parts must know of a line.

One array of floats holds, one after the other: amplitudes, N - 1 rows of TILE; phases, N rows; sines and versines, each
twice; tiles, 4 parts of M + 1 rows: sums, differences, their cosine transform, their sine transform; 2 M rows for a
transform by blocks.
"""

from typing import NamedTuple

import numpy as np

from ...compiler.dispatch import device
from ...compiler.vectors import TILE, WIDTH, without_refcount
from ...numerics.rng import LANES


@device
def phases_at(n):
    return (n - 1) * TILE


@device
def sines_at(n):
    return phases_at(n) + n * TILE + LANES


@device
def sines_length(n):
    return (2 * n + 2 * WIDTH) * WIDTH


@device
def tiles_at(n):
    return sines_at(n) + 4 * sines_length(n)


@device
def around(n, position):
    """The position modulo n, for one from 1 - n to 2 n - 1."""
    return position + n if position < 0 else (position - n if position >= n else position)


@device
def turn_work(n):
    """How many floats of scratch a flow needs."""
    return tiles_at(n) + 6 * (n // 2 + 1) * TILE


class Line(NamedTuple):
    """What tiles must know of a line; the last fields are those of the lattice."""

    places: np.ndarray  #: its row of ``Lattice.cosets``; in rows: the position of c = 0 in row 0, 1, ..., M
    n: int
    blocks_of: int
    order: np.ndarray
    cosines: np.ndarray
    sines: np.ndarray
    fourier: np.ndarray
    phases: np.ndarray
    phases_across: np.ndarray
    rest: float


@device
def line_of(lattice, places):
    """The record of a line, its arrays on loan: `places` must be part of the lattice."""
    return Line(
        without_refcount(places),
        lattice.n,
        lattice.blocks_of,
        without_refcount(lattice.order),
        without_refcount(lattice.cosines),
        without_refcount(lattice.sines),
        without_refcount(lattice.fourier),
        without_refcount(lattice.phases),
        without_refcount(lattice.phases_across),
        lattice.rest,
    )
