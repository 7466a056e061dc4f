"""Flows of one step of one path, to see which of them made it NaN or infinite, or changed a Casimir function.

The compiled loop finds the step and its noise.  Plain Python makes that step again, of a model whose flows are watched.
"""

import inspect
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from ..compiler.inlining import uncompiled
from ..ensemble import protocol
from ..ensemble.loop import PAIRS_REVERSED, TimeGrid, for_kernels, paths_of, states_at
from ..ensemble.noise_of_step import noise_of_step
from ..ensemble.observer import growth, invariants_of, state_recorder
from ..ensemble.protocol import dimension, drift_angle, frozen, joint_angle, large, noise_angle
from ..ensemble.random_states import RandomState, first_states
from ..ensemble.scheme_protocol import advance, advance_large, report_row, work_size
from ..kinds.blocks import BATCH_BYTES, in_batches, integrated_batch
from ..numerics.rng import LANES
from ..printing.text import short
from ..specs import SpecError
from ..statistics.tallies import Batch
from .compiling import physical_memory

#: What is watched of a model: the word for it, and the method for its angle, which blocks of states return.
FLOWS: dict[str, tuple[str, Any]] = {
    "drift_flow": ("drift", drift_angle),
    "noise_flow": ("noise", noise_angle),
    "joint_flow": ("joint", joint_angle),
    "block_drift_flow": ("drift", None),
    "block_energy_flow": ("drift", None),
    "block_noise_flow": ("noises, group", None),
    "block_friction_flow": ("friction", None),
    "block_judged_noises": ("noises, judged", None),
}
#: So that Python makes a flow as a whole.
_AS_A_WHOLE = {"drift_tables": (), "noise_tables": (), "friction_tables": ()}
_MOST_CASIMIRS = 4  #: each of so many has a column

TraceTick = Callable[[int, int], None]


class TracedFlow(NamedTuple):
    """A flow, and the state after it."""

    name: str
    time: float | None  #: None where noises have several
    angle: float | None
    y: np.ndarray


class TracedPaths(NamedTuple):
    """Paths of one scheme at some step sizes, with the noise that drives them."""

    plan: Any
    times: TimeGrid
    stream: Any
    first: int
    end: int

    @classmethod
    def of(cls, plan: Any) -> list["TracedPaths"]:
        """Those of a plan, one set after the other; SpecError for a lattice whose sites threads share."""
        plan = plan.of_paths
        if plan.case.in_parts:
            raise SpecError(f"{plan.case.name}: is one large lattice, whose flows are not traced; take a smaller one")
        first, sets = getattr(plan.case, "path", 0), plan.path_sets(plan.initial_extra())
        each = zip(plan.paths_on(), sets, strict=False)
        return [cls(plan, times, stream, first, first + path_set.samples) for (times, stream), path_set in each]

    def lost(self, tick: TraceTick) -> tuple[int, int] | None:
        """(path, level) of the first path that is not finite at the end, None if there is none."""
        d, levels, is_one = dimension(self.plan.model), len(self.times.doublings), self.end - self.first == 1
        room = min(BATCH_BYTES / (8 * LANES * levels * d), self.stream.most_blocks(self.plan.model, self.times))
        times = self.times._replace(first_lane=self.first % LANES if is_one else 0)

        def advanced(state: Any, blocks: int) -> Any:
            tick(state[0] * LANES, self.end)
            states = self._integrated(times, Batch(0, state[0], blocks, self.end))
            finite = np.isfinite(paths_of(states, d)).all(axis=1)
            finite[times.reversals == PAIRS_REVERSED] = True  # as the others of their samples make them
            lost = [(int(path) + state[0] * LANES, int(level)) for path, level in np.argwhere(~finite.T)]
            return state[0] + blocks, next((at for at in lost if self.first <= at[0] < self.end), None)

        begin, last = self.first // LANES, -(-self.end // LANES)
        for state in in_batches((begin, None), advanced, lambda s: 0 if s[1] else last - s[0], max(1, int(room))):
            if state[1]:
                return tuple(state[1])
        return None

    def _integrated(self, times: TimeGrid, batch: Batch, *observer: Any) -> np.ndarray:
        """States of a batch at the end."""
        with np.errstate(all="ignore"):
            return integrated_batch(self.plan, times, self.stream, batch, *observer)[0]

    def alone(self, level: int) -> TimeGrid:
        """Times of one step size alone, on the same noise."""
        times, at = self.times, slice(level, level + 1)
        coarser = (times.doublings[at] >= np.arange(times.doublings[level] + 2)[:, np.newaxis]).sum(axis=1)
        paths = {name: getattr(times, name)[at] for name in ("doublings", "reversals", "by_reference")}
        return times._replace(coarser=coarser, **paths)

    def states(self, path: int, level: int) -> np.ndarray:
        """(steps + 1, d): a path at one step size from y_0 on; SpecError where they need more memory than there is."""
        times, d, (block, lane) = self.alone(level), dimension(self.plan.model), divmod(path, LANES)
        steps, memory = times.reference_steps >> int(times.doublings[0]), physical_memory()
        if memory is not None and 8.0 * steps * d > memory:
            needs = f"the states of one path need {8e-9 * steps * d:.3g} GB, and this machine has {memory / 1e9:.3g} GB"
            raise SpecError(f"{self.plan.case.name}: {needs}; make final_time smaller with --set final_time=...")
        rows = np.empty((1, steps + 1, d))
        initial = first_states(self.plan.initial, self.stream, block, 1)
        rows[0, 0] = initial[:, lane if isinstance(self.plan.initial, RandomState) else 0]
        alone = Batch(0, block, 1, path + 1)
        self._integrated(times._replace(first_lane=lane), alone, state_recorder(times, rows, 1, lane))
        return rows[0]


