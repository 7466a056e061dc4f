"""Record of paths besides their last states: the same type for all studies, so that they share their kernels."""

import math
from typing import NamedTuple

import numpy as np

from ..compiler.dispatch import answers, device, kernel, number, unrolled
from ..compiler.pointers import in_memory
from ..compiler.records import class_of
from ..numerics import arrays
from ..numerics.elementary import exp
from ..numerics.rng import LANES, PARTS
from .fields import scaled_square, smallest_component, squared_distance
from .lanes import load_lane
from .protocol import (
    casimir_indices,
    casimirs,
    conserved,
    decay_rates,
    dimension,
    frozen,
    hamiltonian,
    is_inlined,
    large,
    populations,
)
from .random_states import RandomState

# ---------------------------------------------------------------------------------------------------------------------
# Casimir functions along paths: their distances from the values along the exact solution.
#
# The exact solution preserves C(y).  With damping at the rate gamma it preserves exp(k gamma t) C(y) where C is
# homogeneous of degree k, so that this takes the place of C(y) wherever Casimir functions are judged.
# ---------------------------------------------------------------------------------------------------------------------


def growth(model, t):
    """exp(k gamma t) for each Casimir function, shape (..., C) for t of shape (...); 1 without damping."""
    rates = decay_rates(model)
    with np.errstate(over="ignore"):
        return arrays.exp(np.multiply.outer(t, rates)) if rates else 1.0


def casimirs_of_states(model, states):
    """(C, paths) the Casimir functions of states (d, paths)."""
    if large(model):
        return np.array([casimirs(model, state) for state in np.ascontiguousarray(states.T)]).T
    return np.array(casimirs(model, tuple(states)))


def empty_invariants(model, states):
    """Arrays for states (n, d) and times (n,), and for H (n,) and the Casimir functions (n, C) of them."""
    room = np.zeros((states, dimension(model))), np.zeros(states)
    return *room, np.empty(states), np.empty((states, conserved(model)))


def invariants_of(model, states, times):
    """H (n,) and the Casimir functions (n, C) of states (n, d) at times (n,), as kernels round them."""
    _, _, energy, values = empty_invariants(model, len(states))
    invariants(model, states, times, energy, values)
    return energy, values


@unrolled(casimir_indices)
def _keep_casimir(index, model, values, row, casimir):
    c = number(index)
    values[row, c] = casimir[c]
    return values


@kernel
def invariants(model, states, times, energy, values):
    """Put H and the Casimirs of each row of `states` (n, d) at its time into `energy` (n,) and `values` (n, C)."""
    model = in_memory(model)
    block = np.zeros(states.shape[1] * LANES)  # of which the first lane is used: words take states from blocks
    for row in range(len(states)):
        for i in range(states.shape[1]):  # an assignment of slices would take a second to compile
            block[i * LANES] = states[row, i]
        y = load_lane(model, block, 0)
        energy[row] = hamiltonian(frozen(model, times[row], 0.0), y)
        _keep_casimir(model, values, row, casimirs(model, y))


#: The contents of ``Observer.rows``: sums of squared distances to the reference, or states.
SQUARES, STATES = range(2)


class Observer(NamedTuple):
    """Record of some blocks of paths; an array of length 0 records nothing.

    After step n of a level, where its stride divides n, ``rows[block, place + n / stride - 1]`` is set, by `holds`:
    SQUARES, sums of |y - y_ref|^2 over every PARTS-th lane, or STATES, those of some consecutive lanes from `lane` on,
    component after component.

    ``extremes[block, level, c, lane]`` is the largest |C_c(y) - C_c(y_0)| over all steps of a level; of the reference,
    the last level, it is that of the last step.  With damping C_c(y) counts exp(k gamma t) times, see :func:`growth`.
    Behind the Casimir functions may stand the largest |y|^2 / |y_0|^2 and, of populations, the smallest component.
    """

    rows: np.ndarray  #: (blocks, places, width)
    holds: int
    lane: int
    levels: np.ndarray  #: (levels, 3) int64: place, stride (0 for never) and the number of the last step
    extremes: np.ndarray  #: (blocks, levels, 0 or C or C + 2, LANES)
    start: np.ndarray  #: (1 or blocks, C + 1, LANES): C_c(y_0) and 1 / |y_0|, of all blocks or of each
    rates: np.ndarray  #: (levels, C): k gamma h


def last_states_only(times):
    """Observer of a grid of times that records nothing: :func:`integrate` leaves the last states."""
    steps = times.reference_steps >> times.doublings
    levels = np.stack([np.zeros_like(steps), np.zeros_like(steps), steps], axis=1)
    nothing = np.zeros((0, 0, 0))
    return Observer(nothing, SQUARES, 0, levels, np.zeros((0, 0, 0, 0)), nothing, np.zeros((0, 0)))


