"""The group of results of a stability study."""

from typing import TYPE_CHECKING

import numpy as np

from spi.ensemble.loop import report_columns, thread_count
from spi.ensemble.protocol import REPORT, casimirs, populations
from spi.expressions import canonical
from spi.kinds.plans import State
from spi.storage.records import Group, Variables

from .law import law_variables
from .paths import summary

if TYPE_CHECKING:
    from . import StabilityPlan

_AXES = ("value", "h")
_PER_POINT = ("finite", "largest_norm", "error", "error_stderr")


def group(p: "StabilityPlan", state: State) -> Group:
    """The results of one scheme of a case, from its final state."""
    case = p.case
    coordinates = {
        "value": np.array(case.sweep.values),
        "h": np.array(case.steps),
        "casimir": np.arange(len(casimirs(p.first.model, p.first.initial))),
    }
    if case.functions:
        coordinates["function"] = np.array(list(case.functions))
    down = slice(None, None, -1)  # levels go from small steps to large ones, results from large to small
    variables = {
        name: (axes, values[:, down] if axes[:2] == _AXES else values)
        for name, (axes, values) in _variables(p, state).items()
    }
    return Group(
        case.name,
        p.part.variant,
        coordinates,
        variables,
        {
            **p.description(),
            "sweep": case.sweep.word,
            "samples": case.samples,
            "reference_step": case.reference_step,
            "reference_scheme": case.reference_scheme,
            "accurate": case.accurate,
            "functions": tuple(canonical(e) for e in case.expressions),
            "panels": case.panels,
            "wall_seconds": state.seconds,
            "threads": thread_count(),
        },
    )


def _variables(p: "StabilityPlan", state: State) -> Variables:
    """All variables, step sizes from small to large."""
    totals = [state.total(i) for i in range(len(p.points))]
    each = [summary(point, p.functions, known) for point, known in zip(p.points, totals, strict=True)]
    told = {name: np.array([one[name] for one in each]) for name in each[0]}
    found: dict[str, tuple[tuple[str, ...], np.ndarray]] = {name: (_AXES, told[name]) for name in _PER_POINT}
    if populations(p.first.model):
        found["positive"] = _AXES, told["positive"]
    found |= {name: ((*_AXES, "casimir"), told[name]) for name in ("casimir_worst", "casimir_median")}
    report = np.array([known.report[1:] for known in totals])
    found |= {name: (_AXES, values) for name, values in report_columns(report).items()}
    if p.first.row.composition is not None:  # its flows may rotate
        found["largest_angle"] = _AXES, report[..., REPORT.index("largest_angle")]
    if p.functions:
        found |= law_variables(told["expectation"], told["expectation_stderr"], state.more)
    return found
