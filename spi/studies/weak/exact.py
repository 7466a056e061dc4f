"""Weak errors without sampling, from ``spi.kolmogorov``."""

import functools
import json
import time
from typing import NamedTuple

import numpy as np

from ...ensemble import thread_count
from ...estimators import Order
from ...expressions import as_numpy
from ...kolmogorov import expectations
from ...schemes import scheme_row
from ...schemes.splitting import compositions
from .sums import order_variables

_CLEAR = 20.0  # a weak error counts as resolved if it is so many times its own numerical error


class Plan(NamedTuple):
    """A case turned into what the solver needs."""

    model: NamedTuple
    compositions: tuple
    initial: tuple
    final_time: float
    steps: np.ndarray  #: (S,) from large to small
    functions: tuple
    accuracy: float | None


class State(NamedTuple):
    """Nothing or everything is done."""

    done: int
    seconds: float  #: wall clock
    cpu_seconds: float
    value: np.ndarray  #: (F, S)
    value_bound: np.ndarray
    limit: np.ndarray  #: (F,)
    limit_bound: np.ndarray
    error: np.ndarray  #: (F, S)
    error_bound: np.ndarray
    notes: str  #: JSON


def plan(case, scheme, eps=None):
    """The plan for one scheme of a case."""
    return plan_of(case, scheme_row(scheme, eps).record, np.array(case.steps))


def plan_of(case, splitting, steps):
    """The plan for a splitting scheme with steps of one's own."""
    acting = compositions(splitting, case.model)
    return Plan(case.model, acting, case.initial, case.final_time, steps, case.expressions, case.accuracy)


def cost(case, scheme, eps=None):
    """No steps of paths; seconds (times threads, as it uses all of them) and bytes are rough."""
    seconds = {"sphere": 10.0, "cylinder": 45.0}[type(case.model).surface]
    return 0, seconds * thread_count(), int(2e9)


def start(p):
    """The state before anything is done."""
    shape = (len(p.functions), len(p.steps))
    per_step, per_function = np.zeros(shape), np.zeros(len(p.functions))
    return State(0, 0.0, 0.0, per_step, per_step, per_function, per_function, per_step, per_step, "")


def batches(p, state):
    """All in one batch."""
    if state.done:
        return
    began, cpu_began = time.perf_counter(), time.process_time()
    e = _solution(*p._replace(steps=tuple(p.steps.tolist())))
    seconds = time.perf_counter() - began, time.process_time() - cpu_began
    values = (e.value, e.error, e.limit, e.limit_error, e.weak_error, e.weak_error_error)
    yield State(1, *seconds, *values, json.dumps(e.notes, default=lambda value: value.tolist()))


@functools.lru_cache(maxsize=8)
def _solution(model, compositions, initial, final_time, steps, functions, accuracy):
    """Kept, because the control of several eps is the same."""
    callables = [as_numpy(f) for f in functions]
    return expectations(model, compositions, initial, final_time, np.array(steps), callables, accuracy)


def progress(p, state):
    """0 or 1 of 1; no standard error."""
    return state.done, 1, float("nan")


def _order(h, error, bound):
    """The slope between the two finest steps; its interval is one and a half times what the slope before differs.

    Where the error is C h^p + D h^q, slopes tend to p by at least a factor of 2 each time h is halved.
    """
    if len(h) < 3:
        return Order(np.nan, np.nan, np.nan, len(h))
    slope = np.diff(np.log(error)) / np.diff(np.log(h))
    trust = (bound / error)[-2:].sum() / np.log(h[-2] / h[-1])
    half = 1.5 * abs(slope[-1] - slope[-2]) + trust
    return Order(slope[-1], slope[-1] - half, slope[-1] + half, len(h))


def results(p, state):
    """Coordinates, variables and attributes of the results."""
    axes = ("function", "h")
    resolved = np.abs(state.error) >= _CLEAR * state.error_bound
    each = zip(state.error, state.error_bound, resolved, strict=True)
    orders = [_order(p.steps[r], np.abs(e[r]), b[r]) for e, b, r in each]
    variables = {
        "error": (axes, state.error),
        "error_bound": (axes, state.error_bound),
        "resolved": (axes, resolved),
        "expectation": (axes, state.value),
        "expectation_bound": (axes, state.value_bound),
        "limit": (("function",), state.limit),
        "limit_bound": (("function",), state.limit_bound),
        **order_variables(orders),
    }
    attributes = {"cpu_seconds": state.cpu_seconds, "wall_seconds": state.seconds, "notes": state.notes}
    return {"h": p.steps}, variables, attributes
