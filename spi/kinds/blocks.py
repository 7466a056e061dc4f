"""Plans whose paths are summed up block after block."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, ClassVar, NamedTuple

import numpy as np

from spi.compiler.inlining import is_loaded
from spi.compiler.timing import compiling
from spi.ensemble import loop
from spi.ensemble.loop import AS_TOSSED, COINS_TURNED, PAIRS_REVERSED, TimeGrid, integrated, thread_count
from spi.ensemble.observer import state_recorder
from spi.ensemble.protocol import dimension, in_place, large
from spi.ensemble.random_states import RandomState, block_states
from spi.ensemble.scheme_protocol import REPORT, SUMMED, report_columns
from spi.numerics.rng import LANES
from spi.schemes import typical_ns
from spi.statistics.accumulators import Sums
from spi.statistics.estimators import ROUND, group_counts, jackknife_stderr, mean_over_paths
from spi.statistics.tallies import Batch, Chunk, PathSet, chunk_blocks
from spi.storage.stored import Array, Described, array

from .plans import Done, KernelCall, PartCost, Plan, State, path_grid


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


BATCH_BYTES = 64e6  #: of the contributions of a batch


class _Reached(NamedTuple):
    """Where the computation of a path set is after a batch."""

    block: int  #: the next one
    sums: Any  #: of the chunk of the last block
    added: list[tuple[Chunk, Any]]


class BatchedPlan(Plan):
    """Base of the two that follow: chunks are computed in batches of blocks, of which a study says what it observes."""

    sums: ClassVar[type[Sums]]  #: what is summed up

    def lengths(self, number: int) -> dict[str, int]:
        """Lengths of the axes of the sums over a path set, by name."""
        raise NotImplementedError

    def empty(self, number: int) -> Any:
        """Sums over no paths of a path set."""
        return self.sums.empty(self.lengths(number))

    def most_blocks(self, number: int) -> int:
        """Largest number of blocks of a path set in a batch, because of memory."""
        return max(1, int(BATCH_BYTES / self.sums.bytes_of_a_block(self.lengths(number))))

    @property
    def most_at_once(self) -> int:
        """Largest number of blocks of any path set in a batch, because of memory."""
        return 2**62

    def observe(self, batch: Batch) -> dict[str, Array]:
        """Contributions of a batch: an array for each field of the sums, the axis of the blocks first.

        Others where :meth:`added` makes those of them.
        """
        raise NotImplementedError

    def added(self, sums: Any, contributions: dict[str, Array], batch: Batch) -> Any:
        """Sums with the contributions of a batch, or of those of its blocks that belong to one chunk.

        Times are added elsewhere.  One row after the other, so that the bits do not depend on how blocks are divided
        into batches.
        """
        return sums.with_batch(contributions, batch)

    def timed(self, sums: Any, batch: Batch, seconds: float, cpu_seconds: float) -> Any:
        """Sums with the time that a batch took."""
        return sums._replace(seconds=sums.seconds + seconds, cpu_seconds=sums.cpu_seconds + cpu_seconds)

    def advance(self, chunks: Sequence[Chunk], started: Any | None) -> Iterator[list[tuple[Chunk, Any]]]:
        """Compute consecutive chunks of one path set, see :class:`Plan`."""
        for call in self.kernel_calls():  # so that nothing is compiled or loaded while it is timed
            if not is_loaded(call.kernel, call.arguments):
                call.kernel(*call.arguments)
        number, last = chunks[0].path_set, chunks[-1].first + chunks[-1].blocks
        sums = self.empty(number) if started is None else started
        begin = _Reached(chunks[0].first + sums.paths // LANES, sums, [])
        advance, most = partial(self._batch, chunks), min(self.most_blocks(number), self.most_at_once)
        for reached in in_batches(begin, advance, lambda reached: last - reached.block, most):
            yield reached.added

    def _batch(self, chunks: Sequence[Chunk], before: _Reached, blocks: int) -> _Reached:
        """The next `blocks` blocks, which may belong to several chunks."""
        batch = Batch(chunks[0].path_set, before.block, blocks, chunks[-1].end)
        began, cpu_began = time.perf_counter(), time.process_time()
        with compiling() as clock:  # kernels of functions and of initial states, which no plan names beforehand
            pieces = self._pieces(chunks, before.sums, batch)
        spent = time.perf_counter() - began - clock.seconds, time.process_time() - cpu_began - clock.cpu_seconds
        added = [
            (chunk, self.timed(sums, part, *(part.blocks / blocks * seconds for seconds in spent)))
            for chunk, part, sums in pieces
        ]
        return _Reached(batch.first + blocks, added[-1][1], added)

    def _pieces(self, chunks: Sequence[Chunk], sums: Any, batch: Batch) -> list[tuple[Chunk, Batch, Any]]:
        """(chunk, its blocks of the batch, its sums) of each chunk of a batch; `sums` are those before it."""
        contributions = self.observe(batch)
        size = chunks[0].blocks  # only the last chunk of a path set can have fewer
        pieces: list[tuple[Chunk, Batch, Any]] = []
        first, stop = batch.first, batch.first + batch.blocks
        while first < stop:
            chunk = chunks[(first - chunks[0].first) // size]
            last = min(stop, chunk.first + chunk.blocks)
            part, at = batch.part(first, last - first), slice(first - batch.first, last - batch.first)
            sums = self.empty(batch.path_set) if first == chunk.first else sums
            sums = self.added(sums, {name: rows[at] for name, rows in contributions.items()}, part)
            sums = sums._replace(paths=min(last * LANES, batch.end) - chunk.first * LANES)
            pieces.append((chunk, part, sums))
            first = last
        return pieces


def integrated_batch(
    p: Plan, grid: TimeGrid, stream: Any, batch: Batch, *observer: Any
) -> tuple[np.ndarray, np.ndarray]:
    """States of a batch of a plan's paths after the last step of a grid, and the reports of the scheme."""
    of = p.scheme, p.model, p.initial, grid, stream
    states, report = integrated(*of, batch.first, batch.blocks, batch.end, *observer)
    return states, report