def state_recorder(times, rows, every, lane=0):
    """Observer that puts states of lanes from `lane` on into `rows` every `every` steps of the largest size.

    `rows` is (blocks, levels * (stored + 1), d * lanes), level after level; the first states of each level, those at
    ``times.first_step``, are left as they are.
    """
    nothing = last_states_only(times)
    steps = nothing.levels[:, 2]
    stored = steps[0] // every
    before = (times.first_step >> times.doublings[0]) // every  # steps are counted from t = 0 on
    places = 1 + np.arange(len(steps)) * (stored + 1) - before
    levels = np.stack([places, every * (steps // steps[0]), steps], axis=1)
    return nothing._replace(rows=rows, holds=STATES, lane=lane, levels=levels)


def path_observer(model, initial, times, blocks, *, squares=False, sizes=False):
    """Observer of Casimir functions and, if wanted, of squared distances to the reference and sizes of states."""
    nothing = last_states_only(times)
    levels, steps = nothing.levels, nothing.levels[:, 2]
    count, (first, rates) = len(steps), (casimirs(model, initial), decay_rates(model))
    places = int(steps[:-1].sum()) if squares else 0
    if squares:
        levels[:-1, 0], levels[:-1, 1] = np.cumsum(steps[:-1]) - steps[:-1], 1
    start = np.empty((1, len(first) + 1, LANES))
    start[0] = np.reshape((*first, 1.0 / (math.hypot(*initial) or 1.0)), (-1, 1))  # sizes of those at 0 are absolute
    decay = np.multiply.outer(times.reference_step * 2.0**times.doublings, rates or np.zeros(len(first)))
    extremes = np.zeros((blocks, count, len(first) + 2 * sizes, LANES))
    if sizes:
        extremes[:, :, -1] = np.inf
    rows = np.zeros((blocks, places, PARTS))
    return nothing._replace(rows=rows, levels=levels, extremes=extremes, start=start, rates=decay)


def beginning_at(observer, model, initial, states):
    """Observer of paths that begin at `states` (blocks, levels, d * LANES or more), which differ at random."""
    if not isinstance(initial, RandomState) or not observer.extremes.size:
        return observer
    d = len(initial)
    y = np.moveaxis(states[:, 0, : d * LANES].reshape(-1, d, LANES), 1, 0).reshape(d, -1)
    with np.errstate(divide="ignore"):
        start = np.concatenate([casimirs_of_states(model, y), 1.0 / np.sqrt((y**2).sum(axis=0, keepdims=True))])
    return observer._replace(start=np.ascontiguousarray(start.reshape(len(start), -1, LANES).transpose(1, 0, 2)))


@device(by_type=True)
def observe(observer, model, row, paths, level, n, y, reference):
    """Record step n (from 1 on) of a level: `y` are the states of block `row`, `reference` those of the last level.

    Only the first `paths` lanes count, since the last block may be partly idle.
    """
    return _observe if is_inlined(model) else _on_its_own


def _observe(observer, model, row, paths, level, n, y, reference):
    stride = observer.levels[level, 1]
    if stride > 0 and n % stride == 0:
        place = observer.levels[level, 0] + n // stride - 1
        if observer.holds == SQUARES:
            _add_squares(model, observer.rows[row, place], paths, y, reference)
        else:
            _keep_states(model, observer.rows[row, place], observer.lane, y)
    if observer.extremes.shape[2] > 0 and (level < len(observer.levels) - 1 or n == observer.levels[level, 2]):
        start = observer.start[row if len(observer.start) > 1 else 0]
        _watch(model, observer.extremes[row, level], start, observer.rates[level], n, paths, y)


_on_its_own = device(inline=False)(_observe)


@device
def _add_squares(model, squares, paths, y, reference):
    for first in range(0, LANES, PARTS):
        for part in range(PARTS):
            lane = first + part
            square = squared_distance(load_lane(model, y, lane), load_lane(model, reference, lane))
            squares[part] += square if lane < paths else 0.0


@device
def _keep_states(model, stored, first, y):
    lanes = len(stored) // dimension(model)
    for i in range(dimension(model)):
        for lane in range(lanes):
            stored[i * lanes + lane] = y[i * LANES + first + lane]


@device
def _watch(model, extremes, start, rates, n, paths, y):
    _watch_casimirs(model, extremes, start, rates, n, paths, y)
    if extremes.shape[0] > conserved(model):
        sizes, smallest = extremes[conserved(model)], extremes[conserved(model) + 1]
        inverse = start[conserved(model)]
        for lane in range(LANES):
            size = scaled_square(load_lane(model, y, lane), inverse[lane])
            if not size <= sizes[lane]:  # true for NaN
                sizes[lane] = size
        if populations(model):
            for lane in range(LANES):
                least = smallest_component(load_lane(model, y, lane))
                if not least >= smallest[lane]:
                    smallest[lane] = least


@unrolled(casimir_indices)
def _watch_casimir(index, model, worst, start, rates, n, paths, y):
    c = number(index)
    grown = _grown(model, rates, n, c)
    for lane in range(LANES):
        change = abs(grown * casimirs(model, load_lane(model, y, lane))[c] - start[c, lane])
        if not change <= worst[c, lane]:
            worst[c, lane] = change
    return worst


@device(by_type=True)
def _grown(model, rates, n, c):
    """exp(k gamma n h), the inverse of the decay of Casimir function c by damping over n steps of a level."""
    if answers(decay_rates, class_of(model)):
        return lambda model, rates, n, c: exp(rates[c] * n)
    return lambda model, rates, n, c: 1.0


def _watch_all(model, worst, start, rates, n, paths, y):
    """All Casimir functions of a path at once, as an array-state model computes them."""
    for lane in range(paths):
        values = casimirs(model, load_lane(model, y, lane))
        for c in range(len(values)):
            change = abs(values[c] - start[c, lane])
            if not change <= worst[c, lane]:
                worst[c, lane] = change


@device(by_type=True)
def _watch_casimirs(model, worst, start, rates, n, paths, y):
    """Update the largest changes of Casimir functions; of an array-state model in the first `paths` lanes only."""
    return _watch_all if large(model) else _watch_casimir


# ---------------------------------------------------------------------------------------------------------------------
# Values along many paths: Hamiltonians, sums over jackknife groups, counts in bins.
# ---------------------------------------------------------------------------------------------------------------------


@kernel
def energies(model, states, energy):
    """H of the states (blocks, times, d * LANES) of blocks, in `energy` (blocks, times, LANES)."""
    model = in_memory(model)
    for row in range(states.shape[0]):
        for t in range(states.shape[1]):
            for lane in range(LANES):
                energy[row, t, lane] = hamiltonian(model, load_lane(model, states[row, t], lane))
