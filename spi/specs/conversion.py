"""An experiment made into one of another kind, with defaults that suit it.

What is integrated stays: model, damping, temperature, initial value, seed, eps, compositions, schemes and the
truncation of increments.  Step sizes, final times and numbers of paths suit the other kind, in proportion to the
largest step.
"""

from contextlib import suppress
from typing import Any, NamedTuple

from .cases import BaseCase
from .document import Document
from .files import Files
from .layers import ONLY_IN_FILES, laid_over
from .naming import as_yaml
from .sweep import versions

#: The keys that say what is integrated.
_KEPT = (
    *("model", "damping", "temperature", "initial", "seed", "eps", "compositions", "schemes", "truncate_noise"),
    "noise",
)


class Given(NamedTuple):
    """What an experiment says that one of another kind can use."""

    step: float  #: a step size h, the largest of the experiment unless it is too large for its times
    length: int  #: steps of this size until the final time, at least 8
    samples: int | None  #: number of paths, None if one is followed
    functions: dict[str, str]  #: test functions by name, {} if it has none
    measured: bool  #: whether it measures errors, so that its times and steps are fit for that
    case: BaseCase  #: the record
    keys: dict[str, Any]  #: what says what is integrated, as the file writes it

    def errors(self, number: int, finer: int) -> dict[str, Any]:
        """The keys of errors against so many step sizes, and a reference that is so much finer than the smallest.

        Along a path that was only followed, 8 steps h are time enough, and h/4 is the largest step: later, paths of
        different steps may have lost one another.
        """
        length, h = (self.length, self.step) if self.measured else (32, self.step / 4)
        steps = [h / 2**k for k in range(number)]
        return {"final_time": h * length, "steps": steps, "reference_step": steps[-1] / finer}

    def paths(self, most: int) -> int:
        """Those of the experiment, or `most` if it has none or more."""
        return min(self.samples or most, most)


def converted(text: str, name: str, cases: tuple[BaseCase, ...], files: Files, kind: str, keys: Any) -> str:
    """The YAML of an experiment of another kind.

    `text` is that of a valid file called `name`, of which `cases` are the records and which names `files`; `keys` is
    the module of the kind, whose function ``of_another`` says what it needs besides: Given -> keys and
    values, None for a key that it lacks.
    """
    document = Document(text, lambda line: f"line {line}:")
    own = {case["name"]: case for case in document.data.get("cases") or ()}
    above = {key: value for key, value in document.data.items() if key not in ONLY_IN_FILES}
    made = []
    by_owner: dict[str, list[BaseCase]] = {}
    for case in cases:
        by_owner.setdefault(case.owner, []).append(case)
    for name, (first, *others) in by_owner.items():
        raw = laid_over(above, own.get(name, {}))
        case, title = first, first.title
        if sweep := first.sweep:  # the middle value stands for the others
            middle = len(sweep.values) // 2 * (second := max(1, len(sweep.second_values))) + second // 2
            raw = [*versions(raw, first.swept_in, files).values()][middle]
            case, title = (sweep.cases or [first, *others])[middle], sweep.title or title
        given = _given(case, {key: raw[key] for key in _KEPT if key in raw})
        of_kind = {**given.keys, **keys.of_another(given)}
        kept = {key: value for key, value in of_kind.items() if value is not None}
        made.append({"name": name, "title": title, **kept})
    title = f"{document.data.get('title', name)} ({kind})"
    if not own:
        made[0].pop("name"), made[0].pop("title")
        whole = {"title": title, "kind": kind, **made[0]}
    else:
        whole = {"title": title, "kind": kind, "cases": made}
    return as_yaml(_with_numbers(whole))


def _given(case: BaseCase, keys: dict[str, Any]) -> Given:
    if case.noise is None and any(case.row(name).needs_truncation for name in case.schemes):
        keys["truncate_noise"] = True
    keys.setdefault("schemes", list(case.schemes))
    h = max(getattr(case, "steps", None) or (case.step,))  # type: ignore[attr-defined]
    length = max(round(case.last_time / h), 1)
    while length < 8 or (h >= 1 and "truncate_noise" in keys):
        h, length = h / 2, 2 * length
    functions = dict(getattr(case, "functions", {}))
    measured = hasattr(case, "reference_step")
    return Given(h, length, getattr(case, "samples", None), functions, measured, case, keys)


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
