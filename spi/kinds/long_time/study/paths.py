"""The paths of a study of long times, from one snapshot to the next."""

import time
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from spi.ensemble import FinalStates, add_reports, empty_report, grid, integrate
from spi.protocol import casimirs, memory_size
from spi.rng import LANES, STEPS_PER_TOSS
from spi.sphere_law import SphereLaw

if TYPE_CHECKING:
    from . import LongTimePlan

_WARM_UP = 1 / 16  # of the time, before snapshots count for the law


class State(NamedTuple):
    """What is known after `n` steps of step size number `level`, and after all steps of those before."""

    level: int
    n: int
    seconds: float  #: wall clock
    y: np.ndarray  #: (blocks, d * LANES + memory)
    casimir: np.ndarray  #: (levels, records, C, paths), relative error
    report: np.ndarray  #: (levels, len(REPORT))
    nonfinite: np.ndarray  #: (levels,) int64, paths
    snapshots: np.ndarray  #: (levels,) int64, those that count for the law
    moments: np.ndarray  #: (levels, moments, paths), sums over snapshots
    counts: np.ndarray  #: (levels, variables, bins, paths)


def initial_rows(p: "LongTimePlan") -> np.ndarray:
    """y_0 for all paths, as ``State.y``."""
    y = np.zeros((p.blocks, len(p.initial) * LANES + memory_size(p.scheme, p.model)))
    y[:, : len(p.initial) * LANES] = np.repeat(p.initial, LANES)
    return y


def next_stop(p: "LongTimePlan", state: State) -> int:
    """The number of steps until which the paths are run next."""
    if state.n < p.spacing:
        return min(max(2 * state.n, STEPS_PER_TOSS), p.case.step_count)
    return min((state.n // p.spacing + 1) * p.spacing, p.case.step_count)


def integration(p, times, y):
    """The arguments of :func:`spi.ensemble.integrate` for all blocks from the states `y` on, with `times` a grid."""
    stop = times.first_step + times.reference_steps
    last = FinalStates(np.empty((p.blocks, 1, y.shape[1])), np.array([stop]))
    return p.scheme, p.model, y, times, p.stream, last, empty_report(p.blocks, 1), 0, p.blocks, p.samples


def advance_state(p: "LongTimePlan", state: State) -> State:
    """The state at the next snapshot."""
    began = time.perf_counter()
    level, stop = state.level, next_stop(p, state)
    times = grid(p.case.steps[level], stop - state.n, truncate=p.case.truncate_noise, first_step=state.n)
    arguments = integration(p, times, state.y)
    integrate(*arguments)
    *_, last, report, _, _, _ = arguments
    y = last.y[:, 0]
    d = len(p.initial)
    states = y[:, : d * LANES].reshape(p.blocks, d, LANES).swapaxes(0, 1).reshape(d, -1)
    total = state.report.copy()
    total[level] = add_reports(total[level : level + 1], report)[0]
    state = state._replace(n=stop, y=y, report=total)
    with np.errstate(all="ignore"):
        if stop in p.records:
            state = _recorded(p, state, states)
        if p.law and stop > _WARM_UP * p.case.step_count:
            state = _counted(p.law, state, states)
    if stop == p.case.step_count:
        nonfinite = state.nonfinite.copy()
        nonfinite[level] = (~np.isfinite(states[:, : p.samples]).all(axis=0)).sum()
        state = state._replace(level=level + 1, n=0, y=initial_rows(p), nonfinite=nonfinite)
    return state._replace(seconds=state.seconds + time.perf_counter() - began)


def _recorded(p: "LongTimePlan", state: State, states: np.ndarray) -> State:
    """The state with the relative errors of the Casimirs at this time."""
    if not state.casimir.shape[2]:
        return state
    first = np.array(casimirs(p.model, p.initial))[:, None]
    change = np.array(casimirs(p.model, tuple(states))) - first
    casimir = state.casimir.copy()
    casimir[state.level, np.searchsorted(p.records, state.n)] = change / np.where(first == 0.0, 1.0, np.abs(first))
    return state._replace(casimir=casimir)


def _counted(law: SphereLaw, state: State, states: np.ndarray) -> State:
    """The state with one more snapshot in its sums."""
    moments, counts, snapshots = state.moments.copy(), state.counts.copy(), state.snapshots.copy()
    moments[state.level] += law.moments_of(states)
    law.count(states, counts[state.level])
    snapshots[state.level] += 1
    return state._replace(moments=moments, counts=counts, snapshots=snapshots)
