"""Sites in the order of other programs: x fastest, where the state has the last vector of the lattice fastest."""

from collections.abc import Sequence
from typing import Any

import numpy as np


def along_first(spins: np.ndarray, size: Sequence[int], per_cell: int, back: bool = False) -> np.ndarray:
    """(sites, ...) of a state with cells along the first vector fastest, or `back`; sites of a cell stay together."""
    lengths = (*size, 1, 1)[:3]
    shape = (*(lengths[::-1] if back else lengths), per_cell, *spins.shape[1:])
    return np.ascontiguousarray(np.swapaxes(spins.reshape(shape), 0, 2)).reshape(spins.shape)


def places_of(lattice: Any) -> np.ndarray:
    """(sites, 3): places of the sites, cells along the first vector fastest.

    `lattice` is a model, or what its ``geometry`` says by the same names.
    """
    get = lattice.get if isinstance(lattice, dict) else lambda name: getattr(lattice.cell, name, None)
    size = lattice["size"] if isinstance(lattice, dict) else lattice.size
    sites, vectors = np.array(get("sites")), np.array(get("vectors"))
    lengths = (*size, 1, 1)[:3]
    cells = np.stack(np.meshgrid(*map(np.arange, lengths), indexing="ij"), axis=-1).reshape(-1, 3)
    places = (cells[:, : len(vectors)] @ vectors)[:, np.newaxis] + sites
    return along_first(places.reshape(-1, 3), size, len(sites))
