"""Casimir functions along paths: how far they moved from what the exact solution makes of them.

The exact solution preserves C(y).  With damping at the rate gamma it preserves exp(k gamma t) C(y) where C is
homogeneous of degree k, so that this takes the place of C(y) wherever Casimir functions are judged.
"""

from typing import NamedTuple

import numpy as np

from ..compiler.dispatch import device, number, unrolled
from ..compiler.records import class_of
from ..numerics.rng import LANES
from .lanes import load_lane
from .protocol import casimir_indices, casimirs, decay_rates, large


class Decaying(NamedTuple):
    """Casimir functions that decay, for observers."""

    at_start: tuple  #: C(y_0)
    exponents: np.ndarray  #: (levels, C), k gamma h of the step size h of each level


def watched_casimirs(model, initial, step_sizes):
    """What :func:`watch_casimirs` must know of paths from `initial` on: C(y_0), or a :class:`Decaying`."""
    first, rates = casimirs(model, initial), decay_rates(model)
    return Decaying(first, np.multiply.outer(np.array(step_sizes, float), rates)) if rates else first


def growth(model, t):
    """exp(k gamma t) for each Casimir function, shape (..., C) for t of shape (...); 1 without damping."""
    rates = decay_rates(model)
    with np.errstate(over="ignore"):
        return np.exp(np.multiply.outer(t, rates)) if rates else 1.0


def casimirs_of_states(model, states):
    """(C, paths) the Casimir functions of states (d, paths)."""
    if large(model):
        return np.array([casimirs(model, state) for state in np.ascontiguousarray(states.T)]).T
    return np.array(casimirs(model, tuple(states)))


@device(by_type=True)
def _growth(first, c, level, n):
    """The factor of Casimir function c after n steps of a level."""
    if class_of(first) is Decaying:
        return lambda first, c, level, n: np.exp(first.exponents[level, c] * n)
    return lambda first, c, level, n: 1.0


@device(by_type=True)
def _at_start(first):
    return (lambda first: first.at_start) if class_of(first) is Decaying else (lambda first: first)


@unrolled(casimir_indices)
def _watch_one(index, model, worst, first, level, n, y):
    c = number(index)
    grown = _growth(first, c, level, n)
    for lane in range(LANES):
        change = abs(grown * casimirs(model, load_lane(model, y, lane))[c] - _at_start(first)[c])
        if not change <= worst[c, lane]:  # true for NaN
            worst[c, lane] = change
    return worst


def _watch_all(model, worst, first, level, n, paths, y):
    """All Casimir functions of a path at once, as an array-state model finds them."""
    for lane in range(paths):
        values = casimirs(model, load_lane(model, y, lane))
        for c in range(len(values)):
            change = abs(values[c] - first[c])
            if not change <= worst[c, lane]:
                worst[c, lane] = change


@device(by_type=True)
def watch_casimirs(model, worst, first, level, n, paths, y):
    """For each lane of `worst` (C, LANES) the largest |C_c(y) - C_c(y_0)| so far, for observers of step n of a level.

    `first` is what :func:`watched_casimirs` says; with damping C_c(y) counts exp(k gamma t) times.  Of an array-state
    model only the first `paths` lanes are watched.
    """
    if large(model):
        return _watch_all
    return lambda model, worst, first, level, n, paths, y: _watch_one(model, worst, first, level, n, y)
