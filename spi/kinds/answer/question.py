"""The answer spec that ``spi answer`` makes of an experiment of another kind."""

from collections.abc import Sequence
from contextlib import suppress
from functools import reduce
from itertools import groupby
from typing import Any

from spi.specs.cases import BaseCase
from spi.specs.document import Document, SpecError
from spi.specs.experiment import ANSWER, ONLY_IN_FILES, Experiment, laid_over
from spi.specs.files import Files
from spi.specs.naming import as_yaml
from spi.specs.sweep import versions

#: The keys about the system and its noise.
_SYSTEM = ("model", "damping", "temperature", "initial", "seed", "noise")

#: The functions for an experiment without test functions, and the default accuracy.
_FUNCTIONS, _ACCURACY = {"mean": "y1", "square": "y1^2"}, 1e-3


def question(experiment: Experiment) -> str:
    """The spec, as YAML, of an answer about the models and the initial values of an experiment of another kind.

    Functions and final time are those of the experiment; the scheme is left to choose.  SpecError if a case of it has a
    multiscale scheme.
    """
    document = Document(experiment.text, str)
    own = {case["name"]: case for case in document.data.get("cases") or ()}
    above = {key: value for key, value in document.data.items() if key not in ONLY_IN_FILES}
    files = Files(experiment.path, experiment.files)
    answers = []
    for name, cases in groupby(experiment.cases, lambda case: case.owner):
        raw, case, title = _middle(laid_over(above, own.get(name, {})), [*cases], files)
        if case.eps is not None:
            right = "answers are about the equation; use schemes without eps"
            raise SpecError(f"{experiment.called}: has a multiscale scheme; {right}")
        answers.append({"name": name, "title": title, **_asked(raw, case)} if own else _asked(raw, case))
    heading = {"title": f"{experiment.title} ({ANSWER})", "kind": ANSWER}
    return as_yaml(_with_numbers(heading | ({"cases": answers} if own else answers[0])))


def _middle(raw: dict[str, Any], cases: Sequence[BaseCase], files: Files) -> tuple[dict[str, Any], BaseCase, str]:
    """The keys, the record and the title of a case; of a swept parameter those of its middle value."""
    case = cases[0]
    if not (sweep := case.sweep):
        return raw, case, case.title
    n = reduce(lambda n, values: n * len(values) + len(values) // 2, sweep.parameters.values(), 0)
    return [*versions(raw, case.swept_in, files).values()][n], cases[n], sweep.title


def _asked(raw: dict[str, Any], case: BaseCase) -> dict[str, Any]:
    """The keys of an answer about a case, of which `raw` are the keys as the file has them."""
    functions, time = dict(getattr(case, "functions", {})), case.last_time
    if not functions:
        h = max(getattr(case, "steps", None) or (case.step,))  # type: ignore[attr-defined]
        functions, time = _FUNCTIONS, h * max(round(time / h), 1)
    system = {key: raw[key] for key in _SYSTEM if raw.get(key) is not None}
    return {**system, "final_time": time, "functions": functions, "accuracy": _ACCURACY}


def _with_numbers(value: Any) -> Any:
    """Values as a person would write them: numbers without quotes."""
    if isinstance(value, dict):
        return {key: _with_numbers(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_with_numbers(inner) for inner in value]
    for kind in (int, float) if isinstance(value, str) else ():
        with suppress(ValueError):
            if str(kind(value)) == value:
                return kind(value)
    return value
