"""What is to be said of an experiment before it is run."""

import itertools
import math
from collections.abc import Iterator
from typing import Any

from .. import specs
from ..ensemble.protocol import dimension, large, strengths
from ..exact.reach import reach
from ..kinds import KINDS
from ..models.delegation import undamped
from ..systems import variables

_MOST_COMPONENTS = 24  #: of states of which it is found where noises take them


def remarks(experiment: specs.Experiment) -> list[str]:
    """What of an experiment will not be computed, or not as it was asked for, a line each."""
    of_kind: Any = getattr(KINDS[experiment.kind].study, "remarks", lambda case: ())
    several = len({case.owner for case in experiment.cases}) > 1
    each = ((case, itertools.chain(of_kind(case), _of_areas(case), _of_driver(case))) for case in experiment.cases)
    found = dict.fromkeys(f"{case.owner}: " * several + line for case, lines in each for line in lines)
    return [*found, *warnings(experiment)]


def warnings(experiment: specs.Experiment) -> list[str]:
    """What the results of an experiment can not be taken for, a line each."""
    several = len({case.owner for case in experiment.cases}) > 1
    found: dict[Any, str] = {}  # cases that differ in steps or strengths have the same fields
    for case in experiment.cases:
        model = undamped(case.model)
        if math.isinf(case.temperature) or large(model) or dimension(model) > _MOST_COMPONENTS:
            continue
        same = type(model), model._replace(sigma=tuple(map(bool, strengths(model)))), case.initial
        if same not in found:
            line = _of_temperature(case, model)
            found[same] = f"{case.owner}: {line}" if several and line else line
    return list(filter(None, found.values()))


def _of_temperature(case: specs.BaseCase, model: Any) -> str:
    """That the law to which paths tend is not the Gibbs law, but one for each value of what is conserved besides."""
    names = variables(model) or [f"y{i + 1}" for i in range(dimension(model))]
    try:
        rank, surface, invariants = reach(model, case.initial, names)
    except (ValueError, ArithmeticError):  # of formulas that are not for several states at once
        return ""
    if rank >= surface:
        return ""
    kept = " and ".join(invariants) if invariants else "no linear or quadratic function"
    return (
        f"warning: the noises and the drift move a state in {rank} of the {surface} dimensions of its Casimir surface,"
        f" so that exp(-H/T) is not the only stationary law; besides Casimir functions they keep {kept}"
    )


def _of_areas(case: specs.BaseCase) -> Iterator[str]:
    if case.areas != "exact":
        yield "Lévy areas are Gaussian, with the right moments given the increments: results hold in law"


def _of_driver(case: specs.BaseCase) -> Iterator[str]:
    if case.driver:
        yield f"the noises are driven by another process than Brownian motion: {case.driver}"
