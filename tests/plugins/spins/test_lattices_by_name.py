"""Bonds of the lattices that have names, against all distances between sites on a torus."""

import itertools
from types import SimpleNamespace

import numpy as np
import pytest

from spi.plugins.spins.kinds.trajectory.figure import _cells
from spi.plugins.spins.models.lattices import LATTICES, lattice

SIZE = {1: (9,), 2: (5, 5), 3: (5, 5, 5)}
#: name -> (bonds of a site, length) of each shell, and how many types of bonds the first shell has.
SHELLS = {
    "ring": ([(2, 1.0)], 1),
    "square": ([(4, 1.0)], 2),
    "triangular": ([(6, 1.0)], 3),
    "honeycomb": ([(3, 3**-0.5)], 3),
    "cubic": ([(6, 1.0)], 3),
    "bcc": ([(8, 0.75**0.5)], 8),
    "kagome": ([(4, 0.5)], 6),
    "ring_j1_j2": ([(2, 1.0), (2, 2.0)], 1),
    "square_j1_j2": ([(4, 1.0), (4, 2**0.5)], 2),
    "honeycomb_j1_j2": ([(3, 3**-0.5), (6, 1.0)], 3),
}


@pytest.mark.parametrize("name", sorted({*LATTICES} - {"chain"}))
def test_bonds_are_all_pairs_at_the_least_distances(name):
    shells, first = SHELLS[name]
    cell = LATTICES[name]
    size = SIZE[len(cell.vectors)]
    vectors = np.array(cell.vectors)
    cells = np.array(list(itertools.product(*map(range, size))))
    places = ((cells @ vectors)[:, None] + np.array(cell.sites)).reshape(-1, 3)
    images = np.array(list(itertools.product(*((-n, 0, n) for n in size)))) @ vectors
    distances = np.linalg.norm(places[:, None, None] - places[None, :, None] + images, axis=-1).min(axis=-1)
    different = np.unique(np.round(distances, 9))[1:]
    found = lattice(cell, size, True)
    for number, (count, length) in enumerate(shells):
        assert different[number] == pytest.approx(length, abs=1e-8)
        pairs = {(i, j) for i, j in np.argwhere(abs(distances - length) < 1e-9).tolist() if i < j}
        here = found.types < first if number == 0 else found.types >= first
        bonds = [tuple(sorted(bond)) for bond in found.bonds[here].tolist()]
        assert len(bonds) == len(set(bonds)) and set(bonds) == pairs
        assert (np.bincount(np.ravel(bonds), minlength=len(places)) == count).all()


@pytest.mark.parametrize(
    ("name", "corners", "filled"),
    [("square", 4, 1), ("triangular", 6, 1), ("honeycomb", None, 0.91), ("kagome", None, 0.93)],
)
def test_sites_are_drawn_side_by_side(name, corners, filled):
    """Squares and hexagons fill the plane; around holes a little is left; each is around its own site, none overlap."""
    cell = LATTICES[name]
    one = SimpleNamespace(place={"sites": cell.sites, "vectors": cell.vectors})
    cells = _cells(one)
    areas = [0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) for x, y in (c.T for c in cells)]
    whole = abs(np.linalg.det(np.array(cell.vectors)[:2, :2]))
    assert len(cells) == len(cell.sites) and filled - 0.01 < sum(areas) / whole < filled + 0.01
    assert corners is None or [len(np.unique(c.round(9), axis=0)) for c in cells] == [corners]
