"""Means and variances of functions over time: a kind of experiment in one file."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from spi.drawing.panels import CurvePanel, Figures
from spi.kinds.blocks import SampledPlan, lanes_of
from spi.kinds.plans import each_scheme
from spi.printing.tables import Column, Table
from spi.specs.cases import FunctionKeys, StepCase
from spi.specs.keys import Samples, key_of
from spi.statistics.accumulators import Array, Batch, Sums, moments
from spi.statistics.claims import claimable
from spi.storage.stored import Stored, array, axis, fact


class Spread(Stored):
    headline, row_axes = ("mean",), ("function", "t")
    tables = (Table("function t", [Column("mean", "mean (95 %)"), Column("variance", "variance", form=".3e")]),)
    functions: tuple[str, ...] = axis("test function", name="function")
    t: Array = axis("time", "time")
    mean: Array = array("function t", "mean", "value", "E phi(y(t))", claim="equal")
    mean_stderr: Array = array("function t", "standard error of the mean", "value")
    variance: Array = array("function t", "variance", formula="Var phi(y(t))", claim="at most")
    samples: int = fact("number of paths", column=True)
    step: float = fact("step size", "time")


class Case(FunctionKeys, StepCase):
    """Means and variances of functions of the state over time."""

    samples: key_of(Samples, "number of paths")
    quantities, scoping = claimable(Spread), ("functions",)


class SpreadSums(Sums):
    values: Array = moments("function time")


@dataclass(frozen=True, kw_only=True)
class SpreadPlan(SampledPlan):
    record, sums = Spread, SpreadSums

    def lengths(self, number: int) -> dict[str, int]:
        return {"function": len(self.phis), "time": 1 + self.grid.reference_steps}

    def observe(self, batch: Batch) -> dict[str, Array]:
        y = np.moveaxis(lanes_of(self.recorded(batch)[0], len(self.initial)), 2, 0)
        return {"values": np.stack([phi(y) for phi in self.phis], axis=1)}

    def estimates(self, sums: SpreadSums) -> dict[str, Any]:
        mean, square = sums.values.sum(axis=-1) / sums.paths
        variance = np.maximum(square - mean**2, 0.0) * sums.paths / (sums.paths - 1)
        values = {"functions": tuple(self.case.functions), "t": self.case.step * np.arange(mean.shape[1])}
        return values | {"mean": mean, "mean_stderr": np.sqrt(variance / sums.paths), "variance": variance}


Record, parts, plan = Spread, each_scheme, SpreadPlan.of
draw = Figures({"all": [CurvePanel(field, over="t", facet="function") for field in ("mean", "variance")]}, ["samples"])
