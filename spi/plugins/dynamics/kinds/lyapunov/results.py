"""Records of Lyapunov exponents."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from spi.numerics.groups import filled_groups
from spi.plugins.dynamics.kinds.maps import DensityMap
from spi.printing.tables import Column, Table
from spi.printing.text import short, with_interval
from spi.statistics.claims import lost_among
from spi.statistics.estimators import RESOLVED
from spi.storage.records import student
from spi.storage.stored import DIVERGED, Array, Claimed, Stored, array, axis, derived, fact, nested

#: The panels of a figure.
PANELS = ("lyapunov", "pullback")

#: The relative spread of values that are alike on all paths.
EQUAL = 1e-6

_SMALL = 0.1  # share of the spread of H up to which a change of its mean does not count


class Pictures(DensityMap):
    """Many states on one path of noise that ends now: their places, and their distances from each other.

    A picture at t is of the noise from -t to 0, which all pictures share as far as they go, so that they converge.
    """

    t: Array = axis("how long the noise has acted", "time", name="map_t")
    distance: Array = array("map_t", "mean distance of two states", formula="E |y - z|")
    distance_stderr: Array = array("map_t", "standard error of that, for this path of noise")
    typical: Array = array("map_t", "typical distance of two states", formula="exp E log |y - z|")
    points: int = fact("number of states")

    @derived("map_t", "half the interval of the mean distance")
    def distance_half(self) -> Array:
        """(times,) half the 95 % interval of the mean distance, Student's over the jackknife groups."""
        return student(filled_groups(self.points) - 1) * self.distance_stderr


def _dimension(reading: "Exponents", readings: Sequence["Exponents"]) -> str:
    """Dimension as text, a lower bound where exponents do not suffice for it."""
    half = reading.dimension_half
    if half is None and math.isfinite(reading.dimension):
        return f"{reading.dimension:g} or more"
    return with_interval(reading.dimension, half) if half else f"{reading.dimension:g}"


_LARGE = 1e3  # factors of vectors between two stops from which on differences lose too many digits
_SUM = Claimed("equal", "exponent_sum", expected="total_known")


