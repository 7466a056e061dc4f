"""Trajectories: one path of each scheme, all on the same Brownian path, with the Hamiltonian and the Casimirs."""

import time
from typing import NamedTuple

import numpy as np

from ..dispatch import kernel, means, number, unrolled
from ..ensemble import Grid, Noise, brownian, empty_report, grid, integrate, report_columns, thread_count
from ..lanes import load
from ..protocol import REPORT, casimir_indices, casimirs, hamiltonian, observe
from ..records import Group, Part, describe
from ..rng import LANES
from ..schemes import scheme_row, typical_ns


class Recorder(NamedTuple):
    """The states of one lane after every step."""

    y: np.ndarray  #: (steps + 1, d)
    lane: int


@means(observe, Recorder)
def _(observer, model, row, paths, level, n, y, reference):
    for i in range(observer.y.shape[1]):
        observer.y[n, i] = y[i * LANES + observer.lane]


class State(NamedTuple):
    """Nothing (0 blocks) or all (1) is done."""

    blocks: int
    seconds: float
    y: np.ndarray
    report: np.ndarray


class Plan(NamedTuple):
    """A case turned into what the ensemble needs."""

    scheme: NamedTuple
    model: NamedTuple
    initial: tuple
    grid: Grid
    noise: Noise
    path: int


def parts(case):
    """What is run one after the other: each scheme."""
    return [Part(scheme, eps=eps) for scheme, eps in case.runs]


def plan(case, part):
    """The plan for one scheme of a case."""
    steps = round(case.final_time / case.step)
    noise = brownian(case.seed)
    times = grid(case.step, steps, truncate=case.truncate_noise)
    return Plan(scheme_row(part.scheme, part.eps).record, case.model, case.initial, times, noise, case.path)


def cost(case, part):
    """Steps of paths (of a whole block), seconds of one thread at typical speed, and bytes of memory."""
    steps = round(case.final_time / case.step)
    ns = typical_ns(part.scheme, case.model)
    return steps * LANES, steps * LANES * 1e-9 * ns, 8 * (steps + 1) * (type(case.model).dimension + 4)


def start(p):
    """The state before anything is done."""
    return State(0, 0.0, np.zeros((0, len(p.initial))), np.zeros(len(REPORT)))


def batches(p, state):
    """Run the path, if it has not been; one batch."""
    if state.blocks:
        return
    began = time.perf_counter()
    block, lane = divmod(p.path, LANES)
    y = np.empty((p.grid.reference_steps + 1, len(p.initial)))
    y[0] = p.initial
    report = empty_report(1, 1)
    integrate(p.scheme, p.model, p.initial, p.grid, p.noise, Recorder(y, lane), report, block, 1, p.path + 1)
    yield State(1, time.perf_counter() - began, y, report[0, 0])


def progress(p, state):
    """0 or 1 paths of 1, and no standard error."""
    return state.blocks, 1, float("nan")


@unrolled(casimir_indices)
def _keep_casimir(index, model, values, row, y):
    c = number(index)
    values[row, c] = casimirs(model, y)[c]
    return values


@kernel
def invariants(model, states, energy, conserved):
    """H and the Casimirs of each row of `states` (n, LANES * d), in `energy` (n,) and `conserved` (n, c)."""
    for row in range(len(states)):
        y = load(model, states[row], 0)
        energy[row] = hamiltonian(model, y)
        _keep_casimir(model, conserved, row, y)


def group(case, part, state):
    """The results of one scheme of a case, from its final state."""
    n, d = state.y.shape
    spread = np.zeros((n, d * LANES))
    spread[:, ::LANES] = state.y
    energy, conserved = np.empty(n), np.empty((n, len(casimir_indices(case.model))))
    invariants(case.model, spread, energy, conserved)
    t = np.arange(n) * case.step
    lost = np.flatnonzero(~np.isfinite(state.y).all(axis=1))
    told, solver = report_columns(state.report), {}
    if "solves" in told:
        solver = {
            "solver_failures": int(told["failures"]),
            "solver_iterations_mean": told["iterations"] / told["solves"],
            "solver_largest_residual": told["largest_residual"],
        }
    if "largest_angle" in told:
        solver["largest_angle"] = told["largest_angle"]
    with np.errstate(invalid="ignore"):
        drift = np.abs(conserved - conserved[0]).max(axis=0)
    return Group(
        case.name,
        part.group,
        {"t": t, "component": np.arange(d), "casimir": np.arange(conserved.shape[1])},
        {
            "y": (("t", "component"), state.y),
            "hamiltonian": (("t",), energy),
            "casimirs": (("t", "casimir"), conserved),
        },
        {
            **describe(case, scheme_row(part.scheme, part.eps), part.eps),
            "step": case.step,
            "path": case.path,
            "panels": " ".join(case.panels),
            "nonfinite_from": float(t[lost[0]]) if len(lost) else float("nan"),
            "casimir_drift": tuple(float(x) for x in drift),
            "wall_seconds": state.seconds,
            "threads": thread_count(),
            **solver,
        },
    )
