"""Components of cosets taken from states and added to them, as tiles: WIDTH paths of one coset, or cosets of one path.

There are three ways, each the fastest where it can be used.
"""

from typing import NamedTuple

import numpy as np

from ...compiler.dispatch import device, method
from ...compiler.vectors import TILE, WIDTH, flipped, fused, load, load_pairs, store, store_pairs, without_refcount
from ...numerics.rng import LANES

# ---------------------------------------------------------------------------------------------------------------------
# The scratch of a flow, and the record of a line.
#
# One array of floats holds, one after the other: amplitudes, N - 1 rows of TILE; phases, N rows; sines and versines,
# each twice; tiles, 4 parts of M + 1 rows: sums, differences, their cosine transform, their sine transform; 2 M rows
# for a transform by blocks.
# ---------------------------------------------------------------------------------------------------------------------


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
    """The floats of scratch for a flow."""
    return tiles_at(n) + 6 * (n // 2 + 1) * TILE


class Line(NamedTuple):
    """The data of a line that tiles need; the last fields are those of the lattice."""

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
    """The record of a line, its arrays without counted references: `places` must be part of the lattice."""
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


@method
def take_pair(way, line, c, j, y, work, tiles):
    """z_j and z_{N-j} as vectors: real part, imaginary part, and those of the other."""


@method
def add_pair(way, line, c, j, out, work, tiles, re, im, other_re, other_im):
    """Add 1 / N of these vectors to z_j and z_{N-j}."""


@method
def begin_tile(way, line, c, y, work, tiles):
    """Prepare a tile for :func:`take_pair` and put z_0 into the first row of sums."""


@method
def end_tile(way, line, c, out, work, tiles):
    """Finish a tile after :func:`add_pair` and add 1 / N of the first row of the cosine transform to z_0."""


@device
def divided(line, x):
    """x / N, without the bias of rounded numbers; see ``tables.rest_of_share``."""
    return fused(1.0 / line.n, x, line.rest * x)


@device
def _place(line, c, j, width):
    """(place where component j of coset c begins, sign of its imaginary part)."""
    place = line.places[(c - 1) * line.n + j]
    return (place - (place & 1)) * width, 1.0 - 2.0 * (place & 1)


def _pair_together(way, line, c, j, y, work, tiles):
    """z_j and z_{N-j} of the WIDTH paths, real and imaginary parts."""
    at, sign = _place(line, c, j, WIDTH)
    other, other_sign = _place(line, c, line.n - j, WIDTH)
    return load(y, at), sign * load(y, at + WIDTH), load(y, other), other_sign * load(y, other + WIDTH)


def _add_pair_together(way, line, c, j, out, work, tiles, re, im, other_re, other_im):
    """Add 1 / N of these to z_j and z_{N-j}."""
    at, sign = _place(line, c, j, WIDTH)
    store(out, at, load(out, at) + divided(line, re))
    store(out, at + WIDTH, load(out, at + WIDTH) + divided(line, sign * im))
    at, sign = _place(line, c, line.n - j, WIDTH)
    store(out, at, load(out, at) + divided(line, other_re))
    store(out, at + WIDTH, load(out, at + WIDTH) + divided(line, sign * other_im))


# The components of one path on the line of (s, 1): in row j of the state, with c = 0 at the position M - s j, z_j
# stands at the position - c and the conjugate of z_{N-j} at the position + c.


@device
def _row_of(line, j):
    """(place where the row begins in the state, position of c = 0) for j or N - j <= M."""
    row = min(j, line.n - j)
    return 2 * (line.n // 2 + (row - 1) * line.n), line.places[row]


def _pair_in_row(way, line, c, j, y, work, tiles):
    """z_j and z_{N-j} of cosets c, c + 1, ..."""
    n = line.n
    begin, middle = _row_of(line, j)
    re, im = load_pairs(y, begin, n, around(n, middle - c - WIDTH + 1))
    re, im = flipped(re), flipped(im)
    other_re, other_im = load_pairs(y, begin, n, around(n, middle + c))
    if 2 * j < n:
        return re, im, other_re, -1.0 * other_im
    return other_re, -1.0 * other_im, re, im


def _add_pair_in_row(way, line, c, j, out, work, tiles, re, im, other_re, other_im):
    """Add 1 / N of these to z_j and z_{N-j} of cosets c, c + 1, ..., M."""
    n = line.n
    count = min(WIDTH, n // 2 + 1 - c)
    begin, middle = _row_of(line, j)
    if 2 * j > n:
        re, im, other_re, other_im = other_re, other_im, re, im
    low, high = around(n, middle - c - WIDTH + 1), around(n, middle + c)
    a, b = load_pairs(out, begin, n, low)
    store_pairs(
        out, begin, n, low, WIDTH - count, WIDTH, a + divided(line, flipped(re)), b + divided(line, flipped(im))
    )
    a, b = load_pairs(out, begin, n, high)
    store_pairs(out, begin, n, high, 0, count, a + divided(line, other_re), b + divided(line, -1.0 * other_im))


# The components of one path on any line, one by one.


@device
def _pack(line, c, count, y, work, rows):
    """z_j, j < `count`, of cosets c, c + 1, ... of one path, in rows of TILE; after the last coset copies of it."""
    for column in range(WIDTH):
        for j in range(count):
            place, sign = _place(line, min(c + column, line.n // 2), j, 1)
            work[rows + j * TILE + column] = y[place]
            work[rows + j * TILE + WIDTH + column] = sign * y[place + 1]


@device
def _unpack(line, c, count, out, work, rows):
    """Add 1 / N of rows of TILE to the z_j, j < `count`, of cosets c, c + 1, ..., M of one path."""
    for column in range(min(WIDTH, line.n // 2 + 1 - c)):
        for j in range(count):
            place, sign = _place(line, c + column, j, 1)
            out[place] += divided(line, work[rows + j * TILE + column])
            out[place + 1] += divided(line, sign * work[rows + j * TILE + WIDTH + column])


def _pair_packed(way, line, c, j, y, work, tiles):
    """z_j and z_{N-j} from their rows."""
    rows = tiles + 2 * (line.n // 2 + 1) * TILE
    at, other = rows + j * TILE, rows + (line.n - j) * TILE
    return load(work, at), load(work, at + WIDTH), load(work, other), load(work, other + WIDTH)


def _add_pair_packed(way, line, c, j, out, work, tiles, re, im, other_re, other_im):
    """Store the changes of z_j and z_{N-j} in rows."""
    at, other = tiles + j * TILE, tiles + (line.n - j) * TILE
    store(work, at, re)
    store(work, at + WIDTH, im)
    store(work, other, other_re)
    store(work, other + WIDTH, other_im)


class Together(NamedTuple):
    """WIDTH paths in one coset."""

    take_pair, add_pair = _pair_together, _add_pair_together

    def begin_tile(way, line, c, y, work, tiles):
        at, sign = _place(line, c, 0, WIDTH)
        store(work, tiles, load(y, at))
        store(work, tiles + WIDTH, sign * load(y, at + WIDTH))

    def end_tile(way, line, c, out, work, tiles):
        cos = tiles + 2 * (line.n // 2 + 1) * TILE
        at, sign = _place(line, c, 0, WIDTH)
        store(out, at, load(out, at) + divided(line, load(work, cos)))
        store(out, at + WIDTH, load(out, at + WIDTH) + divided(line, sign * load(work, cos + WIDTH)))


class InRows(NamedTuple):
    """One path on the line of (s, 1)."""

    take_pair, add_pair = _pair_in_row, _add_pair_in_row

    def begin_tile(way, line, c, y, work, tiles):
        for column in range(WIDTH):
            place = 2 * max(line.n // 2 - c - column, 0)
            work[tiles + column], work[tiles + WIDTH + column] = y[place], y[place + 1]

    def end_tile(way, line, c, out, work, tiles):
        cos = tiles + 2 * (line.n // 2 + 1) * TILE
        for column in range(min(WIDTH, line.n // 2 + 1 - c)):
            place = 2 * (line.n // 2 - c - column)
            out[place] += divided(line, work[cos + column])
            out[place + 1] += divided(line, work[cos + WIDTH + column])


class Packed(NamedTuple):
    """One path on any line: the components in rows of TILE before and after."""

    take_pair, add_pair = _pair_packed, _add_pair_packed

    def begin_tile(way, line, c, y, work, tiles):
        rows = tiles + 2 * (line.n // 2 + 1) * TILE
        _pack(line, c, line.n, y, work, rows)
        store(work, tiles, load(work, rows))
        store(work, tiles + WIDTH, load(work, rows + WIDTH))

    def end_tile(way, line, c, out, work, tiles):
        cos = tiles + 2 * (line.n // 2 + 1) * TILE
        store(work, tiles, load(work, cos))
        store(work, tiles + WIDTH, load(work, cos + WIDTH))
        _unpack(line, c, line.n, out, work, tiles)


@device
def fold(way, line, c, y, work, tiles):
    """Sums and differences of z_j and z_{N-j}."""
    part = (line.n // 2 + 1) * TILE
    begin_tile(way, line, c, y, work, tiles)
    for row in range(1, line.n // 2 + 1):
        re, im, other_re, other_im = take_pair(way, line, c, line.order[row], y, work, tiles)
        at = tiles + row * TILE
        store(work, at, re + other_re)
        store(work, at + WIDTH, im + other_im)
        store(work, at + part, re - other_re)
        store(work, at + part + WIDTH, im - other_im)


@device
def unfold(way, line, c, out, work, tiles):
    """Add the transform back, divided by N, to the z_j of `out`."""
    part = (line.n // 2 + 1) * TILE
    for row in range(1, line.n // 2 + 1):
        j, cos, sin = line.order[row], tiles + 2 * part + row * TILE, tiles + 3 * part + row * TILE
        a, a_im, b, b_im = load(work, cos), load(work, cos + WIDTH), load(work, sin), load(work, sin + WIDTH)
        add_pair(way, line, c, j, out, work, tiles, a - b_im, a_im + b, a + b_im, a_im - b)
    end_tile(way, line, c, out, work, tiles)
