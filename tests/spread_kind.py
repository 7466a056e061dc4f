"""Means and variances of functions over time: a kind of experiment in one file."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from spi.drawing.panels import CurvePanel, Figures
from spi.ensemble.observer import state_recorder
from spi.ensemble.protocol import Positive
from spi.ensemble.random_states import block_states
from spi.kinds.blocks import BlocksPlan, lanes_of
from spi.kinds.plans import each_scheme
from spi.printing.tables import Column, Table
from spi.specs.cases import BaseCase, FunctionKeys
from spi.specs.keys import Samples, Schemes, key_of
from spi.statistics.accumulators import Array, Sums, moments
from spi.statistics.claims import claimable
from spi.storage.stored import Stored, array, axis, fact


class Spread(Stored):
    """Means and variances of functions of the state of one scheme."""

    headline, row_axes = ("mean",), ("function", "t")
    tables = (Table("function t", [Column("mean", "mean (95 %)"), Column("variance", "variance", form=".3e")]),)

    functions: tuple[str, ...] = axis("test function", name="function")
    t: Array = axis("time", "time")
    mean: Array = array("function t", "mean", "value", "E phi(y(t))", claim="equal")
    mean_stderr: Array = array("function t", "standard error of the mean", "value")
    variance: Array = array("function t", "variance", formula="Var phi(y(t))", claim="at most")
    samples: int = fact("number of paths", column=True)


class Case(FunctionKeys, BaseCase):
    """Means and variances of functions of the state over time."""

    final_time: key_of(Positive, "final time T, a multiple of the step", "time")
    step: key_of(Positive, "step size h", "time")
    schemes: key_of(Schemes, "a list of schemes")
    samples: key_of(Samples, "number of paths")
    quantities: ClassVar = claimable(Spread)
    truncate_noise: ClassVar = False


class SpreadSums(Sums):
    """Sums over some paths of F functions at T times."""

    values: Array = moments("function time")


@dataclass(frozen=True, kw_only=True)
class SpreadPlan(BlocksPlan):
    """Means and variances of one scheme."""

    record, sums = Spread, SpreadSums

    def lengths(self, number: int) -> dict[str, int]:
        return {"function": len(self.case.functions), "time": 1 + self.grid.reference_steps}

    def observe(self, number: int, first: int, blocks: int, end: int) -> dict[str, Array]:
        y = np.empty((blocks, 1 + self.grid.reference_steps, len(self.initial) * 64))
        y[:, 0] = block_states(self.initial, self.stream, first, blocks)
        self.integrated(first, blocks, end, state_recorder(self.grid, y, 1))
        states = np.moveaxis(lanes_of(y, len(self.initial)), 2, 0)
        return {"values": np.stack([phi(states) for phi in self.phis], axis=1)}

    def estimates(self, sums: SpreadSums) -> dict[str, Any]:
        mean, square = sums.values.sum(axis=-1) / sums.paths
        variance = (square - mean**2) * sums.paths / (sums.paths - 1)
        t, stderr = self.case.step * np.arange(mean.shape[1]), np.sqrt(np.maximum(variance, 0.0) / sums.paths)
        values = {"mean": mean, "mean_stderr": stderr, "variance": variance}
        return values | {"functions": tuple(self.case.functions), "t": t}


PANELS = {field: [CurvePanel(field, over="t", facet="function", label=f"{field} of {{f}}")] for field in ("mean", "variance")}
Record, parts, plan, draw = Spread, each_scheme, SpreadPlan.of, Figures(PANELS, facts=("samples", "step"))
