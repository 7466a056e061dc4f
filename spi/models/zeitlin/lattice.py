"""Modes of the torus modulo an odd N, the lines through 0 on which they lie, and shells of equal length.

A mode is a pair of integers m = (m1, m2), understood modulo N and written with |m1|, |m2| <= M, N = 2M + 1.  Since
omega_{-m} is the complex conjugate of omega_m, one of m and -m stands for both: that with m2 > 0, or m2 = 0 < m1.
These d/2 = (N^2 - 1)/2 modes go row by row, m2 = 0, 1, ..., M, and in a row from m1 = M down; for N = 3 this is the
paper's order (1,0), (1,1), (0,1), (-1,1).

A state is (Re omega, Im omega) of mode after mode, d = N^2 - 1 floats.
"""

import functools
import math

Mode = tuple[int, int]


@functools.cache
def modes(n: int) -> tuple[Mode, ...]:
    """The (N^2 - 1)/2 modes that stand for all, in the order of the state."""
    largest = n // 2
    rows = [(m1, 0) for m1 in range(largest, 0, -1)]
    return (*rows, *((m1, m2) for m2 in range(1, largest + 1) for m1 in range(largest, -largest - 1, -1)))


def nearest(n: int, mode: Mode) -> Mode:
    """The representative of a mode with |m1|, |m2| <= M."""
    half = n // 2
    return (mode[0] + half) % n - half, (mode[1] + half) % n - half


def shell(mode: Mode) -> int:
    """The shell of a mode: |m|, rounded to the nearest integer."""
    return round(math.hypot(*mode))


@functools.cache
def places(n: int) -> dict[Mode, tuple[int, int]]:
    """Mode -> (number of the mode that stands for it, 1, or -1 where omega is the complex conjugate of that)."""
    found = {m: (i, 1) for i, m in enumerate(modes(n))}
    return found | {(-a, -b): (i, -1) for (a, b), (i, _) in found.items()}


@functools.cache
def lines(n: int) -> tuple[tuple[Mode, tuple[Mode, ...]], ...]:
    """The lines through 0, ((g, modes), ...): the cyclic subgroups of N elements, each with the modes it moves.

    The line of g has all multiples of g; the generator g is the first of its modes in the order of the state, and lines
    follow each other in the order of their generators.  Each mode that stands for two belongs to the first line on
    which it lies, of which there are several only where N is no prime.
    """
    order = {m: i for i, m in enumerate(modes(n))}
    taken: set[Mode] = set()
    on_line: set[Mode] = set()
    found = []
    for g in modes(n):
        if g in on_line or math.gcd(g[0], g[1], n) > 1:
            continue
        line = [nearest(n, (a * g[0], a * g[1])) for a in range(1, n)]
        on_line.update(m for a, m in enumerate(line, 1) if math.gcd(a, n) == 1)
        own = sorted((m for m in line if m in order and m not in taken), key=order.__getitem__)
        taken.update(own)
        found.append((g, tuple(own)))
    return tuple(found)
