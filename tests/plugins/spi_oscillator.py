"""A plug-in in one file of another package: a model, a kind of experiment and a function for Python."""

from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np

from spi.drawing.panels import CurvePanel, Figures
from spi.ensemble.protocol import NonNegative
from spi.kinds.blocks import SampledPlan, lanes_of
from spi.kinds.plans import each_scheme
from spi.plugins import Plugin
from spi.printing.tables import Column, Table
from spi.specs.cases import StepCase
from spi.specs.keys import Samples, key_of
from spi.statistics.accumulators import Array, Batch, Sums, moments
from spi.statistics.claims import claimable
from spi.storage.stored import Stored, array, axis, fact

PLUGIN = Plugin(
    "oscillator",
    models={"oscillator": "spi_oscillator:Oscillator"},
    kinds={"energy_growth": "spi_oscillator"},
    offered={"energy_rate": "spi_oscillator:energy_rate"},
)


class Oscillator(NamedTuple):
    """H = p^2/2 + q^2/2 in canonical variables y = (q, p), kicked by the noise Ĥ = q."""

    sigma: Annotated[tuple[NonNegative | None], "strength of the kicks; 0 switches them off"] = (1.0,)

    dimension, pieces, noises, conserved = 2, 2, 1, 0

    def drift_flow(model, k, t, y, angles):
        q, p = y
        return (q + t * p, p) if k == 0 else (q, p - t * q)

    def noise_flow(model, k, t, y, angles):
        return y[0], y[1] - t

    def structure(model, y, v):
        return v[1], -v[0]

    def structure_derivative(model, y, u, v):
        return 0.0 * v[0], 0.0 * v[1]

    def casimirs(model, y):
        return ()

    def hamiltonian(model, y):
        return 0.5 * (y[0] * y[0] + y[1] * y[1])

    def drift_gradient(model, y):
        return y

    def drift_hessian(model, y, v):
        return v

    def noise_gradient(model, k, y):
        return 1.0, 0.0

    def noise_hessian(model, k, y, v):
        return 0.0 * v[0], 0.0 * v[1]


class Energy(Stored):
    """Mean energies over time."""

    headline, row_axes = ("energy",), ("t",)
    tables = (Table("t", [Column("energy", "energy (95 %)")]),)
    t: Array = axis("time", "time")
    energy: Array = array("t", "mean energy", "energy", "E H(y(t))", claim="equal")
    energy_stderr: Array = array("t", "standard error of the mean energy", "energy")
    samples: int = fact("number of paths", column=True)
    step: float = fact("step size", "time")


class Case(StepCase):
    """Mean energies over time."""

    samples: key_of(Samples, "number of paths")
    quantities = claimable(Energy)


class EnergySums(Sums):
    """Sums over paths of H and of its square."""

    energy: Array = moments("time")


@dataclass(frozen=True, kw_only=True)
class EnergyPlan(SampledPlan):
    """One scheme of a case."""

    record, sums = Energy, EnergySums

    def lengths(self, number: int) -> dict[str, int]:
        return {"time": 1 + self.grid.reference_steps}

    def observe(self, batch: Batch) -> dict[str, Array]:
        q, p = np.moveaxis(lanes_of(self.recorded(batch)[0], 2), 2, 0)
        return {"energy": (q * q + p * p) / 2}  # (blocks, times, LANES)

    def estimates(self, sums: EnergySums) -> dict[str, Any]:
        mean, square = sums.energy.sum(axis=-1) / sums.paths
        stderr = np.sqrt(np.maximum(square - mean**2, 0.0) / (sums.paths - 1))
        return {"t": self.case.step * np.arange(len(mean)), "energy": mean, "energy_stderr": stderr}


Record, parts, plan = Energy, each_scheme, EnergyPlan.of
draw = Figures({"energy": [CurvePanel("energy", over="t")]}, ["samples"])


def energy_rate(sigma: float) -> float:
    """d/dt E H(y(t)) = sigma^2 / 2."""
    return sigma**2 / 2
