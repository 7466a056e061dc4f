"""Equilibrium: means over time along long paths, autocorrelations and histograms, see ``means``.

All step sizes run until the same time.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from spi.kinds import one_path as alone
from spi.kinds.blocks import paths_moved
from spi.kinds.functions import evaluated, origin_of, path_function
from spi.kinds.plans import PartCost, State, Task, each_scheme
from spi.models.delegation import undamped
from spi.numerics.rng import LANES
from spi.numerics.types import Array
from spi.plugins.dynamics.kinds.long_paths.study import CHUNK_BLOCKS, LongPlan
from spi.plugins.dynamics.kinds.references import EXACT
from spi.statistics.estimators import GROUPS
from spi.statistics.rounding import size_of_values
from spi.statistics.tallies import Batch, Chunk

from . import means
from .results import Equilibrium

_LAWS = "reference laws"  # the name of the task
_PILOT = 4096  # steps of one block, around whose values the bins of histograms lie


parts = each_scheme


@dataclass(frozen=True, kw_only=True)
class EquilibriumPlan(LongPlan):
    """Means over time of one scheme, with one step size after the other."""

    record = Equilibrium
    sums = means.RecordedPaths

    @functools.cached_property
    def recorders(self) -> tuple[means.FunctionRecorder, ...]:
        """Recorder of functions at each step size."""
        numbers = range(len(self.case.steps))
        if self.is_long:
            return tuple(means.FunctionRecorder.of(self.case, i) for i in numbers)
        return tuple(means.FunctionRecorder.of(self.case, i, self._bins(i)) for i in numbers)

    def _bins(self, number: int) -> tuple[Array, Array]:
        """(low, width), (F,) each, of the bins of the functions, from values of the first block."""
        steps = min(self.case.counts[number], _PILOT)
        first = Batch.of_first(1, number)
        y, _, _ = self.integrated(first, self._states_at_start(first), 0, steps, max(1, steps // 256))
        states = np.moveaxis(y.reshape(y.shape[1], -1, self.lanes)[y.shape[1] // 2 :], 1, 0)
        values = evaluated(self.case.path_functions, states)
        return means.bins_around(values.reshape(len(values), -1), self.case.bins)

    def cost(self) -> PartCost:
        """Also of looking at states, and the memory of recorded values of many paths."""
        cost, count = super().cost(), len(self.case.functions)
        looks = len(self.case.steps) * self.case.last_time / self.case.between
        if not self.movers:
            blocks = -(-self.case.samples // LANES)
            looks *= alone.idle(blocks) * paths_moved(self.model, self.case.samples)
            cost = cost._replace(bytes=cost.bytes + count * 2**21 * min(blocks, CHUNK_BLOCKS))
        return cost._replace(seconds=cost.seconds + 1e-9 * looks * alone.look_ns(self.case, count))

    def deciding(self, number: int | None) -> dict[str, Any]:
        """See :class:`LongPlan`; other step sizes decide when paths are looked at."""
        if number is None:  # the references are among the answers of the tasks
            return super().deciding(None) | self.case.model_dump(include={"reference"})
        return super().deciding(number) | {"records": self.records.tolist(), "between": self.case.between}

    def lengths(self, number: int) -> dict[str, int]:
        """See :class:`LongPlan`."""
        recorder = self.recorders[number]
        further = {"lane": LANES, "group": GROUPS, "batch": recorder.series.batches}
        return further | {"stretch": 2 * recorder.series.lags} | recorder.lengths

    def next_stop(self, n: int, number: int = 0) -> int:
        """See :class:`LongPlan`; stops are as near as the memory of recorded states asks for."""
        piece = self.recorders[number].series.piece(len(self.initial), CHUNK_BLOCKS)
        later = self.records[self.records > n].tolist()
        return int(min([(n // piece + 1) * piece, self.case.counts[number], *later]))

    def every(self, number: int, stop: int) -> int:
        """See :class:`LongPlan`: states that come before those that count are not recorded."""
        series = self.recorders[number].series
        return series.stride if self.is_long or stop > series.first * series.stride else 0

    def looked(self, chunk: Chunk, paths: means.RecordedPaths, before: int, stored: Array) -> means.RecordedPaths:
        """Paths with the values of functions at the stored states."""
        recorder = self.recorders[chunk.path_set]
        values = recorder.values(stored, before, self.lanes)
        return recorder.recorded(paths, values, before, chunk.batch)

    def look(self, number: int, n: int, state: Array) -> Sequence[Array]:
        """(F,) the functions of one large lattice, if its state counts."""
        recorder = self.recorders[number]
        return [recorder.values_of(state)] if recorder.counts_at(n) else ()

    def with_looks(
        self, chunk: Chunk, paths: means.RecordedPaths, before: int, looks: list[Array]
    ) -> means.RecordedPaths:
        """Path with values of functions."""
        values = np.transpose(looks)[:, np.newaxis, np.newaxis]
        in_lanes = np.broadcast_to(values, (len(values), 1, LANES, len(looks)))
        return self.recorders[chunk.path_set].recorded(paths, in_lanes, before, chunk.batch)

    def ended(self, chunk: Chunk, paths: means.RecordedPaths, states: Array) -> means.RecordedPaths:
        """Paths of a chunk after all steps, with sums over groups in place of values."""
        summed = self.recorders[chunk.path_set].finished(paths, chunk.batch)
        left = {name: getattr(paths, name)[:, :0] for name in ("stretch", "batches", "squares")}
        return super().ended(chunk, paths, states)._replace(**left, **summed)

    def rounding_sizes(self, totals: Sequence[means.RecordedPaths]) -> Array:
        """See :class:`LongPlan`."""
        model, sizes = undamped(self.case.model), []
        for c in range(totals[0].casimir.shape[1]):
            function = path_function(model, (), f"C{c + 1}")
            at_start = abs(origin_of(function, self.case.initial)) or 1.0
            sizes.append(max(1.0, size_of_values(function.values, self.case.initial) / at_start))
        return np.array(sizes)

    def tasks(self, state: State) -> list[Task]:
        """References that are quadratures of the Gibbs law."""
        if EXACT not in self.case.reference.values():
            return []
        recorders = means.with_bins(self.recorders, self.totals(state))
        return [Task(_LAWS, lambda: means.references_of(recorders, self.case)._asdict())]

    def found(self, state: State) -> dict[str, Any]:
        """The means."""
        known = state.answers.get(_LAWS)
        return {"averages": means.averages(self.recorders, self.case, self.totals(state), known)}


plan = EquilibriumPlan.of
