"""Eigenvalues that are nearly equal: how many digits they cost, and how their spaces are moved together.

The projections on the spaces of two eigenvalues have entries of 1 over the gap, which cancel in a motion.  Both
together are one space with a projection of size 1, and about the mean of the eigenvalues N_j = c_j K, K^2 = kappa.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import mpmath
import numpy as np

from .eigenspaces import (
    CLOSE,
    TINY,
    Coordinates,
    Eigen,
    Near,
    Row,
    Space,
    both_placed,
    coordinates,
    entries_of,
    power_of,
    size_of,
)

_NEAR = mpmath.mpf(10) ** -2  # relative: so near are eigenvalues whose spaces may be moved together


def loss(spaces: Sequence[Space], matrices: Sequence[Any], order: Sequence[int]) -> float:
    """By how much the terms that a motion adds up exceed what they add up to, over a time of 1 over the largest rate.

    What one component adds to another is taken to be 1, or as much as (1 - |M|/m)^-1 has there if that is more: |M| is
    the sum of the matrices without their signs, m twice its spectral radius.
    """
    size = np.abs(sum(np.array(matrix.tolist(), float) for matrix in map(_without_signs, matrices)))
    radius = float(max(abs(np.linalg.eigvals(size))))
    fastest = max((_speed(space) for space in spaces), default=0.0)
    if not radius or not fastest:
        return 1.0
    natural = np.linalg.inv(np.eye(len(order)) - size / (2.0 * radius))
    added = sum(_added(space, 1.0 / fastest, order) for space in spaces)
    return float(np.max(added / np.maximum(natural, 1.0)))


def _without_signs(matrix: Any) -> Any:
    return matrix.apply(abs)


def _speed(space: Space) -> float:
    own = 0.0 if space.near is None else float(mpmath.sqrt(abs(space.near.square)) * max(map(abs, space.near.factors)))
    return max(*(float(abs(x)) for x in (*space.rates, *space.phases)), own)


def _added(space: Space, time: float, order: Sequence[int]) -> np.ndarray:
    """The sizes of the terms by which each component moves with each other, an array (component, component)."""
    left, right = _dense(space.left, order), _dense(space.right, order).T
    rate = min(1.0, time * sum(float(abs(x)) for x in space.rates))
    phase = min(1.0, time * sum(float(abs(x)) for x in space.phases))
    (a, b), (c, d) = ((np.abs(x.real), np.abs(x.imag)) for x in (left, right))
    found = (c @ a + d @ b) * (rate + phase**2) + (c @ b + d @ a) * (phase + rate)
    inner = np.zeros((len(space.left), len(space.left)))
    for shear in space.shears:
        for m, n, value in shear:
            inner[m, n] += time * float(abs(value))
    if space.near is not None:
        moved = time * float(max(map(abs, space.near.factors)))
        inner += min(1.0, moved**2 * float(abs(space.near.square))) * np.eye(len(inner))
        for m, n, value in space.near.entries:
            inner[m, n] += moved * float(abs(value))
    return found + np.abs(right) @ inner @ np.abs(left)


def _dense(rows: Sequence[Row], order: Sequence[int]) -> np.ndarray:
    place = {component: n for n, component in enumerate(order)}
    dense = np.zeros((len(rows), len(order)), complex)
    for n, row in enumerate(rows):
        for component, value in row.items():
            dense[n, place[component]] = complex(value)
    return dense


# ---------------------------------------------------------------------------------------------------------------------
# Two spaces as one
# ---------------------------------------------------------------------------------------------------------------------


def together(
    matrices: Sequence[Any], mixed: Any, values: Sequence[Eigen], spaces: Sequence[Space], order: Sequence[int]
) -> list[Space]:
    """The spaces, those of eigenvalues that are nearly equal put together two by two, the nearest first."""
    left = dict(enumerate(spaces))
    found = []
    for first, second in _pairs(mixed, values):
        if first in left and second in left:
            joint = _joint(matrices, mixed, values[first], values[second], (spaces[first], spaces[second]), order)
            if joint is not None:
                left.pop(first)
                left.pop(second, None)
                found.append(joint)
    return [*left.values(), *found]


def _pairs(mixed: Any, values: Sequence[Eigen]) -> list[tuple[int, int]]:
    """Numbers of eigenvalues that are nearly equal; of one twice where it is nearly its own conjugate."""
    size = size_of(mixed, [e.value for e in values])
    found = []
    for n, first in enumerate(values):
        if first.is_complex:
            found.append((2 * mpmath.im(first.value), n, n))
        for m, second in enumerate(values[n + 1 :], n + 1):
            if first.is_complex == second.is_complex:
                found.append((abs(first.value - second.value), n, m))
    return [(n, m) for gap, n, m in sorted(found) if gap < _NEAR * size]


def _joint(
    matrices: Sequence[Any],
    mixed: Any,
    first: Eigen,
    second: Eigen,
    spaces: tuple[Space, Space],
    order: Sequence[int],
) -> Space | None:
    """The two spaces as one; None if there they are not K with K^2 a real number times factors."""
    multiplicity = first.multiplicity + second.multiplicity
    if first is second:  # and its conjugate
        power = power_of(mixed, first.value, 1) * power_of(mixed, mpmath.conj(first.value), 1)
        power = power.apply(mpmath.re) ** first.multiplicity
    else:
        power = power_of(mixed, first.value, first.multiplicity) * power_of(mixed, second.value, second.multiplicity)
    is_complex = first.is_complex and first is not second
    found = coordinates(matrices, power, multiplicity)
    rates = [(a + b) / 2 for a, b in zip(spaces[0].rates, spaces[1].rates, strict=True)]
    phases = [(a + b) / 2 * is_complex for a, b in zip(spaces[0].phases, spaces[1].phases, strict=True)]
    near = _near(list(_about(found, rates, phases)))
    if near is None:
        return None
    left, right = both_placed(found, is_complex, order)
    return Space(tuple(rates), tuple(phases), left, right, tuple(() for _ in matrices), near)


def _about(found: Coordinates, rates: Sequence[Any], phases: Sequence[Any]) -> Iterator[Any]:
    """Each of the matrices about its mean eigenvalue."""
    for acting, rate, phase in zip(found.acting, rates, phases, strict=True):
        yield acting - (mpmath.mpc(rate, phase) if phase else rate) * mpmath.eye(acting.rows)


def _near(rests: Sequence[Any]) -> Near | None:
    """K and its multiples, if that is what the matrices are."""
    largest = max(rests, key=lambda rest: mpmath.mnorm(rest, "f"))
    size = mpmath.mnorm(largest, "f")
    if not size:
        return None
    d = largest.rows
    row, column = max(((m, n) for m in range(d) for n in range(d)), key=lambda place: abs(largest[place]))
    factors = [rest[row, column] / largest[row, column] for rest in rests]
    square = largest * largest
    kappa = mpmath.fsum(square[n, n] for n in range(d)) / d
    exact = all(
        mpmath.mnorm(rest - c * largest, "f") <= TINY * size for rest, c in zip(rests, factors, strict=True)
    ) and mpmath.mnorm(square - kappa * mpmath.eye(d), "f") <= CLOSE * abs(kappa)
    if not exact or any(abs(mpmath.im(x)) > TINY * abs(x) for x in (kappa, *factors)):
        return None
    return Near(tuple(mpmath.re(c) for c in factors), mpmath.re(kappa), entries_of(largest))
