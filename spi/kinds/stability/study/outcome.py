"""The results of a stability study."""

from typing import TYPE_CHECKING, Any

import numpy as np

from spi.ensemble.loop import thread_count
from spi.ensemble.protocol import REPORT, populations
from spi.expressions import canonical
from spi.kinds.plans import State
from spi.kinds.solver import reported

from ..results import CasimirErrors, Stability
from .law import law
from .paths import summary

if TYPE_CHECKING:
    from . import StabilityPlan

_PER_POINT = ("finite", "largest_norm", "error", "error_stderr")


def results(p: "StabilityPlan", state: State) -> Stability:
    """The results of one scheme of a case, from its final state."""
    case = p.case
    return Stability(
        about=p.description(),
        values=np.array(case.sweep.values),
        h=np.array(case.steps),
        **_arrays(p, state),
        word=case.sweep.word,
        functions=tuple(canonical(e) for e in case.expressions),
        accurate=case.accurate,
        samples=case.samples,
        reference_step=case.reference_step,
        reference_scheme=case.reference_scheme,
        panels=case.panels,
        wall_seconds=state.seconds,
        threads=thread_count(),
    )


def _arrays(p: "StabilityPlan", state: State) -> dict[str, Any]:
    """All arrays by the names of their fields."""
    totals = [state.total(i) for i in range(len(p.points))]
    each = [summary(point, p.functions, known) for point, known in zip(p.points, totals, strict=True)]
    # levels go from small steps to large ones, results from large to small
    told = {name: np.array([one[name][::-1] for one in each]) for name in each[0]}
    report = np.array([known.report[:0:-1] for known in totals])
    found: dict[str, Any] = {name: told[name] for name in _PER_POINT} | reported(report)
    if populations(p.first.model):
        found["positive"] = told["positive"]
    if told["casimir_worst"].shape[-1]:
        found["casimirs"] = CasimirErrors(worst=told["casimir_worst"], median=told["casimir_median"])
    if p.first.row.composition is not None:  # its flows may rotate
        found["largest_angle"] = report[..., REPORT.index("largest_angle")]
    if p.functions:
        found["law"] = law(tuple(p.case.functions), told["expectation"], told["expectation_stderr"], state.more)
    return found
