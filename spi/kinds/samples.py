"""Values of test functions at the end of paths, and path sets whose samples have several paths each."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from spi.ensemble.loop import Grid, integrated
from spi.ensemble.protocol import dimension
from spi.numerics.rng import LANES
from spi.statistics.estimators import ROUND
from spi.statistics.powers import with_powers
from spi.statistics.tallies import PathSet, chunk_blocks

from .blocks import Blockwise
from .plans import Plan

BATCH_BYTES = 64e6  #: of the values of a batch
POWERS = 4  #: of quantities, of which there are sums


def values_of_blocks(
    p: Plan, grid: Grid, stream: Any, first_block: int, blocks: int, samples: int
) -> tuple[np.ndarray, np.ndarray]:
    """Integrate blocks; the values of the test functions at the end (blocks, paths, F, LANES), and the report."""
    states, report = integrated(p.scheme, p.model, p.initial, grid, stream, first_block, blocks, samples)
    d, functions = len(p.initial), p.phis
    y = np.moveaxis(states[..., : d * LANES].reshape(*states.shape[:2], d, LANES), 2, 0)
    values = np.empty((*states.shape[:2], len(functions), LANES))
    with np.errstate(all="ignore"):
        for f, phi in enumerate(functions):
            values[:, :, f] = phi(y)
    return values, report


class Sample(NamedTuple):
    """The paths of one sample of a path set."""

    grid: Grid
    stream: Any  #: a ``RandomStream``, or the points that the paths follow
    weights: np.ndarray  #: (quantities, paths), by which the values of phi on the paths make quantities
    steps: int  #: of all paths

    @classmethod
    def of(cls, grid: Grid, stream: Any, weights: Sequence[Sequence[float]]) -> "Sample":
        """That whose paths are those of a grid."""
        return cls(grid, stream, np.array(weights), int((grid.reference_steps >> grid.doublings).sum()))


class SamplesPlan(Blockwise):
    """The head of every plan whose sums are those of powers of quantities, over samples of several paths."""

    @property
    def sets(self) -> Sequence[Sample]:
        """The paths of a sample of each path set."""
        raise NotImplementedError

    def wanted(self, extra: Any) -> np.ndarray:
        """(path sets,) the samples that are wanted for now."""
        raise NotImplementedError

    def path_sets(self, extra: Any) -> Sequence[PathSet]:
        """The samples that are wanted for now."""
        d = dimension(self.model)
        return tuple(
            PathSet(int(samples), max(ROUND, chunk_blocks(one.steps, d)))
            for samples, one in zip(self.wanted(extra), self.sets, strict=True)
        )

    def most_blocks(self, number: int) -> int:
        """How many blocks of a path set a batch may have, because of memory."""
        floats = self.sets[number].weights.shape[1] * (len(self.initial) + 4 * len(self.case.functions))
        return max(1, int(BATCH_BYTES / (8 * LANES * floats)))

    def values(self, number: int, first: int, blocks: int, end: int) -> np.ndarray:
        """(blocks, paths, F, LANES) the values of the test functions on the paths of some blocks of samples."""
        one = self.sets[number]
        return values_of_blocks(self, one.grid, one.stream, first, blocks, end)[0]

    def rows(self, number: int, first: int, blocks: int, end: int) -> np.ndarray:
        """(blocks, quantities, F, LANES) the quantities of some blocks of samples."""
        values, weights = self.values(number, first, blocks, end), self.sets[number].weights
        with np.errstate(invalid="ignore", over="ignore"):
            each = (w[:, np.newaxis, np.newaxis] * values[:, i, np.newaxis] for i, w in enumerate(weights.T))
            return np.asarray(sum(each))

    def added(self, sums: Any, rows: np.ndarray, at: slice, first: int, end: int) -> Any:
        """The sums with the powers of the quantities `at`, of which the first is that of block `first`."""
        return sums._replace(sums=with_powers(sums.sums, rows[at], first, end))
