"""The mean of H(y(T)) over the paths of a scheme, at each step size."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from spi.ensemble.loop import integrated, nested_grid
from spi.ensemble.protocol import hamiltonian
from spi.kinds.blocks import BlocksPlan
from spi.kinds.plans import Cost, Done, State
from spi.numerics.rng import LANES
from spi.schemes import typical_ns
from spi.statistics.estimators import stderr_of_mean
from spi.storage.records import Part

from .results import Energies


class Sums(NamedTuple):
    """H at the end of some paths."""

    paths: int
    seconds: float
    cpu_seconds: float
    energy: np.ndarray  #: (levels, paths)

    def plus(self, later: "Sums") -> "Sums":
        joined = np.concatenate((self.energy, later.energy), axis=1)
        return Sums(
            self.paths + later.paths, self.seconds + later.seconds, self.cpu_seconds + later.cpu_seconds, joined
        )


def parts(case: Any) -> list[Part]:
    return [Part(scheme, eps=eps) for scheme, eps in case.runs]


def plan(case: Any, part: Part) -> "EnergyPlan":
    times = nested_grid(case.final_time, case.reference_step, case.steps, case.truncate_noise, None)
    return EnergyPlan(case=case, part=part, grid=times, samples=case.samples)


@dataclass(frozen=True, kw_only=True)
class EnergyPlan(BlocksPlan):
    def cost(self) -> Cost:
        steps = int(self.steps.sum()) * self.samples
        return Cost(steps, steps * 1e-9 * typical_ns(self.row, self.model), 8 * self.samples)

    def empty(self, number: int) -> Sums:
        return Sums(0, 0.0, 0.0, np.zeros((len(self.steps), 0)))

    def most_blocks(self, number: int) -> int:
        return 64

    def rows(self, number: int, first: int, blocks: int, end: int) -> np.ndarray:
        states, _ = integrated(self.scheme, self.model, self.initial, self.grid, self.stream, first, blocks, end)
        return states.reshape(blocks, len(self.steps), len(self.initial), LANES)

    def added(self, sums: Sums, rows: np.ndarray, at: slice, first: int, end: int) -> Sums:
        y = np.moveaxis(rows[at], 0, -2).reshape(len(self.steps), len(self.initial), -1)
        energy = np.array([hamiltonian(self.model, tuple(states)) for states in y])[:, : end - first * LANES]
        return sums._replace(energy=np.concatenate((sums.energy, energy), axis=1))

    def progress(self, state: State) -> Done:
        return Done(state.tally().paths, self.samples, float("nan"))

    def results(self, state: State) -> Energies:
        energy = state.total().energy[:-1]
        return Energies(
            about=self.description(),
            h=np.array(self.case.steps),
            energy=energy.mean(axis=1),
            energy_stderr=stderr_of_mean(energy),
            samples=self.samples,
        )
