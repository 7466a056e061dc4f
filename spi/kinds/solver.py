"""What a scheme reports of its steps, in the results of every kind that integrates."""

from typing import Annotated, Any

import numpy as np

from spi.ensemble.scheme_protocol import REPORT, SUMMED, report_columns
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


class Acceptance(Described):
    """How often a scheme that judges flows accepted them; arrays of one shape."""

    noise_accepted: Annotated[Array, array("", "share of the noise flows that were accepted")]
    drift_accepted: Annotated[Array, array("", "share of the steps of the drift that were accepted")]


def _ratio(part: np.ndarray, whole: np.ndarray, otherwise: float) -> np.ndarray:
    """`part` over `whole`, and `otherwise` where the whole is 0."""
    whole = np.asarray(whole, float)
    return np.divide(part, whole, out=np.full(whole.shape, otherwise), where=whole != 0)


def reported(report: np.ndarray) -> dict[str, Any]:
    """The fields `solver`, `acceptance` and `largest_angle` of a record, from reports (..., columns).

    None where there is nothing.
    """
    columns = report_columns(report)
    solver = {name: columns[name] for name in Solver.__annotations__ if name in columns}
    judged = [columns[name] for name in REPORT[3:SUMMED] if name in columns]
    shares = [_ratio(accepted, of, np.nan) for of, accepted in zip(judged[::2], judged[1::2], strict=True)]
    return {
        "solver": Solver(**solver) if solver else None,
        "acceptance": Acceptance(noise_accepted=shares[0], drift_accepted=shares[1]) if shares else None,
        "largest_angle": columns.get("largest_angle"),
    }


def acceptance_note(acceptance: Acceptance | None, i: int = -1) -> str:
    """What to print of the step size number i, "" where nothing was judged."""
    if acceptance is None:
        return ""
    noise, drift = (float(np.ravel(each)[i]) for each in (acceptance.noise_accepted, acceptance.drift_accepted))
    return f"accepted: {noise:.1%} of the noise flows, {drift:.1%} of the steps of the drift"
