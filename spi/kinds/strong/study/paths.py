"""The sums over paths of a study of strong errors, and what blocks of paths contribute to them."""

from typing import NamedTuple

import numpy as np

from spi.ensemble.loop import add_reports


class Totals(NamedTuple):
    """What is known of some paths."""

    paths: int
    seconds: float  #: wall clock
    cpu_seconds: float
    squares: np.ndarray  #: (GROUPS, points)
    drift: np.ndarray  #: (levels, casimirs)
    nonfinite: np.ndarray  #: (levels,)
    report: np.ndarray  #: (levels, len(REPORT))

    def plus(self, later: "Totals") -> "Totals":
        """These paths and some later ones."""
        return Totals(
            paths=self.paths + later.paths,
            seconds=self.seconds + later.seconds,
            cpu_seconds=self.cpu_seconds + later.cpu_seconds,
            squares=self.squares + later.squares,
            drift=np.maximum(self.drift, later.drift),
            nonfinite=self.nonfinite + later.nonfinite,
            report=add_reports(self.report, later.report[np.newaxis]),
        )


class Rows(NamedTuple):
    """What some blocks contribute, a row for each."""

    squares: np.ndarray  #: (blocks, points, PARTS) sums of |y_h - y_ref|^2
    drift: np.ndarray  #: (blocks, levels, C, LANES)
    nonfinite: np.ndarray  #: (blocks, levels)
    report: np.ndarray  #: (blocks, levels, len(REPORT))
