"""Looks of results, which are those of their spec as it is now: titles, panels, and what the key ``figure`` says."""

import json
from typing import Any

from .. import specs
from ..specs.cases import BaseCase
from ..storage.records import Group, StoredResults
from .checkpoint import as_run


def attributes(experiment: specs.Experiment) -> dict[str, Any]:
    """Root attributes that no number depends on."""
    chosen = json.dumps(experiment.chosen) if experiment.chosen else None
    own = {"expect": experiment.expect, "asks": experiment.asks, "figure": experiment.figure, "figure_keys": chosen}
    return {**as_run(experiment), **own}


def relooked(results: StoredResults, experiment: specs.Experiment) -> StoredResults:
    """Results with the looks of an experiment that has the same numbers: its hash is that of their spec."""
    cases = {case.owner: case for case in experiment.cases} | {case.name: case for case in experiment.cases}
    groups = tuple(_relooked(group, cases[group.case]) for group in results.groups)
    root = {name: value for name, value in (results.attributes | attributes(experiment)).items() if value is not None}
    return results._replace(attributes=root, groups=groups)


def _relooked(group: Group, case: BaseCase) -> Group:
    """Group with the looks of its case; what is empty is left to the record of the kind where the group has it not."""
    own = {name: getattr(case, name) for name in case.looks - {"title"}}
    if case.sweep:
        own |= {"swept_title": case.sweep.title, "swept_of": case.sweep.of}
    of_group = case.sweep.title if case.sweep and group.case == case.owner else case.title
    kept = {name: value for name, value in group.attributes.items() if name not in own}
    given = {name: it for name, it in own.items() if it or name in group.attributes}
    return group._replace(attributes=kept | {"case_title": of_group} | given)
