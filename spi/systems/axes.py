"""exp(sum_j a_j M_j) of matrices that do not commute, by Rodrigues' formula.

Where A(a) = sum_j a_j M_j fulfils A^3 = -w A with a quadratic form w(a), exp(A) = 1 + sin(r)/r A + (1 - cos r)/r^2 A^2
with r^2 = w; hyperbolic functions where w < 0.  This holds for rotations of vectors about any axis.
"""

import itertools
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import mpmath

from .brackets import DIGITS, NOTHING
from .eigenspaces import TINY
from .functionals import Entries
from .splitting import connected

_MOST = 6  # matrices that do not commute


class Axis(NamedTuple):
    """Components that turn together about an axis."""

    components: tuple[int, ...]
    matrices: Mapping[int, Entries]  #: the number of a parameter a_j -> M_j on these components
    square: Mapping[tuple[int, int], mpmath.mpf]  #: w = sum square[i, j] a_i a_j with i <= j
    definite: bool  #: whether w is never negative
    lost: int = 0  #: see :attr:`.spectrum.Block.lost`


def clusters(matrices: Sequence[Entries]) -> list[list[int]]:
    """The numbers of matrices that do not commute, those together that are linked; none where all commute."""
    pairs = itertools.combinations(range(len(matrices)), 2)
    return [sorted(group) for group in connected((i, j) for i, j in pairs if not _commute(matrices[i], matrices[j]))]


def _commute(first: Entries, second: Entries) -> bool:
    total: dict[tuple[int, int], Any] = {}
    for a, b, sign in ((first, second, 1), (second, first, -1)):
        for (i, k), x in a.items():
            for (m, j), y in b.items():
                if k == m:
                    total[i, j] = total.get((i, j), mpmath.mpf(0)) + sign * x * y
    return all(abs(value) < NOTHING for value in total.values())


def axes(matrices: Sequence[Entries], cluster: Sequence[int], parts: Sequence[set[int]]) -> list[Axis] | None:
    """How some components turn by a cluster of matrices, part by part; None where Rodrigues' formula does not hold."""
    if len(cluster) > _MOST:
        return None
    found = []
    with mpmath.workdps(DIGITS):
        for part in parts:
            order = sorted(part)
            inside = {n: {p: c for p, c in matrices[n].items() if p[0] in part} for n in cluster}
            square = _square(list(inside.values()), order)
            if square is None:
                return None
            named = {(cluster[i], cluster[j]): value for (i, j), value in square.items()}
            kept = {n: entries for n, entries in inside.items() if entries}
            found.append(Axis(tuple(order), kept, named, _is_definite(square, len(cluster))))
    return found


def _square(matrices: Sequence[Entries], order: Sequence[int]) -> dict[tuple[int, int], Any] | None:
    """The quadratic form w, from its values at random points, and checked at others."""
    count = len(matrices)
    places = [(i, j) for i in range(count) for j in range(i, count)]
    points = [[mpmath.frac(mpmath.sqrt(2 + 3 * n + 5 * j) * 7) for j in range(count)] for n in range(len(places) + 3)]
    values = [_value(matrices, order, point) for point in points]
    if None in values:
        return None
    rows = mpmath.matrix([[point[i] * point[j] for i, j in places] for point in points])
    solved = mpmath.lu_solve(rows[: len(places), :], mpmath.matrix(values[: len(places)]))
    if mpmath.mnorm(rows * solved - mpmath.matrix(values), "f") > TINY:
        return None
    return {place: solved[n] for n, place in enumerate(places) if abs(solved[n]) > TINY}


def _value(matrices: Sequence[Entries], order: Sequence[int], point: Sequence[Any]) -> Any:
    """w at one point; None where A^3 is no multiple of A."""
    place = {component: n for n, component in enumerate(order)}
    total = mpmath.zeros(len(order))
    for entries, a in zip(matrices, point, strict=True):
        for (i, j), c in entries.items():
            total[place[i], place[j]] += a * c
    cube = total**3
    size = mpmath.mnorm(total, "f")
    i, j = max(((i, j) for i in range(len(order)) for j in range(len(order))), key=lambda p: abs(total[p]))
    w = -cube[i, j] / total[i, j]
    return w if mpmath.mnorm(cube + w * total, "f") < TINY * size**3 else None


def _is_definite(square: Mapping[tuple[int, int], Any], count: int) -> bool:
    matrix = mpmath.zeros(count)
    for (i, j), c in square.items():
        matrix[i, j] += c / 2
        matrix[j, i] += c / 2
    return min(mpmath.eigsy(matrix, eigvals_only=True)) > -TINY
