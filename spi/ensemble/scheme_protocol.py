"""Methods and traits of a scheme: one step of a block of paths, and its needs; see ``protocol.py`` for models."""

import numpy as np

from ..compiler.dispatch import device, method, trait
from ..numerics.rng import LANES


@method
def advance(scheme, model, h, dW, coins, y, work, report):
    """One step of size h for LANES paths: replaces the states in `y`.

    `dW` holds the increments, channel k of lane l at [k * LANES + l]; channels that are off are not to be read.
    For a scheme with :func:`substeps` those over sub-steps follow, as ``increments.first_lane`` says.
    For one that :func:`needs_areas` the Lévy areas of :func:`area_pairs` are the last floats in `dW`, see ``areas.py``.
    `coins`, one of 1.0 or -1.0 per lane, is filled only if the scheme :func:`tosses`.  `work` is scratch of
    ``work_size(scheme, model)`` floats; the scheme adds the quantities of :data:`REPORT` to `report`, a
    :func:`report_row`, of the lanes in use alone.
    """


@method(optional=True)
def advance_large(scheme, model, h, dW, coins, y, work, report):
    """One step of an array-state model, for the lanes in use of :func:`lanes_in_use`; others may stay as they are."""


@method(optional=True)
def move_group(scheme, array_state_model, h, width, count, states, x, new, times, work, report):
    """A step of `count` paths for ``large.step_by_groups``: the array of new states, `states`, `x` or `new`.

    Component i of state j stands at [i * width + j], and the time of noise k at [k * width + j].
    """


@method(default=True)
def of_arrays(scheme, array_state_model):
    """Record that kernels get in place of the scheme where states are arrays.  Called in Python only.

    That of a composition of flows has a field `program` (1 or 2, flows) of :data:`FLOW`, the first flow to act first:
    those of every path, or of paths with the coin 1 and of those with the coin -1.
    """
    return scheme


#: The kinds of flows: of a piece of H, of a group of noises, of friction.
DRIFT, NOISE, FRICTION = range(3)
#: A flow of a program: its kind and its number; the share of the step, of noise that of its increment; the increment
#: of noise, that over the sub-steps from `first` to before `stop` where a step has n of them; and 1 where times of
#: noises are to be taken, 0 where those of the flow before are still right.
_INTEGERS = "kind", "k", "first", "stop", "n", "takes"
FLOW = np.dtype([*((name, np.int64) for name in _INTEGERS), ("share", np.float64)])


@trait(bool, default=False)
def tosses(scheme):
    """Whether the scheme needs a fair coin per step and path."""


@trait(bool, default=False)
def judges(scheme):
    """Whether the scheme accepts or rejects flows and needs uniform numbers behind the coins, see ``increments.py``."""


@trait(int, default=1)
def substeps(scheme):
    """Number of equal sub-steps, a power of two, into which the increments of a step must be resolved."""


@trait(bool, default=False)
def needs_areas(scheme):
    """Whether a step needs the Lévy areas of noises that do not commute, and then coins as well."""


@method(default=True)
def work_size(scheme, model):
    """Floats of scratch for one block."""
    return 0


@method(default=True)
def compile_size(scheme, model):
    """(flows, fields): the flows whose code a step has, else how often it has the derivative of the whole field.

    Called in Python only, to predict how long its kernel takes to be compiled.
    """
    return 0, 1


@method(default=True)
def memory_size(scheme, model):
    """Floats, at first 0, that a block carries from step to step behind its states in `y`."""
    return 0


#: The quantities that schemes report, per step size and over all paths and steps: numbers of equations solved, of
#: iterations and of failures; of noise flows and steps of the drift judged and accepted; the largest relative residual;
#: and the largest |angle| of a rotation (0 if none is above pi/4).
REPORT = (
    *("solves", "iterations", "failures", "noise_judged", "noise_accepted", "drift_judged", "drift_accepted"),
    *("largest_residual", "largest_angle"),
)
SUMMED = 7  #: the first so many are sums, the others maxima

_FIRST, _END = len(REPORT), len(REPORT) + 1
ROW = len(REPORT) + 2  #: floats of a row that a step is given: behind the quantities stand the lanes in use


def report_row(first=0, end=LANES):
    """A row of a report for steps, in which the lanes from `first` to before `end` are in use."""
    return np.array([0.0] * len(REPORT) + [first, end])


@device
def use_lanes(report, first, end):
    """Say which lanes of a row are in use."""
    report[_FIRST], report[_END] = first, end


@device
def lanes_in_use(report):
    """(first, end): the lanes of a block that are paths asked for, from `first` to before `end`; others do not count.

    Other lanes are moved as well, with the increments of their own paths, so that bits do not depend on it.
    """
    return int(report[_FIRST]), int(report[_END])


def report_columns(report):
    """{name: values} of a report (..., columns): of solvers, flows judged and the largest angle, if there were any."""
    by_name = {name: report[..., i] for i, name in enumerate(REPORT)}
    groups = (*REPORT[:3], REPORT[7]), REPORT[3:7], REPORT[8:]
    return {name: by_name[name] for names in groups if by_name[names[0]].any() for name in names}
