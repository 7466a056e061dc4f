"""What a file of sums tells of the run that it belongs to: of which spec it is, and how far."""

import json
import math
from collections.abc import Sequence
from typing import Any

from .. import specs
from ..kinds.state import State
from .load import name_of


def progress_of(states: Sequence[State]) -> str:
    """How far the parts of an experiment are, as in ``splitting 120 of 500 samples, midpoint 0 of 500 samples``."""
    several = len({state.plan.case.name for state in states}) > 1
    told = []
    for state in states:
        plan, one = state.plan, state.plan.progress(state)
        of_paths = one.total > 1 and float(one.total).is_integer()  # else in seconds, or in parts of a path
        known = one.total > 0 and math.isfinite(one.done / one.total)
        share = f"{math.floor(100 * one.done / one.total) if known else 0} %"
        count = f"{int(one.done):,} of {int(one.total):,} samples" if of_paths else share
        told.append(f"{name_of(plan) if several else plan.part.name} {count}")
    return ", ".join(told)


def as_run(experiment: specs.Experiment) -> dict[str, Any]:
    """The spec, and how it is run, by the names that these have among the root attributes of results."""
    return {
        "experiment": experiment.name,
        "kind": experiment.kind,
        "title": experiment.title,
        "profile": experiment.profile,
        "overrides": experiment.overrides,
        "spec": experiment.text,
        "model_sources": json.dumps(dict(experiment.files)),
    }
