"""Long times: how rounding errors of Casimirs grow over very many steps, and the law of the states.

Paths are integrated from snapshot to snapshot.  Casimirs are looked at after 128, 256, 512, ... steps and at the end.
On a sphere all flows preserve the area, so that with noise the law of the states tends to the uniform one: then y_j is
uniform on [-|y_0|, |y_0|], and means, and fractions of the snapshots in bins of equal probability, are compared with
their exact values.  Standard errors come from the paths, which are independent of one another.
"""

import time
from typing import NamedTuple

import numpy as np

from ..ensemble import (
    BATCH_SECONDS,
    FinalStates,
    Noise,
    add_reports,
    brownian,
    empty_report,
    grid,
    integrate,
    limited_threads,
    report_columns,
    thread_count,
)
from ..estimators import fit_order, stderr_of_mean
from ..protocol import REPORT, casimirs, memory_size, noise_indices
from ..records import Group, Part, describe
from ..rng import LANES, STEPS_PER_TOSS
from ..schemes import scheme_row, typical_ns
from ..sphere_law import BINS, SphereLaw

#: About how many snapshots of each path.
SNAPSHOTS = 8192
_WARM_UP = 1 / 16  # of the time, before snapshots count for the law
_FIT_FROM = 2**12  # steps, before which rounding errors are too few to fit their growth


