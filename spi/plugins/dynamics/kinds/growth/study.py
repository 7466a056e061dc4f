"""Growth: how rounding errors of Casimirs grow over very many steps, and the law of the states.

On a sphere all flows preserve the area, so that with noise the law of the states tends to the uniform one: then y_j is
uniform on [-|y_0|, |y_0|], and means, and fractions of the snapshots in bins of equal probability, are compared with
their exact values.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from spi.kinds.plans import State, each_scheme
from spi.plugins.dynamics.exact.sphere_law import BINS, SphereLaw, obstacle
from spi.plugins.dynamics.kinds.long_paths.paths import LongPaths
from spi.plugins.dynamics.kinds.long_paths.study import LongPlan
from spi.statistics import estimators
from spi.statistics.accumulators import Array, joined, of_first

from .results import Growth, StationaryLaw

_WARM_UP = 1 / 16  # of the time, before snapshots count for the law


class GrowthPaths(LongPaths):
    """Also sums over the snapshots that count for the law."""

    snapshots: Array = of_first(dtype=int)  #: their number
    moments: Array = joined("moment")
    counts: Array = joined("variable bin")


parts = each_scheme


@dataclass(frozen=True, kw_only=True)
class GrowthPlan(LongPlan):
    """Errors of the Casimir functions of one scheme, and the law of its states where the limit of that is known."""

    record = Growth
    sums = GrowthPaths
    by_path = (*LongPlan.by_path, "moments", "counts")

    @cached_property
    def law(self) -> SphereLaw | None:
        """Limit of the law of the states, None where that is not known."""
        model, initial = self.case.model, self.case.initial
        return None if obstacle(model, initial) else SphereLaw.of(model, initial)

    def lengths(self, number: int) -> dict[str, int]:
        """See :class:`LongPlan`."""
        law = self.law
        return {"moment": len(law.moments) if law else 0, "variable": len(law.variables) if law else 0, "bin": BINS}

    def at_stop(self, number: int, paths: GrowthPaths, states: np.ndarray) -> GrowthPaths:
        """The paths with one more snapshot, once the law may count as reached."""
        if self.law is None or paths.n <= _WARM_UP * self.case.counts[number]:
            return paths
        counts = paths.counts.copy()
        self.law.count(states, counts)
        moments = paths.moments + self.law.moments_of(states)
        return paths._replace(moments=moments, counts=counts, snapshots=paths.snapshots + 1)

    def found(self, state: State) -> dict[str, Any]:
        """Law."""
        totals = self.totals(state)
        law = law_of_states(self.law, totals) if self.law else None
        return {"law": law, "snapshots": int(totals[0].snapshots)}


plan = GrowthPlan.of


def law_of_states(law: SphereLaw, totals: Sequence[GrowthPaths]) -> StationaryLaw:
    """Means and fractions in bins against their exact values, from the paths of each step size."""
    snapshots = max(totals[0].snapshots, 1)
    moments = np.array([paths.moments for paths in totals]) / snapshots
    fractions = np.array([paths.counts for paths in totals]) / snapshots
    below = np.cumsum(fractions, axis=2)[:, :, :-1]
    away = np.abs(below.mean(axis=3) - np.arange(1, BINS) / BINS)
    farthest = away.argmax(axis=2)[..., None]
    return StationaryLaw(
        variables=tuple(law.variables),
        moments=tuple(law.moments),
        mean=moments.mean(axis=2),
        mean_stderr=estimators.stderr_of_mean(moments),
        mean_exact=np.array(list(law.moments.values())),
        fraction=fractions.mean(axis=3),
        fraction_stderr=estimators.stderr_of_mean(fractions),
        distance=np.take_along_axis(away, farthest, 2)[..., 0],
        distance_stderr=np.take_along_axis(estimators.stderr_of_mean(below), farthest, 2)[..., 0],
    )
