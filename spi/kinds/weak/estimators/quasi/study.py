"""Randomised quasi-Monte Carlo: plain sampling whose paths follow scrambled Sobol' points, see ``increments.py``.

The jackknife groups of paths are the independent scrambles, so that all standard errors are those over scrambles.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from spi.ensemble.increments import Points, dimensions_of, points_of
from spi.numerics.rng import POINTS
from spi.numerics.sobol import SCRAMBLES
from spi.statistics.estimators import standard_deviation

from ...results import Quasi
from ..plain.study import PlainPlan


@dataclass(frozen=True, kw_only=True)
class QuasiPlan(PlainPlan):
    """Weak errors of one scheme by scrambled points."""

    of_others: ClassVar[frozenset[str]] = frozenset(("standard_error", "seconds", "accuracy", "prefixes"))

    @property
    def prefixes(self) -> tuple[int, ...]:
        """None: points are evenly spread only in powers of two."""
        return ()

    @cached_property
    def stream(self) -> Points:
        """The points in the place of independent increments."""
        return points_of(self.case.seed, POINTS, self.scheme, self.model, self.grid)

    def estimates(self, sums: Any) -> dict[str, Any]:
        """The weak errors, and the gain over independent paths."""
        estimated, values = super().estimates(sums), self._of_own(sums).values[:, :-1].sum(axis=-1)
        sd = standard_deviation(*values / self.samples).T
        with np.errstate(divide="ignore", invalid="ignore"):
            gain = sd**2 / (self.samples * estimated["sampled"].expectation_stderr ** 2)
        steps, reference = self.grid.reference_steps, self.grid.reference_scheme
        quasi = Quasi(
            gain=gain,
            scrambles=SCRAMBLES,
            points=self.samples // SCRAMBLES,
            dimensions=dimensions_of(self.scheme, reference, self.model, steps)[1],
        )
        return estimated | {"quasi": quasi}


plan = QuasiPlan.of
