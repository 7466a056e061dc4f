"""What a scheme is asked: one step of a block of paths, and what it needs for that; see ``protocol.py`` for models."""

from ..compiler.dispatch import method, trait


@method
def advance(scheme, model, h, dW, coins, y, work, report):
    """One step of size h for LANES paths: replaces the states in `y`.

    `dW` holds the increments, channel k of lane l at [k * LANES + l]; channels that are off are not to be read.
    For a scheme with :func:`substeps` those over sub-steps follow, as ``increments.first_lane`` says.
    For one that :func:`needs_areas` the Lévy areas of :func:`area_pairs` are the last floats in `dW`, see ``areas.py``.
    `coins`, one of 1.0 or -1.0 per lane, is filled only if the scheme :func:`tosses`.  `work` is scratch of
    ``work_size(scheme, model)`` floats; the scheme adds to `report` what :data:`REPORT` says.
    """


@method(optional=True)
def advance_large(scheme, model, paths, h, dW, coins, y, work, report):
    """The same of an array-state model, for the first `paths` of the LANES paths; the others may stay as they are."""


@trait(bool, default=False)
def tosses(scheme):
    """Whether the scheme needs a fair coin per step and path."""


@trait(bool, default=False)
def judges(scheme):
    """Whether the scheme accepts flows or not, and needs uniform numbers behind the coins, see ``increments.py``."""


@trait(int, default=1)
def substeps(scheme):
    """Into how many equal sub-steps, a power of two, the increments of a step must be resolved."""


@trait(bool, default=False)
def needs_areas(scheme):
    """Whether a step needs the Lévy areas of noises that do not commute, and then coins as well."""


@method(default=True)
def work_size(scheme, model):
    """How many floats of scratch one block needs."""
    return 0


@method(default=True)
def memory_size(scheme, model):
    """How many floats, at first 0, a block keeps from step to step behind its states in `y`."""
    return 0


#: What schemes report, per step size and over all paths and steps: how often they solved an equation, iterations and
#: failures in all; how many noise flows and steps of the drift were judged, and how many of them accepted; the largest
#: relative residual; and the largest |angle| of a rotation (0 if none is above pi/4).
REPORT = (
    *("solves", "iterations", "failures", "noise_judged", "noise_accepted", "drift_judged", "drift_accepted"),
    *("largest_residual", "largest_angle"),
)
SUMMED = 7  #: so many of them are sums, the others maxima


def report_columns(report):
    """What there is in a report (..., columns), by name: of solvers or of flows judged if there were any, and the rest.

    That is the largest angle, if any was large.
    """
    by_name = {name: report[..., i] for i, name in enumerate(REPORT)}
    groups = (*REPORT[:3], REPORT[7]), REPORT[3:7], REPORT[8:]
    return {name: by_name[name] for names in groups if by_name[names[0]].any() for name in names}
