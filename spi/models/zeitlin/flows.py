"""The flow of all modes of one line: a phase for each Fourier component of each parallel line.

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

from ...compiler.dispatch import device
from ...compiler.tiles import multiply_tile
from ...compiler.vectors import TILE, WIDTH, load, store, without_refcount
from ...numerics.angles import ANY_ANGLES, REDUCED_ANGLES, sin_versine
from ...numerics.elementary import REDUCIBLE
from ...numerics.rng import LANES
from .cosets import InRows, Packed, Together, around, fold, line_of, phases_at, sines_at, sines_length, tiles_at, unfold

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
    """The cosine transform of the sums and the sine transform of the differences."""
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
    """The flow of line k with the amplitudes in `work`, of `width` states y[i * width + path], in place: `out` is `y`.

    If not `exact`, out + B(y) grad H in place of `out`.  `width` is 1 or WIDTH.  Returns a bound of the largest angle.
    """
    y, out, work, cosets = without_refcount(y), without_refcount(out), without_refcount(work), lattice.cosets[k]
    if width == WIDTH:
        line = line_of(lattice, cosets)
        largest = _prepare(exact, line, WIDTH, work)
        _tiles(Together(), 1, exact, line, WIDTH, y, out, work)
        return 2.0 * largest
    largest = _prepare(exact, line_of(lattice, cosets), 1, work)
    if lattice.middles[k, 0] >= 0:
        _tiles(InRows(), WIDTH, exact, line_of(lattice, lattice.middles[k]), 1, y, out, work)
    else:
        _tiles(Packed(), WIDTH, exact, line_of(lattice, cosets), 1, y, out, work)
    return 2.0 * largest
