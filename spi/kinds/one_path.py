"""One path of a large lattice, which threads share: states while it moves, and functions of them."""

from functools import cached_property
from typing import Any

import numpy as np

from spi.ensemble.increments import draw_paths
from spi.ensemble.long_states import LONG
from spi.ensemble.loop import TimeGrid, thread_count
from spi.ensemble.protocol import conserved, function_calls, one_path
from spi.ensemble.random_states import RandomState
from spi.kinds.functions import path_function
from spi.kinds.plans import KernelCall, Plan
from spi.models.delegation import undamped
from spi.numerics.rng import INITIAL

COPY_NS, FUNCTION_NS = 5.0, 15.0  #: of three numbers: to copy them, to evaluate a function
BYTES = 150  #: of three numbers: the state, its parts, their places, and scratch of functions
_NORMALS = 2**20  # that are drawn at a time


def is_long(case: Any) -> bool:
    """Whether the path of a case is looked at state by state, without tables of the sites."""
    return bool(case.in_parts) and len(case.initial) > LONG


def look_ns(case: Any, functions: int) -> float:
    """Nanoseconds of looking at the state of a long path once, at typical speed."""
    return len(case.initial) / 3 * (COPY_NS + FUNCTION_NS * functions)


def idle(most: int) -> float:
    """Factor by which all threads together spend more time than work takes that at most so many of them share."""
    return thread_count() / min(thread_count(), most)


def move_seconds(mover: Any, steps: int) -> float:
    """Seconds of typical speed for so many steps, as all threads together have them, of which some may be idle."""
    return 1e-9 * steps * float(mover.ns) * idle(mover.most_threads)


def bytes_of(case: Any) -> int:
    """Memory that one path takes besides what is stored of it."""
    return int(len(case.initial) / 3 * BYTES)


class LatticePlan(Plan):
    """Base of plans whose paths stand in blocks, or are one, of a large lattice, whose state threads share."""

    @cached_property
    def movers(self) -> tuple[Any, ...]:
        """Those of the one lattice by each step size; none where paths stand in blocks."""
        case = self.case
        return tuple(one_path(case.model, self.scheme, h) for h in case.noise_steps) if case.in_parts else ()

    @cached_property
    def is_long(self) -> bool:
        """Whether functions are evaluated state by state, without tables of the sites."""
        return is_long(self.case)

    @property
    def model(self) -> Any:
        """Record of the model for kernels, of a long path that of a part."""
        return self.movers[0].model if self.is_long else super().model

    def calls_of_a_step(self, times: TimeGrid, stream: Any) -> list[KernelCall]:
        """Kernels that move a block, or the one path, copy its states, and look at them."""
        if not self.movers:
            return super().calls_of_a_step(times, stream)
        looking = function_calls(undamped(self.case.model)) if self.is_long else ()
        return [KernelCall(*call) for call in (*self.movers[0].calls, *looking)]


def start_of(plan: Any, path: int = 0) -> np.ndarray:
    """(d,): y_0 of a path; by a law it is drawn alone."""
    if not isinstance(plan.initial, RandomState):
        return np.asarray(plan.initial, float)
    law, keys = plan.initial.law, plan.stream.keys
    own = keys._replace(stream=np.uint64(int(keys.stream) + INITIAL))
    z = np.empty((law.numbers, 1, 1))
    for first in range(0, len(z), _NORMALS):
        draw_paths(own, 1.0, first, path, z[first : first + _NORMALS])
    return np.asarray(law.of_one_lattice(law.states(z[:, 0])[:, 0], int(keys.seed), int(keys.stream), path))


def invariants(case: Any, states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """H (times,) and the Casimir functions (times, C) of states (times, d)."""
    model = undamped(case.model)
    energy = path_function(model, (), "H").values(states.T)
    return energy, casimirs(case, states.T).T


def casimirs(case: Any, states: np.ndarray) -> np.ndarray:
    """(C, paths): the Casimir functions of states (d, paths)."""
    model = undamped(case.model)
    return np.array([path_function(model, (), f"C{c + 1}").values(states) for c in range(conserved(model))])
