"""What a scheme reports of its steps, in the results of every kind that integrates."""

from typing import Annotated, Any

import numpy as np

from spi.ensemble.loop import report_columns
from spi.storage.stored import Array, Described, array


class Solver(Described):
    """What an implicit scheme reports of its equations; arrays of one shape."""

    solves: Annotated[Array, array("", "equations solved")]
    iterations: Annotated[Array, array("", "iterations of all solves")]
    failures: Annotated[Array, array("", "solves that did not converge")]
    largest_residual: Annotated[Array, array("", "largest relative residual")]

    @property
    def failing_fraction(self) -> np.ndarray:
        """Failures over solves, in the shape of the fields; 0 where nothing was solved."""
        return _ratio(self.failures, self.solves, 0.0)

    @property
    def iterations_per_solve(self) -> np.ndarray:
        """Iterations over solves, in the shape of the fields; NaN where nothing was solved."""
        return _ratio(self.iterations, self.solves, np.nan)


def _ratio(part: np.ndarray, whole: np.ndarray, otherwise: float) -> np.ndarray:
    """`part` over `whole`, and `otherwise` where the whole is 0."""
    whole = np.asarray(whole, float)
    return np.divide(part, whole, out=np.full(whole.shape, otherwise), where=whole > 0)


def reported(report: np.ndarray) -> dict[str, Any]:
    """The fields `solver` and `largest_angle` of a record, from reports (..., columns); None where there is nothing."""
    columns = report_columns(report)
    angle = columns.pop("largest_angle", None)
    return {"solver": Solver(**columns) if columns else None, "largest_angle": angle}
