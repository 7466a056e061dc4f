"""The mean of H(y(T)) over the paths of a scheme, at each step size."""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from spi.ensemble import FinalStates, empty_report, integrate, nested_grid
from spi.estimators import stderr_of_mean
from spi.kinds.plans import Cost, Done, PathsPlan
from spi.protocol import hamiltonian
from spi.records import Group, Part, Variables
from spi.rng import LANES
from spi.schemes import typical_ns


class State(NamedTuple):
    """Nothing, or all, is done."""

    seconds: float
    energy: np.ndarray  #: (levels, paths)


def parts(case: Any) -> list[Part]:
    return [Part(scheme, eps=eps) for scheme, eps in case.runs]


def plan(case: Any, part: Part) -> "EnergyPlan":
    times = nested_grid(case.final_time, case.reference_step, case.steps, case.truncate_noise, None)
    return EnergyPlan(case=case, part=part, grid=times, samples=case.samples)


@dataclass(frozen=True, kw_only=True)
class EnergyPlan(PathsPlan):
    def cost(self) -> Cost:
        steps = int(self.steps.sum()) * self.samples
        return Cost(steps, steps * 1e-9 * typical_ns(self.part.scheme, self.model), 8 * self.samples)

    def start(self) -> State:
        return State(seconds=0.0, energy=np.zeros((len(self.steps), 0)))

    def batches(self, state: State) -> Iterator[State]:
        if state.energy.size:
            return
        began = time.perf_counter()
        levels, d = len(self.steps), len(self.initial)
        last = FinalStates(np.empty((self.blocks, levels, d * LANES)), self.steps)
        report = empty_report(self.blocks, levels)
        arguments = self.grid, self.stream, last, report, 0, self.blocks, self.samples
        integrate(self.scheme, self.model, self.initial, *arguments)
        y = np.moveaxis(last.y.reshape(self.blocks, levels, d, LANES), 0, -2).reshape(levels, d, -1)
        energy = np.array([hamiltonian(self.model, tuple(states)) for states in y])[:, : self.samples]
        yield State(seconds=time.perf_counter() - began, energy=energy)

    def progress(self, state: State) -> Done:
        return Done(state.energy.shape[1], self.samples, float("nan"))

    def group(self, state: State) -> Group:
        energy = state.energy[:0:-1]
        mean, stderr = energy.mean(axis=1), stderr_of_mean(energy)
        variables: Variables = {"energy": (("h",), mean), "energy_stderr": (("h",), stderr)}
        attributes = {**self.description(), "samples": self.samples}
        return Group(self.case.name, self.part.variant, {"h": np.array(self.case.steps)}, variables, attributes)
