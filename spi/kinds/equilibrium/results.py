"""What is stored of long times."""

from collections.abc import Iterable, Iterator
from typing import Annotated

import numpy as np

from spi.kinds.solver import Acceptance, Solver
from spi.storage.stored import Array, Described, Stored, array, axis, fact


class Law(Described):
    """The law of the states beside the exact stationary one, from the snapshots of all paths.

    Means of moments such as y_1^2, and distributions of variables such as y_1 in bins of equal probability.
    """

    variables: Annotated[tuple[str, ...], axis("variable", name="variable")]
    moments: Annotated[tuple[str, ...], axis("moment", name="moment")]
    mean: Annotated[Array, array("h moment", "mean of the moment")]
    mean_stderr: Annotated[Array, array("h moment", "standard error of the mean of the moment")]
    mean_exact: Annotated[Array, array("moment", "exact mean of the moment")]
    fraction: Annotated[Array, array("h variable bin", "fraction of the snapshots in the bin; exact: 1 / bins")]
    fraction_stderr: Annotated[Array, array("h variable bin", "standard error of the fraction")]
    distance: Annotated[
        Array, array("h variable", "largest difference from the exact distribution function", name="law_distance")
    ]
    distance_stderr: Annotated[
        Array, array("h variable", "standard error of the difference", name="law_distance_stderr")
    ]

    @property
    def z(self) -> np.ndarray:
        """(S, M) means less their exact values, in standard errors."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return (self.mean - self.mean_exact) / self.mean_stderr


class Equilibrium(Stored):
    """Paths of one scheme over very many steps at several step sizes, from large to small.

    Errors of the Casimirs are C(y_n) / C(y_0) - 1, or absolute ones if C(y_0) = 0, after several numbers of steps.
    """

    h: Annotated[Array, axis("step size", "time")]
    n: Annotated[Array, axis("number of steps")]
    casimir_mean: Annotated[Array, array("h n casimir", "mean error of the Casimir over the paths")]
    casimir_rms: Annotated[Array, array("h n casimir", "root mean square error of the Casimir")]
    casimir_worst: Annotated[Array, array("h n casimir", "largest modulus of the error of the Casimir")]
    casimir_one: Annotated[Array, array("h n casimir", "error of the Casimir on path 0")]
    nonfinite: Annotated[Array, array("h", "diverged paths (NaN or infinity)")]
    growth: Annotated[
        Array, array("h casimir", "growth of the error; NaN where not fitted", formula="p in rms = C n^p")
    ]
    growth_low: Annotated[Array, array("h casimir", "lower end of the 95 % interval of the growth")]
    growth_high: Annotated[Array, array("h casimir", "upper end of the 95 % interval of the growth")]
    bias: Annotated[Array, array("h casimir", "mean error of the Casimir at the end, per step")]
    bias_stderr: Annotated[Array, array("h casimir", "standard error of the bias")]
    solver: Annotated[Solver | None, array("h", "what an implicit scheme reports")] = None
    acceptance: Annotated[Acceptance | None, array("h", "how often flows were accepted")] = None
    largest_angle: Annotated[Array | None, array("h", "largest angle of a rotation, where any exceeds pi/4", "rad")] = (
        None
    )
    law: Law | None = None  # where the stationary law is known
    samples: Annotated[int, fact("number of paths", column=True)]
    steps_each: Annotated[int, fact("number of steps of each path")]
    snapshots: Annotated[int, fact("snapshots of each path that count for the law")]
    panels: Annotated[tuple[str, ...], fact("what the figure of the case shows")]

    @property
    def casimir_count(self) -> int:
        """How many Casimir functions there are."""
        return self.casimir_rms.shape[2]

    @property
    def largest_finite(self) -> int | None:
        """Number of the largest step size at which all paths are finite; None if there is none."""
        finite = np.flatnonzero(self.nonfinite == 0)
        return int(finite[np.argmax(self.h[finite])]) if len(finite) else None


def with_laws(readings: Iterable[Equilibrium]) -> Iterator[tuple[Equilibrium, Law]]:
    """The results of which the law is known, each with its law."""
    return ((reading, reading.law) for reading in readings if reading.law)


Record = Equilibrium
