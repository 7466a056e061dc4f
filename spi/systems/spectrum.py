"""exp(a_1 M_1 + ... + a_r M_r) of commuting real matrices in closed form, for all a at once.

The components fall into blocks that no matrix links.  A block splits into the joint generalised eigenspaces of its
matrices.  On one of them M_j = chi_j + N_j with numbers chi_j and commuting nilpotent N_j, so that the exponential is
e^z sum_n (sum_j a_j N_j)^n / n! with z = sum_j a_j chi_j: rotations by Im z, scalings by e^(Re z), shears by the N_j.
Complex eigenspaces come in conjugate pairs, of which one is kept.

Where two eigenvalues are nearly equal, the projections on their spaces are large and cancel: of 16 digits those of
1 over the gap are lost.  The two spaces are then moved together: N_j is a multiple c_j of one matrix K with
K^2 = kappa, and exp(b K) = 1 + (cosh(sqrt(kappa) b) - 1) + sinh(sqrt(kappa) b)/sqrt(kappa) K has no such cancellation.
"""

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import mpmath
import numpy as np

from .eigenspaces import (
    CLOSE,
    DIGITS,
    TINY,
    Coordinates,
    Eigen,
    Inseparable,
    Near,
    Row,
    Space,
    both_placed,
    coordinates,
    entries_of,
    power_of,
    separated,
    size_of,
)
from .functionals import Entries
from .splitting import connected

_BEARABLE, _MOST_LOSS = 30.0, 1e4  # see :func:`loss`: roundings of 1e-16 become so many times larger
_NEAR = mpmath.mpf(10) ** -2  # relative: so near are eigenvalues whose spaces may be moved together


class Block(NamedTuple):
    """Components that move together."""

    components: tuple[int, ...]
    spaces: tuple[Space, ...]
    #: (M, omega^2) where exp(a M) = 1 + sin(omega a)/omega M + (1 - cos(omega a))/omega^2 M^2, for one matrix with
    #: M^3 = -omega^2 M; negative omega^2 for hyperbolic functions, None where this does not hold
    turn: tuple[Entries, mpmath.mpf] | None
    cancels: bool  #: whether the spaces would lose digits, so that the turn is to be taken
    lost: int  #: digits that are lost nevertheless, where eigenvalues are nearly equal


def blocks(matrices: Sequence[Entries]) -> list[Block]:
    """What moves under commuting matrices, block by block."""
    links = [place for entries in matrices for place in entries]
    found = []
    with mpmath.workdps(DIGITS):
        for group in connected(links):
            order = sorted(group)
            parts = [{p: c for p, c in entries.items() if p[0] in group} for entries in matrices]
            dense = [_dense(entries, order) for entries in parts]
            acting = [entries for entries in parts if entries]
            turn = _turn(acting[0], order) if len(acting) == 1 else None
            spaces, lost = _spaces(dense, order, turn is not None)
            moving = tuple(space for space in spaces if space.moves)
            cancels = lost >= _BEARABLE
            digits = round(math.log10(lost)) if cancels and turn is None else 0
            found.append(Block(tuple(order), moving, turn, cancels, digits))
    return found


def _spaces(matrices: Sequence[Any], order: Sequence[int], has_turn: bool) -> tuple[list[Space], float]:
    """(spaces, what they lose, see :func:`loss`); Inseparable if that is too much and there is no other way."""
    mixed, values, spaces = separated(matrices, order)
    lost = loss(spaces, matrices, order)
    if lost < _BEARABLE or has_turn:
        return spaces, lost
    joint = together(matrices, mixed, values, spaces, order)
    if (less := loss(joint, matrices, order)) < lost / 10:
        spaces, lost = joint, less
    if lost > _MOST_LOSS:
        digits = f"{math.ceil(math.log10(lost))} of 16 digits, and {math.log10(_MOST_LOSS):.0f} may be lost"
        raise Inseparable(f"its field has eigenvalues so close to one another that each step would lose {digits}")
    return spaces, lost


def _dense(entries: Entries, order: Sequence[int]) -> Any:
    place = {component: n for n, component in enumerate(order)}
    matrix = mpmath.zeros(len(order))
    for (row, column), value in entries.items():
        matrix[place[row], place[column]] = value
    return matrix


def _turn(entries: Entries, order: Sequence[int]) -> tuple[Entries, mpmath.mpf] | None:
    """See :attr:`Block.turn`."""
    matrix = _dense(entries, order)
    cube = matrix**3
    size = mpmath.mnorm(matrix, "f")
    largest = max(entries, key=lambda place: abs(entries[place]))
    row, column = (order.index(component) for component in largest)
    square = -cube[row, column] / matrix[row, column]
    if abs(square) < CLOSE**2 * size**2 or mpmath.mnorm(cube + square * matrix, "f") > TINY * size**3:
        return None
    return entries, square


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
    left, right = _by_component(space.left, order), _by_component(space.right, order).T
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


def _by_component(rows: Sequence[Row], order: Sequence[int]) -> np.ndarray:
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
