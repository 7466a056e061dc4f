"""The records of long times."""

from collections.abc import Iterable, Iterator
from typing import Annotated

import numpy as np

from spi.kinds.blocks import Acceptance, Solver
from spi.statistics.claims import WIDEST, Quantity, at_steps, each_step, lost_is_infinite, order
from spi.storage.records import INTERVAL, Description, Order, in_standard_errors
from spi.storage.stored import Array, Described, Stored, array, axis, fact

#: The panels of the figure: of functions, and all, those of Casimir functions and the uniform law first.
OF_FUNCTIONS = ("means", "histogram", "autocorrelation", "heat", "acceptance")
PANELS = ("growth", "law", "distance", "moments", *OF_FUNCTIONS)

#: Number of batches into which the time of a path after the burn-in is divided.
BATCHES = 16
#: Least number of paths whose standard error is that of independent paths; with fewer it is that of correlated values.
LEAST_PATHS = 8
#: Least number of integrated autocorrelation times that a path must have.
LONG_ENOUGH = 50
#: Two standard errors may differ by this factor, beyond their own uncertainty.
APART = 1.5


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
        return in_standard_errors(self.mean - self.mean_exact, self.mean_stderr)


class Averages(Described):
    """Means of functions over the later part of the time and over all paths, and quantities by which to judge them."""

    functions: Annotated[tuple[str, ...], axis("function", name="function")]
    texts: Annotated[tuple[str, ...], fact("what the functions are")]
    temperature: Annotated[float, fact("temperature of the case, inf without one", "energy", name="held_at")]
    spacing: Annotated[float, fact("time between two values along a path", "time")]
    kept: Annotated[int, fact("values of each path and function that count")]
    average: Annotated[Array, array("h function", "mean over time and paths")]
    average_half: Annotated[Array, array("h function", "half of the 95 % interval of the mean")]
    stderr_paths: Annotated[Array, array("h function", "standard error of the mean, from independent paths")]
    stderr_tau: Annotated[Array, array("h function", "standard error of the mean, from autocorrelations")]
    stderr_batches: Annotated[Array, array("h function", "standard error of the mean, from means over batches of time")]
    tau: Annotated[
        Array, array("h function", "integrated autocorrelation time", "time", "1/2 spacing + sum of rho(s) spacing")
    ]
    tau_stderr: Annotated[Array, array("h function", "standard error of this time", "time")]
    window: Annotated[Array, array("h function", "lag at which that sum ends, 5 tau; NaN where none is known", "time")]
    halves: Annotated[
        Array,
        array("h function", "mean of the second half of the time less that of the first, in standard errors"),
    ]
    variance: Annotated[Array, array("h function", "variance over time and paths")]
    variance_stderr: Annotated[Array, array("h function", "standard error of the variance")]
    reference: Annotated[Array, array("function", "known mean, or mean at the smallest step size; NaN without one")]
    reference_stderr: Annotated[Array, array("function", "standard or numerical error of the reference")]
    reference_variance: Annotated[Array, array("function", "exact variance; NaN where not known")]
    order: Annotated[tuple[Order, ...], array("function", "order in the step size of the bias of the mean")]
    constant: Annotated[Array, array("function", "C in bias = C h^p with the fitted order p; NaN where not fitted")]
    lag: Annotated[Array, axis("time between two values", "time")]
    correlation: Annotated[Array, array("h function lag", "autocorrelation", formula="Cov(f(y_t), f(y_(t+s))) / Var f")]
    correlation_stderr: Annotated[Array, array("h function lag", "standard error of the autocorrelation")]
    cell_low: Annotated[Array, array("h function", "lower end of the first cell of the histogram")]
    cell_width: Annotated[Array, array("h function", "width of a cell")]
    density: Annotated[Array, array("h function cell", "share of the values in the cell, by its width")]
    density_stderr: Annotated[Array, array("h function cell", "standard error of the density")]
    density_exact: Annotated[Array, array("h function cell", "the same of the exact law; NaN where not known")]

    @property
    def stderr(self) -> np.ndarray:
        """(S, F) the standard error from which intervals are computed."""
        return np.where(np.isfinite(self.stderr_paths), self.stderr_paths, self.stderr_tau)

    @property
    def bias(self) -> np.ndarray:
        """(S, F) means less the reference."""
        return self.average - self.reference

    @property
    def bias_stderr(self) -> np.ndarray:
        """(S, F) its standard error, with that of the reference; 0 at the step size that is the reference itself."""
        return np.where(self.bias == 0, 0.0, np.hypot(self.stderr, self.reference_stderr))

    @property
    def deviation(self) -> np.ndarray:
        """(S, F) the bias in standard errors."""
        return in_standard_errors(self.bias, self.bias_stderr)

    def response(self, f: int) -> tuple[str, float]:
        """The response proportional to the variance, by name, and the factor; NaN without a temperature.

        It is the "heat capacity" Var H / T^2, or of another function f the "susceptibility" Var f / T.
        """
        name = "heat capacity" if self.texts[f] == "H" else "susceptibility"
        power = 2 if self.texts[f] == "H" else 1
        return name, 1 / self.temperature**power if np.isfinite(self.temperature) else np.nan

    def disagreement(self, samples: int) -> np.ndarray:
        """(S, F) the largest quotient of two of the standard errors, beyond twice its own uncertainty."""
        count = samples * self.kept
        with np.errstate(divide="ignore", invalid="ignore"):
            of_tau = self.tau_stderr / (2 * self.tau)
            of_paths = np.full_like(of_tau, 1 / np.sqrt(2 * max(samples - 1, 1)))
            of_batches = np.full_like(of_tau, 1 / np.sqrt(2 * max(min(count, samples * BATCHES) - 1, 1)))
            each = np.log([self.stderr_paths, self.stderr_tau, self.stderr_batches])
            spread = np.array([of_paths, of_tau, of_batches])
            excess = [abs(each[i] - each[j]) - 2 * np.hypot(spread[i], spread[j]) for i, j in ((0, 1), (0, 2), (1, 2))]
            return np.exp(np.fmax.reduce(excess))


