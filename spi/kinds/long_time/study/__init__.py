"""Long times: how rounding errors of Casimirs grow over very many steps, and the law of the states.

Paths are integrated from snapshot to snapshot.  Casimirs are looked at after 128, 256, 512, ... steps and at the end.
On a sphere all flows preserve the area, so that with noise the law of the states tends to the uniform one: then y_j is
uniform on [-|y_0|, |y_0|], and means, and fractions of the snapshots in bins of equal probability, are compared with
their exact values.  Standard errors come from the paths, which are independent of one another.
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from spi.ensemble.loop import BATCH_SECONDS, grid, limited_threads, thread_count
from spi.exact.sphere_law import SphereLaw, obstacle
from spi.kinds.plans import Cost, Done, KernelCall, SchemePlan, State
from spi.numerics.rng import LANES, STEPS_PER_TOSS
from spi.schemes import typical_ns
from spi.statistics.tallies import Chunk, PathSet
from spi.storage.records import Part

from ..results import LongTimes
from .outcome import results
from .paths import Paths, advanced, paths_at_start

#: About how many snapshots of each path.
SNAPSHOTS = 8192

_CHUNK_BLOCKS = 16  # which go from the first step to the last together


def parts(case: Any) -> list[Part]:
    """What is run one after the other: each scheme."""
    return [Part(scheme) for scheme in case.schemes]


def plan(case: Any, part: Part) -> "LongTimePlan":
    """The plan for one scheme of a case."""
    known = obstacle(case.model, case.initial) is None
    law = SphereLaw.of(case.model, case.initial) if known else None
    return LongTimePlan(case=case, part=part, samples=case.samples, law=law)


@dataclass(frozen=True, kw_only=True)
class LongTimePlan(SchemePlan):
    """Very many steps of one scheme, with one step size after the other."""

    law: SphereLaw | None  #: to which the law of the states tends, None where that is not known

    @property
    def records(self) -> np.ndarray:
        """The numbers of steps after which Casimirs are looked at."""
        count = self.case.step_count
        return np.union1d(STEPS_PER_TOSS << np.arange(int(np.log2(count / STEPS_PER_TOSS)) + 1), [count])

    @property
    def spacing(self) -> int:
        """Steps from snapshot to snapshot."""
        return STEPS_PER_TOSS << max(0, round(np.log2(self.case.step_count / STEPS_PER_TOSS / SNAPSHOTS)))

    def cost(self) -> Cost:
        """Steps of paths, seconds of one thread at typical speed, and bytes of memory."""
        steps = len(self.case.steps) * self.case.step_count * self.blocks * LANES
        idle = thread_count() / min(thread_count(), self.blocks)  # a block cannot be shared by threads
        seconds = idle * steps * 1e-9 * typical_ns(self.row, self.model)
        of_a_block = sum(np.asarray(v).nbytes for v in paths_at_start(self, 1))
        return Cost(steps, seconds, of_a_block * self.blocks * len(self.case.steps))

    def path_sets(self, more: Any) -> Sequence[PathSet]:
        """All paths of each step size."""
        return (PathSet(self.samples, _CHUNK_BLOCKS),) * len(self.case.steps)

    def empty(self, number: int) -> Paths:
        """No paths."""
        return paths_at_start(self, 0)

    def kernel_calls(self) -> list[KernelCall]:
        """One step of the first block."""
        return self.calls_of_a_step(grid(self.case.steps[0], 1, truncate=self.case.truncate_noise), self.stream)

    def advance(self, chunks: Sequence[Chunk], known: Paths | None) -> Iterator[list[tuple[Chunk, Paths]]]:
        """Compute chunks, see :class:`~spi.kinds.plans.Plan`."""
        for chunk in chunks:
            paths = known if known and len(known.y) == chunk.blocks else paths_at_start(self, chunk.blocks)
            known = None
            with limited_threads(chunk.blocks):  # a thread without a block would wait in a busy loop
                until = time.perf_counter() + BATCH_SECONDS
                while not paths.paths:
                    paths = advanced(self, chunk, paths)
                    if time.perf_counter() > until or paths.paths:
                        yield [(chunk, paths)]
                        until = time.perf_counter() + BATCH_SECONDS

    def progress(self, state: State) -> Done:
        """Steps done and all steps, in paths, and no standard error."""
        levels, done = len(self.case.steps), 0.0
        for i, path_set in enumerate(state.path_sets):
            chunks, tally = path_set.chunks(i), state.tally(i)
            done += sum(sums.paths for sums in tally.nodes.values())
            done += sum(chunks[index].paths * sums.n / self.case.step_count for index, sums in tally.short.items())
        return Done(done / levels, self.samples, float("nan"))

    def results(self, state: State) -> LongTimes:
        """The results of one scheme of a case, from its final state."""
        return results(self, state)
