"""Remarks on an experiment before it is run."""

import math
from collections.abc import Iterator
from typing import Any

from .. import specs, systems
from ..ensemble.protocol import dimension, large, report, strengths
from ..exact.gibbs import reach
from ..kinds import KINDS
from ..models.delegation import undamped
from ..schemes import typical_ns

_MOST_COMPONENTS = 24  #: of states whose reachable set is computed


def remarks(experiment: specs.Experiment) -> list[str]:
    """The parts of an experiment that are not computed, or not as it asks for, a line each, and its warnings."""
    of_kind: Any = getattr(KINDS[experiment.kind].study, "remarks", lambda case: ())
    lines = {_of(experiment, case, line): None for case in experiment.cases for line in (*of_kind(case), *_noise(case))}
    return [*lines, *warnings(experiment)]


def warnings(experiment: specs.Experiment) -> list[str]:
    """The limits of the results of an experiment, a line each."""
    lines: dict[Any, str] = {}  # cases that differ in steps or strengths have the same fields
    for case in experiment.cases:
        model = undamped(case.model)
        if math.isinf(case.temperature) or large(model) or dimension(model) > _MOST_COMPONENTS:
            continue
        fields = type(model), model._replace(sigma=tuple(map(bool, strengths(model)))), case.initial
        if fields not in lines:
            line = _of_temperature(case, model)
            lines[fields] = line and _of(experiment, case, line)
    return list(filter(None, lines.values()))


def _of(experiment: specs.Experiment, case: specs.BaseCase, line: str) -> str:
    """A line with the name of its case, where there are several."""
    several = len({case.owner for case in experiment.cases}) > 1
    return f"{case.owner}: {line}" if several else line


def _of_temperature(case: specs.BaseCase, model: Any) -> str:
    """A warning where exp(-H/T) is not the only stationary law, as further functions are conserved; "" elsewhere."""
    try:
        rank, surface = reach(model, case.initial)
    except (ValueError, ArithmeticError):  # of formulas that are not for several states at once
        return ""
    if rank >= surface:
        return ""
    return (
        f"warning: the noises and the drift move a state in {rank} of the {surface} dimensions of its Casimir surface,"
        " so that exp(-H/T) is not the only stationary law"
    )


def _noise(case: specs.BaseCase) -> Iterator[str]:
    """Noise that is not that of the equation."""
    if case.areas != "exact":
        yield "Lévy areas are Gaussian, with the right moments given the increments: results hold in law"
    if case.driver:
        yield f"the noises are driven by another process than Brownian motion: {case.driver}"


def reports(experiment: specs.Experiment) -> dict[str, list[str]]:
    """Reports on the models of an experiment, lines by the name of the system and its cases.

    Of generated models how they are split, of others what they say themselves.
    """
    reports: dict[tuple[str, ...], list[str]] = {}
    for case in experiment.cases:
        model = undamped(case.model)
        lines = systems.report(model)
        if lines:
            steps = (f"a step of {s}: about {typical_ns(case.row(s), case.model):.3g} ns" for s in case.schemes)
            lines = [*lines, *steps]
        if lines := lines or report(model, case.initial):
            reports.setdefault((case.model_name, *lines), []).append(case.name)
    several = len(experiment.cases) > 1
    return {f"{name} ({', '.join(cases)})" if several else name: lines for (name, *lines), cases in reports.items()}
