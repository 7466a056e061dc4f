"""How long a flow or a step of a model takes that does not say so: numbers that count are taken through its methods.

They go through the uncompiled functions once, so that an estimate costs milliseconds and depends on nothing but the
sources: neither on the processor nor on how busy it is.
"""

import contextlib
import functools
from collections.abc import Iterator
from typing import Any

import numpy as np

from ..compiler.inlining import uncompiled
from ..ensemble.fields import step_field_derivative, step_gradient, unit
from ..ensemble.protocol import (
    area_pairs,
    component_indices,
    dimension,
    flow_ns,
    needs_areas,
    noise_indices,
    noises,
    structure,
    substeps,
)
from ..numerics.angles import TINY_ANGLES
from ..numerics.rng import LANES
from .euler_maruyama import euler_step
from .rows import PARTS, angle, flow, sweeps

# Nanoseconds per path on one thread of a processor with AVX-512 at about 4 GHz, fitted to the models of the package and
# to rings of up to eight spins.  An operation is an addition or a multiplication; each sweep loads and stores a state.
_OPERATION = 0.008
_COMPONENT = 0.07
#: In operations: functions of NumPy that are slow or come as calls.
_WEIGHTS = {np.divide: 4, np.sqrt: 8, np.sin: 40, np.cos: 40, np.exp: 40, np.log: 40}
_FREE = {np.negative, np.absolute, np.maximum, np.minimum}
_TAKEN_APART = 20  #: a number whose bits are looked at, as by ``elementary.exp``
_NEWTON_ITERATIONS = 2.5
_TERMS = 8  # of an exponential series at small steps
_DRAW_NS = 0.85  # an increment
_TYPICAL_TERMS = 8  # of the Fourier series of areas


class _Counter:
    """How many operations were made."""

    operations = 0


class _Counted(np.lib.mixins.NDArrayOperatorsMixin):
    """A number of which every operation is counted, and so are those of the results."""

    def __init__(self, value: float, counter: _Counter):
        self.value, self.counter = float(value), counter

    def __float__(self) -> float:
        """Only where a function looks at the bits; see ``elementary.bits``."""
        self.counter.operations += _TAKEN_APART
        return self.value

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *operands: Any, **_: Any) -> Any:
        """All operators come here as functions of NumPy."""
        value = ufunc(*(x.value if isinstance(x, _Counted) else x for x in operands))
        if isinstance(value, np.bool_):
            return value
        self.counter.operations += 0 if ufunc in _FREE else _WEIGHTS.get(ufunc, 1)
        return _Counted(value, self.counter)


class _State:
    """What the methods of a model are given: a state, increments, all of them counted."""

    def __init__(self, model: Any):
        self.counter = _Counter()
        self.y = tuple(self.number(0.5 + 0.01 * i) for i in range(dimension(model)))
        self.dW = [self.number(0.01)] * (noises(model) * LANES)

    def number(self, value: float) -> _Counted:
        return _Counted(value, self.counter)


@contextlib.contextmanager
def _counting(model: Any) -> Iterator[_State]:
    with uncompiled(), np.errstate(all="ignore"):
        yield _State(model)


@functools.lru_cache(typed=True)
def flow_cost(part: str, k: int, model: Any) -> float:
    """Nanoseconds of one flow, the `part` being "drift" or "noise"."""
    with _counting(model) as given:
        t = given.number(0.01)
        angle(PARTS[part], model, k, t, given.y)
        flow(PARTS[part], model, k, t, given.y, TINY_ANGLES)
    return _OPERATION * given.counter.operations + _COMPONENT * dimension(model)


@functools.lru_cache(typed=True)
def euler_cost(model: Any) -> float:
    """Nanoseconds of a step of Euler-Maruyama."""
    with _counting(model) as given:
        euler_step(model, 0.01, given.dW, 0, given.y)
    return _OPERATION * given.counter.operations + _COMPONENT * dimension(model)


@functools.lru_cache(typed=True)
def exponential_cost(model: Any) -> float:
    """Nanoseconds of one exponential of Munthe-Kaas and of what it acts by, which is about a step of Euler-Maruyama."""
    d = dimension(model)
    with _counting(model) as given:
        structure(model, given.y, given.y)
    term = _OPERATION * (given.counter.operations + 5 * d) + _COMPONENT * d
    return _TERMS * term + euler_cost(model)


@functools.lru_cache(typed=True)
def midpoint_cost(model: Any) -> float:
    """Nanoseconds of a step of the midpoint rule: a d x d system, set up and solved a few times, and more."""
    d = dimension(model)
    with _counting(model) as given:
        gradient = step_gradient(model, 0.01, given.dW, 0, given.y)
        step_field_derivative(model, 0.01, given.dW, 0, given.y, gradient, unit(component_indices(model), 0))
    columns = _OPERATION * d * given.counter.operations
    # each pair of rows: load and store two entries per column
    elimination = _COMPONENT * sum((d - 1 - c) * (d + 1 - c) for c in range(d))
    return _NEWTON_ITERATIONS * (columns + elimination) + 3 * euler_cost(model)


def typical_ns(row, model):
    """Nanoseconds per step and path on one thread of a processor with AVX-512 at about 4 GHz, for estimates."""
    stated = flow_ns(model)
    acting = () if row.composition is None else sweeps(row.composition, model)
    if stated:
        step = stated * (len(acting) or row.work)
    else:
        try:
            step = sum(flow_cost(part, k, model) for _, part, k, *_ in acting) or row.step_cost(model)
        except Exception:  # a method of somebody's fails; what is wrong is told where it is compiled
            step = 0.5 * (len(acting) or row.work)
    draws = len(noise_indices(model)) * substeps(row.record)
    if needs_areas(row.record) and area_pairs(model):
        draws *= 1 + 2 * _TYPICAL_TERMS
    return row.overhead * (_DRAW_NS * draws + step)
