"""Trajectories: one path of each scheme, all on the same Brownian path, with the Hamiltonian and the Casimirs."""

import json
import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from spi.ensemble.loop import BATCH_SECONDS, TimeGrid, add_reports, integrated, one_step
from spi.ensemble.observer import growth, invariants_of, state_recorder
from spi.ensemble.protocol import decay_rates, geometry, large
from spi.ensemble.random_states import RandomState
from spi.ensemble.scheme_protocol import REPORT, judges, memory_size, report_columns
from spi.kinds import one_path as alone
from spi.kinds.blocks import paths_moved, reported
from spi.kinds.functions import evaluated, function_of
from spi.kinds.plans import Done, KernelCall, PartCost, State, each_scheme, path_grid
from spi.models.delegation import depends_on_time
from spi.numerics.rng import LANES, STEPS_PER_TOSS
from spi.schemes import typical_ns
from spi.statistics.tallies import Chunk, PathSet

from .results import Crossings, SolverMeans, Trajectory, Values, finite


class OnePath(NamedTuple):
    """One path, or none, or one that has not made all its steps."""

    paths: int  #: 0 until all steps are made
    seconds: float  #: wall clock
    steps: int  #: number of those made
    y: np.ndarray  #: (recorded + 1, d), at first (0, d)
    report: np.ndarray  #: (len(REPORT),)

    def plus(self, later: "OnePath") -> "OnePath":
        """There is only one."""
        raise TypeError("a trajectory has one path")


parts = each_scheme