class Plan(NamedTuple):
    """A case turned into what the ensemble needs."""

    scheme: NamedTuple
    model: NamedTuple
    initial: tuple
    noise: Noise
    truncate: bool
    h: tuple  #: from large to small
    count: int  #: of steps of each path
    samples: int
    law: SphereLaw | None

    @property
    def blocks(self):
        return -(-self.samples // LANES)

    @property
    def records(self):
        """The numbers of steps after which Casimirs are looked at."""
        return np.union1d(STEPS_PER_TOSS << np.arange(int(np.log2(self.count / STEPS_PER_TOSS)) + 1), [self.count])

    @property
    def spacing(self):
        """Steps from snapshot to snapshot."""
        return STEPS_PER_TOSS << max(0, round(np.log2(self.count / STEPS_PER_TOSS / SNAPSHOTS)))


class State(NamedTuple):
    """What is known after `n` steps of step size number `level`, and after all steps of those before."""

    level: int
    n: int
    seconds: float
    y: np.ndarray  #: (blocks, d * LANES + memory)
    casimir: np.ndarray  #: (levels, records, C, paths), relative error
    report: np.ndarray  #: (levels, columns)
    nonfinite: np.ndarray  #: (levels,) int64, paths
    snapshots: np.ndarray  #: (levels,) int64, those that count for the law
    moments: np.ndarray  #: (levels, moments, paths), sums over snapshots
    counts: np.ndarray  #: (levels, variables, bins, paths)


def parts(case):
    """What is run one after the other: each scheme."""
    return [Part(scheme) for scheme in case.schemes]


def plan(case, part):
    """The plan for one scheme of a case."""
    model = case.model
    moving = noise_indices(model) and np.count_nonzero(case.initial) > 1  # on an axis nothing does
    known = getattr(type(model), "surface", None) == "sphere" and moving
    return Plan(
        scheme_row(part.scheme).record,
        model,
        case.initial,
        brownian(case.seed),
        case.truncate_noise,
        case.steps,
        case.step_count,
        case.samples,
        SphereLaw.of(model, case.initial) if known else None,
    )


def cost(case, part):
    """Steps of paths, seconds of one thread at typical speed, and bytes of memory."""
    p = plan(case, part)
    steps = len(p.h) * p.count * p.blocks * LANES
    idle = thread_count() / min(thread_count(), p.blocks)  # a block cannot be shared by threads
    return steps, idle * steps * 1e-9 * typical_ns(part.scheme, case.model), sum(np.asarray(v).nbytes for v in start(p))


def start(p):
    """The state before the first step."""
    levels, paths, conserved = len(p.h), p.blocks * LANES, len(casimirs(p.model, p.initial))
    moments, variables = (len(p.law.moments), len(p.law.variables)) if p.law else (0, 0)
    return State(
        0,
        0,
        0.0,
        _initial_states(p),
        np.full((levels, len(p.records), conserved, paths), np.nan),
        np.zeros((levels, len(REPORT))),
        np.zeros(levels, np.int64),
        np.zeros(levels, np.int64),
        np.zeros((levels, moments, paths)),
        np.zeros((levels, variables, BINS, paths)),
    )


def _initial_states(p):
    y = np.zeros((p.blocks, len(p.initial) * LANES + memory_size(p.scheme, p.model)))
    y[:, : len(p.initial) * LANES] = np.repeat(p.initial, LANES)
    return y


def _next_stop(p, state):
    """The number of steps until which the paths are run next."""
    if state.n < p.spacing:
        return min(max(2 * state.n, STEPS_PER_TOSS), p.count)
    return min((state.n // p.spacing + 1) * p.spacing, p.count)


def advance_state(p, state):
    """The state at the next snapshot."""
    began = time.perf_counter()
    level, stop = state.level, _next_stop(p, state)
    last = FinalStates(np.empty((p.blocks, 1, state.y.shape[1])), np.array([stop]))
    times = grid(p.h[level], stop - state.n, truncate=p.truncate, first_step=state.n)
    report = empty_report(p.blocks, 1)
    integrate(p.scheme, p.model, state.y, times, p.noise, last, report, 0, p.blocks, p.samples)
    y = last.y[:, 0]
    d = len(p.initial)
    states = y[:, : d * LANES].reshape(p.blocks, d, LANES).swapaxes(0, 1).reshape(d, -1)
    total = state.report.copy()
    total[level] = add_reports(total[level : level + 1], report)[0]
    state = state._replace(n=stop, y=y, report=total)
    with np.errstate(all="ignore"):
        if stop in p.records:
            state = _recorded(p, state, states)
        if p.law and stop > _WARM_UP * p.count:
            state = _counted(p, state, states)
    if stop == p.count:
        nonfinite = state.nonfinite.copy()
        nonfinite[level] = (~np.isfinite(states[:, : p.samples]).all(axis=0)).sum()
        state = state._replace(level=level + 1, n=0, y=_initial_states(p), nonfinite=nonfinite)
    return state._replace(seconds=state.seconds + time.perf_counter() - began)


def _recorded(p, state, states):
    """The state with the relative errors of the Casimirs at this time."""
    if not state.casimir.shape[2]:
        return state
    first = np.array(casimirs(p.model, p.initial))[:, None]
    casimir = state.casimir.copy()
    casimir[state.level, np.searchsorted(p.records, state.n)] = (np.array(casimirs(p.model, tuple(states))) - first) / (
        np.where(first == 0.0, 1.0, np.abs(first))
    )
    return state._replace(casimir=casimir)


def _counted(p, state, states):
    """The state with one more snapshot in its sums."""
    moments, counts, snapshots = state.moments.copy(), state.counts.copy(), state.snapshots.copy()
    moments[state.level] += p.law.moments_of(states)
    p.law.count(states, counts[state.level])
    snapshots[state.level] += 1
    return state._replace(moments=moments, counts=counts, snapshots=snapshots)


def batches(p, state):
    """Run all that is left; yields the state after each batch of about half a second."""
    with limited_threads(p.blocks):  # a thread without a block would wait in a busy loop
        until = time.perf_counter() + BATCH_SECONDS
        while state.level < len(p.h):
            state = advance_state(p, state)
            if time.perf_counter() > until:
                yield state
                until = time.perf_counter() + BATCH_SECONDS
        yield state


def progress(p, state):
    """Steps done and all steps, in paths, and no standard error."""
    done = (state.level + state.n / p.count) / len(p.h)
    return done * p.samples, p.samples, float("nan")


def group(case, part, state):
    """The results of one scheme of a case, from its final state."""
    p = plan(case, part)
    coordinates, variables = _growth(p, state)
    variables["nonfinite"] = ("h",), state.nonfinite
    variables |= {name: (("h",), values) for name, values in report_columns(state.report).items()}
    if p.law:
        more, law = _law(p, state)
        coordinates, variables = coordinates | more, variables | law
    return Group(
        case.name,
        part.group,
        coordinates,
        variables,
        {
            **describe(case, scheme_row(part.scheme)),
            "samples": case.samples,
            "steps_each": case.step_count,
            "snapshots": int(state.snapshots[0]),
            "panels": " ".join(case.panels),
            "wall_seconds": state.seconds,
            "threads": thread_count(),
        },
    )


def _growth(p, state):
    """Errors of the Casimirs over time, the exponent of their growth, and their bias."""
    n, h = p.records, np.array(p.h)
    casimir = state.casimir[..., : p.samples]
    levels, _, conserved, _ = casimir.shape
    axes, each = ("h", "n", "casimir"), ("h", "casimir")
    growth, bias = np.full((3, levels, conserved), np.nan), np.full((2, levels, conserved), np.nan)
    with np.errstate(all="ignore"):
        for i in range(levels):
            for c in range(conserved):
                growth[:, i, c] = _exponent(n, casimir[i, :, c])
                end = casimir[i, -1, c] / p.count
                bias[:, i, c] = end.mean(), stderr_of_mean(end)
        variables = {
            "casimir_mean": (axes, casimir.mean(axis=3)),
            "casimir_rms": (axes, np.sqrt((casimir**2).mean(axis=3))),
            "casimir_worst": (axes, np.abs(casimir).max(axis=3, initial=0.0)),
            "casimir_one": (axes, casimir[..., 0]),
            **dict(zip(("growth", "growth_low", "growth_high"), ((each, v) for v in growth), strict=True)),
            **dict(zip(("bias", "bias_stderr"), ((each, v) for v in bias), strict=True)),
        }
    return {"h": h, "n": n, "casimir": np.arange(conserved)}, variables


def _exponent(n, error):
    """p of (mean of error^2)^(1/2) = C n^p with its 95 % interval, from errors (records, paths)."""
    paths = error.shape[1]
    squares = (error**2).T
    value = np.sqrt(squares.mean(axis=0))
    use = (n >= _FIT_FROM) & np.isfinite(value) & (value > 0.0)
    if paths < 2 or use.sum() < 3:
        return np.nan, np.nan, np.nan
    without = np.sqrt(np.maximum(squares.sum(axis=0) - squares, 0.0) / (paths - 1))
    # in 1/n, because where the points bend, those of the largest steps are left out: here those of early times
    found = fit_order(1.0 / n, value, without, np.ones(paths), use)
    return -found.order, -found.high, -found.low


def _law(p, state):
    """Means and fractions in bins against their exact values."""
    snapshots = np.maximum(state.snapshots, 1).reshape(-1, 1, 1)
    moments = state.moments[..., : p.samples] / snapshots
    fractions = state.counts[..., : p.samples] / snapshots[..., None]
    below = np.cumsum(fractions, axis=2)[:, :, :-1]
    away = np.abs(below.mean(axis=3) - np.arange(1, BINS) / BINS)
    farthest = away.argmax(axis=2)[..., None]
    coordinates = {
        "variable": np.array(p.law.variables),
        "bin": np.arange(BINS),
        "moment": np.array(list(p.law.moments)),
    }
    return coordinates, {
        "mean": (("h", "moment"), moments.mean(axis=2)),
        "mean_stderr": (("h", "moment"), stderr_of_mean(moments)),
        "mean_exact": (("moment",), np.array(list(p.law.moments.values()))),
        "fraction": (("h", "variable", "bin"), fractions.mean(axis=3)),
        "fraction_stderr": (("h", "variable", "bin"), stderr_of_mean(fractions)),
        "law_distance": (("h", "variable"), np.take_along_axis(away, farthest, 2)[..., 0]),
        "law_distance_stderr": (("h", "variable"), np.take_along_axis(stderr_of_mean(below), farthest, 2)[..., 0]),
    }
