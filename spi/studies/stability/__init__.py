"""Stability: what schemes keep of the equation where steps are large or parameters extreme.

For each value of the swept word the same Brownian paths are run at all step sizes.  Of every path the study keeps the
largest relative error of each Casimir and the largest |y| over all times, and the last state; from these come the
fraction of paths that stay finite, the distance from the scheme's own path at the reference step, and, where there are
test functions and the law of the equation is known without sampling, the distance of expectations from the truth.
"""

import functools

import numpy as np

from ...ensemble import brownian, nested_grid, report_columns, thread_count
from ...expressions import as_numpy, canonical
from ...kolmogorov import limits
from ...protocol import REPORT
from ...records import Group, Part, describe
from ...rng import LANES
from ...schemes import SCHEMES, reference_record, scheme_row, typical_ns
from .paths import Plan, arrays_of
from .paths import batches as batches
from .paths import start as start

#: Numerical error that the true expectations may have.
_ACCURACY = 1e-3
#: What they take for one value, on one thread.
_TRUTH_SECONDS = 3.0


def parts(case):
    """What is run one after the other: each scheme, whatever its eps if that is what is swept."""
    return [Part(scheme) for scheme in case.schemes]


def plan(case, part):
    """The plan for one scheme of a case."""
    points = tuple((c.model, c.initial, _eps(c, part)) for c in case.sweep.cases)
    eps = points[0][2]
    reference = reference_record(case.reference_scheme, eps)
    times = nested_grid(case.final_time, case.reference_step, case.steps, case.truncate_noise, reference)
    return Plan(
        scheme_row(part.scheme, eps).record,
        points,
        times,
        brownian(case.seed),
        times.reference_steps >> times.doublings,
        case.samples,
        case.expressions,
    )


def _eps(case, part):
    return case.eps[0] if SCHEMES[part.scheme].multiscale else None


def cost(case, part):
    """Steps of paths, seconds of one thread at typical speed, and bytes of memory."""
    p = plan(case, part)
    steps = int(p.steps.sum()) * p.samples * len(p.points)
    seconds = steps * 1e-9 * typical_ns(part.scheme, case.model)
    if case.functions and _has_truth(case.model) and part.scheme == case.schemes[0]:
        seconds += _TRUTH_SECONDS * len(p.points)
    return steps, seconds, sum(v.nbytes for v in arrays_of(p))


def _has_truth(model):
    return getattr(type(model), "surface", None) == "sphere"


def progress(p, state):
    """Paths done of all values, all of them, and no standard error."""
    return state.done * p.samples + min(state.blocks * LANES, p.samples), len(p.points) * p.samples, float("nan")


@functools.lru_cache(maxsize=256)
def _truth(model, initial, final_time, functions):
    """E phi(y(T)) and its numerical error, (F,) each; kept, because it is the same for all schemes."""
    return limits(model, initial, final_time, [as_numpy(f) for f in functions], _ACCURACY)


def _law(case, p, state):
    """Expectations of the test functions, and how far from the truth they are, as variables."""
    mean, stderr = state.expectation, state.expectation_stderr
    truth, bound = np.full((2, len(mean), mean.shape[2]), np.nan)
    for i, (model, initial, _) in enumerate(p.points):
        if _has_truth(model):
            truth[i], bound[i] = _truth(model, initial, case.final_time, p.functions)
    with np.errstate(invalid="ignore"):
        away = np.abs(mean - truth[:, None])
        away = np.where(np.isfinite(truth)[:, None] & np.isnan(away), np.inf, away)
    farthest = np.argmax(np.nan_to_num(away, nan=-1.0, posinf=np.inf), axis=2)[..., None]
    doubt = np.hypot(stderr, bound[:, None])
    axes = ("value", "h", "function")
    return {
        "expectation": (axes, mean),
        "expectation_stderr": (axes, stderr),
        "truth": (axes[::2], truth),
        "truth_bound": (axes[::2], bound),
        "law_distance": (axes[:2], np.take_along_axis(away, farthest, 2)[..., 0]),
        "law_distance_stderr": (axes[:2], np.take_along_axis(doubt, farthest, 2)[..., 0]),
    }


def group(case, part, state):
    """The results of one scheme of a case, from its final state."""
    p = plan(case, part)
    down, axes = slice(None, None, -1), ("value", "h")
    names = ["finite", "largest_norm", "error", "error_stderr"]
    model = p.points[0][0]
    if getattr(type(model), "populations", False):
        names.append("positive")
    variables = {name: (axes, getattr(state, name)) for name in names}
    variables |= {name: ((*axes, "casimir"), getattr(state, name)) for name in ("casimir_worst", "casimir_median")}
    variables |= {name: (axes, v) for name, v in report_columns(state.report[:, 1:]).items()}
    if hasattr(p.scheme, "stages"):  # a splitting, which rotates
        variables["largest_angle"] = axes, state.report[:, 1:, REPORT.index("largest_angle")]
    coordinates = {
        "value": np.array(case.sweep.values),
        "h": np.array(case.steps),
        "casimir": np.arange(state.casimir.shape[1]),
    }
    if case.functions:
        coordinates["function"] = np.array(list(case.functions))
        variables |= _law(case, p, state)
    # levels go from small steps to large ones, results from large to small
    variables = {name: (a, v[:, down] if a[:2] == axes else v) for name, (a, v) in variables.items()}
    row = scheme_row(part.scheme, p.points[0][2])
    label = row.label.partition(", eps = ")[0]
    return Group(
        case.name,
        part.group,
        coordinates,
        variables,
        {
            **_fixed(case, part, row._replace(label=label)),
            "sweep": case.sweep.word,
            "samples": case.samples,
            "reference_step": case.reference_step,
            "reference_scheme": case.reference_scheme,
            "accurate": case.accurate,
            "functions": tuple(canonical(e) for e in case.expressions),
            "panels": " ".join(case.panels),
            "wall_seconds": state.seconds,
            "threads": thread_count(),
        },
    )


def _fixed(case, part, row):
    """What describes the case whatever the value of the swept word."""
    each = [describe(c, row, _eps(c, part)) for c in case.sweep.cases]
    return {name: value for name, value in each[0].items() if all(other[name] == value for other in each)}
