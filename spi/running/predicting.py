"""What an answer would take, from its pilot alone."""

from collections.abc import Iterator
from typing import Any, NamedTuple

from ..kinds.answer import study
from ..kinds.answer.planner import PILOTING
from ..kinds.plans import State
from ..specs import Experiment
from .compiling import compile_missing
from .load import plans
from .run import Watch, kernel_calls, progress_of_part
from .workers import advance_some_here, allocate


class Prediction(NamedTuple):
    """Of one case."""

    case: str
    how: str  #: what was chosen, in words
    seconds: float  #: of processor time; NaN where nothing would be sampled
    next_digit: float  #: the same to a tenth of the accuracy


def predictions(experiment: Experiment, watch: Watch) -> Iterator[Prediction]:
    """Those of the cases of an experiment of kind answer."""
    for plan in plans(experiment):
        of_kind: Any = plan
        compile_missing(kernel_calls([plan]), watch.report_compiling)
        state = State(plan)

        def tick(number: int, state: State = state) -> None:
            watch.report(progress_of_part(state, number, 1))

        while state.extra.stage == PILOTING and not study.is_clear(of_kind, state.extra):
            advance_some_here([state], {(0, chunk) for chunk in state.missing()}, tick)
            allocate(0, state, tick)
        extra, end = state.extra, plan.case.final_time
        both = f" ({told})" if of_kind.solvable and (told := study.why(extra, plan.case.accuracy)) else ""
        if extra.solving == study.SOLVING:
            yield Prediction(plan.case.name, f"without sampling{both}", extra.solving_seconds, float("nan"))
            continue
        how = f"{plan.case.schemes[extra.scheme]}, {extra.levels} levels of extrapolation, multilevel, steps "
        how += f"{end / 2**extra.base:g} to {end / 2**extra.finest:g}, for {extra.aim:g}{both}"
        yield Prediction(plan.case.name, how, extra.predicted_cpu_seconds, extra.next_cpu_seconds)
