"""The flow of all modes of one line: a phase for each Fourier component of each parallel line.

Let H be a sum over modes a g of the line of g, with dH/d omega_{ag} = conj(x_a), x_{-a} = conj(x_a), constant along the
flow.  On the coset of the modes m with m x g = c, written m_c + j g, j = 0, ..., N - 1, z_j = omega_{m_c + j g} obeys

    z_j' = sum_{a = 1..M} sin(2 pi a c / N) (conj(x_a) z_{j+a} - x_a z_{j-a}),

a circulant system: its Fourier components, z_j = sum_q u_q exp(2 pi i j q / N), turn as

    u_q(t) = exp(-i t (phi(q + c) - phi(q - c))) u_q(0),    phi(q) = sum_a Re(x_a exp(-2 pi i a q / N)),

so that N phases serve all cosets: in the matrices of ``matrices.py`` this is W -> U W U* with U diagonal in the basis
in which the matrices of the line are.  The coset of -c is the complex conjugate of that of c, and that of 0 is at rest.

A transform of length N is a cosine and a sine transform of sums and differences of z_j and z_{N-j}, products of real
matrices with as many columns as there are cosets and paths.  What is added to z is the transform back of
(exp(-i theta) - 1) u, with sine and versine: roundings of the constants then count by theta^2 only, and with them the
Casimirs do not drift.
"""

from ...angles import ANY_ANGLES, REDUCED_ANGLES, sin_versine
from ...dispatch import called, inlined
from ...elementary import REDUCIBLE
from ...vectors import TILE, WIDTH, load, multiply_tile, store

# Scratch of a flow: amplitudes, N - 1 rows of TILE; phases, N rows; sines and versines, each twice; tiles, 4 parts of
# M + 1 rows: sums, differences, their cosine transform, their sine transform; 2 M rows for a transform by blocks.


@inlined
def phases_at(n):
    return (n - 1) * TILE


@inlined
def sines_at(n):
    return phases_at(n) + n * TILE


@inlined
def sines_length(n):
    return (2 * n + 2 * WIDTH) * WIDTH


@inlined
def tiles_at(n):
    return sines_at(n) + 4 * sines_length(n)


