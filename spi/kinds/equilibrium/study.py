"""Long times: how rounding errors of Casimirs grow over very many steps, and the law of the states.

Paths are integrated from snapshot to snapshot.  Casimirs are evaluated after 128, 256, 512, ... steps and at the end.
On a sphere all flows preserve the area, so that with noise the law of the states tends to the uniform one: then y_j is
uniform on [-|y_0|, |y_0|], and means, and fractions of the snapshots in bins of equal probability, are compared with
their exact values.  Standard errors come from the paths, which are independent of one another.

Where functions are given, all step sizes run until the same time, and means over that time, autocorrelations and
histograms are estimated, see ``means``.
"""

import functools
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from spi.ensemble import loop
from spi.ensemble.areas import fourier_terms
from spi.ensemble.observer import casimirs_of_states, growth, state_recorder
from spi.ensemble.protocol import casimirs, conserved, one_path
from spi.exact.sphere_law import BINS, SphereLaw, obstacle
from spi.kinds import one_path as alone
from spi.kinds.blocks import paths_moved, reported
from spi.kinds.functions import evaluated, origin_of, path_function
from spi.kinds.plans import Cost, Done, KernelCall, Plan, State, Task, each_scheme
from spi.models.delegation import undamped
from spi.numerics.rng import LANES, STEPS_PER_TOSS
from spi.schemes import typical_ns
from spi.statistics.estimators import GROUPS
from spi.statistics.rounding import size_of_values
from spi.statistics.tallies import Chunk, PathSet
from spi.storage.records import Part

from . import means
from .growth import OF_PATHS, Paths, casimir_errors, law_of_states
from .references import EXACT
from .results import Equilibrium

#: About the number of snapshots of each path.
SNAPSHOTS = 8192

_LAWS = "reference laws"  # the name of the task
_CHUNK_BLOCKS = 16  # which are integrated from the first step to the last together
_WARM_UP = 1 / 16  # of the time, before snapshots count for the law
_PILOT = 4096  # steps of one block, around whose values the bins of histograms lie


parts = each_scheme


def plan(case: Any, part: Part) -> "EquilibriumPlan":
    """The plan for one scheme of a case."""
    has_law = not case.functions and not obstacle(case.model, case.initial)
    law = SphereLaw.of(case.model, case.initial) if has_law else None
    return EquilibriumPlan(case=case, part=part, law=law)


