"""What kernels must know of the sine-Euler equations for an N: where modes stand, their weights, transforms."""

import functools
import math
from typing import NamedTuple

import numpy as np

from ...vectors import TILE
from .lattice import Mode, lines, modes, nearest, places


class Lattice(NamedTuple):
    """The lines of an N.  On the line of g all modes are a g, a = 1, ..., N - 1; see ``flows.py`` for the rest."""

    n: int
    #: (lines, M N): where on coset c = 1, ..., M of the line the modes m_c + j g, j = 0, ..., N - 1, stand: twice the
    #: number of the mode, plus 1 where the mode is the conjugate of that
    cosets: np.ndarray
    own_first: np.ndarray  #: (lines + 1,) where the modes that a line moves begin in the arrays that follow
    own_mode: np.ndarray  #: number of the mode
    own_multiple: np.ndarray  #: a - 1 of the mode a g, or of its conjugate, a = 1, ..., M
    own_sign: np.ndarray  #: -1.0 where it is the conjugate
    own_weight: np.ndarray  #: 1 / |m|^2
    phases: np.ndarray  #: (N, 2M) cos and sin of 2 pi a q / N, a = 1, ..., M, one after the other
    phases_across: np.ndarray  #: its transpose, with as many columns as fill tiles
    cosines: np.ndarray  #: (M + 1, M + 1) cos(2 pi j q / N)
    sines: np.ndarray  #: (M, M) sin(2 pi j q / N), j, q = 1, ..., M
    modes: np.ndarray  #: (d/2, 2)
    turns: np.ndarray  #: (N, 2) cos and sin of 2 pi r / N


class OnLine(NamedTuple):
    """Where a mode stands on the line that moves it: m = a g, or m = -a g with the sign -1, a = 1, ..., M."""

    line: int
    multiple: int  #: a - 1
    sign: float


@functools.lru_cache(maxsize=8)
def on_lines(n: int) -> dict[Mode, OnLine]:
    """Each mode that stands for two, line by line."""
    found = {}
    for k, (g, own) in enumerate(lines(n)):
        multiples = {nearest(n, (a * g[0], a * g[1])): a for a in range(1, n)}
        for m in own:
            a = multiples[m]
            found[m] = OnLine(k, a - 1, 1.0) if a <= n // 2 else OnLine(k, n - a - 1, -1.0)
    return found


def _cosets(n, g):
    """(M N,) as :class:`Lattice` says."""
    where, found = places(n), []
    numbers = {place: 2 * i + (sign < 0) for place, (i, sign) in where.items()}
    # some u with u x g = 1 modulo n, found among the modes; gcd(g, n) = 1
    u = next(m for m in where if (m[0] * g[1] - m[1] * g[0]) % n == 1)
    for c in range(1, n // 2 + 1):
        found += [numbers[nearest(n, (c * u[0] + j * g[0], c * u[1] + j * g[1]))] for j in range(n)]
    return found


def _turns(n, rows, columns):
    """(cos, sin) of 2 pi r c / N, with the product reduced first, so that equal entries are equal to the bit."""
    reduced = np.multiply.outer(rows, columns) % n
    angles = [2 * math.pi * (r if 2 * r < n else r - n) / n for r in range(n)]
    return (np.array([f(angle) for angle in angles])[reduced] for f in (math.cos, math.sin))


@functools.lru_cache(maxsize=8)
def lattice(n: int) -> Lattice:
    """The tables of an N."""
    half = n // 2
    own = on_lines(n)
    cos, sin = _turns(n, np.arange(n), np.arange(1, half + 1))
    phases = np.stack([cos, sin], axis=2).reshape(n, 2 * half)
    across = np.zeros((2 * half, -(-n // TILE) * TILE))
    across[:, :n] = phases.T
    cosines, _ = _turns(n, np.arange(half + 1), np.arange(half + 1))
    _, sines = _turns(n, np.arange(1, half + 1), np.arange(1, half + 1))
    return Lattice(
        n=n,
        cosets=np.array([_cosets(n, g) for g, _ in lines(n)], np.int32),
        own_first=np.cumsum([0, *(len(moved) for _, moved in lines(n))]),
        own_mode=np.array([places(n)[m][0] for m in own]),
        own_multiple=np.array([at.multiple for at in own.values()]),
        own_sign=np.array([at.sign for at in own.values()]),
        own_weight=np.array([1.0 / (m1**2 + m2**2) for m1, m2 in own]),
        phases=phases.ravel(),
        phases_across=across.ravel(),
        cosines=cosines.ravel(),
        sines=sines.ravel(),
        modes=np.array(modes(n)),
        turns=np.stack(list(_turns(n, np.arange(n), np.array([1]))), axis=2).reshape(n, 2),
    )
