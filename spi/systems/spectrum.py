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
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import mpmath

from .eigenspaces import CLOSE, DIGITS, TINY, Inseparable, Space, separated
from .near import loss, together
from .splitting import connected

Entries = Mapping[tuple[int, int], mpmath.mpf]  #: (row, column) -> number of a matrix

_BEARABLE, _MOST_LOSS = 30.0, 1e4  # see :func:`.near.loss`: roundings of 1e-16 become so many times larger


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
    """(spaces, what they lose, see :func:`.near.loss`); Inseparable if that is too much and there is no other way."""
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