class Exponents(Stored):
    """Lyapunov exponents on the Casimir surface, averaged from the warm-up to several times and over the paths."""

    headline = ("largest_exponent", "exponent_sum")
    measures = (
        r"The largest Lyapunov exponent is the mean rate $\lim_{t \to \infty} \frac{1}{t} \log |\delta y(t)|$ at which "
        r"near paths on the same noise part; where it is negative they meet."
    )
    row_axes = ("number", "t")
    tables = (
        Table(
            "",
            [
                Column("exponent", "exponent {} (95 %)", over="number"),
                Column("total", "sum (95 %)"),
                Column(_dimension, "dimension (95 %)"),
            ],
        ),
    )

    number: Array = axis("number of the exponent, the largest first")
    t: Array = axis("time until which is averaged", "time")
    exponent: Array = array("number t", "Lyapunov exponent", "1/time", formula="E log R_kk / (t - warm_up)")
    exponent_stderr: Array = array("number t", "standard error of the exponent", "1/time")
    total: Array = array("t", "sum of the exponents: mean divergence of the flow", "1/time", claim=_SUM)
    total_stderr: Array = array("t", "standard error of the sum", "1/time")
    total_known: float | None = fact("what the sum is of the equation", "1/time", default=None)
    rounding: Array | None = array(
        "t", "differences of exponents that roundings of near paths make", "1/time", default=None
    )
    dimension_stderr: float | None = fact(
        "standard error of the Lyapunov dimension, where exponents suffice for it", default=None
    )
    energy: Array | None = array("t", "mean of H", "energy", formula="E H(y(t))", default=None)
    energy_stderr: Array | None = array("t", "standard error of the mean of H", "energy", default=None)
    energy_change: float | None = fact(
        "mean of H at the later half of these times, less that at the earlier half", "energy", default=None
    )
    energy_change_stderr: float | None = fact("standard error of this change", "energy", default=None)
    change: float = fact("largest factor, or its inverse, by which a vector changed before it was scaled")
    nonfinite: int = fact("diverged paths (NaN or infinity)", claim=DIVERGED)
    step: float = fact("step size", "time")
    samples: int = fact("number of paths", column=True)
    ns_per_step: float = fact("time of a step and path, that of its near paths included", "ns")
    panels: tuple[str, ...] = fact("what the figure of the case shows", default=PANELS)
    pictures: Pictures | None = nested(prefix="pullback_", default=None)

    @derived("t", "largest Lyapunov exponent", claim="equal")
    def largest_exponent(self) -> Array:
        """(times,) the first exponent."""
        return self.exponent[0]

    @derived("t", "half its interval")
    def largest_exponent_half(self) -> Array:
        """(times,) half its 95 % intervals."""
        return self.exponent_half[0]

    @derived(
        "",
        "Lyapunov dimension",
        column="dimension",
        claim=Claimed("equal", where="is_dimension_known", lost="dimension_lost"),
    )
    def dimension(self) -> float:
        """Lyapunov dimension at the last time, see :func:`kaplan_yorke`."""
        return float(kaplan_yorke(self.exponent[:, -1]))

    @derived("", "whether the exponents suffice for the dimension")
    def is_dimension_known(self) -> bool:
        """Whether the exponents suffice for the dimension."""
        return self.dimension_stderr is not None

    @derived("", "why no claim about the dimension passes")
    def dimension_lost(self) -> str:
        """Exponents that the dimension lacks."""
        return lost_among(self.exponent[:, -1], "exponents")

    def freedom(self, name: str) -> float:
        """Of the dimension, and of pictures, that of the jackknife groups; of means that of the paths."""
        if self.pictures is not None and name.startswith("pullback_"):
            return filled_groups(self.pictures.points) - 1
        return super().freedom(name) if name == "dimension" else self.samples - 1

    @property
    def exponent_half(self) -> Array:
        """(m, times) half the 95 % intervals of the exponents."""
        return self.interval() * self.exponent_stderr

    @property
    def total_half(self) -> Array:
        """(times,) half the 95 % interval of the sum."""
        return self.interval() * self.total_stderr

    @derived("", "half the interval of the Lyapunov dimension")
    def dimension_half(self) -> float | None:
        """Half the 95 % interval of the dimension, Student's over the jackknife groups."""
        if self.dimension_stderr is None:
            return None
        return self.interval("dimension") * self.dimension_stderr

    @property
    def is_stationary(self) -> bool:
        """Whether nothing speaks against a stationary law: the mean of H does not change from half to half.

        A change counts if it is resolved and not small beside the spread of H over the paths.
        """
        if self.energy is None or self.energy_stderr is None or self.energy_change is None:
            return True
        spread = self.energy_stderr[-1] * np.sqrt(max(self.samples - 1, 1))
        if not spread > EQUAL * abs(self.energy[-1]):  # as without noise, or not finite
            return True
        stderr = self.energy_change_stderr or 0.0
        return not abs(self.energy_change) > max(RESOLVED * stderr, _SMALL * spread)

    def remarks(self) -> Iterator[str]:
        """What near paths resolve, large changes of vectors, energies that still change, and distances in pictures."""
        if self.rounding is not None:
            sums = abs(float(self.total[-1] - (self.total_known or 0.0))), *np.abs(self.exponent[:, -1]).tolist()
            if any(each <= self.rounding[-1] for each in sums):
                least = short(float(self.rounding[-1]), ".0e")
                yield f"    exponents and sums are known up to {least}, which is the rounding of near paths"
        if self.change > _LARGE:
            yield f"    vectors changed by factors of {self.change:.0e} between two stops: take a smaller `every`"
        if not self.is_stationary and self.energy is not None and self.energy_stderr is not None:
            halves = self.interval() * self.energy_stderr
            began, ended = (
                f"{with_interval(float(self.energy[i]), float(halves[i]))} at t = {self.t[i]:g}" for i in (0, -1)
            )
            why = "no stationary law was found, so that exponents are no limit"
            yield f"    {why}: the mean of H goes from {began} to {ended}"
        if (pictures := self.pictures) is not None:
            yield f"    {pictures.points} states on one path of noise, which began a time t ago:"
            for i, t in enumerate(pictures.t):
                mean = with_interval(float(pictures.distance[i]), float(pictures.distance_half[i]))
                yield f"    t = {t:g}: mean distance {mean}, typical one {short(float(pictures.typical[i]))}"

    @classmethod
    def remarks_of_case(cls, readings: Sequence["Exponents"]) -> Iterator[str]:
        """Unit of exponents."""
        yield "exponents are per unit of time; the dimension is that of Kaplan and Yorke"


def kaplan_yorke(exponents: Array) -> Array:
    """j + (lambda_1 + ... + lambda_j) / |lambda_(j+1)| of exponents (m, ...), j the last with a sum of at least 0.

    NaN if an exponent is not finite.

    J. L. Kaplan, J. A. Yorke, Lecture Notes in Mathematics 730, 1979.
    """
    sums, zero = np.cumsum(exponents, axis=0), np.zeros_like(exponents[:1])
    below = np.concatenate((sums < 0.0, zero == 0.0))
    j = below.argmax(axis=0)[np.newaxis]
    reached = np.take_along_axis(np.concatenate((zero, sums)), j, axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        share = reached / np.abs(np.take_along_axis(np.concatenate((exponents, zero + np.inf)), j, axis=0))
    dimension: Array = np.where(
        np.isfinite(exponents).all(axis=0), (j + np.where(j == len(exponents), 0, share))[0], np.nan
    )
    return dimension


Record = Exponents
