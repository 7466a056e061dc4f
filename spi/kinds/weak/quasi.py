"""Randomised quasi-Monte Carlo: plain sampling whose paths follow scrambled Sobol' points, see ``increments.py``.

The jackknife groups of paths are the independent scrambles, so that all standard errors are those over scrambles.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from spi.ensemble.increments import Points, dimensions_of, points_of
from spi.numerics.rng import POINTS
from spi.numerics.sobol import LEAST_PATHS, MOST_DIMENSIONS, SCRAMBLES
from spi.specs.checks import need
from spi.specs.keys import wrong
from spi.statistics.estimators import standard_deviation

from .plain import PlainPlan
from .results import Quasi


@dataclass(frozen=True, kw_only=True)
class QuasiPlan(PlainPlan):
    """Weak errors of one scheme by scrambled points."""

    LABEL, LOOK = "quasi-Monte Carlo", ("s", "#009E73")
    of_others: ClassVar[frozenset[str]] = frozenset(("standard_error", "seconds", "accuracy", "prefixes"))

    @classmethod
    def check(cls, case: Any) -> None:
        """Raise the error about a number of paths that is no power of two, or too many dimensions."""
        need(case, "quasi", "samples")
        if case.samples < LEAST_PATHS or case.samples & (case.samples - 1):
            right = f"must be a power of two for the estimator 'quasi', {LEAST_PATHS} or more"
            raise wrong(f"is {case.samples}", right, "samples")
        steps, right = round(case.final_time / case.reference_step), "use a reference_step that makes it"
        for scheme in case.schemes:
            dimensions = dimensions_of(case.row(scheme).record, case.reference_record(None), case.model, steps)[1]
            if dimensions > MOST_DIMENSIONS:
                mistake = f"has 'quasi', whose points would have {dimensions} dimensions for '{scheme}'"
                raise wrong(mistake, f"{right} {MOST_DIMENSIONS} or fewer, or plain", "estimators")

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
