"""Directions of spins, under the key ``initial``: named ones, or those in a file.

    initial: {spins: [0, 0, 1]}
    initial: {spins: random, seed: 2}
    initial: {file: skyrmion.ovf}

They become the numbers of the state, which decide results.
"""

from typing import Annotated, Any, Literal

import numpy as np
import pydantic

from spi.ensemble.long_states import state_of
from spi.ensemble.protocol import dimension
from spi.plugins.spins.models import Spins
from spi.plugins.spins.storage.order import along_first, places_of
from spi.specs.files import Files
from spi.specs.keys import Keys, Seed, StateKey, entries_in, key_of, wrong


def _one_or_more(value: Any) -> Any:
    """A single direction as a list of it."""
    return [value] if isinstance(value, list) and not any(isinstance(entry, list) for entry in value) else value


class SpinStates(Keys):
    """Spins along one direction, along one for each site of the cell, or in random directions."""

    spins: key_of(
        Annotated[
            Literal["random"] | tuple[StateKey, ...],
            pydantic.BeforeValidator(_one_or_more),
        ],
        "the direction of all spins, a list of those of the sites of a cell, or random",
    )
    seed: key_of(Seed, "of random directions") = 1

    def state(self, model: Any, files: Files) -> Any:
        """State of a lattice of spins."""
        if not isinstance(model, Spins):
            raise wrong("has spins, which is for the model spins", "give a list, a number per component", "spins")
        sites, per_cell = dimension(model) // 3, len(model.cell.sites)
        if self.spins == "random":
            directions = np.random.default_rng(self.seed).standard_normal((sites, 3))
        else:
            if any(len(direction) != 3 or not any(direction) for direction in self.spins):
                raise wrong("has a direction that is none", "give three numbers, not all 0, such as [0, 0, 1]", "spins")
            given = np.array(self.spins, float)
            if len(given) not in (1, per_cell):
                raise wrong(f"has {entries_in(len(given))}", f"must have 1 or {per_cell}", "spins")
            directions = np.tile(given, (sites // len(given), 1))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        return state_of(directions)


def of_array(model: Any, values: np.ndarray, subtract_mean: bool) -> Any:
    """State of the spins in an array, each divided by its length: see :data:`shapes`.

    Lengths that differ from 1 by less than 1e-9 stay, so that a stored state comes back to the last bit.
    """
    if not isinstance(model, Spins):
        raise wrong("is an array of spins, which is for the model spins", "give a number per component", "file")
    if subtract_mean:
        raise wrong("is true, which is for fields", "leave it out", "subtract_mean")
    cell, size = model.cell, model.size
    sites = dimension(model) // 3
    if values.shape == (sites, 6):
        _check_places(model, values[:, :3])
        directions = along_first(values[:, 3:], size, len(cell.sites), back=True)
    elif values.shape in (fitting := shapes(model)):
        directions = values.reshape(-1, 3)
    else:
        two = sorted(dict.fromkeys(fitting), key=len)[:2]  # the others have lengths of 1 besides
        right = f"must have {' or '.join(' x '.join(map(str, shape)) for shape in two)}"
        raise wrong(f"has {' x '.join(map(str, values.shape))} numbers", right, "file")
    lengths = np.linalg.norm(directions, axis=1, keepdims=True)
    if not lengths.all():
        raise wrong(f"has the spin {int(np.argmin(lengths)) + 1} of length 0", "give every spin a direction", "file")
    return state_of(directions if abs(lengths - 1).max() < 1e-9 else directions / lengths)


def shapes(model: Spins) -> list[tuple[int, ...]]:
    """Shapes of an array of spins: (sites, 3), or the cells along each vector, the sites of a cell if several, and 3.

    A lattice in fewer than three dimensions may have lengths of 1 besides.
    """
    per_cell = len(model.cell.sites)
    inner = [(per_cell, 3), *([(3,)] if per_cell == 1 else [])]
    sizes = dict.fromkeys([model.size, (*model.size, 1, 1)[:3]])
    return [(dimension(model) // 3, 3), *((*size, *end) for size in sizes for end in inner)]


def _check_places(model: Spins, places: np.ndarray) -> None:
    """Raise the error about points of a file that are not the sites, up to their unit and where they begin."""
    own = places_of(model)
    own, given = own - own[0], places - places[0]
    unit = float((own * given).sum() / max((own * own).sum(), 1e-300)) or 1.0
    if abs(given - unit * own).max() > 1e-3 * abs(unit):
        right = "must be in the order of the sites, the first vector fastest, up to a unit of length"
        raise wrong("has points elsewhere than the sites of the lattice", right, "file")
