"""What a study hands to storage, tables and plots: plain arrays with names."""

from typing import Any, NamedTuple

import numpy as np


class Group(NamedTuple):
    """The results of one scheme in one case: the group ``/<case>/<scheme>`` of a results file."""

    case: str
    scheme: str
    coordinates: dict[str, np.ndarray]  #: name of an axis -> its values, a 1-D array (a dimension scale)
    variables: dict[str, tuple[tuple[str, ...], np.ndarray]]  #: name -> (names of its axes, array)
    attributes: dict[str, Any]  #: numbers, strings and tuples of numbers that describe the whole group


class Results(NamedTuple):
    """One results file."""

    attributes: dict[str, Any]  #: see section 6 of the design: kind, title, figure, spec, spec_hash, profile, ...
    groups: tuple[Group, ...]


def describe(case, scheme):
    """The attributes of a group that say what was integrated: `case` of a spec and `scheme`, a row of the schemes."""
    return {
        "scheme_label": scheme.label,
        "case_title": case.title,
        "seed": case.seed,
        "final_time": case.final_time,
        "initial": case.initial,
        "truncate_noise": case.truncate_noise,
        "model": case.model_name,
        **{f"model_{name}": value for name, value in case.model._asdict().items()},
    }
