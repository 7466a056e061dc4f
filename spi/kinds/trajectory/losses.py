"""Where a quantity along a path is not defined, as tables and figures both tell it."""

from typing import NamedTuple

import numpy as np

from .results import Trajectory


class Losses(NamedTuple):
    """At how many times something is not defined although y is finite."""

    number: int
    times: int  #: how many there are
    first: float  #: of those times
    lasting: bool  #: whether it is undefined from then on, as long as y is finite

    def __str__(self) -> str:
        if self.lasting:
            return f"not defined from t = {self.first:g}"
        return f"not defined at {self.number} of {self.times} times, first t = {self.first:g}"


def losses(reading: Trajectory, values: np.ndarray) -> Losses | None:
    """Those of `values` (t, ...) along the path of a reading; None if they are finite wherever y is."""
    alive = np.isfinite(reading.y).all(axis=1)
    lost = np.flatnonzero(alive & ~np.isfinite(values.reshape(len(values), -1)).all(axis=1))
    if not len(lost):
        return None
    lasting = len(lost) == alive[lost[0] :].sum()
    return Losses(len(lost), len(values), float(reading.t[lost[0]]), bool(lasting))


def diverged(reading: Trajectory) -> str:
    """From when on y is not finite; empty if it always is."""
    return "" if reading.nonfinite_from is None else f"diverged from t = {reading.nonfinite_from:g}"
