"""Tables of the sine-Euler equations for an N, for kernels: places of modes, their weights, transforms."""

import functools
import itertools
import math
from collections.abc import Iterable
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from spi.compiler.vectors import TILE, WIDTH

# ---------------------------------------------------------------------------------------------------------------------
# Modes of the torus modulo an odd N, the lines through 0 on which they lie, and shells of equal length.
#
# A mode is a pair of integers m = (m1, m2), understood modulo N and written with |m1|, |m2| <= M, N = 2M + 1.  Since
# omega_{-m} is the complex conjugate of omega_m, one of m and -m stands for both: that with m2 > 0, or m2 = 0 < m1.
# These d/2 = (N^2 - 1)/2 modes go row by row, m2 = 0, 1, ..., M, and in a row from m1 = M down; for N = 3 this is the
# paper's order (1,0), (1,1), (0,1), (-1,1).
#
# A state is (Re omega, Im omega) of mode after mode, d = N^2 - 1 floats.
# ---------------------------------------------------------------------------------------------------------------------

Mode = tuple[int, int]


@functools.cache
def modes(n: int) -> tuple[Mode, ...]:
    """(N^2 - 1)/2 modes of the state, one of each pair m, -m, in their order."""
    largest = n // 2
    rows = [(m1, 0) for m1 in range(largest, 0, -1)]
    return (*rows, *((m1, m2) for m2 in range(1, largest + 1) for m1 in range(largest, -largest - 1, -1)))


def nearest(n: int, mode: Mode) -> Mode:
    """Representative of a mode with |m1|, |m2| <= M."""
    half = n // 2
    return (mode[0] + half) % n - half, (mode[1] + half) % n - half


def shell(mode: Mode) -> int:
    """Shell of a mode: |m|, rounded to the nearest integer."""
    return round(math.hypot(*mode))


@functools.cache
def places(n: int) -> dict[Mode, tuple[int, int]]:
    """Mode -> (number of the mode that stands for it, 1, or -1 where omega is the complex conjugate of that)."""
    stored = {m: (i, 1) for i, m in enumerate(modes(n))}
    return stored | {(-a, -b): (i, -1) for (a, b), (i, _) in stored.items()}


@functools.cache
def lines(n: int) -> tuple[tuple[Mode, tuple[Mode, ...]], ...]:
    """Lines through 0, ((g, modes), ...): the cyclic subgroups of N elements, each with the modes it moves.

    The line of g has all multiples of g; the generator g is the first of its modes in the order of the state, and lines
    follow each other in the order of their generators.  Each mode of the state belongs to the first line on which
    it lies; it lies on several only where N is no prime.
    """
    order = {m: i for i, m in enumerate(modes(n))}
    taken: set[Mode] = set()
    on_line: set[Mode] = set()
    through_origin = []
    for g in modes(n):
        if g in on_line or math.gcd(g[0], g[1], n) > 1:
            continue
        line = [nearest(n, (a * g[0], a * g[1])) for a in range(1, n)]
        on_line.update(m for a, m in enumerate(line, 1) if math.gcd(a, n) == 1)
        own = sorted((m for m in line if m in order and m not in taken), key=order.__getitem__)
        taken.update(own)
        through_origin.append((g, tuple(own)))
    return tuple(through_origin)


class LineTables(NamedTuple):
    """Lines of an N.  On the line of g all modes are a g, a = 1, ..., N - 1; see ``flows.py`` for the rest."""

    n: int
    #: (lines, M N): the places of the modes m_c + j g, j = 0, ..., N - 1, on the cosets c = 1, ..., M of the line:
    #: twice the number of the mode, plus 1 where the mode is the conjugate of that
    cosets: np.ndarray
    #: (lines, M + 1) of the line of (s, 1) the positions M - s j, modulo N, in the rows j of the state; -1 for
    #: lines and N to which ``flows.InRows`` does not apply
    middles: np.ndarray
    own_first: np.ndarray  #: (lines + 1,) where the modes that a line moves begin in the arrays that follow
    own_mode: np.ndarray  #: number of the mode
    own_multiple: np.ndarray  #: a - 1 of the mode a g, or of its conjugate, a = 1, ..., M
    own_sign: np.ndarray  #: -1.0 where it is the conjugate
    own_weight: np.ndarray  #: 1 / |m|^2
    phases: np.ndarray  #: (N, 2M) cos and sin of 2 pi a q / N, a = 1, ..., M, one after the other
    phases_across: np.ndarray  #: its transpose, with as many columns as fill tiles
    order: np.ndarray  #: (M + 1,) 0 and one of j and N - j, j = 1, ..., M, in the order of the rows of transforms
    blocks_of: int  #: b of :func:`by_blocks`; M where transforms are dense
    cosines: np.ndarray  #: (M + 1, M + 1) cos(2 pi j q / N), or the blocks of that without the first row and column
    sines: np.ndarray  #: (M, M) sin(2 pi j q / N) without the first, or its blocks
    fourier: np.ndarray  #: (2, a, a) the real Fourier matrix of :func:`by_blocks`, and its transpose
    rest: float  #: see :func:`rest_of_share`
    modes: np.ndarray  #: (d/2, 2)
    turns: np.ndarray  #: (N, 2) cos and sin of 2 pi r / N


