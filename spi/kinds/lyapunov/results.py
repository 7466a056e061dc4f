"""What is stored of Lyapunov exponents."""

from typing import Annotated

import numpy as np

from spi.storage.stored import Array, Described, Stored, array, axis, fact, nested

#: What a figure can show.
PANELS = ("lyapunov", "pullback")

#: The sides of a picture of a sphere.
SPHERE_SIDES = "Mollweide y", "Mollweide x"


class Pictures(Described):
    """Many states on one path of noise that ends now: where they are, and how far from each other.

    A picture at t is of the noise from -t to 0, the same for all t as far as they go, so that pictures converge.
    Its cells have equal areas; on a sphere they are those of Mollweide's projection, whose area is 4 pi.
    """

    t: Annotated[Array, axis("how long the noise has acted", "time", name="pullback_t")]
    sides: Annotated[tuple[str, ...], axis("what the cells divide: their rows and their columns", name="side")]
    low: Annotated[Array, array("pullback_t side", "lower end of the first cell")]
    width: Annotated[Array, array("pullback_t side", "width of a cell")]
    count: Annotated[Array, array("pullback_t row column", "number of states in the cell")]
    outside: Annotated[Array, array("pullback_t", "share of the states outside of all cells")]
    distance: Annotated[Array, array("pullback_t", "mean distance of two states", formula="E |y - z|")]
    distance_stderr: Annotated[Array, array("pullback_t", "standard error of that, for this path of noise")]
    typical: Annotated[Array, array("pullback_t", "typical distance of two states", formula="exp E log |y - z|")]
    points: Annotated[int, fact("number of states")]

    @property
    def is_sphere(self) -> bool:
        """Whether the cells are those of a sphere."""
        return self.sides == SPHERE_SIDES

    @property
    def occupied(self) -> np.ndarray:
        """(times,) the share of the cells in which there are states, on a sphere of those that touch it."""
        number: int = self.count[0].size
        share: np.ndarray = (self.count > 0).sum(axis=(1, 2)) / (number * (np.pi / 4 if self.is_sphere else 1.0))
        return share

    @property
    def density(self) -> np.ndarray:
        """(times, rows, columns) share of the states in the cell by its area: on a sphere per steradian."""
        found: np.ndarray = self.count / (self.points * self.width.prod(axis=1)[:, np.newaxis, np.newaxis])
        return found


class Exponents(Stored):
    """Lyapunov exponents on the Casimir surface, averaged from the warm-up to several times and over the paths."""

    number: Annotated[Array, axis("number of the exponent, the largest first")]
    t: Annotated[Array, axis("time until which is averaged", "time")]
    exponent: Annotated[Array, array("number t", "Lyapunov exponent", "1/time", formula="E log R_kk / (t - warm_up)")]
    exponent_stderr: Annotated[Array, array("number t", "standard error of the exponent", "1/time")]
    total: Annotated[Array, array("t", "sum of the exponents: mean divergence of the flow", "1/time")]
    total_stderr: Annotated[Array, array("t", "standard error of the sum", "1/time")]
    total_known: Annotated[
        float | None,
        fact("what the sum is of the equation", "1/time"),
    ] = None
    dimension_stderr: Annotated[
        float | None, fact("standard error of the Lyapunov dimension, where exponents suffice for it")
    ] = None
    change: Annotated[float, fact("largest factor, or its inverse, by which a vector changed before it was scaled")]
    nonfinite: Annotated[int, fact("diverged paths (NaN or infinity)")]
    step: Annotated[float, fact("step size", "time")]
    samples: Annotated[int, fact("number of paths", column=True)]
    ns_per_step: Annotated[float, fact("time of a step and path, that of its near paths included", "ns")]
    panels: Annotated[tuple[str, ...], fact("what the figure of the case shows")] = PANELS
    pictures: Annotated[Pictures | None, nested(prefix="pullback_")] = None

    @property
    def dimension(self) -> float:
        """The Lyapunov dimension at the last time, see :func:`kaplan_yorke`."""
        return float(kaplan_yorke(self.exponent[:, -1]))


def kaplan_yorke(exponents: np.ndarray) -> np.ndarray:
    """j + (lambda_1 + ... + lambda_j) / |lambda_(j+1)| of exponents (m, ...), j the last with a sum of at least 0.

    J. L. Kaplan, J. A. Yorke, Lecture Notes in Mathematics 730, 1979.
    """
    sums, zero = np.cumsum(exponents, axis=0), np.zeros_like(exponents[:1])
    below = np.concatenate((sums < 0.0, zero == 0.0))
    j = below.argmax(axis=0)[np.newaxis]
    reached = np.take_along_axis(np.concatenate((zero, sums)), j, axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        share = reached / np.abs(np.take_along_axis(np.concatenate((exponents, zero + np.inf)), j, axis=0))
    found: np.ndarray = (j + np.where(j == len(exponents), 0.0, share))[0]
    return found


Record = Exponents
