"""Plans whose paths are summed up block after block, also those whose results are means at several times."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from spi.compiler.inlining import is_loaded
from spi.ensemble import loop
from spi.ensemble.loop import Grid, integrated, thread_count
from spi.ensemble.observer import add_moments
from spi.ensemble.protocol import dimension
from spi.ensemble.scheme_protocol import REPORT, SUMMED, report_columns
from spi.numerics.rng import LANES
from spi.statistics.estimators import GROUPS, ROUND, group_counts, jackknife_stderr, mean_over_paths, with_powers
from spi.statistics.tallies import Chunk, PathSet, chunk_blocks
from spi.storage.stored import Array, Described, array

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
    """The state of a path set after a batch."""

    block: int  #: the next one
    sums: Any  #: of the chunk of the last block
    added: list[tuple[Chunk, Any]]


class Blockwise(Plan):
    """The base of all plans that sum up paths block after block."""

    def most_blocks(self, number: int) -> int:
        """The largest number of blocks of a path set in a batch, because of memory."""
        raise NotImplementedError

    @property
    def most_at_once(self) -> int:
        """The largest number of blocks of any path set in a batch, because of memory."""
        return 2**62

    def rows(self, number: int, first: int, blocks: int, end: int) -> Any:
        """The contributions of `blocks` blocks of a path set from `first` on; paths from number `end` on are idle."""
        raise NotImplementedError

    def added(self, sums: Any, rows: Any, at: slice, first: int, end: int) -> Any:
        """The sums with the rows `at`, of which the first is that of block `first`; times are added elsewhere.

        One row after the other, so that the bits do not depend on how blocks are divided into batches.
        """
        raise NotImplementedError

    def timed(self, sums: Any, first: int, blocks: int, seconds: float, cpu_seconds: float) -> Any:
        """The sums with the time that `blocks` blocks took, from block `first` on."""
        return sums._replace(seconds=sums.seconds + seconds, cpu_seconds=sums.cpu_seconds + cpu_seconds)

    def advance(self, chunks: Sequence[Chunk], started: Any | None) -> Iterator[list[tuple[Chunk, Any]]]:
        """Compute consecutive chunks of one path set, see :class:`Plan`."""
        for call in self.kernel_calls():  # so that nothing is compiled or loaded while it is timed
            if not is_loaded(call.kernel, call.arguments):
                call.kernel(*call.arguments)
        number, last = chunks[0].path_set, chunks[-1].first + chunks[-1].blocks
        sums = self.empty(number) if started is None else started
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
            (chunk, self.timed(sums, first, last - first, *((last - first) * seconds for seconds in spent)))
            for chunk, first, last, sums in pieces
        ]
        return _Batch(stop, added[-1][1], added)


@dataclass(frozen=True, kw_only=True)
class BlocksPlan(PathsPlan, Blockwise):
    """The base of all plans with one set of paths, on one grid, that are summed up block after block."""

    def path_sets(self, extra: Any) -> Sequence[PathSet]:
        """All paths."""
        return (PathSet(self.samples, chunk_blocks(int(self.steps.sum()), dimension(self.model))),)

    @property
    def most_at_once(self) -> int:
        """The largest number of blocks whose noise fits into memory."""
        return int(self.stream.most_blocks(self.model, self.grid))

    def so_far(self, state: State) -> State | None:
        """The state of the first paths, as many as are computed without a gap."""
        paths = state.tally().leading(state.path_sets[0])
        case = self.case.model_copy(update={"samples": paths})
        return state.of(replace(self, samples=paths, case=case)) if paths else None


def lost_among(lost: np.ndarray, first: int, end: int) -> int:
    """The number of paths `lost` (blocks, LANES) that are before number `end`, the first block being number `first`."""
    counted = first * LANES + np.arange(lost.size).reshape(lost.shape) < end
    return int((lost & counted).sum())


@dataclass(frozen=True, kw_only=True)
class MeansPlan(BlocksPlan):
    """The base of all plans whose results are means over paths of values at several times.

    Its sums have `values` (2, T, columns, GROUPS), by jackknife groups, of values and of their squares.
    """

    def kernel_calls(self) -> list[KernelCall]:
        """One step of one block, and nothing summed up."""
        values, no_pairs = np.zeros((1, 1, 1, LANES)), (np.zeros(0, int), np.zeros(0, int), np.zeros((1, 1, 0, GROUPS)))
        adding = KernelCall(add_moments, (values, 0, 0, np.zeros((2, 1, 1, GROUPS)), *no_pairs, (0, 0)))
        return [*super().kernel_calls(), adding]

    def progress(self, state: State) -> Done:
        """Paths done, all paths, and the standard error of the first mean at the last time."""
        sums = state.so_far()
        if not sums.paths:
            return Done(0, self.samples, float("nan"))
        counts = group_counts(sums.paths)
        mean, without = mean_over_paths(sums.values[0], counts)
        return Done(sums.paths, self.samples, float(jackknife_stderr(mean, without, counts)[-1, 0]))


# ---------------------------------------------------------------------------------------------------------------------
# Values of test functions at the end of paths, and path sets whose samples have several paths each.
# ---------------------------------------------------------------------------------------------------------------------

BATCH_BYTES = 64e6  #: of the values of a batch
POWERS = 4  #: number of powers of quantities that are summed up


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
        """The sample whose paths are those of a grid."""
        return cls(grid, stream, np.array(weights), int((grid.reference_steps >> grid.doublings).sum()))


class SamplesPlan(Blockwise):
    """The base of all plans that sum up powers of quantities, over samples of several paths."""

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
            PathSet(int(samples), max(ROUND, chunk_blocks(sample.steps, d)))
            for samples, sample in zip(self.wanted(extra), self.sets, strict=True)
        )

    def most_blocks(self, number: int) -> int:
        """The largest number of blocks of a path set in a batch, because of memory."""
        floats = self.sets[number].weights.shape[1] * (len(self.initial) + 4 * len(self.case.functions))
        return max(1, int(BATCH_BYTES / (8 * LANES * floats)))

    def values(self, number: int, first: int, blocks: int, end: int) -> np.ndarray:
        """(blocks, paths, F, LANES) the values of the test functions on the paths of some blocks of samples."""
        sample = self.sets[number]
        return values_of_blocks(self, sample.grid, sample.stream, first, blocks, end)[0]

    def rows(self, number: int, first: int, blocks: int, end: int) -> np.ndarray:
        """(blocks, quantities, F, LANES) the quantities of some blocks of samples."""
        values, weights = self.values(number, first, blocks, end), self.sets[number].weights
        with np.errstate(invalid="ignore", over="ignore"):
            each = (w[:, np.newaxis, np.newaxis] * values[:, i, np.newaxis] for i, w in enumerate(weights.T))
            return np.asarray(sum(each))

    def added(self, sums: Any, rows: np.ndarray, at: slice, first: int, end: int) -> Any:
        """The sums with the powers of the quantities `at`, of which the first is that of block `first`."""
        return sums._replace(sums=with_powers(sums.sums, rows[at], first, end))


# ---------------------------------------------------------------------------------------------------------------------
# Reports of schemes on their steps, in the results of every kind that integrates.
# ---------------------------------------------------------------------------------------------------------------------


class Solver(Described):
    """The report of an implicit scheme on its equations; arrays of one shape."""

    solves: Array = array("", "equations solved")
    iterations: Array = array("", "iterations of all solves")
    failures: Array = array("", "solves that did not converge")
    largest_residual: Array = array("", "largest relative residual")

    @property
    def failing_fraction(self) -> np.ndarray:
        """Failures over solves, in the shape of the fields; 0 where nothing was solved."""
        return _ratio(self.failures, self.solves, 0.0)

    @property
    def iterations_per_solve(self) -> np.ndarray:
        """Iterations over solves, in the shape of the fields; NaN where nothing was solved."""
        return _ratio(self.iterations, self.solves, np.nan)


class Acceptance(Described):
    """Shares of flows that a scheme with a test of acceptance accepted; arrays of one shape."""

    noise_accepted: Array = array("", "share of the noise flows that were accepted")
    drift_accepted: Array = array("", "share of the steps of the drift that were accepted")


def _ratio(part: np.ndarray, whole: np.ndarray, otherwise: float) -> np.ndarray:
    """`part` over `whole`, and `otherwise` where the whole is 0."""
    whole = np.asarray(whole, float)
    return np.divide(part, whole, out=np.full(whole.shape, otherwise), where=whole != 0)


def reported(report: np.ndarray) -> dict[str, Any]:
    """The fields `solver`, `acceptance` and `largest_angle` of a record, from reports (..., columns).

    None where a scheme reports nothing of the kind.
    """
    columns = report_columns(report)
    solver = {name: columns[name] for name in Solver.__annotations__ if name in columns}
    judged = [columns[name] for name in REPORT[3:SUMMED] if name in columns]
    shares = [_ratio(accepted, of, np.nan) for of, accepted in zip(judged[::2], judged[1::2], strict=True)]
    return {
        "solver": Solver(**solver) if solver else None,
        "acceptance": Acceptance(noise_accepted=shares[0], drift_accepted=shares[1]) if shares else None,
        "largest_angle": columns.get("largest_angle"),
    }
