"""The mean of H(y(T)) over the paths of a scheme, at each step size."""

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any

import numpy as np

from spi.ensemble.loop import Grid
from spi.ensemble.protocol import hamiltonian
from spi.kinds.blocks import BlocksPlan, lanes_of
from spi.kinds.plans import each_scheme, reference_grid
from spi.statistics.accumulators import Array, Sums, joined
from spi.statistics.estimators import stderr_of_mean

from .results import Energies

parts = each_scheme


class EnergySums(Sums):
    """H at the end of some paths, at each step size."""

    energy: Annotated[Array, joined("level")]


@dataclass(frozen=True, kw_only=True)
class EnergyPlan(BlocksPlan):
    """The energies of one scheme."""

    record = Energies
    sums = EnergySums

    @cached_property
    def grid(self) -> Grid:
        return reference_grid(self.case, self.part, self.case.steps)

    def lengths(self, number: int) -> dict[str, int]:
        return {"level": len(self.steps)}

    def observe(self, number: int, first: int, blocks: int, end: int) -> dict[str, Array]:
        states, _ = self.integrated(first, blocks, end)
        y = np.moveaxis(lanes_of(states, len(self.initial)), 2, 0)
        return {"energy": np.asarray(hamiltonian(self.model, tuple(y)))}

    def estimates(self, sums: EnergySums) -> dict[str, Any]:
        energy = sums.energy[:-1]
        return {
            "h": np.array(self.case.steps),
            "energy": energy.mean(axis=1),
            "energy_stderr": stderr_of_mean(energy),
        }


plan = EnergyPlan.of