@inlined
def turn_work(n):
    """How many floats of scratch a flow needs."""
    return tiles_at(n) + 6 * (n // 2 + 1) * TILE


# ---------------------------------------------------------------------------------------------------------------------
# Phases
# ---------------------------------------------------------------------------------------------------------------------


@inlined
def _find_phases(lattice, width, work):
    """phi from the amplitudes, one row of `width` per q, without gaps; returns its largest modulus."""
    n, columns, first = lattice.n, lattice.n - 1, phases_at(lattice.n)
    if width == 1:
        stride = (n + TILE - 1) // TILE * TILE
        for q in range(0, stride, TILE):
            multiply_tile(work, 0, columns, lattice.phases_across, q, stride, work, first + q, TILE, 1)
    else:
        multiply_tile(lattice.phases, 0, columns, work, 0, TILE, work, first, TILE, n)
        for q in range(1, n):
            store(work, first + q * WIDTH, load(work, first + q * TILE))
    largest = 0.0
    for i in range(first, first + n * width):
        largest = max(largest, abs(work[i]))
    return largest


@inlined
def _sines(angles, n, width, work):
    """Sines and versines of the phases, always eight together, so that each is rounded alike at any width."""
    first, begin, size = phases_at(n), sines_at(n), sines_length(n)
    for i in range(0, n * width, WIDTH):
        phases, sines, versines = work[first + i :], work[begin + i :], work[begin + size + i :]
        for lane in range(WIDTH):
            sines[lane], versines[lane] = sin_versine(angles, phases[lane])


@inlined
def _repeat_sines(n, width, work):
    """Sines and versines in rows r = 0, 1, ... of phi(r) and of phi(-r), indices modulo N."""
    begin, size = sines_at(n), sines_length(n)
    for part in range(begin, begin + 2 * size, size):
        for i in range(n * width, (2 * n + WIDTH) * width):
            work[part + i] = work[part + i - n * width]
        for r in range(2 * n + WIDTH):
            source = part + (2 * n - r if r <= 2 * n else 3 * n - r) * width
            for lane in range(width):
                work[part + 2 * size + r * width + lane] = work[source + lane]


# ---------------------------------------------------------------------------------------------------------------------
# Tiles: the WIDTH paths of one coset, or WIDTH cosets of one path
# ---------------------------------------------------------------------------------------------------------------------


@inlined
def _pack(cosets, n, c, y, work, at):
    """The z_j of cosets c, c + 1, ... of one path, in rows of TILE; after the last coset come copies of it."""
    for column in range(WIDTH):
        first = (min(c + column, n // 2) - 1) * n
        for j in range(n):
            place = cosets[first + j]
            sign = 1.0 - 2.0 * (place & 1)
            work[at + j * TILE + column] = y[place - (place & 1)]
            work[at + j * TILE + WIDTH + column] = sign * y[place | 1]


@inlined
def _unpack(cosets, n, c, out, work, at):
    """Add 1 / N of rows of TILE to the z_j of cosets c, c + 1, ... of one path."""
    share = 1.0 / n
    for column in range(min(WIDTH, n // 2 + 1 - c)):
        first = (c + column - 1) * n
        for j in range(n):
            place = cosets[first + j]
            sign = 1.0 - 2.0 * (place & 1)
            out[place - (place & 1)] += share * work[at + j * TILE + column]
            out[place | 1] += share * (sign * work[at + j * TILE + WIDTH + column])


@inlined
def _row(cosets, n, c, j, width, y, work, at):
    """z_j as vectors of real and imaginary parts."""
    if width == 1:
        return load(work, at + j * TILE), load(work, at + j * TILE + WIDTH)
    place = cosets[(c - 1) * n + j]
    sign = 1.0 - 2.0 * (place & 1)
    return load(y, (place - (place & 1)) * WIDTH), sign * load(y, (place | 1) * WIDTH)


@inlined
def _add_to_row(cosets, n, c, j, width, out, work, at, re, im):
    """Add 1 / N of re + i im to z_j of `out`, or keep it for :func:`_unpack`: both round alike."""
    if width == 1:
        store(work, at + j * TILE, re)
        store(work, at + j * TILE + WIDTH, im)
    else:
        place = cosets[(c - 1) * n + j]
        sign = 1.0 - 2.0 * (place & 1)
        first, second = (place - (place & 1)) * WIDTH, (place | 1) * WIDTH
        store(out, first, load(out, first) + 1.0 / n * re)
        store(out, second, load(out, second) + 1.0 / n * (sign * im))


@inlined
def _fold(lattice, cosets, c, width, y, work, tiles):
    """Sums and differences of z_j and z_{N-j}."""
    n, half = lattice.n, lattice.n // 2
    part = (half + 1) * TILE
    re, im = _row(cosets, n, c, 0, width, y, work, tiles + 2 * part)
    store(work, tiles, re)
    store(work, tiles + WIDTH, im)
    for row in range(1, half + 1):
        j = lattice.order[row]
        re, im = _row(cosets, n, c, j, width, y, work, tiles + 2 * part)
        other_re, other_im = _row(cosets, n, c, n - j, width, y, work, tiles + 2 * part)
        at = tiles + row * TILE
        store(work, at, re + other_re)
        store(work, at + WIDTH, im + other_im)
        store(work, at + part, re - other_re)
        store(work, at + part + WIDTH, im - other_im)


@inlined
def _unfold(lattice, cosets, c, width, out, work, tiles):
    """Add the transform back, divided by N, to the z_j of `out`."""
    n, half = lattice.n, lattice.n // 2
    part = (half + 1) * TILE
    cos, sin = tiles + 2 * part, tiles + 3 * part
    re, im = load(work, cos), load(work, cos + WIDTH)
    _add_to_row(cosets, n, c, 0, width, out, work, tiles, re, im)
    for row in range(1, half + 1):
        j = lattice.order[row]
        a_re, a_im = load(work, cos + row * TILE), load(work, cos + row * TILE + WIDTH)
        b_re, b_im = load(work, sin + row * TILE), load(work, sin + row * TILE + WIDTH)
        _add_to_row(cosets, n, c, j, width, out, work, tiles, a_re - b_im, a_im + b_re)
        _add_to_row(cosets, n, c, n - j, width, out, work, tiles, a_re + b_im, a_im - b_re)


@inlined
def _transform(lattice, work, tiles):
    """The cosine transform of the sums and the sine transform of the differences."""
    half = lattice.n // 2
    part = (half + 1) * TILE
    cos, sin = tiles + 2 * part, tiles + 3 * part
    if lattice.blocks_of == half:
        multiply_tile(lattice.cosines, 0, half + 1, work, tiles, TILE, work, cos, TILE, half + 1)
        multiply_tile(lattice.sines, 0, half, work, tiles + part + TILE, TILE, work, sin + TILE, TILE, half)
    else:
        _transform_by_blocks(lattice, lattice.cosines, work, tiles, cos)
        _transform_by_blocks(lattice, lattice.sines, work, tiles + part, sin)
        first, total = (load(work, tiles), load(work, tiles + WIDTH)), (load(work, tiles), load(work, tiles + WIDTH))
        for row in range(TILE, part, TILE):
            total = (total[0] + load(work, tiles + row), total[1] + load(work, tiles + row + WIDTH))
            store(work, cos + row, first[0] + load(work, cos + row))
            store(work, cos + row + WIDTH, first[1] + load(work, cos + row + WIDTH))
        store(work, cos, total[0])
        store(work, cos + WIDTH, total[1])


@called
def _transform_by_blocks(lattice, blocks, work, source, target):
    """Rows 1, ..., M of `target` from those of `source`; see ``tables.by_blocks``."""
    half, b = lattice.n // 2, lattice.blocks_of
    a, stride = half // b, b * TILE
    between = tiles_at(lattice.n) + 4 * (half + 1) * TILE
    after = between + half * TILE
    for row in range(0, stride, TILE):
        multiply_tile(lattice.fourier, 0, a, work, source + TILE + row, stride, work, between + row, stride, a)
    multiply_tile(blocks, 0, b, work, between, TILE, work, after, TILE, b)
    for f in range((a - 1) // 2):
        row = (1 + 2 * f) * stride
        multiply_tile(blocks, b * b * (1 + 4 * f), 2 * b, work, between + row, TILE, work, after + row, TILE, 2 * b)
    for row in range(0, stride, TILE):
        multiply_tile(lattice.fourier, a * a, a, work, after + row, stride, work, target + TILE + row, stride, a)


@inlined
def _turned(exact, work, up, down, size, re, im):
    """(exp(-i (phi_1 - phi_2)) - 1) (re + i im), given where sine and versine of both phases stand.

    If not `exact`, to first order in the phases, which then stand in the place of the sines.
    """
    if not exact:
        b = load(work, down) - load(work, up)
        return -1.0 * b * im, b * re
    s1, v1, s2, v2 = load(work, up), load(work, up + size), load(work, down), load(work, down + size)
    a = (v1 * v2 - v1) + (s1 * s2 - v2)
    b = (s2 - v1 * s2) - (s1 - s1 * v2)
    return a * re - b * im, a * im + b * re


@inlined
def _turn_components(exact, lattice, c, width, work, tiles):
    """From the transforms of a tile to sums and differences of what is to be added to u_q and u_{-q}."""
    n, half, size = lattice.n, lattice.n // 2, sines_length(lattice.n)
    part, up, down = (half + 1) * TILE, sines_at(n), sines_at(n) + 2 * sines_length(n)
    re, im = load(work, tiles + 2 * part), load(work, tiles + 2 * part + WIDTH)
    re, im = _turned(exact, work, up + c * width, down + c * width, size, re, im)
    store(work, tiles, re)
    store(work, tiles + WIDTH, im)
    for row in range(1, half + 1):
        q, at = lattice.order[row], tiles + row * TILE
        a_re, a_im = load(work, at + 2 * part), load(work, at + 2 * part + WIDTH)
        b_re, b_im = load(work, at + 3 * part), load(work, at + 3 * part + WIDTH)
        plus, minus = (q + c) * width, (n - q + c) * width
        re, im = _turned(exact, work, up + plus, down + minus, size, a_re + b_im, a_im - b_re)
        other_re, other_im = _turned(exact, work, up + minus, down + plus, size, a_re - b_im, a_im + b_re)
        store(work, at, re + other_re)
        store(work, at + WIDTH, im + other_im)
        store(work, at + part, re - other_re)
        store(work, at + part + WIDTH, im - other_im)


@inlined
def _turn(exact, lattice, k, width, y, out, work):
    """:func:`turn`, or if not `exact` :func:`add_field`, for a width that is known while compiling."""
    n, cosets, tiles = lattice.n, lattice.cosets[k], tiles_at(lattice.n)
    largest = _find_phases(lattice, width, work)
    if not exact:
        work[sines_at(n) : sines_at(n) + n * width] = work[phases_at(n) : phases_at(n) + n * width]
    elif largest <= 0.5 * REDUCIBLE:
        _sines(REDUCED_ANGLES, n, width, work)
    else:
        _sines(ANY_ANGLES, n, width, work)
    _repeat_sines(n, width, work)
    for c in range(1, n // 2 + 1, WIDTH if width == 1 else 1):
        if width == 1:
            _pack(cosets, n, c, y, work, tiles + 2 * (n // 2 + 1) * TILE)
        _fold(lattice, cosets, c, width, y, work, tiles)
        _transform(lattice, work, tiles)
        _turn_components(exact, lattice, c, width, work, tiles)
        _transform(lattice, work, tiles)
        _unfold(lattice, cosets, c, width, out, work, tiles)
        if width == 1:
            _unpack(cosets, n, c, out, work, tiles)
    return largest


@called
def turn(lattice, k, width, y, work):
    """The flow of line k with the amplitudes in `work`, of `width` states y[i * width + path], in place.

    `width` is 1 or WIDTH.  Returns a bound of the largest angle.
    """
    if width == 1:
        return 2.0 * _turn(True, lattice, k, 1, y, y, work)
    return 2.0 * _turn(True, lattice, k, 8, y, y, work)


@called
def add_field(lattice, k, width, y, out, work):
    """out + B(y) grad H for the H of line k with the amplitudes in `work`, in place; shapes as for :func:`turn`."""
    if width == 1:
        _turn(False, lattice, k, 1, y, out, work)
    else:
        _turn(False, lattice, k, 8, y, out, work)
