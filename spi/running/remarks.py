"""Remarks on an experiment before it is run."""

from collections.abc import Iterator
from typing import Any

from .. import specs
from ..ensemble.protocol import generated, in_place, report
from ..kinds import KINDS
from ..models.delegation import undamped
from ..numerics.rng import LANES
from ..plugins import Registry
from ..schemes import typical_ns

WARNINGS = Registry("warnings")  #: name -> the warning about a case, "" if there is none


def remarks(experiment: specs.Experiment) -> list[str]:
    """Parts of an experiment that are not computed, or not as it asks for, a line each, and its warnings."""
    of_kind: Any = getattr(KINDS[experiment.kind].study, "remarks", lambda case: ())
    lines = {_of(experiment, case, line): None for case in experiment.cases for line in (*of_kind(case), *_about(case))}
    return [*lines, *warnings(experiment)]


def warnings(experiment: specs.Experiment) -> list[str]:
    """Limits of the results of an experiment, a line each."""
    each = ((case, warning(case)) for case in experiment.cases for warning in WARNINGS.values())
    return list(dict.fromkeys(_of(experiment, case, line) for case, line in each if line))


def _of(experiment: specs.Experiment, case: specs.BaseCase, line: str) -> str:
    """A line with the name of its case, where there are several."""
    several = len({case.owner for case in experiment.cases}) > 1
    return f"{case.owner}: {line}" if several else line


def _about(case: specs.BaseCase) -> Iterator[str]:
    """Noise that is not that of the equation, and paths that take as long as more of them would."""
    if case.areas != "exact":
        yield "Lévy areas are Gaussian, with the right moments given the increments: results hold in law"
    if case.driver:
        yield f"the noises are driven by another process than Brownian motion: {case.driver}"
    used = (getattr(case, "samples", None) or 0) % LANES
    if used and in_place(case.model) and not case.in_parts:
        yield f"paths of a lattice are moved {LANES} at once: {LANES - used} more would take no longer"


def reports(experiment: specs.Experiment) -> dict[str, list[str]]:
    """Reports on the models of an experiment, lines by the name of the system and its cases.

    Of generated models also what a step takes.
    """
    reports: dict[tuple[str, ...], list[str]] = {}
    for case in experiment.cases:
        model = undamped(case.model)
        lines = report(model, case.initial)
        if lines and generated(model):
            steps = (f"a step of {s}: about {typical_ns(case.row(s), case.model):.3g} ns" for s in case.schemes)
            lines = [*lines, *steps]
        if lines:
            reports.setdefault((case.model_name, *lines), []).append(case.name)
    several = len(experiment.cases) > 1
    return {f"{name} ({', '.join(cases)})" if several else name: lines for (name, *lines), cases in reports.items()}
