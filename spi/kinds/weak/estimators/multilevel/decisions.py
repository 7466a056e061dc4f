"""What a multilevel estimator has decided: how many samples each level gets, and what came of earlier allocations."""

import time
from typing import Any, NamedTuple

import numpy as np

from spi.ensemble.random_states import RandomState
from spi.exact.kolmogorov import can_solve
from spi.schemes.asymptotic import AsymptoticPreserving
from spi.statistics.estimators import ROUND

from ...study import stderr_of
from ..kolmogorov.study import solution

PILOT = 2 * ROUND  #: blocks of each level before the first allocation
SHARES = (1 / 16, 1 / 4, 1.0, 1.0)  #: of the budget, or of 1/target^2, that the allocations have in view


class Errors(NamedTuple):
    """Errors and their leave-one-out values, in which each level lacks a group."""

    error: np.ndarray  #: (F, S)
    without: np.ndarray  #: (GROUPS, F, S)
    counts: np.ndarray  #: (GROUPS,) as good as the paths of each group
    unseen: np.ndarray  #: (F, S) what they lack unseen, half the width of an interval


class Decisions(NamedTuple):
    """What is known besides sums over paths, of F test functions at S step sizes, over all levels of extrapolation."""

    seconds: float  #: wall clock
    cpu_seconds: float
    allocations: int  #: how many have been made
    targets: np.ndarray  #: (levels,) blocks that the current allocation wants
    used: np.ndarray  #: (levels,) bool, which levels are in the errors, chosen after the pilot where there is a choice
    known: np.ndarray  #: (levels, F) expectations of the control, NaN until they are
    control_bound: float  #: the largest estimate of their numerical error
    history_error: np.ndarray  #: (allocations, F, S) when each allocation was fulfilled
    history_error_stderr: np.ndarray  #: (allocations, F, S)
    history_cpu_seconds: np.ndarray  #: (allocations,)

    @classmethod
    def pilot(cls, levels: int, functions: int, steps: int, control: bool) -> "Decisions":
        """The pilot is wanted, and the expectations of the control, if there is one, are not known."""
        return cls(
            seconds=0.0,
            cpu_seconds=0.0,
            allocations=0,
            targets=np.full(levels, PILOT),
            used=np.full(levels, True),
            known=np.full((levels, functions), np.nan if control else 0.0),
            control_bound=0.0,
            history_error=np.zeros((len(SHARES), functions, steps)),
            history_error_stderr=np.zeros((len(SHARES), functions, steps)),
            history_cpu_seconds=np.zeros(len(SHARES)),
        )

    @property
    def recorded(self) -> bool:
        """Whether the errors of the current allocation, if there is one, are in the history."""
        return not self.allocations or bool(self.history_cpu_seconds[self.allocations - 1])

    def with_errors(self, errors: Errors, cpu_seconds: float) -> "Decisions":
        """These with the errors of the current allocation, which has been fulfilled."""
        error, stderr, seconds = (
            values.copy() for values in (self.history_error, self.history_error_stderr, self.history_cpu_seconds)
        )
        i = self.allocations - 1
        error[i], stderr[i], seconds[i] = errors.error, stderr_of(*errors), cpu_seconds
        return self._replace(history_error=error, history_error_stderr=stderr, history_cpu_seconds=seconds)

    def with_control(self, case: Any, control: tuple, steps: np.ndarray) -> "Decisions":
        """These with the expectations of the control, rows of flows, at steps from the largest to that of reference."""
        began, cpu_began = time.perf_counter(), time.process_time()
        exact = solution(case, control, steps)
        differences = (exact.weak_error[:, :-1] - exact.weak_error[:, 1:]).T[::-1]
        return self._replace(
            seconds=self.seconds + time.perf_counter() - began,
            cpu_seconds=self.cpu_seconds + time.process_time() - cpu_began,
            known=np.concatenate([differences, exact.value[:, :1].T]),
            control_bound=float(exact.weak_error_bound.max()),
        )


def control_of(case: Any, record: Any) -> tuple | None:
    """The rows of the limit, a splitting scheme, if the scheme has a limit of which the expectations are known."""
    solvable = can_solve(case.model) and not case.truncate_noise and not isinstance(case.initial, RandomState)
    return record.stages if solvable and isinstance(record, AsymptoticPreserving) else None
