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
# M + 1 rows: sums, differences, their cosine transform, their sine transform.


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
    return tiles_at(n) + 4 * (n // 2 + 1) * TILE


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
            multiply_tile(work, 0, columns, lattice.phases_across, q, stride, work, first + q, 1)
    else:
        multiply_tile(lattice.phases, 0, columns, work, 0, TILE, work, first, n)
        for q in range(1, n):
            store(work, first + q * WIDTH, load(work, first + q * TILE))
    largest = 0.0
    for i in range(first, first + n * width):
        largest = max(largest, abs(work[i]))
    return largest


@inlined
def _sines(angles, n, width, work):
    """Sines and versines of the phases."""
    first, begin, size = phases_at(n), sines_at(n), sines_length(n)
    phases, sines, versines = work[first:], work[begin:], work[begin + size :]
    for i in range(n * width):
        sines[i], versines[i] = sin_versine(angles, phases[i])


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
    """Add rows of TILE to the z_j of cosets c, c + 1, ... of one path."""
    for column in range(min(WIDTH, n // 2 + 1 - c)):
        first = (c + column - 1) * n
        for j in range(n):
            place = cosets[first + j]
            sign = 1.0 - 2.0 * (place & 1)
            out[place - (place & 1)] += work[at + j * TILE + column]
            out[place | 1] += sign * work[at + j * TILE + WIDTH + column]


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
    """Add to z_j of `out`, or keep for :func:`_unpack` what is to be added."""
    if width == 1:
        store(work, at + j * TILE, re)
        store(work, at + j * TILE + WIDTH, im)
    else:
        place = cosets[(c - 1) * n + j]
        sign = 1.0 - 2.0 * (place & 1)
        first, second = (place - (place & 1)) * WIDTH, (place | 1) * WIDTH
        store(out, first, load(out, first) + re)
        store(out, second, load(out, second) + sign * im)


@inlined
def _fold(cosets, n, c, width, y, work, tiles):
    """Sums and differences of z_j and z_{N-j}."""
    half = n // 2
    part = (half + 1) * TILE
    re, im = _row(cosets, n, c, 0, width, y, work, tiles + 2 * part)
    store(work, tiles, re)
    store(work, tiles + WIDTH, im)
    for j in range(1, half + 1):
        re, im = _row(cosets, n, c, j, width, y, work, tiles + 2 * part)
        other_re, other_im = _row(cosets, n, c, n - j, width, y, work, tiles + 2 * part)
        at = tiles + j * TILE
        store(work, at, re + other_re)
        store(work, at + WIDTH, im + other_im)
        store(work, at + part, re - other_re)
        store(work, at + part + WIDTH, im - other_im)


@inlined
def _unfold(cosets, n, c, width, out, work, tiles):
    """Add the transform back, divided by N, to the z_j of `out`."""
    half, share = n // 2, 1.0 / n
    part = (half + 1) * TILE
    cos, sin = tiles + 2 * part, tiles + 3 * part
    re, im = share * load(work, cos), share * load(work, cos + WIDTH)
    _add_to_row(cosets, n, c, 0, width, out, work, tiles, re, im)
    for j in range(1, half + 1):
        a_re, a_im = load(work, cos + j * TILE), load(work, cos + j * TILE + WIDTH)
        b_re, b_im = load(work, sin + j * TILE), load(work, sin + j * TILE + WIDTH)
        re, im = share * (a_re - b_im), share * (a_im + b_re)
        _add_to_row(cosets, n, c, j, width, out, work, tiles, re, im)
        re, im = share * (a_re + b_im), share * (a_im - b_re)
        _add_to_row(cosets, n, c, n - j, width, out, work, tiles, re, im)


@inlined
def _transform(lattice, work, tiles):
    """The cosine transform of the sums and the sine transform of the differences."""
    half = lattice.n // 2
    part = (half + 1) * TILE
    multiply_tile(lattice.cosines, 0, half + 1, work, tiles, TILE, work, tiles + 2 * part, half + 1)
    multiply_tile(lattice.sines, 0, half, work, tiles + part + TILE, TILE, work, tiles + 3 * part + TILE, half)


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
def _turn_components(exact, n, c, width, work, tiles):
    """From the transforms of a tile to sums and differences of what is to be added to u_q and u_{-q}."""
    half, size = n // 2, sines_length(n)
    part, up, down = (half + 1) * TILE, sines_at(n), sines_at(n) + 2 * sines_length(n)
    re, im = load(work, tiles + 2 * part), load(work, tiles + 2 * part + WIDTH)
    re, im = _turned(exact, work, up + c * width, down + c * width, size, re, im)
    store(work, tiles, re)
    store(work, tiles + WIDTH, im)
    for q in range(1, half + 1):
        at = tiles + q * TILE
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
        _fold(cosets, n, c, width, y, work, tiles)
        _transform(lattice, work, tiles)
        _turn_components(exact, n, c, width, work, tiles)
        _transform(lattice, work, tiles)
        _unfold(cosets, n, c, width, out, work, tiles)
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
