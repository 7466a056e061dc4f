"""Record of growth: errors of the Casimir functions over very many steps, and the law of the states."""

from collections.abc import Iterator, Sequence
from statistics import NormalDist

import numpy as np

from spi.plugins.dynamics.kinds.long_paths.results import CASIMIRS, LongRecord, count
from spi.printing.tables import Column, Table
from spi.storage.records import in_standard_errors
from spi.storage.stored import Array, Described, array, axis, derived, fact

#: The panels of the figure.
PANELS = ("growth", "law", "distance", "acceptance")


class StationaryLaw(Described):
    """Law of the states beside the exact stationary one, from the snapshots of all paths.

    Means of moments such as y_1^2, and distributions of variables such as y_1 in bins of equal probability.
    """

    variables: tuple[str, ...] = axis("variable", name="variable")
    moments: tuple[str, ...] = axis("moment", name="moment")
    mean: Array = array("h moment", "mean of the moment")
    mean_stderr: Array = array("h moment", "standard error of the mean of the moment")
    mean_exact: Array = array("moment", "exact mean of the moment")
    fraction: Array = array("h variable bin", "fraction of the snapshots in the bin; exact: 1 / bins")
    fraction_stderr: Array = array("h variable bin", "standard error of the fraction")
    distance: Array = array(
        "h variable",
        "largest difference from the exact distribution function",
        name="law_distance",
        claim="at most",
    )
    distance_stderr: Array = array("h variable", "standard error of the difference", name="law_distance_stderr")

    @property
    def z(self) -> Array:
        """(S, M) means less their exact values, in standard errors."""
        return in_standard_errors(self.mean - self.mean_exact, self.mean_stderr)

    @property
    def farthest(self) -> Array:
        """(S,) the moments whose means are farthest from the exact ones; empty where these are not finite."""
        farthest = np.array(self.moments)[np.abs(self.z).argmax(axis=1)]
        return np.where(np.isfinite(self.mean_z), farthest, "")

    @derived("h", "largest distance of a mean from the exact one, in standard errors", column="mean_z", claim="at most")
    def mean_z(self) -> Array:
        """(S,) of all moments."""
        return np.abs(self.z).max(axis=1)


class Growth(LongRecord):
    """Growth of the errors of the Casimir functions of one scheme, and the law of its states where one is known."""

    headline = ("casimir_worst", "growth", "law_distance")
    measures = r"The growth of a Casimir error is $p$ in $\mathrm{rms} = C n^p$ after $n$ steps."
    tables = (
        CASIMIRS,
        Table(
            "h",
            [
                Column("law_distance", "distance of the\nlaw of {} (95 %)", over="variable", among=("y3", "H")),
                Column("mean_z", "largest |z|\nof the means", form=".1f", missing="not finite"),
                Column(lambda one, _: one.law and one.law.farthest, "of"),
            ],
            title="stationary law",
        ),
    )
    row_axes = ("h", "casimir")

    law: StationaryLaw | None = None  # where the stationary law is known
    snapshots: int = fact("snapshots of each path that count for the law")

    def freedom(self, name: str) -> float:
        """That of the paths."""
        return self.samples - 1

    @classmethod
    def remarks_of_case(cls, readings: Sequence["Growth"]) -> Iterator[str]:
        """Paths, and how large |z| is by chance."""
        first = readings[0]
        snapshots = f", {first.snapshots} snapshots of each path" if first.snapshots else ""
        yield f"{first.samples} paths of {count(first.steps_each)} steps each{snapshots}"
        if first.law:
            moments = len(first.law.moments)
            bound = f"is below {chance(moments):.1f} in 95 % of cases"
            yield f"by chance the largest |z| of {moments} independent means {bound}"


Record = Growth


def chance(count: int) -> float:
    """Bound of the largest |z| of `count` independent standard normals in 95 % of cases."""
    return NormalDist().inv_cdf(0.5 + 0.5 * 0.95 ** (1 / count))
