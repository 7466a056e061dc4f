"""The group of results of a stability study."""

from typing import TYPE_CHECKING

import numpy as np

from spi.ensemble import report_columns, thread_count
from spi.expressions import canonical
from spi.protocol import REPORT, populations
from spi.records import Group, Variables
from spi.schemes import SCHEMES

from .law import law_variables
from .paths import State

if TYPE_CHECKING:
    from . import StabilityPlan

_AXES = ("value", "h")
_OF_STATE = ("finite", "largest_norm", "error", "error_stderr")


def group(p: "StabilityPlan", state: State) -> Group:
    """The results of one scheme of a case, from its final state."""
    case = p.case
    coordinates = {
        "value": np.array(case.sweep.values),
        "h": np.array(case.steps),
        "casimir": np.arange(state.casimir.shape[1]),
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
    found: dict[str, tuple[tuple[str, ...], np.ndarray]] = {name: (_AXES, getattr(state, name)) for name in _OF_STATE}
    if populations(p.first.model):
        found["positive"] = _AXES, state.positive
    found |= {name: ((*_AXES, "casimir"), getattr(state, name)) for name in ("casimir_worst", "casimir_median")}
    report = state.report[:, 1:]
    found |= {name: (_AXES, values) for name, values in report_columns(report).items()}
    if SCHEMES[p.part.scheme].composition is not None:  # its flows may rotate
        found["largest_angle"] = _AXES, report[..., REPORT.index("largest_angle")]
    return found | (law_variables(state) if p.functions else {})
