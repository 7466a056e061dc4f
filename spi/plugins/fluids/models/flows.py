"""Flow of all modes of one line: a phase for each Fourier component of each parallel line.

Let H be a sum over modes a g of the line of g, with dH/d omega_{ag} = conj(x_a), x_{-a} = conj(x_a), constant along the
flow.  On the coset of the modes m with m x g = c, written m_c + j g, j = 0, ..., N - 1, z_j = omega_{m_c + j g} obeys

    z_j' = sum_{a = 1..M} sin(2 pi a c / N) (conj(x_a) z_{j+a} - x_a z_{j-a}),

a circulant system: its Fourier components, z_j = sum_q u_q exp(2 pi i j q / N), turn as

    u_q(t) = exp(-i t (phi(q + c) - phi(q - c))) u_q(0),    phi(q) = sum_a Re(x_a exp(-2 pi i a q / N)),

so that N phases serve all cosets: in the matrices of ``kernels.py`` this is W -> U W U* with U diagonal in the basis
in which the matrices of the line are diagonal.  The coset of -c is the complex conjugate of that of c, and that of 0 is
at rest.

A transform of length N is a cosine and a sine transform of sums and differences of z_j and z_{N-j}, products of real
matrices with as many columns as there are cosets and paths.  The change of z is the transform back of
(exp(-i theta) - 1) u, with sine and versine: roundings of the constants then count by theta^2 only, and with them the
Casimirs do not drift.
"""

from typing import NamedTuple

import numpy as np

from spi.compiler.dispatch import device, method
from spi.compiler.vectors import (
    TILE,
    WIDTH,
    flipped,
    fused,
    load,
    load_pairs,
    multiply_tile,
    store,
    store_pairs,
    without_refcount,
)
from spi.numerics.angles import ANY_ANGLES, REDUCED_ANGLES, sin_versine
from spi.numerics.elementary import REDUCIBLE
from spi.numerics.rng import LANES

# ---------------------------------------------------------------------------------------------------------------------
# Components of cosets taken from states and added to them, as tiles: WIDTH paths of one coset, or cosets of one path.
# There are three ways, each the fastest where it can be used.
#
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
    """Position modulo n, for one from 1 - n to 2 n - 1."""
    return position + n if position < 0 else (position - n if position >= n else position)