@dataclass(frozen=True, kw_only=True)
class TrajectoryPlan(alone.LatticePlan):
    """One path of one scheme: number ``case.path`` of the seed."""

    record = Trajectory

    @cached_property
    def grid(self) -> TimeGrid:
        """Times of the path."""
        return path_grid(self.case, self.part, self.case.step)

    def paths_on(self) -> list[tuple[TimeGrid, Any]]:
        """The path."""
        return [(self.grid, self.stream)]

    def cost(self) -> PartCost:
        """Steps of all paths that are computed, seconds of one thread at typical speed, and bytes of memory."""
        steps = self.grid.reference_steps
        stored = 8 * (self.case.recorded + 1) * (len(self.initial) + 4)
        scratch = alone.bytes_of(self.case) if self.movers else 0
        idle = 1 if self.movers else alone.idle(1)
        return PartCost(steps * self._paths, idle * steps * self._seconds_per_step, scratch + stored, stored)

    def deciding(self, number: int | None) -> dict[str, Any]:
        """See :meth:`Plan.deciding`: of what is stored the spacing of the states that are recorded.

        Not the final time of a large model, whose path goes on from its last state.
        """
        entries, noise = super().deciding(number), self.case.noise
        ends = not large(self.model) or (noise and noise.at_once)
        left_out = {"save", "every", *(() if ends else ("final_time",))}
        spacing = {"every": self.case.spacing} if self.case.spacing > 1 else {}
        return {key: value for key, value in entries.items() if key not in left_out} | spacing

    def sizes(self) -> list[int]:
        """Number of steps."""
        return [self.grid.reference_steps]

    def adopted(self, number: int, sums: Any) -> OnePath | None:
        """Path; a shorter one can go on if it ends where coins are tossed anew."""
        if sums.steps >= self.grid.reference_steps:
            return sums if sums.steps == self.grid.reference_steps else None
        return None if sums.steps % self._unit else sums._replace(paths=0)

    @property
    def _unit(self) -> int:
        """Number of steps after whose multiples a path can go on from its state."""
        return math.lcm(STEPS_PER_TOSS, self.case.spacing)

    def path_sets(self, extra: Any) -> Sequence[PathSet]:
        """One path."""
        return (PathSet(1, 1),)

    def empty(self, number: int) -> OnePath:
        """No path."""
        return OnePath(paths=0, seconds=0.0, steps=0, y=np.zeros((0, len(self.initial))), report=np.zeros(len(REPORT)))

    def _start(self, y: np.ndarray, n: int) -> Any:
        """States to go on from after n steps: of a large model the stored state in the lane of the path."""
        if not large(self.model):
            return self.initial
        states = np.zeros((1, 1, len(self.initial) * LANES))
        states[0, 0, self.case.path % LANES :: LANES] = y[n // self.case.spacing]
        return states

    def _stop(self, n: int) -> int:
        """Step at which to stop next after step n: the last, but of a large model after about half a second."""
        last = self.grid.reference_steps
        if not large(self.model):
            return last
        unit = self._unit
        return min(last, n + unit * max(1, round(BATCH_SECONDS / (unit * self._seconds_per_step))))

    @property
    def _paths(self) -> int:
        """Number of paths that make steps: a block, of a large model only those up to the one that is wanted."""
        return 1 if self.movers else paths_moved(self.model, self.case.path % LANES + 1)

    @property
    def _seconds_per_step(self) -> float:
        """Seconds of one thread at typical speed for a step of all these paths."""
        if self.movers:
            return alone.move_seconds(self.movers[0], 1)
        return self._paths * 1e-9 * typical_ns(self.row, self.model)

    def advance(self, chunks: Sequence[Chunk], started: OnePath | None) -> Iterator[list[tuple[Chunk, OnePath]]]:
        """Run the path, at once or, of a large model, in batches."""
        block, lane = divmod(self.case.path, LANES)
        path = started or self.empty(0)
        y = np.empty((self.case.recorded + 1, len(self.initial)))
        if self.movers:
            y[0] = alone.start_of(self, self.case.path)
        else:
            y[0] = self.initial_states(block, 1)[:, lane if isinstance(self.initial, RandomState) else 0]
        y[: len(path.y)] = path.y
        while not path.paths:
            began, stop = time.perf_counter(), self._stop(path.steps)
            times = self.grid._replace(first_step=path.steps, reference_steps=stop - path.steps, first_lane=lane)
            to_come = y[np.newaxis, path.steps // self.case.spacing :]  # the first of them is where the path goes on
            if self.movers:
                report = self._moved(to_come[0], path.steps, stop)
            else:
                recorder = state_recorder(times, to_come, self.case.spacing, lane)
                start, end = self._start(y, path.steps), self.case.path + 1
                _, report = integrated(self.scheme, self.model, start, times, self.stream, block, 1, end, recorder)
            path = OnePath(
                paths=int(stop == self.grid.reference_steps),
                seconds=path.seconds + time.perf_counter() - began,
                steps=stop,
                y=y[: stop // self.case.spacing + 1],
                report=add_reports(path.report[np.newaxis], report)[0],
            )
            yield [(chunks[0], path)]

    def kernel_calls(self) -> list[KernelCall]:
        """One step of the block of the path, or of the large lattice."""
        return self.calls_of_a_step(self.grid, self.stream)

    def _moved(self, y: np.ndarray, steps: int, stop: int) -> np.ndarray:
        """States of one large lattice from y[0], after `steps` steps, until step `stop`, in y; its report."""
        case = self.case
        states = self.movers[0].along(y[0], steps, stop - steps, case.spacing, int(self.stream.seed), case.path)
        total = np.zeros((1, len(REPORT)))
        for number, (_, state, report) in enumerate(states, 1):
            y[number] = state
            total = add_reports(total, report)
        return total[np.newaxis]

    def progress(self, state: State) -> Done:
        """Part of the path that is done, of 1, and no standard error."""
        return Done(state.so_far().steps / self.grid.reference_steps, 1, float("nan"))

    def _values(self, y: np.ndarray, t: np.ndarray) -> Values | None:
        """Functions of the case along the path, of its states (stored, d) at the times t."""
        case = self.case
        if not case.functions:
            return None
        functions = [function_of(case, text) for text in case.functions.values()]
        texts = tuple(function.label for function in functions)
        if self.is_long:
            value = np.array([evaluated(functions, *one) for one in zip(y, t, strict=True)]).T
        else:
            value = evaluated(functions, y.T, t)
        between = np.diff(t)[:, np.newaxis]
        for f, function in enumerate(functions):
            value[f] = function.along(value[f][np.newaxis, :, np.newaxis], between)[0, :, 0]
        return Values(functions=tuple(case.functions), texts=texts, value=value)

    def _section(self, y: np.ndarray) -> Crossings | None:
        """Crossings of the section of the case.

        Without noise, coins and memory of the scheme a crossing is where a step of size theta h from the state before
        leads, theta by Brent's method within its bracket.  Otherwise it is on the line between two states.
        """
        case = self.case
        if case.section is None:
            return None
        of, *stored = (function_of(case, f) for f in (case.section.of, *case.section.store))
        with np.errstate(all="ignore"):
            g = np.asarray(of.values(y.T), float)
        up, down = (g[:-1] < 0) & (g[1:] >= 0), (g[:-1] >= 0) & (g[1:] < 0)
        found = {"up": up, "down": down, "both": up | down}[case.section.direction]
        found[:1] &= g[:1] != 0  # a path that begins on the section does not cross it there
        at = np.flatnonzero(found)
        coins = judges(self.scheme) or any(stage.coin is not None for stage in getattr(self.scheme, "stages", ()))
        moves = self.is_noisy or depends_on_time(case.model) or memory_size(self.scheme, self.model)
        by_steps = not coins and not moves
        theta, states = g[at] / (g[at] - g[at + 1]), y[at] + 0.0
        for k, n in enumerate(at.tolist()):
            if by_steps:
                theta[k], states[k] = self._crossing(y[n], of.values, float(g[n]), float(g[n + 1]))
            else:
                states[k] += theta[k] * (y[n + 1] - y[n])
        return Crossings(
            of=of.label,
            t=(at + theta) * case.step,
            stored=case.section.store,
            value=evaluated(stored, states.T),
            located="by the map of the step" if by_steps else "on lines between states",
        )

    def _crossing(self, y: np.ndarray, of: Any, low: float, high: float) -> tuple[float, np.ndarray]:
        """(theta, state) after a step of size theta h from y at which the function is 0; it is low at 0, high at 1."""
        from scipy.optimize import brentq  # not needed to start the program

        found = y

        def value(theta: float) -> float:
            nonlocal found
            found = one_step(self.scheme, self.model, theta * self.case.step, y[np.newaxis])[0]
            return float(of(found[:, np.newaxis])[0])

        theta = low / (low - high)
        if high:
            theta = brentq(lambda x: low if x == 0 else high if x == 1 else value(x), 0.0, 1.0, xtol=1e-15)
        value(theta)
        return theta, found

    def results(self, state: State) -> Trajectory:
        path, case = state.total(), self.case
        y = path.y if len(case.stored) == len(path.y) else path.y[case.stored]
        t = case.stored * case.spacing * case.step
        energy, conserved = alone.invariants(case, y) if self.is_long else invariants_of(self.model, y, t)
        lost = np.flatnonzero(~finite(y))
        with np.errstate(invalid="ignore"):
            change = conserved * growth(self.model, t) - conserved[0]
            drift = np.abs(change).max(axis=0)
        fields = (
            self.whole(state)
            | _reported(path.report)
            | {
                "t": t,
                "y": y,
                "hamiltonian": energy,
                "casimirs": conserved,
                "damped_changes": change if decay_rates(self.model) else None,
                "casimir_drift": tuple(drift.tolist()),
                "nonfinite_from": float(t[lost[0]]) if len(lost) else None,
                "times": case.times or (),
                "preserves": self.row.preserves,
                "values": self._values(y, t),
                "section": self._section(path.y),
                "geometry": json.dumps(place) if (place := geometry(case.model)) else "",
            }
        )
        return Trajectory(**fields)


def _reported(report: np.ndarray) -> dict[str, Any]:
    """Fields of the record about equations, accepted flows and angles, from a report that has them."""
    columns = report_columns(report)
    fields: dict[str, Any] = {"largest_angle": float(columns["largest_angle"])} if "largest_angle" in columns else {}
    fields["acceptance"] = reported(report)["acceptance"]
    if "solves" in columns:
        mean, residual = float(columns["iterations"] / columns["solves"]), float(columns["largest_residual"])
        fields["solver"] = SolverMeans(
            failures=int(columns["failures"]), iterations_mean=mean, largest_residual=residual
        )
    return fields


plan = TrajectoryPlan.of
