"""Work and precision: the errors of schemes against the processor time that one path takes.

Errors are those of the studies ``strong`` or, where there is a test function, ``weak``.  Time is measured for each
step size alone, on one thread, after everything is compiled: the median of several repetitions, those of all step
sizes taking turns, so that a change of the machine's mood does not favour one of them.
"""

import time

import numpy as np

from ..ensemble import FinalStates, brownian, empty_report, grid, integrate, limited_threads
from ..records import Group
from ..rng import LANES
from ..schemes import reference_record, scheme_row
from . import strong, weak

#: Steps of paths that one repetition takes: some milliseconds.
_PATH_STEPS = 2**20
#: What variables of the studies of errors are kept.
_KEPT = ("error", "error_stderr", "resolved", "nonfinite", "casimir_drift")


def _of_case(case):
    return weak if case.functions else strong


def _of_plan(p):
    return strong if isinstance(p, strong.Plan) else weak


def parts(case):
    """What is run one after the other: each scheme, weak errors with the first estimator that can do it."""
    first = {}
    for part in _of_case(case).parts(case):
        first.setdefault(part.group, part)
    return list(first.values())


def plan(case, part):
    """The plan for the errors of one scheme of a case."""
    return _of_case(case).plan(case, part)


def cost(case, part):
    """Steps of paths, seconds of one thread at typical speed, and bytes of memory, of the errors."""
    return _of_case(case).cost(case, part)


def start(p):
    """The state before anything is done."""
    return _of_plan(p).start(p)


def batches(p, state):
    """Run what is left; yields the state after each batch."""
    return _of_plan(p).batches(p, state)


def progress(p, state):
    """How much is done, of how much, and a standard error."""
    return _of_plan(p).progress(p, state)


def seconds_per_path(case, part):
    """Processor seconds of one path at each step size, (repeats, step sizes), on one thread."""
    jobs = [_job(case, part, h) for h in case.steps]
    found = np.empty((case.repeats, len(jobs)))
    with limited_threads(1):
        for _, run in jobs:
            run()  # compile, and touch the memory
        for repeat in range(case.repeats):
            for i, (paths, run) in enumerate(jobs):
                began = time.process_time()
                run()
                found[repeat, i] = (time.process_time() - began) / paths
    return found


def _job(case, part, h):
    """(paths, function that integrates them): a whole path from 0 to T at step size h, with nothing else to be done."""
    steps = round(case.final_time / h)
    blocks = max(1, _PATH_STEPS // (LANES * steps))
    scheme = scheme_row(part.scheme, part.eps).record
    reference = reference_record(case.reference_scheme, part.eps)
    times = grid(h, steps, truncate=case.truncate_noise, reference_scheme=reference, by_reference=(0,))
    if case.functions:
        observer = FinalStates(np.empty((blocks, 1, len(case.initial) * LANES)), np.array([steps]))
    else:
        observer = strong.sums_of(case.model, case.initial, np.array([steps]), blocks)
    noise, report = brownian(case.seed), empty_report(blocks, 1)
    arguments = scheme, case.model, case.initial, times, noise, observer, report, 0, blocks, blocks * LANES
    return blocks * LANES, lambda: integrate(*arguments)


def group(case, part, state):
    """The results of one scheme of a case: errors, and the quartiles of the times."""
    found = weak.group(case, part, state) if case.functions else strong.untimed_group(case, part, state)
    variables = dict(found.variables)
    exact = "error_bound" in variables
    if exact:
        variables["error_stderr"] = variables.pop("error_bound")
    if case.functions:  # there is one
        variables = {name: (axes[1:], v[0]) for name, (axes, v) in variables.items() if axes == ("function", "h")} | {
            name: entry for name, entry in variables.items() if entry[0] == ("h",)
        }
        variables["error"] = ("h",), np.abs(variables["error"][1])
    variables = {name: variables[name] for name in _KEPT if name in variables}
    h, kept = np.array(case.steps), {axis for axes, _ in variables.values() for axis in axes}
    low, median, high = np.quantile(seconds_per_path(case, part), (0.25, 0.5, 0.75), axis=0)
    variables |= {
        "seconds_per_path": (("h",), median),
        "seconds_per_path_low": (("h",), low),
        "seconds_per_path_high": (("h",), high),
        "ns_per_step": (("h",), 1e9 * median * h / case.final_time),
    }
    attributes = {
        **found.attributes,
        **_order_of_one(found),
        "measure": "weak" if case.functions else "strong",
        "exact": exact,
        "targets": case.targets or _targets(variables["error"][1][variables["resolved"][1]]),
        "repeats": case.repeats,
    }
    coordinates = {name: values for name, values in found.coordinates.items() if name in kept}
    return Group(case.name, part.group, coordinates, variables, attributes)


def _order_of_one(found):
    """The order of the only test function, as the study of strong errors has it."""
    if "order" not in found.variables:
        return {}
    order, low, high, points = (found.variables[f"order{end}"][1][0] for end in ("", "_low", "_high", "_points"))
    return {"order": float(order), "order_ci": (float(low), float(high)), "points_in_fit": int(points)}


def _targets(error):
    """Powers of ten within the errors that are resolved, or the next below if there is none."""
    error = error[error > 0.0]
    if not len(error):
        return (0.1,)
    low, high = np.ceil(np.log10(error.min())), np.floor(np.log10(error.max()))
    return tuple(10.0**e for e in np.arange(high, min(low, high) - 1, -1))