@device
def turn_work(n):
    """Floats of scratch for a flow."""
    return tiles_at(n) + 6 * (n // 2 + 1) * TILE


class Line(NamedTuple):
    """Data of a line that tiles need; the last fields are those of the lattice."""

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
    """Record of a line, its arrays without counted references: `places` must be part of the lattice."""
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


class CosetLanes(NamedTuple):
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


# ---------------------------------------------------------------------------------------------------------------------
# Phases
# ---------------------------------------------------------------------------------------------------------------------


@device
def _find_phases(line, width, work):
    """phi from the amplitudes, one row of `width` per q, without gaps; returns its largest modulus."""
    n, columns, first = line.n, line.n - 1, phases_at(line.n)
    if width == 1:
        stride = (n + TILE - 1) // TILE * TILE
        for q in range(0, stride, TILE):
            multiply_tile(work, 0, columns, line.phases_across, q, stride, work, first + q, TILE, 1)
    else:
        multiply_tile(line.phases, 0, columns, work, 0, TILE, work, first, TILE, n)
        for q in range(1, n):
            store(work, first + q * WIDTH, load(work, first + q * TILE))
    largest = 0.0
    for i in range(first, first + n * width):
        largest = max(largest, abs(work[i]))
    return largest


@device
def _sines(largest, n, width, work):
    """Sines and versines of the phases, always LANES together, so that each is rounded alike at any width.

    Phases beyond reduction go to the library's sine, each by itself: other phases must not change the bits of a path.
    """
    first, begin, size = phases_at(n), sines_at(n), sines_length(n)
    for i in range(0, n * width, LANES):
        phases, sines, versines = work[first + i :], work[begin + i :], work[begin + size + i :]
        for lane in range(LANES):
            sines[lane], versines[lane] = sin_versine(REDUCED_ANGLES, phases[lane])
    if largest > REDUCIBLE:
        for i in range(n * width):
            if abs(work[first + i]) > REDUCIBLE:
                work[begin + i], work[begin + size + i] = sin_versine(ANY_ANGLES, work[first + i])


@device
def _repeat_sines(n, work):
    """Sines and versines of one path as phi(r) and phi(-r), r = 0, 1, ..., indices modulo N, for vectors of cosets."""
    begin, size = sines_at(n), sines_length(n)
    for part in range(begin, begin + 2 * size, size):
        for i in range(n, 2 * n + WIDTH):
            work[part + i] = work[part + i - n]
        for r in range(2 * n + WIDTH):
            work[part + 2 * size + r] = work[part + (2 * n - r if r <= 2 * n else 3 * n - r)]


# ---------------------------------------------------------------------------------------------------------------------
# Tiles
# ---------------------------------------------------------------------------------------------------------------------


@device
def _transform(line, work, tiles):
    """Cosine transform of the sums and the sine transform of the differences."""
    half = line.n // 2
    part = (half + 1) * TILE
    cos, sin = tiles + 2 * part, tiles + 3 * part
    if line.blocks_of == half:
        multiply_tile(line.cosines, 0, half + 1, work, tiles, TILE, work, cos, TILE, half + 1)
        multiply_tile(line.sines, 0, half, work, tiles + part + TILE, TILE, work, sin + TILE, TILE, half)
    else:
        _transform_by_blocks(line.n, line.blocks_of, line.fourier, line.cosines, work, tiles, cos)
        _transform_by_blocks(line.n, line.blocks_of, line.fourier, line.sines, work, tiles + part, sin)
        first, total = (load(work, tiles), load(work, tiles + WIDTH)), (load(work, tiles), load(work, tiles + WIDTH))
        for row in range(TILE, part, TILE):
            total = (total[0] + load(work, tiles + row), total[1] + load(work, tiles + row + WIDTH))
            store(work, cos + row, first[0] + load(work, cos + row))
            store(work, cos + row + WIDTH, first[1] + load(work, cos + row + WIDTH))
        store(work, cos, total[0])
        store(work, cos + WIDTH, total[1])


@device(inline=False)
def _transform_by_blocks(n, b, fourier, blocks, work, source, target):
    """Rows 1, ..., M of `target` from those of `source`; see ``tables.by_blocks``."""
    half = n // 2
    a, stride = half // b, b * TILE
    between = tiles_at(n) + 4 * (half + 1) * TILE
    after = between + half * TILE
    for row in range(0, stride, TILE):
        multiply_tile(fourier, 0, a, work, source + TILE + row, stride, work, between + row, stride, a)
    multiply_tile(blocks, 0, b, work, between, TILE, work, after, TILE, b)
    for f in range((a - 1) // 2):
        row = (1 + 2 * f) * stride
        multiply_tile(blocks, b * b * (1 + 4 * f), 2 * b, work, between + row, TILE, work, after + row, TILE, 2 * b)
    for row in range(0, stride, TILE):
        multiply_tile(fourier, a * a, a, work, after + row, stride, work, target + TILE + row, stride, a)


@device
def _phase_places(n, c, q, width):
    """Where the sines of phi(q + c) and phi(q - c) stand, of all paths, or of one path and c, c + 1, ..."""
    begin = sines_at(n)
    if width == WIDTH:
        return begin + around(n, q + c) * WIDTH, begin + around(n, q - c) * WIDTH
    return begin + around(n, q) + c, begin + 2 * sines_length(n) + n - around(n, q) + c


@device
def _turned(exact, n, c, q, width, work, re, im):
    """(exp(-i (phi(q + c) - phi(q - c))) - 1) (re + i im); if not `exact` to first order, with phases as sines."""
    (up, down), size = _phase_places(n, c, q, width), sines_length(n)
    if not exact:
        b = load(work, down) - load(work, up)
        return -1.0 * b * im, b * re
    s1, v1, s2, v2 = load(work, up), load(work, up + size), load(work, down), load(work, down + size)
    a = (v1 * v2 - v1) + (s1 * s2 - v2)
    b = (s2 - v1 * s2) - (s1 - s1 * v2)
    return a * re - b * im, a * im + b * re


@device
def _turn_components(exact, line, c, width, work, tiles):
    """From the transforms of a tile to sums and differences of the changes of u_q and u_{-q}."""
    n, part = line.n, (line.n // 2 + 1) * TILE
    re, im = load(work, tiles + 2 * part), load(work, tiles + 2 * part + WIDTH)
    re, im = _turned(exact, n, c, 0, width, work, re, im)
    store(work, tiles, re)
    store(work, tiles + WIDTH, im)
    for row in range(1, n // 2 + 1):
        q, at = line.order[row], tiles + row * TILE
        a, a_im = load(work, at + 2 * part), load(work, at + 2 * part + WIDTH)
        b, b_im = load(work, at + 3 * part), load(work, at + 3 * part + WIDTH)
        re, im = _turned(exact, n, c, q, width, work, a + b_im, a_im - b)
        other, other_im = _turned(exact, n, c, n - q, width, work, a - b_im, a_im + b)
        store(work, at, re + other)
        store(work, at + WIDTH, im + other_im)
        store(work, at + part, re - other)
        store(work, at + part + WIDTH, im - other_im)


@device
def _tiles(way, step, exact, line, width, y, out, work):
    """All tiles, one each `step` cosets."""
    tiles = tiles_at(line.n)
    for c in range(1, line.n // 2 + 1, step):
        fold(way, line, c, y, work, tiles)
        _transform(line, work, tiles)
        _turn_components(exact, line, c, width, work, tiles)
        _transform(line, work, tiles)
        unfold(way, line, c, out, work, tiles)


@device
def _prepare(exact, line, width, work):
    """Phases and their sines and versines; returns the largest modulus of a phase."""
    n = line.n
    largest = _find_phases(line, width, work)
    if not exact:
        for i in range(n * width):  # an assignment of slices would take a second to compile
            work[sines_at(n) + i] = work[phases_at(n) + i]
    else:
        _sines(largest, n, width, work)
    if width == 1:
        _repeat_sines(n, work)
    return largest


@device(inline=False)
def turn(exact, lattice, k, width, y, out, work):
    """Flow of line k with the amplitudes in `work`, of `width` states y[i * width + path], in place: `out` is `y`.

    If not `exact`, out + B(y) grad H in place of `out`.  `width` is 1 or WIDTH.  Returns a bound of the largest angle.
    """
    y, out, work, cosets = without_refcount(y), without_refcount(out), without_refcount(work), lattice.cosets[k]
    if width == WIDTH:
        line = line_of(lattice, cosets)
        largest = _prepare(exact, line, WIDTH, work)
        _tiles(CosetLanes(), 1, exact, line, WIDTH, y, out, work)
        return 2.0 * largest
    largest = _prepare(exact, line_of(lattice, cosets), 1, work)
    if lattice.middles[k, 0] >= 0:
        _tiles(InRows(), WIDTH, exact, line_of(lattice, lattice.middles[k]), 1, y, out, work)
    else:
        _tiles(Packed(), WIDTH, exact, line_of(lattice, cosets), 1, y, out, work)
    return 2.0 * largest