class Equilibrium(Stored):
    """Paths of one scheme over very many steps at several step sizes, from large to small.

    Errors of the Casimirs are C(y_n) / C(y_0) - 1, or absolute ones if C(y_0) = 0, after several numbers of steps.
    """

    headline = ("casimir_worst", "growth", "law_distance", "average")

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
    averages: Averages | None = None  # where functions are given
    samples: Annotated[int, fact("number of paths", column=True)]
    steps_each: Annotated[int, fact("number of steps of each path, of functions at the largest step size")]
    snapshots: Annotated[int, fact("snapshots of each path that count for the law")]
    accuracy: Annotated[float | None, fact("bias and standard error that are wanted")] = None
    panels: Annotated[tuple[str, ...], fact("what the figure of the case shows")]

    @property
    def casimir_count(self) -> int:
        """The number of Casimir functions."""
        return self.casimir_rms.shape[2]

    @property
    def largest_finite(self) -> int | None:
        """The number of the largest step size at which all paths are finite; None if there is none."""
        finite = np.flatnonzero(self.nonfinite == 0)
        return int(finite[np.argmax(self.h[finite])]) if len(finite) else None


def with_laws(readings: Iterable[Equilibrium]) -> Iterator[tuple[Equilibrium, Law]]:
    """The results with a law, each with it."""
    return ((reading, reading.law) for reading in readings if reading.law)


def with_averages(readings: Iterable[Equilibrium]) -> Iterator[tuple[Equilibrium, Averages]]:
    """The results with means of functions, each with these."""
    return ((reading, reading.averages) for reading in readings if reading.averages)


Record = Equilibrium


# ---------------------------------------------------------------------------------------------------------------------
# Quantities of long times that a spec may expect.
# ---------------------------------------------------------------------------------------------------------------------


def quantities(readings: Iterable[Equilibrium]) -> Iterator[Quantity]:
    """At each step size the growth of errors of the Casimirs, their bias per step, the worst, and diverged paths.

    Where the stationary law is known, the distance from it in each variable and the largest |z| of the means as well;
    of functions their means, and the distances of these from their references.
    """
    for reading in readings:
        for c in range(reading.casimir_count):
            yield from _growth(reading, c)
            yield from each_step("bias", reading.about, reading.h, reading.bias[:, c], reading.bias_stderr[:, c])
            worst = lost_is_infinite(reading.casimir_worst[:, :, c].max(axis=1))
            yield from each_step("casimir_worst", reading.about, reading.h, worst)
        if reading.law:
            yield from _law(reading, reading.law)
        if reading.averages:
            yield from _averages(reading, reading.averages)
        yield from each_step("nonfinite", reading.about, reading.h, reading.nonfinite)


def _growth(reading: Equilibrium, c: int) -> Iterator[Quantity]:
    ends = (values[:, c].tolist() for values in (reading.growth, reading.growth_low, reading.growth_high))
    for h, value, low, high in zip(reading.h.tolist(), *ends, strict=True):
        yield Quantity("growth", reading.about, value, low, high, h=h, widest=WIDEST)


def _law(reading: Equilibrium, law: Law) -> Iterator[Quantity]:
    for distance, stderr in zip(law.distance.T, law.distance_stderr.T, strict=True):
        yield from each_step("law_distance", reading.about, reading.h, distance, stderr)
    yield from each_step("mean_z", reading.about, reading.h, np.abs(law.z).max(axis=1))


def _averages(reading: Equilibrium, averages: Averages) -> Iterator[Quantity]:
    for f, name in enumerate(averages.functions):
        at, (response, factor) = (reading.about, reading.h, name), averages.response(f)
        yield from of_function(
            "average", *at, averages.average[:, f], averages.average_half[:, f], averages.reference[f]
        )
        yield from of_function("tau", *at, averages.tau[:, f], INTERVAL * averages.tau_stderr[:, f])
        yield from of_function("halves", *at, np.abs(averages.halves[:, f]))
        if np.isfinite(averages.reference[f]):
            own = averages.bias[:, f] == 0  # where the reference is the mean itself, which is no deviation
            steps, values = reading.h[~own], np.abs(averages.deviation[~own, f])
            yield from of_function("deviation", reading.about, steps, name, values)
        if np.isfinite(factor):
            values, half = factor * averages.variance[:, f], INTERVAL * abs(factor) * averages.variance_stderr[:, f]
            yield from of_function(
                response.replace(" ", "_"), *at, values, half, factor * averages.reference_variance[f]
            )
        yield order(reading.about, averages.order[f], function=name)


def of_function(
    name: str,
    about: Description,
    h: np.ndarray,
    function: str,
    values: np.ndarray,
    halves: np.ndarray | float = 0.0,
    expected: float = np.nan,
) -> Iterator[Quantity]:
    """A quantity of a function at each step size in `h` (S,), with half the widths of intervals."""
    for quantity in at_steps(name, about, h, values, np.broadcast_to(halves, len(h)), function):
        yield quantity._replace(expected=float(expected))