@dataclass(frozen=True, kw_only=True)
class EquilibriumPlan(Plan):
    """Very many steps of one scheme, with one step size after the other."""

    record = Equilibrium

    law: SphereLaw | None  #: the limit of the law of the states, None where that is not known

    @functools.cached_property
    def one_path(self) -> tuple[Any, ...]:
        """The movers of a single path of each step size, where threads share its state; otherwise none."""
        return tuple(one_path(self.case.model, self.scheme, h) for h in self.case.steps) if self.case.in_parts else ()

    @functools.cached_property
    def is_long(self) -> bool:
        """Whether functions are evaluated state by state, while one large lattice moves."""
        return alone.is_long(self.case)

    @property
    def model(self) -> Any:
        """The record of the model for kernels, of one large lattice that of a part."""
        return self.one_path[0].model if self.is_long else super().model

    @functools.cached_property
    def _start(self) -> np.ndarray:
        """(d,): the state in which one path begins."""
        return alone.start_of(self)

    @property
    def lanes(self) -> int:
        """The states that stand together in an array."""
        return 1 if self.one_path else LANES

    @property
    def records(self) -> np.ndarray:
        """The numbers of steps after which Casimirs are evaluated, which all step sizes reach."""
        count = self.case.counts[0]
        if count < STEPS_PER_TOSS:  # of one large lattice, whose steps need no whole tosses
            return np.array([count])
        count = count if self.case.step_count else count // STEPS_PER_TOSS * STEPS_PER_TOSS
        return np.union1d(STEPS_PER_TOSS << np.arange(int(np.log2(count / STEPS_PER_TOSS)) + 1), [count])

    @property
    def spacing(self) -> int:
        """Steps from snapshot to snapshot."""
        return STEPS_PER_TOSS << max(0, round(np.log2(self.case.counts[0] / STEPS_PER_TOSS / SNAPSHOTS)))

    @functools.cached_property
    def recorders(self) -> tuple[means.Recorder, ...]:
        """The recorder of functions at each step size; none without functions."""
        if not self.case.functions:
            return ()
        if self.is_long:
            return tuple(means.Recorder.of(self.case, i) for i in range(len(self.case.steps)))
        return tuple(means.Recorder.of(self.case, i, self._bins(i)) for i in range(len(self.case.steps)))

    def _bins(self, number: int) -> tuple[np.ndarray, np.ndarray]:
        """(low, width), (F,) each, of the bins of the functions, from values of the first block."""
        steps = min(self.case.counts[number], _PILOT)
        y, _, _ = self._integrated(self._begun(number, 1, 0), number, steps, 0, LANES, max(1, steps // 256))
        states = np.moveaxis(y.reshape(y.shape[1], -1, self.lanes)[y.shape[1] // 2 :], 1, 0)
        values = evaluated(self.case.path_functions, states)
        return means.bins_around(values.reshape(len(values), -1), self.case.bins)

    def cost(self) -> Cost:
        """Steps of paths, seconds of one thread at typical speed, and bytes of memory."""
        if self.one_path:
            return self._cost_of_one()
        blocks = -(-self.case.samples // LANES)
        steps = sum(self.case.counts) * paths_moved(self.model, self.case.samples)
        idle = loop.thread_count() / min(loop.thread_count(), blocks)  # a block cannot be shared
        seconds = idle * steps * 1e-9 * typical_ns(self.row, self.model)
        bare = replace(self, case=self.case.model_copy(update={"functions": {}}))
        of_a_block = sum(np.asarray(values).nbytes for values in bare.empty(0, 1))
        recorded = len(self.case.functions) * 2**21 * min(blocks, _CHUNK_BLOCKS)
        return Cost(steps, seconds, of_a_block * blocks * len(self.case.steps) + recorded)

    def _cost_of_one(self) -> Cost:
        """The same of one lattice, whose sites threads share: its state with copies, and what looking at it needs."""
        steps = sum(self.case.counts)
        moving = sum(n * mover.ns for n, mover in zip(self.case.counts, self.one_path, strict=True))
        looks = len(self.case.steps) * self.case.last_time / self.case.between if self.case.functions else 0
        looking = looks * alone.look_ns(self.case, len(self.case.functions))
        return Cost(steps, 1e-9 * (moving + looking), alone.bytes_of(self.case))

    def deciding(self, number: int | None) -> dict[str, Any]:
        """See :meth:`Plan.deciding`; the paths of one step size do not depend on the other ones."""
        if number is None:  # the references are among the answers of the tasks
            return super().deciding(None) | self.case.model_dump(include={"reference"})
        own: dict[str, Any] = {"steps": self.case.steps[number]}
        if not self.case.step_count:  # which other step sizes decide as well
            own |= {"records": self.records.tolist(), "between": self.case.between}
        return super().deciding(0) | own

    def path_sets(self, extra: Any) -> Sequence[PathSet]:
        """All paths of each step size."""
        return (PathSet(self.case.samples, _CHUNK_BLOCKS),) * len(self.case.steps)

    def empty(self, number: int, blocks: int = 0, first: int = 0) -> Paths:
        """The sums over no paths, or `blocks` blocks from block `first` on before their first step."""
        law, y = self.law, self._begun(number, blocks, first)
        lags = {"function": 0, "lag": 0, "cell": 0, "kept": 0} | (
            self.recorders[number].lengths if self.recorders else {}
        )
        sums = Paths.empty(
            lags
            | {"block": blocks, "lane": LANES, "state": y.shape[1], "level": 1, "record": len(self.records)}
            | {"casimir": self._conserved, "column": means.COLUMNS, "group": GROUPS}
            | {"moment": len(law.moments) if law else 0, "variable": len(law.variables) if law else 0, "bin": BINS}
            | {
                "stretch": 2 * lags["lag"],
                "batch": self.recorders[number].series.batches if self.recorders else 0,
                "power": 2,
            }
        )
        begun = {name: np.zeros((*getattr(sums, name).shape[:-1], blocks * LANES)) for name in OF_PATHS}
        begun["casimir"][:] = np.nan
        return sums._replace(y=y, **begun)

    def _begun(self, number: int, blocks: int, first: int) -> np.ndarray:
        """The states of `blocks` blocks before their first step."""
        if self.one_path:
            return self._start[np.newaxis].repeat(blocks, axis=0) if blocks else np.empty((0, len(self.initial)))
        times = loop.grid(self.case.steps[number], 1)
        return loop.states_at(self.initial, self.scheme, self.model, times, blocks, self.stream, first)[:, 0]

    @property
    def _conserved(self) -> int:
        """The number of Casimir functions."""
        return conserved(self.model) if self.is_long else len(casimirs(self.model, self.initial))

    def kernel_calls(self) -> list[KernelCall]:
        """One step of the first block, or of the one path."""
        if self.one_path:
            return alone.kernel_calls(self.case, self.one_path[0])
        return self.calls_of_a_step(loop.grid(self.case.steps[0], 1, truncate=self.case.clipping), self.stream)

    def advance(self, chunks: Sequence[Chunk], started: Paths | None) -> Iterator[list[tuple[Chunk, Paths]]]:
        """Compute chunks, see :class:`~spi.kinds.plans.Plan`."""
        for chunk in chunks:
            begun = started and len(started.y) == chunk.blocks
            paths: Any = started if begun else self.empty(chunk.path_set, chunk.blocks, chunk.first)
            paths = paths._replace(wanted=chunk.paths)
            started = None
            shared = loop.thread_count() if self.one_path else chunk.blocks
            with loop.limited_threads(shared):  # a thread without a block would wait in a busy loop
                until = time.perf_counter() + loop.BATCH_SECONDS
                while not paths.paths:
                    paths = self._advanced(chunk, paths)
                    if time.perf_counter() > until or paths.paths:
                        yield [(chunk, paths)]
                        until = time.perf_counter() + loop.BATCH_SECONDS

    def next_stop(self, n: int, number: int = 0) -> int:
        """The number of steps at which paths that have done n steps stop next."""
        stop = (n // self.spacing + 1) * self.spacing if n >= self.spacing else max(2 * n, STEPS_PER_TOSS)
        if self.recorders:
            piece = self.recorders[number].series.piece(len(self.initial), _CHUNK_BLOCKS)
            later = self.records[self.records > n].tolist()
            stop = min([(n // piece + 1) * piece, *later])
        return int(min(stop, self.case.counts[number]))

    def _integrated(
        self, y: np.ndarray, number: int, steps: int, n: int, end: int, every: int, first: int = 0
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """States (blocks, 1 + stored, d * LANES) after each `every` steps from t = 0 on, the last ones, and reports.

        The blocks, of which the first is number `first`, have the states y after n steps and take `steps` more; for 0
        as `every` nothing is stored.
        """
        h, case = self.case.steps[number], self.case
        if self.one_path:
            stored, last, report = self.one_path[number].moved(y[0], n, steps, every, int(self.stream.seed), 0)
            stored = np.concatenate([y, stored])[np.newaxis] if every else np.empty((1, 0, len(last)))
            return stored, last[np.newaxis, np.newaxis], report[np.newaxis]
        terms = fourier_terms(self.model, [self.scheme], h, areas=case.areas)
        times = loop.grid(h, steps, truncate=case.clipping, area_terms=terms, first_step=n)
        count = 1 + (n + steps) // every - n // every if every else 0
        stored = np.empty((len(y), count, len(self.initial) * LANES))
        observer = (state_recorder(times, stored, every),) if every else ()
        states = y[:, np.newaxis]
        rows, report = loop.integrated(
            self.scheme, self.model, states, times, self.stream, first, len(y), end, *observer
        )
        return stored, rows, report

    def _advanced(self, chunk: Chunk, paths: Paths) -> Paths:
        """The paths of a chunk at the next snapshot."""
        number = chunk.path_set
        began, before = time.perf_counter(), int(paths.n)
        stop = self.next_stop(before, number)
        recorder = self.recorders[number] if self.recorders else None
        if self.is_long:
            return self._looked_at(chunk, paths, stop, recorder)
        recording = recorder is not None and stop > recorder.series.first * recorder.series.stride
        every = recorder.series.stride if recorder and recording else 0
        stored, rows, report = self._integrated(paths.y, number, stop - before, before, chunk.end, every, chunk.first)
        y, (states,) = rows[:, 0], rows[:, 0].T[np.newaxis] if self.one_path else loop.paths_of(rows, len(self.initial))
        paths = paths._replace(n=stop, y=y, report=loop.add_reports(paths.report, report))
        with np.errstate(all="ignore"):
            if recorder and recording:
                values = recorder.values(stored, before, self.lanes)
                paths = recorder.recorded(paths, values, before, chunk.first, chunk.end)
            paths = self._stopped(chunk, paths, states)
        return paths._replace(seconds=paths.seconds + time.perf_counter() - began)

    def _looked_at(self, chunk: Chunk, paths: Paths, stop: int, recorder: means.Recorder | None) -> Paths:
        """One large lattice at the next stop, whose functions are evaluated while it moves."""
        began, before, y, values, report = time.perf_counter(), int(paths.n), paths.y[0], [], paths.report
        every, mover = recorder.series.stride if recorder else 0, self.one_path[chunk.path_set]
        for n, state, added in mover.along(paths.y[0], before, stop - before, every, int(self.stream.seed), 0):
            y, report = state, loop.add_reports(report, added)
            if recorder and recorder.counts_at(n):
                values.append(recorder.values_of(y))
        paths = paths._replace(n=stop, y=y[np.newaxis], report=report)
        with np.errstate(all="ignore"):
            if recorder and values:
                found = np.transpose(values)[:, np.newaxis, np.newaxis]
                in_lanes = np.broadcast_to(found, (len(found), 1, LANES, len(values)))
                paths = recorder.recorded(paths, in_lanes, before, chunk.first, chunk.end)
            paths = self._stopped(chunk, paths, y[:, np.newaxis])
        return paths._replace(seconds=paths.seconds + time.perf_counter() - began)

    def _stopped(self, chunk: Chunk, paths: Paths, states: np.ndarray) -> Paths:
        """The paths of a chunk that have stopped, with the sums over their states (d, paths)."""
        stop, count = int(paths.n), self.case.counts[chunk.path_set]
        if stop in self.records:
            errors = self._recorded(paths.casimir, stop, self.case.steps[chunk.path_set], states, chunk.first)
            paths = paths._replace(casimir=errors)
        if self.law and stop > _WARM_UP * count:
            paths = paths.counted(self.law, states)
        return self._ended(chunk, paths, states) if stop == count else paths

    def _ended(self, chunk: Chunk, paths: Paths, states: np.ndarray) -> Paths:
        """The paths of a chunk after all steps."""
        summed = self.recorders[chunk.path_set].finished(paths, chunk.first, chunk.end) if self.recorders else {}
        return paths._replace(
            paths=chunk.paths,
            wanted=0,
            y=paths.y[:0],
            stretch=paths.stretch[:, :0],
            batches=paths.batches[:, :0],
            squares=paths.squares[:, :0],
            nonfinite=int((~np.isfinite(states[:, : chunk.paths]).all(axis=0)).sum()),
            **{name: getattr(paths, name)[..., : chunk.paths] for name in OF_PATHS},
            **summed,
        )

    def _recorded(self, errors: np.ndarray, n: int, h: float, states: np.ndarray, block: int) -> np.ndarray:
        """The relative errors (records, C, paths) of the Casimirs with those after n steps of size h."""
        if not errors.shape[1]:
            return errors
        if self.is_long:
            first, now = (alone.casimirs(self.case, y) for y in (self._start[:, np.newaxis], states))
        else:
            now = casimirs_of_states(self.model, states)
            if self.one_path:  # whose law draws one state and no block of them
                first = casimirs_of_states(self.model, self._start[:, np.newaxis])
            else:
                first = self.initial_casimirs(block, -(-states.shape[1] // LANES))[:, : states.shape[1]]
        grown = np.reshape(growth(self.model, n * h), (-1, 1))
        change = now * grown - first
        errors = errors.copy()
        errors[np.searchsorted(self.records, n)] = change / np.where(first == 0.0, 1.0, np.abs(first))
        return errors

    def _sizes(self, totals: Sequence[Paths]) -> np.ndarray | None:
        """(C,): the sizes for rounding of the Casimirs relative to themselves; None where roundings are studied."""
        if self.case.step_count:
            return None
        model, sizes = undamped(self.case.model), []
        for c in range(totals[0].casimir.shape[1]):
            function = path_function(model, (), f"C{c + 1}")
            at_start = abs(origin_of(function, self.case.initial)) or 1.0
            sizes.append(max(1.0, size_of_values(function.values, self.case.initial) / at_start))
        return np.array(sizes)

    def progress(self, state: State) -> Done:
        """Steps done and all steps, in paths, and no standard error."""
        levels, done = len(self.case.steps), 0.0
        for i, path_set in enumerate(state.path_sets):
            chunks, tally = path_set.chunks(i), state.tally(i)
            done += sum(sums.paths for sums in tally.nodes.values())
            done += sum(chunks[index].paths * sums.n / self.case.counts[i] for index, sums in tally.short.items())
        return Done(done / levels, self.case.samples, float("nan"))

    def tasks(self, state: State) -> list[Task]:
        """The references that are quadratures of the Gibbs law."""
        if EXACT not in self.case.reference.values():
            return []
        recorders = means.with_bins(self.recorders, [state.total(i) for i in range(len(self.case.steps))])
        return [Task(_LAWS, lambda: means.references_of(recorders, self.case)._asdict())]

    def results(self, state: State) -> Equilibrium:
        """The results of one scheme of a case, from its final state."""
        case, totals = self.case, [state.total(i) for i in range(len(self.case.steps))]
        estimated = {
            "h": np.array(case.steps),
            "n": self.records,
            **casimir_errors(self.records, np.array([paths.casimir for paths in totals]), self._sizes(totals)),
            "nonfinite": np.array([int(paths.nonfinite) for paths in totals]),
            **reported(np.array([paths.report[0] for paths in totals])),
            "law": law_of_states(self.law, totals) if self.law else None,
            "averages": means.averages(self.recorders, case, totals, state.answers.get(_LAWS))
            if self.recorders
            else None,
            "steps_each": int(self.records[-1]),
            "snapshots": int(totals[0].snapshots),
        }
        return Equilibrium(**(self.whole(state) | estimated))
