"""Long paths, integrated from stop to stop, and the errors of their Casimir functions.

Casimir functions are evaluated after 128, 256, 512, ... steps and at the end.  Standard errors come from the paths,
which are independent of one another.
"""

import functools
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from spi.ensemble import loop
from spi.ensemble.areas import fourier_terms
from spi.ensemble.observer import casimirs_of_states, growth, state_recorder
from spi.ensemble.protocol import casimirs, conserved
from spi.kinds import one_path as alone
from spi.kinds.blocks import paths_moved, reported
from spi.kinds.plans import Done, KernelCall, PartCost, State
from spi.numerics.rng import LANES, STEPS_PER_TOSS
from spi.numerics.types import Array
from spi.schemes import typical_ns
from spi.statistics.tallies import Batch, Chunk, PathSet

from .paths import LongPaths, casimir_errors

#: About the number of stops of each path.
SNAPSHOTS = 8192

CHUNK_BLOCKS = 16  #: which are integrated from the first step to the last together


@dataclass(frozen=True, kw_only=True)
class LongPlan(alone.LatticePlan):
    """Very many steps of one scheme, with one step size after the other; the case is a ``LongCase``."""

    sums: ClassVar[type[LongPaths]] = LongPaths
    by_path: ClassVar[tuple[str, ...]] = ("casimir",)  #: the fields in which the paths stand along the last axis

    @functools.cached_property
    def _start(self) -> Array:
        """(d,): the state in which one path begins."""
        return alone.start_of(self)

    @property
    def lanes(self) -> int:
        """States that stand together in an array."""
        return 1 if self.movers else LANES

    @functools.cached_property
    def records(self) -> Array:
        """Numbers of steps after which Casimirs are evaluated, which all step sizes reach."""
        count = self.case.counts[0]
        if count < STEPS_PER_TOSS:  # of one large lattice, whose steps need no whole tosses
            return np.array([count])
        count = count // STEPS_PER_TOSS * STEPS_PER_TOSS
        return np.union1d(STEPS_PER_TOSS << np.arange(int(np.log2(count / STEPS_PER_TOSS)) + 1), [count])

    @property
    def spacing(self) -> int:
        """Steps from stop to stop."""
        return STEPS_PER_TOSS << max(0, round(np.log2(self.case.counts[0] / STEPS_PER_TOSS / SNAPSHOTS)))

    @property
    def _conserved(self) -> int:
        """Number of Casimir functions."""
        return conserved(self.model) if self.is_long else len(casimirs(self.model, self.initial))

    # --- what further kinds of sums add ------------------------------------------------------------------------------

    def lengths(self, number: int) -> dict[str, int]:
        """Lengths of further axes of the sums of a path set."""
        return {}

    def every(self, number: int, stop: int) -> int:
        """Steps from one state that is looked at to the next, on the way to a stop; 0 for none."""
        return 0

    def looked(self, chunk: Chunk, paths: Any, before: int, stored: Array) -> Any:
        """Paths with what the states (blocks, 1 + stored, d * lanes) after step `before` show, which are some."""
        raise NotImplementedError

    def look(self, number: int, n: int, state: Array) -> Sequence[Array]:
        """What the state (d,) of one large lattice after n steps shows, if it counts."""
        return ()

    def with_looks(self, chunk: Chunk, paths: Any, before: int, looks: list[Array]) -> Any:
        """Paths with what the looks after step `before` showed, which are some."""
        raise NotImplementedError

    def at_stop(self, number: int, paths: Any, states: Array) -> Any:
        """Paths with what their states (d, paths) at a stop show."""
        return paths

    def rounding_sizes(self, totals: Sequence[Any]) -> Array | None:
        """(C,): the sizes for rounding of the Casimirs relative to themselves; None where roundings are studied."""
        return None

    # --- the plan ----------------------------------------------------------------------------------------------------

    def cost(self) -> PartCost:
        """Steps of paths, seconds of one thread at typical speed, and bytes of memory."""
        steps = sum(self.case.counts)
        if self.movers:
            seconds = map(alone.move_seconds, self.movers, self.case.counts)
            return PartCost(steps, sum(seconds), alone.bytes_of(self.case))
        blocks = -(-self.case.samples // LANES)
        steps *= paths_moved(self.model, self.case.samples)
        idle = alone.idle(blocks)  # a block cannot be shared
        of_a_block = 8 * LANES * (len(self.initial) + len(self.records) * self._conserved)
        memory = of_a_block * blocks * len(self.case.steps)
        return PartCost(steps, idle * steps * 1e-9 * typical_ns(self.row, self.model), memory)

    def deciding(self, number: int | None) -> dict[str, Any]:
        """See :meth:`Plan.deciding`; the paths of one step size do not depend on the other ones."""
        if number is None:
            return super().deciding(None)
        return super().deciding(0) | {"steps": self.case.steps[number]}

    def path_sets(self, extra: Any) -> Sequence[PathSet]:
        """All paths of each step size."""
        return (PathSet(self.case.samples, CHUNK_BLOCKS),) * len(self.case.steps)

    def empty(self, number: int) -> Any:
        """Sums over no paths."""
        return self.at_start(Batch(number, 0, 0, 0))

    def at_start(self, batch: Batch) -> Any:
        """Paths of a batch before their first step."""
        y = self._states_at_start(batch)
        own = {"block": batch.blocks, "state": y.shape[1], "level": 1, "record": len(self.records)}
        sums = self.sums.empty(own | {"casimir": self._conserved} | self.lengths(batch.path_set))
        by_path = {name: np.zeros((*getattr(sums, name).shape[:-1], batch.blocks * LANES)) for name in self.by_path}
        by_path["casimir"][:] = np.nan
        return sums._replace(y=y, **by_path)

    def _states_at_start(self, batch: Batch) -> Array:
        """(blocks, d * LANES): states of a batch before their first step."""
        first, blocks = batch.first, batch.blocks
        if self.movers:
            return self._start[np.newaxis].repeat(blocks, axis=0) if blocks else np.empty((0, len(self.initial)))
        times = loop.grid(self.case.steps[batch.path_set], 1)
        return loop.states_at(self.initial, self.scheme, self.model, times, blocks, self.stream, first)[:, 0]

    def kernel_calls(self) -> list[KernelCall]:
        """One step of the first block, or of the one path."""
        return self.calls_of_a_step(loop.grid(self.case.steps[0], 1, truncate=self.case.clipping), self.stream)

    def advance(self, chunks: Sequence[Chunk], started: Any) -> Iterator[list[tuple[Chunk, Any]]]:
        """Compute chunks, see :class:`~spi.kinds.plans.Plan`."""
        for chunk in chunks:
            begun = started and len(started.y) == chunk.blocks
            paths: Any = started if begun else self.at_start(chunk.batch)
            paths = paths._replace(wanted=chunk.paths)
            started = None
            shared = loop.thread_count() if self.movers else chunk.blocks
            with loop.limited_threads(shared):  # a thread without a block would wait in a busy loop
                until = time.perf_counter() + loop.BATCH_SECONDS
                while not paths.paths:
                    paths = self._advanced(chunk, paths)
                    if time.perf_counter() > until or paths.paths:
                        yield [(chunk, paths)]
                        until = time.perf_counter() + loop.BATCH_SECONDS

    def paths_on(self) -> list[tuple[loop.TimeGrid, Any]]:
        """Paths of each step size."""
        case = self.case
        terms = [fourier_terms(self.model, [self.scheme], h, areas=case.areas) for h in case.steps]
        runs = zip(case.steps, case.counts, terms, strict=True)
        return [
            (loop.grid(h, n, truncate=case.clipping, by_reference=(0,), area_terms=of_h), self.stream)
            for h, n, of_h in runs
        ]

    def next_stop(self, n: int, number: int = 0) -> int:
        """Number of steps at which paths that have done n steps stop next."""
        stop = (n // self.spacing + 1) * self.spacing if n >= self.spacing else max(2 * n, STEPS_PER_TOSS)
        return int(min(stop, self.case.counts[number]))

    def integrated(self, batch: Batch, y: Array, n: int, steps: int, every: int) -> tuple[Array, Array, Array]:
        """States (blocks, 1 + stored, d * LANES) after each `every` steps from t = 0 on, the last ones, and reports.

        The batch has the states y after n steps and takes `steps` more; for 0 as `every` nothing is stored.
        """
        h, case = self.case.steps[batch.path_set], self.case
        if self.movers:
            stored, last, report = self.movers[batch.path_set].moved(y[0], n, steps, every, int(self.stream.seed), 0)
            stored = np.concatenate([y, stored])[np.newaxis] if every else np.empty((1, 0, len(last)))
            return stored, last[np.newaxis, np.newaxis], report[np.newaxis]
        terms = fourier_terms(self.model, [self.scheme], h, areas=case.areas)
        times = loop.grid(h, steps, truncate=case.clipping, area_terms=terms, first_step=n)
        count = 1 + (n + steps) // every - n // every if every else 0
        stored = np.empty((len(y), count, len(self.initial) * LANES))
        observer = (state_recorder(times, stored, every),) if every else ()
        run = self.scheme, self.model, y[:, np.newaxis], times, self.stream
        rows, report = loop.integrated(*run, batch.first, batch.blocks, batch.end, *observer)
        return stored, rows, report

    def _advanced(self, chunk: Chunk, paths: Any) -> Any:
        """Paths of a chunk at the next stop."""
        began = time.perf_counter()
        stop = self.next_stop(int(paths.n), chunk.path_set)
        with np.errstate(all="ignore"):
            paths, states = self._moved_alone(chunk, paths, stop) if self.is_long else self._moved(chunk, paths, stop)
            paths = self._stopped(chunk, paths, states)
        return paths._replace(seconds=paths.seconds + time.perf_counter() - began)

    def _moved(self, chunk: Chunk, paths: Any, stop: int) -> tuple[Any, Array]:
        """Paths of a chunk at a stop, and their states (d, paths)."""
        before, every = int(paths.n), self.every(chunk.path_set, stop)
        stored, rows, report = self.integrated(chunk.batch, paths.y, before, stop - before, every)
        y, (states,) = rows[:, 0], rows[:, 0].T[np.newaxis] if self.movers else loop.paths_of(rows, len(self.initial))
        paths = paths._replace(n=stop, y=y, report=loop.add_reports(paths.report, report))
        return self.looked(chunk, paths, before, stored) if every else paths, states

    def _moved_alone(self, chunk: Chunk, paths: Any, stop: int) -> tuple[Any, Array]:
        """One large lattice at a stop, which is looked at while it moves, and its state (d, 1)."""
        number, before, y, report = chunk.path_set, int(paths.n), paths.y[0], paths.report
        every, mover, looks = self.every(number, stop), self.movers[number], list[Array]()
        for n, state, added in mover.along(y, before, stop - before, every, int(self.stream.seed), 0):
            y, report = state, loop.add_reports(report, added)
            looks += self.look(number, n, y)
        paths = paths._replace(n=stop, y=y[np.newaxis], report=report)
        return self.with_looks(chunk, paths, before, looks) if looks else paths, y[:, np.newaxis]

    def _stopped(self, chunk: Chunk, paths: Any, states: Array) -> Any:
        """Paths of a chunk that have stopped, with the sums over their states (d, paths)."""
        number, stop = chunk.path_set, int(paths.n)
        if stop in self.records:
            errors = self._recorded(paths.casimir, stop, self.case.steps[number], states, chunk.first)
            paths = paths._replace(casimir=errors)
        paths = self.at_stop(number, paths, states)
        return self.ended(chunk, paths, states) if stop == self.case.counts[number] else paths

    def ended(self, chunk: Chunk, paths: Any, states: Array) -> Any:
        """Paths of a chunk after all steps."""
        return paths._replace(
            paths=chunk.paths,
            wanted=0,
            y=paths.y[:0],
            nonfinite=int((~np.isfinite(states[:, : chunk.paths]).all(axis=0)).sum()),
            **{name: getattr(paths, name)[..., : chunk.paths] for name in self.by_path},
        )

    def _recorded(self, errors: Array, n: int, h: float, states: Array, block: int) -> Array:
        """Relative errors (records, C, paths) of the Casimirs with those after n steps of size h."""
        if not errors.shape[1]:
            return errors
        if self.is_long:
            first, now = (alone.casimirs(self.case, y) for y in (self._start[:, np.newaxis], states))
        else:
            now = casimirs_of_states(self.model, states)
            if self.movers:  # whose law draws one state and no block of them
                first = casimirs_of_states(self.model, self._start[:, np.newaxis])
            else:
                first = self.initial_casimirs(block, -(-states.shape[1] // LANES))[:, : states.shape[1]]
        grown = np.reshape(growth(self.model, n * h), (-1, 1))
        change = now * grown - first
        errors = errors.copy()
        errors[np.searchsorted(self.records, n)] = change / np.where(first == 0.0, 1.0, np.abs(first))
        return errors

    def progress(self, state: State) -> Done:
        """Steps done and all steps, in paths, and no standard error."""
        levels, done = len(self.case.steps), 0.0
        for i, path_set in enumerate(state.path_sets):
            chunks, tally = path_set.chunks(i), state.tally(i)
            done += sum(sums.paths for sums in tally.nodes.values())
            done += sum(chunks[index].paths * sums.n / self.case.counts[i] for index, sums in tally.short.items())
        return Done(done / levels, self.case.samples, float("nan"))

    def results(self, state: State) -> Any:
        totals = self.totals(state)
        errors = np.array([paths.casimir for paths in totals])
        return self.record(
            **self.whole(state)
            | {
                "h": np.array(self.case.steps),
                "n": self.records,
                **casimir_errors(self.records, errors, self.rounding_sizes(totals)),
                "nonfinite": np.array([int(paths.nonfinite) for paths in totals]),
                **reported(np.array([paths.report[0] for paths in totals])),
                "steps_each": int(self.records[-1]),
            }
            | self.found(state)
        )

    def totals(self, state: State) -> list[Any]:
        """Sums over all paths of each step size."""
        return [state.total(i) for i in range(len(self.case.steps))]

    def found(self, state: State) -> dict[str, Any]:
        """Further fields of the record, from the sums of each step size and the answers of tasks."""
        return {}
