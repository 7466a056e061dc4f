"""The paths of a study of long times: what is kept of them from one snapshot to the next."""

from typing import Any, NamedTuple

import numpy as np

from spi.ensemble.loop import add_reports
from spi.exact.sphere_law import SphereLaw


class Paths(NamedTuple):
    """What is known of the paths of some blocks, which stand along the last axes, after `n` steps of one step size.

    Until all steps are done there is nothing to say of whole paths, and `paths` is 0.
    """

    paths: int
    seconds: float  #: wall clock
    n: int
    y: np.ndarray  #: (blocks, d * LANES + memory), no blocks once all steps are done
    casimir: np.ndarray  #: (records, C, paths), relative error
    report: np.ndarray  #: (len(REPORT),)
    nonfinite: int  #: of the paths
    snapshots: int  #: how many count for the law
    moments: np.ndarray  #: (moments, paths), sums over snapshots
    counts: np.ndarray  #: (variables, bins, paths)
    stretch: np.ndarray  #: (F, blocks, LANES, 2 L) the last values of functions, until all steps are done
    batches: np.ndarray  #: (F, blocks, LANES, BATCHES) sums of values over the batches of time, until then
    values: np.ndarray  #: (COLUMNS, F, GROUPS) sums over paths
    lagged: np.ndarray  #: (F, L, GROUPS) sums of products of values at each lag
    ends: np.ndarray  #: (F, L, GROUPS) sums of both values of all pairs at that lag
    cells: np.ndarray  #: (F, bins + 2, GROUPS) int64: values below all bins or NaN, in each, and above all

    def plus(self, later: "Paths") -> "Paths":
        """These paths and some later ones, all steps done."""
        joined: dict[str, Any] = {
            name: np.concatenate((getattr(self, name), getattr(later, name)), axis=-1) for name in OF_PATHS
        }
        return self._replace(
            paths=self.paths + later.paths,
            seconds=self.seconds + later.seconds,
            report=add_reports(self.report[np.newaxis], later.report[np.newaxis, np.newaxis])[0],
            nonfinite=self.nonfinite + later.nonfinite,
            **{name: getattr(self, name) + getattr(later, name) for name in ADDED},
            **joined,
        )

    def counted(self, law: SphereLaw, states: np.ndarray) -> "Paths":
        """With one more snapshot in the sums, of states (d, paths)."""
        counts, moments = self.counts.copy(), self.moments + law.moments_of(states)
        law.count(states, counts)
        return self._replace(moments=moments, counts=counts, snapshots=self.snapshots + 1)


OF_PATHS = ("casimir", "moments", "counts")  #: the fields in which the paths stand along the last axis
ADDED = ("values", "lagged", "ends", "cells")  #: those that are sums over paths

#: What is recorded of no functions.
NOTHING: dict[str, Any] = {
    "stretch": np.zeros((0, 0, 0, 0)),
    "batches": np.zeros((0, 0, 0, 0)),
    **{name: np.zeros((0, 0, 0)) for name in ("values", "lagged", "ends")},
    "cells": np.zeros((0, 0, 0), np.int64),
}
