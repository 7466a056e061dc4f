"""Lattices of sites and bonds: cells that repeat, and colours of bonds and sites that do not touch each other.

Site s of the cell at (x, y, z) has the number ((x L_2 + y) L_3 + z) S + s, where a cell has S sites and there are L_1,
L_2, L_3 cells along its vectors.
"""

import functools
import itertools
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Len

from spi.compiler.dispatch import kernel

#: In one and two dimensions the last numbers, which are 0, may be left out.
LatticeVector = Annotated[tuple[float, ...], Len(1, 3)]
Pair = tuple[int, int, Annotated[tuple[int, ...], Len(1, 3)]]

MOST_COLOURS = 63  #: bits of a word, less its sign


class _Cell(NamedTuple):
    """Fields of a cell."""

    sites: Annotated[tuple[LatticeVector, ...], Len(1), "places of the sites of a cell, each of one to three numbers"]
    vectors: Annotated[tuple[LatticeVector, ...], Len(1, 3), "one to three vectors by which the cell repeats"]
    bonds: Annotated[
        tuple[Pair, ...], Len(1), "bonds such as [0, 1, [1, 0, 0]]: site 0 here with site 1 of the cell one further"
    ]


class Cell(_Cell):
    """A cell of a lattice: its sites and the bonds that begin in it, all in three dimensions."""

    __slots__ = ()

    def __new__(cls, sites, vectors, bonds):
        sites, vectors = (tuple((*map(float, place), 0.0, 0.0)[:3] for place in places) for places in (sites, vectors))
        return super().__new__(cls, sites, vectors, tuple((i, j, (*shift, 0, 0)[:3]) for i, j, shift in bonds))

    def __str__(cell):
        return f"{len(cell.sites)} sites, {len(cell.bonds)} bonds a cell"

    @property
    def fractions(cell):
        """(sites, vectors): the places of the sites in units of the vectors."""
        return np.linalg.lstsq(np.transpose(cell.vectors), np.transpose(cell.sites))[0].T

    @property
    def displacements(cell):
        """(bonds, vectors): how many cells each bond leads on along each vector."""
        first, second = np.array([bond[:2] for bond in cell.bonds]).T
        shifts = np.array([shift[: len(cell.vectors)] for _, _, shift in cell.bonds])
        return cell.fractions[second] - cell.fractions[first] + shifts

    def direction(cell, bond):
        """Unit vector along a bond."""
        first, second, shift = cell.bonds[bond]
        places = np.array(cell.sites)
        along = places[second] - places[first] + np.array(shift[: len(cell.vectors)]) @ np.array(cell.vectors)
        return along / np.linalg.norm(along)


_X, _Y, _Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
_ORIGIN = ((0.0, 0.0, 0.0),)
_ALONG = [(0, 0, shift) for shift in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]
_SLANTED = (0.5, 0.75**0.5, 0.0)
_CORNERS = tuple((0, 1, shift) for shift in itertools.product((0, -1), repeat=3))

#: name -> cell; chain is open, the others are periodic unless ``boundary`` says otherwise.
LATTICES = {
    "chain": Cell(_ORIGIN, (_X,), tuple(_ALONG[:1])),
    "ring": Cell(_ORIGIN, (_X,), tuple(_ALONG[:1])),
    "square": Cell(_ORIGIN, (_X, _Y), tuple(_ALONG[:2])),
    "triangular": Cell(_ORIGIN, (_X, _SLANTED), (*_ALONG[:2], (0, 0, (1, -1, 0)))),
    "honeycomb": Cell(
        ((0.0, 0.0, 0.0), (0.5, 0.75**0.5 / 3, 0.0)),
        (_X, _SLANTED),
        ((0, 1, (0, 0, 0)), (0, 1, (-1, 0, 0)), (0, 1, (0, -1, 0))),
    ),
    "cubic": Cell(_ORIGIN, (_X, _Y, _Z), tuple(_ALONG)),
    "bcc": Cell((*_ORIGIN, (0.5, 0.5, 0.5)), (_X, _Y, _Z), _CORNERS),
    "kagome": Cell(
        ((0.0, 0.0, 0.0), (0.5, 0.0, 0.0), (0.25, 0.75**0.5 / 2, 0.0)),
        (_X, _SLANTED),
        (
            *((0, 1, (0, 0, 0)), (0, 2, (0, 0, 0)), (1, 2, (0, 0, 0))),
            *((1, 0, (1, 0, 0)), (2, 0, (0, 1, 0)), (1, 2, (1, -1, 0))),
        ),
    ),
}