def watched(model: Any, see: Callable[[str, dict[str, Any], Any], None]) -> Any:
    """Model as Python sees it, with ``see(name, arguments, result)`` after each call of a method of FLOWS."""
    inside = []

    def followed(name: str) -> Callable[..., Any]:
        implemented, parameters = getattr(type(model), name), inspect.signature(getattr(protocol, name)).parameters

        def method(*arguments: Any) -> Any:
            inside.append(name)
            result = implemented(*arguments)
            inside.pop()
            if not inside:
                see(name, dict(zip(parameters, arguments, strict=True)), result)
            return result

        return method

    own: dict[str, Any] = {name: value for name, value in _AS_A_WHOLE.items() if hasattr(type(model), name)}
    own |= {name: followed(name) for name in FLOWS if hasattr(type(model), name)}
    return type(type(model).__name__, (type(model),), own)(*model)


def flows_of_step(paths: TracedPaths, path: int, level: int, n: int) -> list[TracedFlow]:
    """Flows of step n of a path, from 0 on, between its states before and after it.  They are made in Python."""
    plan, times, (block, lane) = paths.plan, paths.alone(level), divmod(path, LANES)
    size, d = 1 << int(times.doublings[0]), dimension(plan.model)
    scheme = times.reference_scheme if times.reference_scheme is not None and times.by_reference[0] else plan.scheme
    scheme, step = for_kernels(scheme, plan.model, None, times)[0], advance_large if large(plan.model) else advance
    dW, coins = noise_of_step(plan.scheme, plan.model, times, paths.stream, block, n)
    before = times._replace(reference_steps=n * size, first_lane=lane)
    begin = states_at(plan.initial, plan.scheme, plan.model, before, 1, paths.stream, block)
    states = paths._integrated(before, Batch(0, block, 1, path + 1)) if n else begin
    # all lanes are this path, so that nothing is decided by another one
    y, dW, coins = (np.repeat(row.reshape(-1, LANES)[:, lane], LANES) for row in (states[0, 0], dW, coins))
    h = times.reference_step * size
    model, calls = frozen(plan.model, times.start + n * h, h), 0
    flows = [TracedFlow("before", None, None, y[: d * LANES : LANES] + 0.0)]

    def see(name: str, given: dict[str, Any], result: Any) -> None:
        nonlocal calls
        word, angle = FLOWS[name]
        calls += 1
        if angle is None:
            width = given.get("width", LANES)
            largest = float(result) if name.endswith("_flow") and result is not None else None
            after = given["y"][: d * width : width]
        elif calls % LANES != 1:  # of the lanes, which are equal, the first
            return
        else:
            del given["angles"]
            largest, after = float(angle(model, *[*given.values()][1:])), result
        t, k = given.get("t"), given.get("k", given.get("group"))
        name = word if k is None else f"{word} {k + 1}"
        flows.append(TracedFlow(name, None if t is None else float(t), largest, np.array(after, float)))

    work = np.zeros(work_size(scheme, plan.model))
    with uncompiled(), np.errstate(all="ignore"):
        step(scheme, watched(model, see), h, dW, coins, y, work, report_row(0, 1))
    return [*flows, TracedFlow("after", None, None, y[: d * LANES : LANES])]


