"""Expectation of the equation alone, refined up to a given accuracy, with the cost of each refinement.

A refinement is given by its number and needs nothing of those before, so that another process can go on from their
values only.  Costs are in seconds of typical speed, from counts of operations, not from a clock: decisions by them are
the same on every machine.
"""

from typing import NamedTuple

import numpy as np

from .kinks import settling


class Refined(NamedTuple):
    """E phi(y(T)) for F functions from some refinements, with bounds of the errors."""

    value: np.ndarray  #: (F,)
    bound: np.ndarray  #: (F,) of the numerical error, infinite before there are enough refinements
    falls: float  #: the factor by which the error is expected to fall with the next refinement, 1 where it does not
    least: int  #: refinements before the error can be estimated


class KnownExpectations:
    """In the place of a solver that refines: expectations (F,) that are known up to errors of at most `bound`."""

    effort = 0.0

    def __init__(self, value, bound):
        self.known, self.known_bound, self.rough = value, bound, np.zeros(len(value), bool)

    def costs(self, effort):
        """No refinements."""
        return []


class Outlook(NamedTuple):
    """Cost of going on to a wanted accuracy."""

    next_seconds: float  #: of the next refinement; infinite where there is none
    next_bound: float  #: the error that it is expected to reach
    seconds: float  #: until the accuracy is reached; infinite where it is not expected to be
    refinements: int  #: until then


#: The factor expected of a refinement before the order of convergence can be measured.
_EXPECTED = 0.3
#: The number of refinements from which the decrease of errors is measured.
_KNOWN = 4


def refined(values, uncertain, rough):
    """:class:`Refined` of refinements (k, F), with uncertainties (k, F), of functions `rough` (F,) or not."""
    values, uncertain = np.asarray(values, float), np.asarray(uncertain, float)
    least = _KNOWN if np.any(rough) else _KNOWN - 1
    if not len(values):
        nothing = np.full(len(rough), np.nan)
        return Refined(nothing, np.full(len(rough), np.inf), _EXPECTED, least)
    settled = settling(values, rough)
    bound = np.where(np.isnan(values[-1]), np.inf, settled.error + uncertain[-1])
    worst = int(np.argmax(bound))
    falls = settled.falls[worst] if len(values) >= _KNOWN else _EXPECTED
    return Refined(values[-1], bound, float(np.clip(np.nan_to_num(falls, nan=_EXPECTED), 1e-3, 1.0)), least)


def outlook(so_far, number, costs, accuracy):
    """:class:`Outlook` after `number` refinements, `costs` being the seconds of all possible refinements."""
    left, bound = costs[number:], float(so_far.bound.max())
    if bound <= accuracy:
        return Outlook(0.0, bound, 0.0, 0)
    if not left:
        return Outlook(np.inf, bound, np.inf, 0)
    if not np.isfinite(bound):  # not before there are enough of them
        least = max(so_far.least - number, 1)
        return Outlook(left[0], np.inf, sum(left[:least]) if len(left) >= least else np.inf, least)
    with np.errstate(divide="ignore"):
        needed = np.ceil(np.log(accuracy / bound) / np.log(so_far.falls)) if so_far.falls < 1.0 else np.inf
    seconds = sum(left[: int(needed)]) if needed <= len(left) else np.inf
    return Outlook(left[0], bound * so_far.falls, seconds, int(min(needed, len(left))))
