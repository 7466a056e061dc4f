"""Directions of spins, under the key ``initial``.

    initial: {spins: [0, 0, 1]}
    initial: {spins: random, seed: 2}

They become the numbers of the state, which decide results.
"""

from typing import Annotated, Any, Literal

import numpy as np
import pydantic

from spi.ensemble.long_states import state_of
from spi.ensemble.protocol import dimension
from spi.plugins.spins.models import Spins
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
