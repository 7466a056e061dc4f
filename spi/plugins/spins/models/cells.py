"""Fields and energies of very many spins in one state, from the bonds of the cell: no table of the sites is needed.

The state is (3 sites,), sites as in ``lattices.py``.  Sums are added row by row of the lattice, so that their bits do
not depend on threads.
"""

import functools
from typing import Any, NamedTuple

import numpy as np
from numba import prange

from spi.compiler.dispatch import device, kernel
from spi.compiler.vectors import without_refcount
from spi.numerics.types import Array

from .tables import bond_matrices


class CellNeighbours(NamedTuple):
    """Neighbours of the sites of a cell, and the lattice that it makes."""

    size: Array  #: (3,) cells along each vector
    first: Array  #: (sites of the cell + 1,) where the neighbours of a site begin
    other: Array  #: the number of a neighbour in its cell
    shift: Array  #: (neighbours, 3) the cells between them
    couplings: Array  #: (neighbours, 9): the matrix A of the bond, seen from the site
    isotropic: Array  #: (neighbours,) whether A is a multiple of 1
    periodic: bool


@functools.lru_cache(16)
def cells_of(model: Any, along: int | None = None) -> CellNeighbours:
    """Neighbours in a lattice of spins; with `along` bonds count by how far they lead along that vector."""
    matrices, cell = bond_matrices(model), model.cell
    away = np.ones(len(cell.bonds)) if along is None else cell.displacements[:, along]
    back = 1.0 if along is None else -1.0
    ends: list[list[tuple[int, Array, Array]]] = [[] for _ in cell.sites]
    for (i, j, shift), matrix, far in zip(cell.bonds, matrices, away, strict=True):
        ends[i].append((j, np.array(shift), far * matrix))
        ends[j].append((i, -np.array(shift), back * far * matrix.T))
    every = [end for of_site in ends for end in of_site]
    couplings = np.array([matrix.ravel() for _, _, matrix in every]).reshape(-1, 9)
    return CellNeighbours(
        size=np.array((*model.size, 1, 1)[:3]),
        first=np.cumsum([0, *map(len, ends)]),
        other=np.array([other for other, _, _ in every], np.int64),
        shift=np.array([shift for _, shift, _ in every], np.int64).reshape(-1, 3),
        couplings=couplings,
        isotropic=np.array([np.array_equal(a.reshape(3, 3), a[0] * np.eye(3)) for a in couplings], bool),
        periodic=model.is_periodic,
    )


def neighbour_fields(model: Any, state: Array, along: int | None = None) -> Array:
    """(sites, 3): the fields of the neighbours, each weighted as in :func:`cells_of`."""
    fields, of = np.empty(len(state)), cells_of(model, along)
    sum_cells(of, np.ascontiguousarray(state), fields, np.empty(of.size[0] * of.size[1]))
    return fields.reshape(-1, 3)


def bond_energy(model: Any, state: Array) -> float:
    """Energy of all bonds."""
    of = cells_of(model)
    rows = np.empty(of.size[0] * of.size[1])
    sum_cells(of, np.ascontiguousarray(state), np.empty(0), rows)
    return -0.5 * float(rows.sum())


def call_of_sums(model: Any) -> tuple[Any, tuple[Any, ...]]:
    """Kernel and the arguments of a call of no rows, which only has it compiled."""
    nothing = np.empty(0)
    return sum_cells, (cells_of(model), nothing, nothing, nothing)


@kernel(parallel=True)
def sum_cells(cells, state, fields, rows):
    """Put the fields of neighbours into `fields`, if it has room, and s . field of rows of cells into `rows`."""
    records = [cells]
    for row in prange(len(rows)):
        of = records[0]
        rows[row] = sum_of_row(of, row, state, fields)


@device(inline=False)
def sum_of_row(cells, row, state, fields):
    """Sum over the cells of one row, those with the same first two places."""
    x, y = row // cells.size[1], row % cells.size[1]
    length, per_cell, total = cells.size[2], len(cells.first) - 1, 0.0
    rows = np.empty(len(cells.other), np.int64)  # where the row of a neighbour begins, -1 where there is none
    for e in range(len(rows)):
        p, q = x + cells.shift[e, 0], y + cells.shift[e, 1]
        inside = 0 <= p < cells.size[0] and 0 <= q < cells.size[1]
        place = p % cells.size[0] * cells.size[1] + q % cells.size[1]
        rows[e] = place * length if inside or cells.periodic else -1
    for z in range(length):
        for s in range(per_cell):
            bx, by, bz = 0.0, 0.0, 0.0
            for e in range(cells.first[s], cells.first[s + 1]):
                r = z + cells.shift[e, 2]
                if r < 0 or r >= length:
                    r = r % length if cells.periodic else -1
                if rows[e] < 0 or r < 0:
                    continue
                there = spin_at(state, (rows[e] + r) * per_cell + cells.other[e])
                sx, sy, sz = there[0], there[1], there[2]
                if cells.isotropic[e]:
                    exchange = cells.couplings[e, 0]
                    bx, by, bz = bx + exchange * sx, by + exchange * sy, bz + exchange * sz
                else:
                    bx += cells.couplings[e, 0] * sx + cells.couplings[e, 1] * sy + cells.couplings[e, 2] * sz
                    by += cells.couplings[e, 3] * sx + cells.couplings[e, 4] * sy + cells.couplings[e, 5] * sz
                    bz += cells.couplings[e, 6] * sx + cells.couplings[e, 7] * sy + cells.couplings[e, 8] * sz
            i = (row * length + z) * per_cell + s
            if len(fields) > 0:
                field = spin_at(fields, i)
                field[0], field[1], field[2] = bx, by, bz
            here = spin_at(state, i)
            total += here[0] * bx + here[1] * by + here[2] * bz
    return total


@device
def spin_at(y, i):
    """Spin of site i, a view: Numba cannot see that an index such as 3 i is not negative."""
    return without_refcount(y[3 * i : 3 * i + 3])