class OnLine(NamedTuple):
    """Place of a mode on the line that moves it: m = a g, or m = -a g with the sign -1, a = 1, ..., M."""

    line: int
    multiple: int  #: a - 1
    sign: float


@functools.lru_cache(maxsize=8)
def on_lines(n: int) -> dict[Mode, OnLine]:
    """Each mode of the state and its place, line by line."""
    places_on_lines = {}
    for k, (g, own) in enumerate(lines(n)):
        multiples = {nearest(n, (a * g[0], a * g[1])): a for a in range(1, n)}
        for m in own:
            a = multiples[m]
            places_on_lines[m] = OnLine(k, a - 1, 1.0) if a <= n // 2 else OnLine(k, n - a - 1, -1.0)
    return places_on_lines


@functools.lru_cache(maxsize=8)
def _places(n):
    """(N, N) the place of the mode (m1, m2), both modulo N, as in ``Lattice.cosets``; -1 for 0."""
    table = np.full((n, n), -1, np.int32)
    for (m1, m2), (i, sign) in places(n).items():
        table[m1, m2] = 2 * i + (sign < 0)
    return table


def _cosets(n, g):
    """(M N,) a row of ``Lattice.cosets``."""
    # some mode u with u x g = 1 modulo n; gcd(g, n) = 1
    u = next(m for m in places(n) if (m[0] * g[1] - m[1] * g[0]) % n == 1)
    c, j = np.arange(1, n // 2 + 1)[:, np.newaxis], np.arange(n)
    return _places(n)[(c * u[0] + j * g[0]) % n, (c * u[1] + j * g[1]) % n].ravel()


def _middles(n, g):
    """(M + 1,) a row of ``Lattice.middles``."""
    if g[1] != 1 or n < WIDTH:
        return [-1] * (n // 2 + 1)
    return [(n // 2 - g[0] * row) % n for row in range(n // 2 + 1)]


def _turns(n, rows, columns):
    """(cos, sin) of 2 pi r c / N, with the product reduced first, so that equal entries are equal to the bit."""
    reduced = np.multiply.outer(rows, columns) % n
    angles = [2 * math.pi * (r if 2 * r < n else r - n) / n for r in range(n)]
    return (np.array([f(angle) for angle in angles])[reduced] for f in (math.cos, math.sin))


def _generator(n):
    """A number whose powers modulo the prime n = 2M + 1, M odd, are M different ones, no two of which add up to 0."""
    half = n // 2
    return next(g * g % n for g in range(2, n) if len({pow(g, 2 * r, n) for r in range(half)}) == half)


_WORTHWHILE = 0.75  # of the operations of a dense transform; smaller matrices take longer for each


def row_order(n: int) -> tuple[np.ndarray, int]:
    """Order of the rows of transforms, and b of :func:`by_blocks` where that takes fewer operations; else M."""
    half = n // 2
    dense = np.arange(half + 1), half
    if half % 2 == 0 or any(n % p == 0 for p in range(3, math.isqrt(n) + 1)):
        return dense

    def cost(b):
        a = half // b
        return 2 * b * a * a + (2 * a - 1) * b * b

    b = min((b for b in range(1, half) if half % b == 0), key=cost, default=half)
    if b == half or cost(b) > _WORTHWHILE * half**2:
        return dense
    h = _generator(n)
    return np.array([0, *(pow(h, r, n) for r in range(half))]), b


def real_fourier(a: int) -> np.ndarray:
    """(a, a) for odd a the orthogonal matrix with rows 1, cos, sin, cos, sin, ... of 2 pi f r / a."""
    f, r = np.arange(1, a // 2 + 1), np.arange(a)
    cos, sin = _turns(a, f, r)
    return np.vstack(
        [np.full((1, a), math.sqrt(1 / a)), math.sqrt(2 / a) * np.stack([cos, sin], axis=1).reshape(-1, a)]
    )


def by_blocks(matrix: np.ndarray, fourier: np.ndarray) -> np.ndarray:
    """Blocks of a matrix K of M rows, K[r, s] a function of r + s modulo M, one after the other.

    Such are the matrices of a cosine or sine transform of prime length whose rows are in the order of the powers of a
    number (Rader, Proceedings of the IEEE 56, 1968).  With M = a b, r = r1 + b r2, the Fourier transform over r2 leaves
    a block of b x b for the frequency 0 and one of 2b x 2b for each pair of frequencies.
    """
    full = _without_rest(fourier, matrix)
    return np.concatenate([full[i:j, i:j].ravel() for i, j in _block_ends(len(fourier), len(matrix))])


def _block_ends(a: int, m: int) -> Iterable[tuple[int, int]]:
    """(begin, end) of each block."""
    b = m // a
    return itertools.pairwise([0, *range(b, m + 1, 2 * b)])


def _without_rest(fourier: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """(M, M) the transformed matrix, symmetric, with 0 beside its blocks."""
    both = np.kron(fourier, np.eye(len(matrix) // len(fourier)))
    full, blocks = both @ matrix @ both.T, np.zeros_like(matrix)
    for i, j in _block_ends(len(fourier), len(matrix)):
        blocks[i:j, i:j] = 0.5 * (full[i:j, i:j] + full[i:j, i:j].T)
    return blocks


def _integers(matrix: np.ndarray) -> np.ndarray:
    """2^100 times a matrix, exactly."""
    return np.vectorize(lambda x: int(math.ldexp(x, 100)), otypes=[object])(matrix)


def rest_of_share(n: int, cosines: np.ndarray, sines: np.ndarray, fourier: np.ndarray) -> float:
    """Correction of the float 1 / N, by which the transform back divides, with which Casimirs have no bias.

    Rounded, the matrix F of the transform has not quite the norm |F|^2 = N^2 (Frobenius), and 1 / N is not quite 1 / N;
    all flows would lose or gain a part of 1e-17 or so times the square of their angles.  The matrices are M x M, those
    of rows and columns from 1 to M, or products with blocks: F_a^T B F_a.
    """
    total, unit = 0, 2**100
    for matrix in (cosines, sines):
        entries, scale = _integers(matrix), unit
        if (a := len(fourier)) > 1:
            both = np.kron(_integers(fourier), np.eye(len(matrix) // a, dtype=object))
            blocks = _integers(_without_rest(fourier, matrix))
            entries, scale = both.T @ blocks @ both, unit**3
        total += Fraction(int(np.square(entries).sum()), scale**2)
    share = (2 - (1 + 4 * (n // 2) + 4 * total) / n**2) / n
    return float(share - Fraction(1.0 / n))


@functools.lru_cache(maxsize=8)
def lattice(n: int) -> LineTables:
    """Tables of an N."""
    half = n // 2
    own = on_lines(n)
    cos, sin = _turns(n, np.arange(n), np.arange(1, half + 1))
    phases = np.stack([cos, sin], axis=2).reshape(n, 2 * half)
    across = np.zeros((2 * half, -(-n // TILE) * TILE))
    across[:, :n] = phases.T
    order, blocks_of = row_order(n)
    cosines, sines = _turns(n, order, order)
    sines = sines[1:, 1:]
    fourier = real_fourier(half // blocks_of)
    rest = rest_of_share(n, cosines[1:, 1:], sines, fourier)
    if blocks_of < half:
        cosines, sines = (by_blocks(matrix, fourier) for matrix in (cosines[1:, 1:], sines))
    return LineTables(
        n=n,
        cosets=np.array([_cosets(n, g) for g, _ in lines(n)]),
        middles=np.array([_middles(n, g) for g, _ in lines(n)]),
        own_first=np.cumsum([0, *(len(moved) for _, moved in lines(n))]),
        own_mode=np.array([places(n)[m][0] for m in own]),
        own_multiple=np.array([at.multiple for at in own.values()]),
        own_sign=np.array([at.sign for at in own.values()]),
        own_weight=np.array([1.0 / (m1**2 + m2**2) for m1, m2 in own]),
        phases=phases.ravel(),
        phases_across=across.ravel(),
        order=order,
        blocks_of=blocks_of,
        cosines=cosines.ravel(),
        sines=sines.ravel(),
        fourier=np.stack([fourier, fourier.T]).ravel(),
        rest=rest,
        modes=np.array(modes(n)),
        turns=np.stack(list(_turns(n, np.arange(n), np.array([1]))), axis=2).reshape(n, 2),
    )
