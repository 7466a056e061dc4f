"""Plans whose paths are summed up block after block, also those whose results are means at several times."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from spi.compiler.inlining import is_loaded
from spi.ensemble import loop
from spi.ensemble.loop import thread_count
from spi.ensemble.moments import add_moments
from spi.ensemble.protocol import dimension
from spi.numerics.rng import LANES
from spi.statistics.estimators import GROUPS, group_counts, jackknife_stderr
from spi.statistics.powers import mean_over_paths
from spi.statistics.tallies import Chunk, PathSet, chunk_blocks

from .plans import Done, KernelCall, PathsPlan, Plan, State


def in_batches(state: Any, advance: Callable[[Any, int], Any], left: Callable[[Any], int], most: int) -> Iterator[Any]:
    """Move a state on with ``advance(state, blocks)`` until no blocks are ``left(state)``; yields it after each batch.

    A batch has at most `most` blocks and takes about BATCH_SECONDS, the first one a block per thread.
    """
    least = min(thread_count(), most)
    blocks = least
    while left(state) > 0:
        began = time.perf_counter()
        state = advance(state, min(blocks, left(state)))
        yield state
        rate = blocks / (time.perf_counter() - began)
        blocks = int(np.clip(rate * loop.BATCH_SECONDS, least, min(most, 4 * blocks)))


class _Batch(NamedTuple):
    """Where a path set stands after a batch."""

    block: int  #: the next one
    sums: Any  #: of the chunk of the last block
    added: list[tuple[Chunk, Any]]


class Blockwise(Plan):
    """The head of every plan that sums up paths block after block."""

    def most_blocks(self, number: int) -> int:
        """How many blocks of a path set a batch may have, because of memory."""
        raise NotImplementedError

    @property
    def most_at_once(self) -> int:
        """How many blocks of any path set a batch may have, because of memory."""
        return 2**62

    def rows(self, number: int, first: int, blocks: int, end: int) -> Any:
        """What `blocks` blocks of a path set contribute, from block `first` on; paths from number `end` on are idle."""
        raise NotImplementedError

    def added(self, sums: Any, rows: Any, at: slice, first: int, end: int) -> Any:
        """The sums with the rows `at`, of which the first is that of block `first`; times are added elsewhere.

        One row after the other, so that the bits do not depend on how blocks are divided into batches.
        """
        raise NotImplementedError

    def timed(self, sums: Any, first: int, blocks: int, seconds: float, cpu_seconds: float) -> Any:
        """The sums with the time that `blocks` blocks took, from block `first` on."""
        return sums._replace(seconds=sums.seconds + seconds, cpu_seconds=sums.cpu_seconds + cpu_seconds)

    def advance(self, chunks: Sequence[Chunk], known: Any | None) -> Iterator[list[tuple[Chunk, Any]]]:
        """Compute consecutive chunks of one path set, see :class:`Plan`."""
        for call in self.kernel_calls():  # so that nothing is compiled or loaded while it is timed
            if not is_loaded(call.kernel, call.arguments):
                call.kernel(*call.arguments)
        number, last = chunks[0].path_set, chunks[-1].first + chunks[-1].blocks
        sums = self.empty(number) if known is None else known
        begin = _Batch(chunks[0].first + sums.paths // LANES, sums, [])
        advance, most = partial(self._batch, chunks), min(self.most_blocks(number), self.most_at_once)
        for batch in in_batches(begin, advance, lambda batch: last - batch.block, most):
            yield batch.added

    def _batch(self, chunks: Sequence[Chunk], before: _Batch, blocks: int) -> _Batch:
        """The next `blocks` blocks, which may belong to several chunks."""
        began, cpu_began = time.perf_counter(), time.process_time()
        number, end = chunks[0].path_set, chunks[-1].end
        rows = self.rows(number, before.block, blocks, end)
        size = chunks[0].blocks  # only the last chunk of a path set can have fewer
        pieces: list[tuple[Chunk, int, int, Any]] = []
        first, stop, sums = before.block, before.block + blocks, before.sums
        while first < stop:
            chunk = chunks[(first - chunks[0].first) // size]
            last = min(stop, chunk.first + chunk.blocks)
            sums = self.empty(number) if first == chunk.first else sums
            sums = self.added(sums, rows, slice(first - before.block, last - before.block), first, end)
            sums = sums._replace(paths=min(last * LANES, end) - chunk.first * LANES)
            pieces.append((chunk, first, last, sums))
            first = last
        spent = (time.perf_counter() - began) / blocks, (time.process_time() - cpu_began) / blocks
        added = [
            (chunk, self.timed(sums, first, last - first, *((last - first) * one for one in spent)))
            for chunk, first, last, sums in pieces
        ]
        return _Batch(stop, added[-1][1], added)


@dataclass(frozen=True, kw_only=True)
class BlocksPlan(PathsPlan, Blockwise):
    """The head of every plan with one set of paths, on one grid, that are summed up block after block."""

    def path_sets(self, extra: Any) -> Sequence[PathSet]:
        """All paths."""
        return (PathSet(self.samples, chunk_blocks(int(self.steps.sum()), dimension(self.model))),)

    @property
    def most_at_once(self) -> int:
        """As many as have room for their noise."""
        return int(self.stream.most_blocks(self.model, self.grid))

    def so_far(self, state: State) -> State | None:
        """The state of the first paths, as many as are known without a gap."""
        paths = state.tally().leading(state.path_sets[0])
        case = self.case.model_copy(update={"samples": paths})
        return state.of(replace(self, samples=paths, case=case)) if paths else None


def lost_among(lost: np.ndarray, first: int, end: int) -> int:
    """How many of the paths `lost` (blocks, LANES) are before number `end`, the first block being number `first`."""
    counted = first * LANES + np.arange(lost.size).reshape(lost.shape) < end
    return int((lost & counted).sum())


@dataclass(frozen=True, kw_only=True)
class MeansPlan(BlocksPlan):
    """The head of every plan whose results are means over paths of values at several times.

    Its sums have `values` (2, T, columns, GROUPS), by jackknife groups, of values and of their squares.
    """

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
