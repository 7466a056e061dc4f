"""Plans whose results are means over paths of values at several times, summed up by jackknife groups."""

from dataclasses import dataclass

import numpy as np

from spi.ensemble.moments import add_moments
from spi.numerics.rng import LANES
from spi.statistics.estimators import GROUPS, group_counts, jackknife_stderr
from spi.statistics.powers import mean_over_paths

from .blocks import BlocksPlan
from .plans import Done, KernelCall, State


def lost_among(lost: np.ndarray, first: int, end: int) -> int:
    """How many of the paths `lost` (blocks, LANES) are before number `end`, the first block being number `first`."""
    counted = first * LANES + np.arange(lost.size).reshape(lost.shape) < end
    return int((lost & counted).sum())


@dataclass(frozen=True, kw_only=True)
class MeansPlan(BlocksPlan):
    """The head of such a plan; its sums have `values` (2, T, columns, GROUPS), of values and of their squares."""

    def kernel_calls(self) -> list[KernelCall]:
        """One step of one block, and nothing summed up."""
        one, no_pairs = np.zeros((1, 1, 1, LANES)), (np.zeros(0, int), np.zeros(0, int), np.zeros((1, 1, 0, GROUPS)))
        adding = KernelCall(add_moments, (one, 0, 0, np.zeros((2, 1, 1, GROUPS)), *no_pairs, (0, 0)))
        return [*super().kernel_calls(), adding]

    def progress(self, state: State) -> Done:
        """Paths done, all paths, and the standard error of the first mean at the last time."""
        known = state.so_far()
        if not known.paths:
            return Done(0, self.samples, float("nan"))
        counts = group_counts(known.paths)
        mean, without = mean_over_paths(known.values[0], counts)
        return Done(known.paths, self.samples, float(jackknife_stderr(mean, without, counts)[-1, 0]))
