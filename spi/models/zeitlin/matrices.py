"""The Casimirs C_k = tr W^k / N, k = 2, 3, ...: for large N the means of omega(x)^k over the torus.

W = sum_m omega_m T_m is a Hermitian N x N matrix, with T_m = w^(m1 m2) Q^m1 P^m2, w = exp(2 pi i / N), from the clock
Q = diag(w^(2 a)) and the shift P.  Since Q P = w^(-2) P Q or w^2 P Q, as the shift is directed,
T_m T_n = w^(+-(m x n)) T_{m+n}, whose commutators are those of the bracket.
"""

import numpy as np

from ...compiler.dispatch import device
from ...compiler.tiles import multiply_tile
from ...compiler.vectors import TILE, WIDTH


@device(inline=False)
def matrix(lattice, y, re, im):
    """W of a state in `re` and `im` (N, N): W[a, a + s] = sum over m1 of omega_(m1, s) w^(m1 (2a + s))."""
    n = lattice.n
    re[:], im[:] = 0.0, 0.0
    for i in range(len(y) // 2):
        m1, m2 = lattice.modes[i, 0] % n, lattice.modes[i, 1]
        for a in range(n):
            b = (a + m2) % n
            turn = m1 * (2 * a + m2) % n
            cos, sin = lattice.turns[turn, 0], lattice.turns[turn, 1]
            entry_re, entry_im = y[2 * i] * cos - y[2 * i + 1] * sin, y[2 * i] * sin + y[2 * i + 1] * cos
            re[a, b] += entry_re
            im[a, b] += entry_im
            re[b, a] += entry_re
            im[b, a] -= entry_im


@device(inline=False)
def product(n, a_re, a_im, b_re, b_im, re, im, work):
    """The product of two complex N x N matrices, given and found as real and imaginary parts; `work` has 3 N TILE."""
    tile, first, second = work[: n * TILE], work[n * TILE : 2 * n * TILE], work[2 * n * TILE :]
    for begin in range(0, n, WIDTH):
        columns = min(WIDTH, n - begin)
        for r in range(n):
            for j in range(columns):
                tile[r * TILE + j], tile[r * TILE + WIDTH + j] = b_re[r, begin + j], b_im[r, begin + j]
        multiply_tile(a_re.ravel(), 0, n, tile, 0, TILE, first, 0, TILE, n)
        multiply_tile(a_im.ravel(), 0, n, tile, 0, TILE, second, 0, TILE, n)
        for r in range(n):
            for j in range(columns):
                re[r, begin + j] = first[r * TILE + j] - second[r * TILE + WIDTH + j]
                im[r, begin + j] = first[r * TILE + WIDTH + j] + second[r * TILE + j]


@device(inline=False)
def trace_of_product(a_re, a_im, b_re, b_im):
    """tr(A B) of Hermitian matrices, which is real."""
    n, total = len(a_re), 0.0
    for i in range(n):
        row = 0.0
        for j in range(n):
            row += a_re[i, j] * b_re[i, j] + a_im[i, j] * b_im[i, j]
        total += row
    return total


@device(inline=False)
def first_casimirs(lattice, count, y):
    """(C_2, C_3, ...), `count` of them: tr(V V) and tr(V V W) of V = W, W^2, ..., one product for each."""
    n = lattice.n
    found = np.empty(count)
    w = np.empty((2, n, n))
    matrix(lattice, y, w[0], w[1])
    power, following, work = w.copy(), np.zeros((2, n, n)), np.zeros(3 * n * TILE)
    for c in range(count):
        if c % 2 == 0:
            found[c] = trace_of_product(power[0], power[1], power[0], power[1]) / n
        else:
            product(n, power[0], power[1], w[0], w[1], following[0], following[1], work)
            found[c] = trace_of_product(power[0], power[1], following[0], following[1]) / n
            power, following = following, power
    return found
