"""Long times: how rounding errors of Casimirs grow over very many steps, and the law of the states.

Paths are integrated from snapshot to snapshot.  Casimirs are looked at after 128, 256, 512, ... steps and at the end.
On a sphere all flows preserve the area, so that with noise the law of the states tends to the uniform one: then y_j is
uniform on [-|y_0|, |y_0|], and means, and fractions of the snapshots in bins of equal probability, are compared with
their exact values.  Standard errors come from the paths, which are independent of one another.
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from spi.ensemble import BATCH_SECONDS, grid, integrate, limited_threads, thread_count
from spi.kinds.plans import Cost, Done, KernelCall, SchemePlan
from spi.protocol import REPORT, casimirs
from spi.records import Group, Part
from spi.rng import LANES, STEPS_PER_TOSS
from spi.schemes import typical_ns
from spi.sphere_law import BINS, SphereLaw, obstacle

from .paths import State, advance_state, initial_rows, integration
from .results import group

#: About how many snapshots of each path.
SNAPSHOTS = 8192


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
        seconds = idle * steps * 1e-9 * typical_ns(self.part.scheme, self.model)
        return Cost(steps, seconds, sum(np.asarray(v).nbytes for v in self.start()))

    def start(self) -> State:
        """The state before the first step."""
        levels, paths, conserved = len(self.case.steps), self.blocks * LANES, len(casimirs(self.model, self.initial))
        moments, variables = (len(self.law.moments), len(self.law.variables)) if self.law else (0, 0)
        return State(
            level=0,
            n=0,
            seconds=0.0,
            y=initial_rows(self),
            casimir=np.full((levels, len(self.records), conserved, paths), np.nan),
            report=np.zeros((levels, len(REPORT))),
            nonfinite=np.zeros(levels, np.int64),
            snapshots=np.zeros(levels, np.int64),
            moments=np.zeros((levels, moments, paths)),
            counts=np.zeros((levels, variables, BINS, paths)),
        )

    def kernel_calls(self) -> list[KernelCall]:
        """One step of the first block."""
        times = grid(self.case.steps[0], 1, truncate=self.case.truncate_noise)
        return [KernelCall(integrate, integration(replace(self, samples=LANES), times, initial_rows(self)[:1]))]

    def batches(self, state: State) -> Iterator[State]:
        """Run all that is left; yields the state after each batch of about half a second."""
        with limited_threads(self.blocks):  # a thread without a block would wait in a busy loop
            until = time.perf_counter() + BATCH_SECONDS
            while state.level < len(self.case.steps):
                state = advance_state(self, state)
                if time.perf_counter() > until:
                    yield state
                    until = time.perf_counter() + BATCH_SECONDS
            yield state

    def progress(self, state: State) -> Done:
        """Steps done and all steps, in paths, and no standard error."""
        done = (state.level + state.n / self.case.step_count) / len(self.case.steps)
        return Done(done * self.samples, self.samples, float("nan"))

    def group(self, state: State) -> Group:
        """The results of one scheme of a case, from its final state."""
        return group(self, state)