class Trace(NamedTuple):
    """Step of a path that is looked at."""

    paths: TracedPaths
    path: int
    level: int
    n: int  #: the number of the step, from 0 on
    lost: bool  #: whether the path is not finite after it

    @classmethod
    def of(cls, paths: TracedPaths, path: int, level: int) -> "Trace":
        """The first step after which a path is not finite, or else the one that changes a Casimir function most."""
        y = paths.states(path, level)
        lost = ~np.isfinite(y).all(axis=1)
        if lost.any():
            return cls(paths, path, level, int(np.argmax(lost)) - 1, True)
        times = paths.alone(level)
        t = times.start + times.reference_step * 2.0 ** times.doublings[0] * np.arange(len(y))
        _, casimirs = invariants_of(paths.plan.model, y, t)
        with np.errstate(all="ignore"):
            change = np.abs(np.diff(casimirs * growth(paths.plan.model, t), axis=0)).max(axis=1, initial=0.0)
        return cls(paths, path, level, int(np.argmax(change)), False)

    def lines(self) -> Iterator[str]:
        """What is looked at, and a line for each flow."""
        plan, times = self.paths.plan, self.paths.alone(self.level)
        h, steps = times.reference_step * 2.0 ** times.doublings[0], times.reference_steps >> int(times.doublings[0])
        what = "diverges" if self.lost else "stays finite; a Casimir function changes most"
        begin, end = times.start + self.n * h, times.start + (self.n + 1) * h
        where = f"in step {self.n + 1} of {steps}, t = {begin:.6g} to {end:.6g}"
        yield f"{plan.case.name}, {plan.part.scheme}, h = {h:.6g}: path {self.path} {what} {where}"
        flows = flows_of_step(self.paths, self.path, self.level, self.n)
        yield from _table(plan, flows, begin)
        if self.lost and np.isfinite(flows[-1].y).all():
            yield "in Python, whose last digits differ, the step stays finite"


def _table(plan: Any, flows: list[TracedFlow], t: float) -> Iterator[str]:
    """Energies and Casimir functions before the step, and by how much they have changed after each flow."""
    with np.errstate(all="ignore"):
        energy, casimirs = invariants_of(plan.model, np.array([flow.y for flow in flows]), np.full(len(flows), t))
        heads, values = [f"C{c + 1}" for c in range(casimirs.shape[1])], np.column_stack([energy, casimirs])
        changes = values - values[0]
        if len(heads) > _MOST_CASIMIRS:  # NaN if one is
            heads, worst = ["largest of C"], np.abs(changes[:, 1:]).max(axis=1)
            values, changes = values[:, :2], np.column_stack([changes[:, 0], worst])
    rows, names = [["", "time", "angle", "H", *heads, ""]], plan.case.variables
    for i, flow in enumerate(flows):
        own = ["" if value is None else short(value) for value in (flow.time, flow.angle)]
        numbers = [f"{value:.6g}" for value in values[0]] if i == 0 else [f"{value:+.1e}" for value in changes[i]]
        lost = np.flatnonzero(~np.isfinite(flow.y))
        which = [f"{names[k] if names else f'y{k + 1}'} = {flow.y[k]}" for k in lost[:_MOST_CASIMIRS]]
        rows.append([flow.name, *own, *numbers, ", ".join([*which, *["..."] * (len(lost) > len(which))])])
    yield from _aligned(rows)


def _aligned(rows: list[list[str]]) -> Iterator[str]:
    """Lines of a table: columns to the right, but for the first and the last one."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for name, *cells, last in rows:
        padded = [f"{cell:>{width}}" for cell, width in zip(cells, widths[1:-1], strict=True)]
        yield "  ".join([f"{name:<{widths[0]}}", *padded, last]).rstrip()


def trace(
    plans: list[Any], path: int | None, tick: TraceTick, begin: Callable[[Any], None] = lambda _: None
) -> Trace | None:
    """Step to look at, of the first path that diverges or of path number `path`; None if all stay finite.

    `begin` is called with each plan before its paths are integrated, `tick` with (paths, of so many) on the way.
    SpecError if there are no paths, or none of that number.
    """
    every = []
    for plan in plans:
        for paths in TracedPaths.of(plan):
            if path is not None:
                paths = paths._replace(first=max(paths.first, path), end=min(paths.end, path + 1))
            if paths.first < paths.end:
                begin(plan)
                every.append(paths)
                if lost := paths.lost(tick):
                    return Trace.of(paths, *lost)
    if not every and path is None:
        raise SpecError(f"{plans[0].case.name}: has no paths to trace, as its results are computed without")
    if not every:
        raise SpecError(
            f"--path: is {path}; must be the number of a path: from 0 to samples - 1, of a trajectory `path`"
        )
    return None if path is None else Trace.of(every[0], path, 0)
