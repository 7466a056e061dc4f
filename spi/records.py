"""What a study hands to storage, tables and plots: plain arrays with names."""

from typing import Any, NamedTuple

import numpy as np


class Part(NamedTuple):
    """What of a case is run at a time: one scheme, with one estimator where a study has several."""

    scheme: str
    estimator: str = ""
    eps: float | None = None  #: of a scheme for the multiscale system

    @property
    def group(self):
        """What the scheme is called in a file."""
        return self.scheme if self.eps is None else f"{self.scheme}_eps_{self.eps:g}"

    @property
    def name(self):
        return f"{self.group}/{self.estimator}" if self.estimator else self.group


class Group(NamedTuple):
    """The results of one part of a case, in a file ``/<case>/<scheme>`` or ``/<case>/<scheme>/<estimator>``."""

    case: str
    scheme: str
    coordinates: dict[str, np.ndarray]  #: name of an axis -> its values, a 1-D array (a dimension scale)
    variables: dict[str, tuple[tuple[str, ...], np.ndarray]]  #: name -> (names of its axes, array)
    attributes: dict[str, Any]  #: numbers, strings and tuples of them that describe the whole group
    estimator: str = ""

    @property
    def arrays(self):
        """name -> array, without the names of its axes."""
        return {name: values for name, (_, values) in self.variables.items()}


class Results(NamedTuple):
    """One results file."""

    attributes: dict[str, Any]  #: see section 6 of the design: kind, title, figure, spec, spec_hash, profile, ...
    groups: tuple[Group, ...]


def family(group):
    """The scheme of a group whatever its eps, the inverse of :attr:`Part.group`."""
    eps = group.attributes.get("eps")
    return group.scheme if eps is None else group.scheme.removesuffix(f"_eps_{eps:g}")


def family_label(group):
    """The same for the label, the inverse of what ``schemes.scheme_row`` does to it."""
    label, eps = group.attributes.get("scheme_label", group.scheme), group.attributes.get("eps")
    return label if eps is None else label.removesuffix(f", eps = {eps:g}")


def describe(case, scheme, eps=None):
    """The attributes of a group that say what was integrated: `case` of a spec and `scheme`, a row of the schemes."""
    return {
        "scheme_label": scheme.label,
        "case_title": case.title,
        "seed": case.seed,
        "final_time": getattr(case, "final_time", None),
        "initial": case.initial,
        "truncate_noise": case.truncate_noise,
        "model": case.model_name,
        "eps": eps,
        **{f"model_{name}": value for name, value in case.model._asdict().items()},
    }
