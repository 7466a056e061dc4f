"""From what a person asks about to an experiment of kind answer, and what its pilots predict."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from spi import specs
from spi.kinds.plans import State
from spi.running import compiling
from spi.running.load import STORED, load, load_about
from spi.running.run import Watch, kernel_calls, plans, progress_of_part
from spi.running.shipped import names, path_of
from spi.running.workers import advance_some_here, allocate
from spi.specs.document import Document, text_of
from spi.specs.naming import completed

from .kinds.answer.decisions import Prediction
from .kinds.answer.keys import DEFAULTS, question


def load_answer(
    path: str | Path, profile: str | None = None, overrides: Sequence[str] = (), trust_code: bool = False
) -> specs.Experiment:
    """An answer about the system and the initial value of an experiment, called ``<name>.answer``.

    A file that says a system only, without a kind, is one itself.  SpecError as for ``spi.running.load.load_any``, and
    if there are no answers about what is integrated.
    """
    if Path(path).suffix not in STORED and (text := _of_system(path)):
        whole = load(path, profile or "laptop", overrides, text)
        return whole._replace(name=f"{whole.name}.answer")
    return load_about(path, "answer", _question, profile, overrides, trust_code)


def _of_system(path: str | Path) -> str:
    """Spec of an answer with the text of a file that says a system only, in which no line moves; "" of other files."""
    text = text_of(path_of(path), names())
    data = Document(text, lambda line: f"{path}:{line}:").data
    if not isinstance(data, dict) or "model" not in data or {"kind", "step", "steps"} & data.keys():
        return ""
    return completed(text, {key: value for key, value in DEFAULTS.items() if key not in data})


def _question(source: specs.Experiment, overrides: Sequence[str]) -> str:
    """Spec of an answer about an experiment, without its functions where there are others in the overrides."""
    return question(source, functions=not any(text.startswith("functions=") for text in overrides))


def predictions(experiment: specs.Experiment, watch: Watch) -> Iterator[tuple[str, Prediction]]:
    """Name of each case of an experiment of kind answer, and its prediction from the pilot alone."""
    for plan in plans(experiment):
        answer: Any = plan
        compiling.compile_missing(kernel_calls([plan]), watch.report_compiling)
        state = State(plan)

        def tick(number: int, state: State = state) -> None:
            watch.report(progress_of_part(state, number, 1))

        while (predicted := answer.prediction(state.extra)) is None:
            advance_some_here([state], {(0, chunk) for chunk in state.missing()}, tick)
            allocate(0, state, tick)
        yield plan.case.name, predicted