def paths_moved(model: Any, samples: int) -> int:
    """Number of paths that make steps so that `samples` do: whole blocks, of arrays not moved in place those wanted."""
    return samples if large(model) and not in_place(model) else -(-samples // LANES) * LANES


@dataclass(frozen=True, kw_only=True)
class SampledPlan(BatchedPlan):
    """Base of all plans that sum up one set of paths, of one scheme, on one grid."""

    @property
    def samples(self) -> int:
        """Number of paths."""
        return int(self.case.samples)

    @cached_property
    def grid(self) -> TimeGrid:
        """Times of the paths and their step sizes, from the largest to the smallest, which is the reference."""
        return path_grid(self.case, self.part, self.case.step)

    @property
    def blocks(self) -> int:
        """Number of blocks of LANES paths, the last one perhaps partly idle."""
        return -(-self.samples // LANES)

    @property
    def steps(self) -> np.ndarray:
        """(levels,) the number of steps of each step size of the grid, the reference last."""
        return self.grid.reference_steps >> self.grid.doublings

    def kernel_calls(self) -> list[KernelCall]:
        """One step of one block."""
        return self.calls_of_a_step(self.grid, self.stream)

    def paths_on(self) -> list[tuple[TimeGrid, Any]]:
        """All paths."""
        return [(self.grid, self.stream)]

    def path_sets(self, extra: Any) -> Sequence[PathSet]:
        """All paths."""
        return (PathSet(self.samples, chunk_blocks(int(self.steps.sum()), dimension(self.model))),)

    @property
    def most_at_once(self) -> int:
        """Largest number of blocks whose noise fits into memory."""
        return int(self.stream.most_blocks(self.model, self.grid))

    def most_blocks(self, number: int) -> int:
        """Largest number of blocks in a batch, because of memory."""
        states = 8 * LANES * len(self.steps) * len(self.initial)
        return max(1, int(BATCH_BYTES / (states + self.sums.bytes_of_a_block(self.lengths(number)))))

    def cost(self) -> PartCost:
        """Steps of paths, seconds of one thread at typical speed, and bytes of memory."""
        steps = int(self.steps.sum()) * paths_moved(self.model, self.samples)
        sums = sum(np.asarray(values).nbytes for values in self.empty(0))
        ns = steps * typical_ns(self.row, self.model) + self.blocks * LANES * _ns_to_draw(self.initial)
        return PartCost(steps, 1e-9 * ns, int(BATCH_BYTES) + sums)

    def integrated(self, batch: Batch, *observer: Any) -> tuple[np.ndarray, np.ndarray]:
        """States of a batch after the last step, and the reports of the scheme."""
        return integrated_batch(self, self.grid, self.stream, batch, *observer)

    def recorded(self, batch: Batch, every: int = 1) -> tuple[np.ndarray, np.ndarray]:
        """States of a batch at t = 0 and after every so many steps of the largest size, and the reports.

        The states are (blocks, levels * stored, d * LANES), those of one step size behind those of another.
        """
        stored, levels = 1 + int(self.steps[0]) // every, len(self.steps)
        y = np.empty((batch.blocks, levels * stored, len(self.initial) * LANES))
        y[:, ::stored] = block_states(self.initial, self.stream, batch.first, batch.blocks)[:, np.newaxis]
        return y, self.integrated(batch, state_recorder(self.grid, y, every))[1]

    def ns_per_step(self, sums: Any) -> float:
        """Processor time of a step and path, by that of the paths of the sums at all step sizes, :func:`ns_of`."""
        return ns_of(sums.cpu_seconds, int(self.steps.sum()) * sums.paths)

    def stderr(self, sums: Any) -> float:
        """The standard error of the first estimate, while paths are computed."""
        return float("nan")

    def progress(self, state: State) -> Done:
        """Paths done, all paths, and the standard error of the first estimate."""
        sums = state.so_far()
        return Done(sums.paths, self.samples, self.stderr(sums) if sums.paths else float("nan"))


_SWEEP_NS = 20.0  # of a component of a site


def _ns_to_draw(initial: Any) -> float:
    """Nanoseconds to draw an initial state, where that takes sweeps over a lattice."""
    sweeps = initial.parameters.get("sweeps") if isinstance(initial, RandomState) else None
    return _SWEEP_NS * len(initial) * (sweeps or 0)


#: Processor seconds below which the start of kernels, some 10 ms, would count more than their steps.
LEAST_TIMED = 0.05


def ns_of(cpu_seconds: float, steps: float) -> float:
    """Processor time of a step in ns; NaN where the run was too short to be timed."""
    return float(1e9 * cpu_seconds / steps) if cpu_seconds >= LEAST_TIMED else float("nan")


def lanes_of(states: np.ndarray, d: int) -> np.ndarray:
    """(blocks, levels, d, LANES): the states (blocks, levels, d * LANES or more) of paths at all step sizes."""
    return states[..., : d * LANES].reshape(*states.shape[:2], d, LANES)


def stderr_of_means(sums: Any) -> float:
    """The standard error of the first mean at the last time, of sums whose `values` are (2, T, columns, GROUPS)."""
    counts = group_counts(sums.paths)
    mean, without = mean_over_paths(sums.values[0], counts)
    return float(jackknife_stderr(mean, without, counts)[-1, 0])


# ---------------------------------------------------------------------------------------------------------------------
# Values of test functions at the end of paths, and path sets whose samples have several paths each.
# ---------------------------------------------------------------------------------------------------------------------

POWERS = 4  #: number of powers of quantities that are summed up


def values_at_end(p: Plan, grid: TimeGrid, stream: Any, batch: Batch) -> tuple[np.ndarray, np.ndarray]:
    """Integrate a batch; the values of the test functions at the end (blocks, paths, F, LANES), and the report."""
    states, report = integrated_batch(p, grid, stream, batch)
    y, functions = np.moveaxis(lanes_of(states, len(p.initial)), 2, 0), p.phis
    values = np.empty((*states.shape[:2], len(functions), LANES))
    with np.errstate(all="ignore"):
        for f, phi in enumerate(functions):
            values[:, :, f] = phi(y)
    return values, report


class Sample(NamedTuple):
    """Paths of one sample of a path set."""

    grid: TimeGrid
    stream: Any  #: a ``RandomStream``, or the points that the paths follow
    weights: np.ndarray  #: (quantities, paths), by which the values of phi on the paths make quantities
    steps: int  #: of all paths

    @classmethod
    def of(cls, grid: TimeGrid, stream: Any, weights: Sequence[Sequence[float]]) -> "Sample":
        """Sample whose paths are those of a grid."""
        return cls(grid, stream, np.array(weights), int((grid.reference_steps >> grid.doublings).sum()))


#: The quantities of a sample of a level: DIFFERENCE, phi at the fine step minus phi at the coarse one, and VALUE, phi
#: at the fine step.
DIFFERENCE, VALUE = range(2)


def two_steps(antithetic: bool) -> tuple[dict[str, Any], list[float]]:
    """Paths of a sample with steps 2h and h, as words of :func:`spi.ensemble.loop.grid`, and weights of DIFFERENCE.

    Antithetic paths come in pairs: within each coarse step that of the fine path makes all its flows in reversed order
    (the two increments exchanged, the coins turned), that of the coarse path turns its coin.
    """
    if not antithetic:
        return {"doublings": (1, 0)}, [-1.0, 1.0]
    reversals = (AS_TOSSED, COINS_TURNED, AS_TOSSED, PAIRS_REVERSED)
    return {"doublings": (1, 1, 0, 0), "reversals": reversals}, [-0.5, -0.5, 0.5, 0.5]


class LevelPlan(BatchedPlan):
    """Base of all plans that sum up powers of quantities, over samples of several paths, as those of a level."""

    @property
    def sets(self) -> Sequence[Sample]:
        """Paths of a sample of each path set."""
        raise NotImplementedError

    def wanted(self, extra: Any) -> np.ndarray:
        """(path sets,) the samples that are wanted for now."""
        raise NotImplementedError

    def paths_on(self) -> list[tuple[TimeGrid, Any]]:
        """Paths of the samples."""
        return [(sample.grid, sample.stream) for sample in self.sets]

    def path_sets(self, extra: Any) -> Sequence[PathSet]:
        """Samples that are wanted for now."""
        d = dimension(self.model)
        return tuple(
            PathSet(int(samples), max(ROUND, chunk_blocks(sample.steps, d)))
            for samples, sample in zip(self.wanted(extra), self.sets, strict=True)
        )

    def most_blocks(self, number: int) -> int:
        """Largest number of blocks of a path set in a batch, because of memory."""
        floats = self.sets[number].weights.shape[1] * (len(self.initial) + 4 * len(self.case.functions))
        return max(1, int(BATCH_BYTES / (8 * LANES * floats)))

    def values(self, batch: Batch) -> np.ndarray:
        """(blocks, paths, F, LANES) the values of the test functions on the paths of a batch of samples."""
        sample = self.sets[batch.path_set]
        return values_at_end(self, sample.grid, sample.stream, batch)[0]

    def observe(self, batch: Batch) -> dict[str, Array]:
        """Quantities of a batch of samples, `sums` (blocks, quantities, F, LANES)."""
        values, weights = self.values(batch), self.sets[batch.path_set].weights
        with np.errstate(invalid="ignore", over="ignore"):
            each = (w[:, np.newaxis, np.newaxis] * values[:, i, np.newaxis] for i, w in enumerate(weights.T))
            return {"sums": np.asarray(sum(each))}


# ---------------------------------------------------------------------------------------------------------------------
# Reports of schemes on their steps, in the results of every kind that integrates.
# ---------------------------------------------------------------------------------------------------------------------


class Solver(Described):
    """Report of an implicit scheme on its equations; arrays of one shape."""

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
    """Fields `solver`, `acceptance` and `largest_angle` of a record, from reports (..., columns).

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
