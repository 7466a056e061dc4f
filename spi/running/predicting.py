"""Predictions of answers, from their pilots alone."""

from collections.abc import Iterator
from typing import Any

from ..kinds.answer.study import Prediction, prediction
from ..kinds.plans import State
from ..specs import Experiment
from .compiling import compile_missing
from .load import plans
from .run import Watch, kernel_calls, progress_of_part
from .workers import advance_some_here, allocate


def predictions(experiment: Experiment, watch: Watch) -> Iterator[tuple[str, Prediction]]:
    """The name of each case of an experiment of kind answer, and its prediction."""
    for plan in plans(experiment):
        compile_missing(kernel_calls([plan]), watch.report_compiling)
        answer: Any = plan
        state = State(plan)

        def tick(number: int, state: State = state) -> None:
            watch.report(progress_of_part(state, number, 1))

        while (predicted := prediction(answer, state.extra)) is None:
            advance_some_here([state], {(0, chunk) for chunk in state.missing()}, tick)
            allocate(0, state, tick)
        yield plan.case.name, predicted
