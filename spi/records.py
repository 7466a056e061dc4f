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