def _with_second(name: str, *shifts: tuple[int, int, int]) -> Cell:
    """A cell that also has the bonds of each site with its like by these shifts, behind the others."""
    cell = LATTICES[name]
    return Cell(*cell[:2], (*cell.bonds, *((site, site, shift) for site in range(len(cell.sites)) for shift in shifts)))


LATTICES |= {
    "ring_j1_j2": _with_second("ring", (2, 0, 0)),
    "square_j1_j2": _with_second("square", (1, 1, 0), (1, -1, 0)),
    "honeycomb_j1_j2": _with_second("honeycomb", (1, 0, 0), (0, 1, 0), (1, -1, 0)),
}


class Lattice(NamedTuple):
    """Sites and bonds of a lattice."""

    sites: int
    of_cell: np.ndarray  #: (sites,) the number of a site in its cell
    bonds: np.ndarray  #: (bonds, 2) the sites of a bond, bonds of one type together
    types: np.ndarray  #: (bonds,) the number of the bond in the cell
    around: np.ndarray  #: (bonds, 3) how often the bond goes around the lattice along each vector
    bond_colours: np.ndarray  #: (bonds,) from 0 on: no two bonds of one colour share a site
    site_colours: np.ndarray  #: (sites,) from 0 on: no bond joins two sites of one colour


@functools.lru_cache(8)
def lattice(cell: Cell, size: tuple[int, ...], periodic: bool) -> Lattice:
    """Lattice of `size` cells along the vectors of a cell; ValueError, with a reason, if there is none."""
    lengths = (*size, 1, 1)[:3]
    per_cell = len(cell.sites)
    cells = np.stack(np.meshgrid(*map(np.arange, lengths), indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(len(cells)).reshape(lengths)
    bonds, types, around = [], [], []
    for kind, (first, second, shift) in enumerate(cell.bonds):
        ends = cells + np.array(shift)
        inside = ((ends >= 0) & (ends < lengths)).all(axis=1)
        whole = np.ones(len(cells), bool) if periodic else inside
        there = number[tuple((ends % lengths)[whole].T)]
        bonds.append(np.stack([number.ravel()[whole] * per_cell + first, there * per_cell + second], axis=1))
        types.append(np.full(len(there), kind))
        around.append((ends // lengths)[whole])
    bonds, types, around = np.concatenate(bonds), np.concatenate(types), np.concatenate(around)
    sites = len(cells) * per_cell
    if (bonds[:, 0] == bonds[:, 1]).any():
        raise ValueError("joins a site to itself")
    bond_colours, site_colours = np.empty(len(bonds), np.int64), np.empty(sites, np.int64)
    if not colour_bonds(bonds, np.zeros(sites, np.int64), bond_colours):
        raise ValueError(f"gives a site more than {MOST_COLOURS // 2} bonds")
    first, others, _ = neighbours(sites, bonds)
    colour_sites(first, others, site_colours)
    of_cell = np.tile(np.arange(per_cell), len(cells))
    return Lattice(sites, of_cell, bonds, types, around, bond_colours, site_colours)


def neighbours(sites, bonds):
    """(first, other, bond): the neighbours of site i are other[first[i] : first[i + 1]], across bonds 2 b or 2 b + 1.

    The number of a bond is even where the site is its first one.
    """
    here = bonds.ravel()
    order = np.argsort(here, kind="stable")
    first = np.concatenate([[0], np.cumsum(np.bincount(here, minlength=sites))])
    return first, bonds[:, ::-1].ravel()[order], order


@kernel
def colour_bonds(bonds, used, colours):
    """Give each bond the first colour that no earlier bond of its sites has; False if there are too many."""
    for b in range(len(bonds)):
        taken, colour = used[bonds[b, 0]] | used[bonds[b, 1]], 0
        while (taken >> colour) & 1:
            colour += 1
        if colour >= MOST_COLOURS:
            return False
        colours[b] = colour
        used[bonds[b, 0]] |= np.int64(1) << colour
        used[bonds[b, 1]] |= np.int64(1) << colour
    return True


@kernel
def colour_sites(first, others, colours):
    """Give each site the first colour that no earlier neighbour has: fewer than a site has neighbours, plus one."""
    for i in range(len(colours)):
        taken, colour = np.int64(0), 0
        for e in range(first[i], first[i + 1]):
            if others[e] < i:
                taken |= np.int64(1) << colours[others[e]]
        while (taken >> colour) & 1:
            colour += 1
        colours[i] = colour
