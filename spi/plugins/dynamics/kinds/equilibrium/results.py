"""The records of long times."""

import math
from collections.abc import Iterator, Sequence
from statistics import NormalDist

import numpy as np

from spi.kinds.blocks import Acceptance, Solver
from spi.plugins.dynamics.statistics.correlation import WINDOW
from spi.printing.tables import Column, Table
from spi.printing.text import HEAVY, decimal, interval_text, power_of_two, short
from spi.statistics.estimators import few_carry
from spi.storage.records import INTERVAL, Order, in_standard_errors, student
from spi.storage.stored import WIDEST, Array, Claimed, Described, Stored, array, axis, derived, fact, nested

#: The panels of the figure: of functions, and all, those of Casimir functions and the uniform law first.
OF_FUNCTIONS = ("means", "histogram", "autocorrelation", "heat", "derived", "acceptance")
PANELS = ("growth", "law", "distance", *OF_FUNCTIONS)

#: Number of batches into which the time of a path after the burn-in is divided.
BATCHES = 16
#: Least number of values of which there are so many batches; of fewer there are 4, and of fewer than 8 there are 2.
FEW = 4 * BATCHES
#: Least number of paths whose standard error is that of independent paths; with fewer it is that of correlated values.
LEAST_PATHS = 8
#: Least number of integrated autocorrelation times that a path must have.
LONG_ENOUGH = 50
#: Two standard errors may differ by this factor, beyond their own uncertainty.
APART = 1.5
#: Fields whose standard errors are those of independent paths, and of jackknife groups of any number of paths.
_OF_PATHS, _OF_GROUPS = ("bias", "law_distance", "mean", "fraction"), ("correlation", "density")
#: The probability by chance of the difference between both halves of the time from which on there is a warning.
_SELDOM = 0.01


def batches_of(values: int) -> int:
    """The number of batches of so many values of a path."""
    return BATCHES if values >= FEW else 4 if values >= 8 else 2


class Law(Described):
    """The law of the states beside the exact stationary one, from the snapshots of all paths.

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

    @derived("h", "largest distance of a mean from the exact one, in standard errors", claim="at most")
    def mean_z(self) -> Array:
        """(S,) of all moments."""
        return np.abs(self.z).max(axis=1)


class Derived(Described):
    """Quantities that follow from means of functions."""

    quantities: tuple[str, ...] = axis("quantity", name="quantity", column="{}")
    formulas: tuple[str, ...] = fact("what the quantities are")
    value: Array = array("h quantity", "quantity that follows from means", name="derived", claim="equal")
    stderr: Array = array("h quantity", "standard error of the quantity", name="derived_stderr")


class Averages(Described):
    """Means of functions over the later part of the time and over all paths, and quantities by which to judge them."""

    functions: tuple[str, ...] = axis("function", name="function")
    texts: tuple[str, ...] = fact("what the functions are")
    temperature: float = fact("temperature of the case, inf without one", "energy", name="held_at")
    spacing: float = fact("time between two values along a path", "time")
    kept: int = fact("values of each path and function that count")
    average: Array = array("h function", "mean over time and paths", claim=Claimed("equal", expected="reference"))
    average_half: Array = array("h function", "half of the 95 % interval of the mean")
    stderr_paths: Array = array("h function", "standard error of the mean, from independent paths")
    stderr_tau: Array = array("h function", "standard error of the mean, from autocorrelations")
    stderr_batches: Array = array("h function", "standard error of the mean, from means over batches of time")
    tau: Array = array(
        "h function",
        "integrated autocorrelation time",
        "time",
        "1/2 spacing + sum of rho(s) spacing",
        claim="equal",
    )
    tau_stderr: Array = array("h function", "standard error of this time", "time")
    window: Array = array("h function", "lag at which that sum ends, 5 tau; NaN where none is known", "time")
    halves: Array = array(
        "h function",
        "mean of the second half of the time less that of the first, in standard errors",
        claim=Claimed("at most", absolute=True),
    )
    kurtosis: Array | None = array(
        "h function", "kurtosis of the means of paths; NaN of constants and of few paths", default=None
    )
    variance: Array = array("h function", "variance over time and paths")
    variance_stderr: Array = array("h function", "standard error of the variance")
    reference: Array = array("function", "known mean, or mean at the smallest step size; NaN without one")
    reference_stderr: Array = array("function", "standard or numerical error of the reference")
    reference_variance: Array = array("function", "exact variance; NaN where not known")
    quantities: Derived | None = nested(default=None)
    order: tuple[Order, ...] = array("function", "order in the step size of the bias of the mean")
    constant: Array = array("function", "C in bias = C h^p with the fitted order p; NaN where not fitted")
    lag: Array = axis("time between two values", "time")
    correlation: Array = array("h function lag", "autocorrelation", formula="Cov(f(y_t), f(y_(t+s))) / Var f")
    correlation_stderr: Array = array("h function lag", "standard error of the autocorrelation")
    cell_low: Array = array("h function", "lower end of the first cell of the histogram")
    cell_width: Array = array("h function", "width of a cell")
    density: Array = array("h function cell", "share of the values in the cell, by its width")
    density_stderr: Array = array("h function cell", "standard error of the density")
    density_exact: Array = array("h function cell", "the same of the exact law; NaN where not known")

    @property
    def stderr(self) -> Array:
        """(S, F) the standard error from which intervals are computed."""
        return np.where(np.isfinite(self.stderr_paths), self.stderr_paths, self.stderr_tau)

    @derived("h function", "mean less the reference", name="average_bias")
    def bias(self) -> Array:
        """(S, F) means less the reference."""
        return self.average - self.reference

    @property
    def bias_stderr(self) -> Array:
        """(S, F) its standard error, with that of the reference; 0 at the step size that is the reference itself."""
        return np.where(self.bias == 0, 0.0, np.hypot(self.stderr, self.reference_stderr))

    @property
    def is_constant(self) -> Array:
        """(F,) which functions are constant up to rounding at all step sizes, and have no autocorrelation time."""
        return np.isnan(self.tau).all(axis=0) & (self.variance >= 0).all(axis=0)

    @derived("h function", "bias in standard errors", claim=Claimed("at most", absolute=True, where="has_reference"))
    def deviation(self) -> Array:
        """(S, F) the bias in standard errors."""
        return in_standard_errors(self.bias, self.bias_stderr)

    @derived("h function", "whether there is a reference, which is not the mean itself")
    def has_reference(self) -> Array:
        """(S, F) bool."""
        return np.isfinite(self.reference) & (self.bias != 0)

    @property
    def factors(self) -> Array:
        """(F,) by which the variance is the response; NaN without a temperature."""
        return np.array([self.response(f)[1] for f in range(len(self.functions))], float)

    @derived("h function", "half the interval of the bias of the mean", name="average_bias_half")
    def bias_half(self) -> Array:
        """(S, F) by the factor of the interval of the mean."""
        with np.errstate(divide="ignore", invalid="ignore"):
            factor = np.where(self.stderr == 0, INTERVAL, self.average_half / self.stderr)
            return np.where(self.bias_stderr == 0, 0.0, factor * self.bias_stderr)

    @derived(
        "h function",
        "heat capacity Var H / T^2, or susceptibility Var f / T",
        claim=(
            Claimed("equal", "heat_capacity", expected="response_exact", where="of_energy"),
            Claimed("equal", "susceptibility", expected="response_exact", where="of_others"),
        ),
    )
    def responses(self) -> Array:
        """(S, F) NaN without a temperature."""
        return self.factors * self.variance

    @derived("h function", "standard error of the response")
    def responses_stderr(self) -> Array:
        """(S, F)."""
        return np.abs(self.factors) * self.variance_stderr

    @derived("function", "exact response")
    def response_exact(self) -> Array:
        """(F,) NaN where it is not known."""
        return self.factors * self.reference_variance

    @derived("function", "whether the response is a heat capacity")
    def of_energy(self) -> Array:
        """(F,) of the Hamiltonian, at a temperature."""
        return np.isfinite(self.factors) & [text == "H" for text in self.texts]

    @derived("function", "whether the response is a susceptibility")
    def of_others(self) -> Array:
        """(F,) of other functions, at a temperature."""
        return np.isfinite(self.factors) & ~self.of_energy

    def response(self, f: int) -> tuple[str, float]:
        """The response proportional to the variance, by name, and the factor; NaN without a temperature.

        It is the "heat capacity" Var H / T^2, or of another function f the "susceptibility" Var f / T.
        """
        name = "heat capacity" if self.texts[f] == "H" else "susceptibility"
        power = 2 if self.texts[f] == "H" else 1
        return name, 1 / self.temperature**power if np.isfinite(self.temperature) else np.nan

    def disagreement(self, samples: int) -> Array:
        """(S, F) the largest quotient of two of the standard errors, beyond twice its own uncertainty."""
        equal = ~np.isfinite(self.stderr_paths) & (samples >= LEAST_PATHS)
        batches = np.where(equal, 1, samples) * min(batches_of(self.kept), self.kept)
        with np.errstate(divide="ignore", invalid="ignore"):
            of_tau = self.tau_stderr / (2 * np.maximum(self.tau, 0.5 * self.spacing))
            of_paths = np.full_like(of_tau, 1 / np.sqrt(2 * max(samples - 1, 1)))
            of_batches = 1 / np.sqrt(2 * np.maximum(batches - 1, 1))
            each = np.log([self.stderr_paths, self.stderr_tau, self.stderr_batches])
            spread = np.array([of_paths, of_tau, of_batches])
            excess = [abs(each[i] - each[j]) - 2 * np.hypot(spread[i], spread[j]) for i, j in ((0, 1), (0, 2), (1, 2))]
            return np.exp(np.fmax.reduce(excess))


def _time_text(value: float, low: float, high: float) -> str:
    """``0.99 ± 0.14``, or ``≤ 1.4`` of a time whose interval reaches 0."""
    return f"≤ {short(high)}" if low <= 0.0 < high else interval_text(value, (low, high))


_WORST = Claimed("at most", infinite=True)


class Equilibrium(Stored):
    """Paths of one scheme over very many steps at several step sizes, from large to small.

    Errors of the Casimirs are C(y_n) / C(y_0) - 1, or absolute ones if C(y_0) = 0, after several numbers of steps.
    """

    headline = ("casimir_worst", "growth", "law_distance", "average")
    measures = (
        r"The bias of a mean is the mean of $f(y_n)$ over long paths less that under the stationary law; the growth of "
        r"a Casimir error is $p$ in $\mathrm{rms} = C n^p$ after $n$ steps."
    )
    tables = (
        Table(
            "h casimir",
            [
                Column("nonfinite", "di-\nverged", red=0),
                Column("casimir_rms", "rms error\nat the end"),
                Column("casimir_worst", "worst"),
                Column("growth", "growth of rms,\nexponent (95 %)", form=".2f", interval="[]", missing="not fitted"),
                Column("bias", "bias/step", interval=""),
                Column("bias_deviation", "in std.\nerrors", form=decimal),
            ],
        ),
        Table(
            "h",
            [
                Column("law_distance", "distance of the\nlaw of {} (95 %)", over="variable", among=("y3", "H")),
                Column("mean_z", "largest |z|\nof the means", form=".1f", missing="not finite"),
                Column(lambda one, _: one.law and one.law.farthest, "of"),
            ],
            title="stationary law",
        ),
        Table(
            "function h",
            [
                Column("average", "mean (95 %)"),
                Column("average_bias", "bias (95 %)"),
                Column("deviation", "in std.\nerrors", form=decimal),
                Column(lambda one, _: one.times, "autocor-\nrelation time"),
                Column("responses", "heat capacity or\nsusceptibility (95 %)"),
            ],
            title="means over time",
        ),
        Table("quantity h", [Column("derived", "value (95 %)", form=".5g")], title="quantities that follow"),
    )
    row_axes, row_columns, row_last = ("h", "n"), ("casimir", "moment", "variable", "function"), ("n",)

    h: Array = axis("step size", "time")
    n: Array = axis("number of steps")
    casimir_mean: Array = array("h n casimir", "mean error of the Casimir over the paths")
    casimir_rms: Array = array("h n casimir", "root mean square error of the Casimir")
    casimir_worst: Array = array("h n casimir", "largest modulus of the error of the Casimir", claim=_WORST)
    casimir_one: Array = array("h n casimir", "error of the Casimir on path 0")
    nonfinite: Array = array("h", "diverged paths (NaN or infinity)", claim="at most")
    growth: Array = array(
        "h casimir",
        "growth of the error; NaN where not fitted",
        formula="p in rms = C n^p",
        claim=Claimed("equal", widest=WIDEST),
    )
    growth_low: Array = array("h casimir", "lower end of the 95 % interval of the growth")
    growth_high: Array = array("h casimir", "upper end of the 95 % interval of the growth")
    bias: Array = array("h casimir", "mean error of the Casimir at the end, per step", claim="equal")
    bias_stderr: Array = array("h casimir", "standard error of the bias")
    rounding: Array | None = array(
        "h casimir", "largest modulus of the error at the end where that is rounding; NaN elsewhere", default=None
    )
    solver: Solver | None = array("h", "what an implicit scheme reports", default=None)
    acceptance: Acceptance | None = array("h", "how often flows were accepted", default=None)
    largest_angle: Array | None = array("h", "largest angle of a rotation, where any exceeds pi/4", "rad", default=None)
    law: Law | None = None  # where the stationary law is known
    averages: Averages | None = None  # where functions are given
    samples: int = fact("number of paths", column=True)
    steps_each: int = fact("number of steps of each path, of functions at the largest step size")
    snapshots: int = fact("snapshots of each path that count for the law")
    accuracy: float | None = fact("bias and standard error that are wanted", default=None)
    panels: tuple[str, ...] = fact("what the figure of the case shows")

    @derived("h casimir", "mean error of the Casimir in standard errors")
    def bias_deviation(self) -> Array:
        """(S, C) the bias by its standard error; NaN where that is 0, and where the errors are rounding."""
        known = self.bias_stderr > 0
        known = known if self.rounding is None else known & np.isnan(self.rounding)
        return in_standard_errors(self.bias, np.where(known, self.bias_stderr, np.nan))

    @property
    def times(self) -> Array | None:
        """(F, S) the autocorrelation times with their intervals, as text; where these begin at 0, the ends alone."""
        if (found := self.estimate("tau")) is None:
            return None
        each = zip(found.value.T.ravel(), found.low.T.ravel(), found.high.T.ravel(), strict=True)
        return np.array([_time_text(*map(float, time)) for time in each]).reshape(found.value.shape[::-1])

    def freedom(self, name: str) -> float:
        """That of the paths for errors of Casimirs and the law, else of the groups of paths, or of few paths batches.

        Autocorrelations and histograms have those of the groups of any number of paths.
        """
        if name in _OF_PATHS:
            return self.samples - 1
        if self.averages is None or self.samples >= LEAST_PATHS or name in _OF_GROUPS:
            return super().freedom(name)
        return batches_of(self.averages.kept) - 1

    @property
    def largest_finite(self) -> int | None:
        """The number of the largest step size at which all paths are finite; None if there is none."""
        finite = np.flatnonzero(self.nonfinite == 0)
        return int(finite[np.argmax(self.h[finite])]) if len(finite) else None

    def remarks(self) -> Iterator[str]:
        """Reasons to doubt the errors of the means, orders of their biases, and what to run for a wanted accuracy."""
        if (averages := self.averages) is None:
            return
        for f in np.flatnonzero(averages.is_constant).tolist():
            spread = short(float(np.sqrt(averages.variance[:, f].max())), ".0e")
            yield f"{self.about.label}: {averages.functions[f]} is constant up to rounding ({spread})"
        yield from (f"{self.about.label}, {line}" for line in _warnings(self, averages))
        for f, name in enumerate(averages.functions):
            if math.isfinite((order := averages.order[f]).order):
                law = f"{averages.constant[f]:.2g} h^{order.order:.2f}"
                yield f"{self.about.label}: bias of {name} {law}, order in [{order.low:.2f}, {order.high:.2f}]"
        yield from planned(self, averages)

    @classmethod
    def answers(cls, readings: Sequence["Equilibrium"]) -> Iterator[str]:
        """For each scheme the largest step size with which all means have the accuracy that is wanted."""
        if (wanted := readings[0].accuracy) is None:
            return
        each = []
        for one, averages in ((one, one.averages) for one in readings if one.averages):
            steps = [(step_for(one, averages, f, wanted), name) for f, name in enumerate(averages.functions)]
            (step, why), name = min(steps)
            each.append(f"{short(step)} with {one.about.label} ({name}: {why})")
        if each:
            yield f"Largest h for means to {short(wanted, '.3g')}: {'; '.join(each)}."

    @classmethod
    def remarks_of_case(cls, readings: Sequence["Equilibrium"]) -> Iterator[str]:
        """Paths, times, the time of averaging, and how large |z| is by chance."""
        first, averages = readings[0], readings[0].averages
        snapshots = f", {first.snapshots} snapshots of each path" if first.snapshots else ""
        largest = f" at h = {first.h[0]:g}" if averages else ""
        yield f"{first.samples} paths of {_count(first.steps_each)} steps each{largest}{snapshots}"
        if first.law:
            count = len(first.law.moments)
            bound = f"is below {chance(count):.1f} in 95 % of cases"
            yield f"by chance the largest |z| of {count} independent means {bound}"
        if averages:
            values = f"{averages.kept} values of each path {averages.spacing:g} apart"
            yield f"means over the last {averages.kept * averages.spacing:.6g} of the time, {values}"
            named = zip(averages.functions, averages.texts, strict=True)
            yield from (f"{name}: {text}" for name, text in named if name != text)


Record = Equilibrium


# ---------------------------------------------------------------------------------------------------------------------
# Lines under the tables: paths, warnings about means, orders of their biases, what to run for a wanted accuracy.
# ---------------------------------------------------------------------------------------------------------------------


def chance(count: int) -> float:
    """The bound of the largest |z| of `count` independent standard normals in 95 % of cases."""
    return NormalDist().inv_cdf(0.5 + 0.5 * 0.95 ** (1 / count))


def _count(steps: int) -> str:
    """A number of steps, powers of two also as such."""
    return f"{power_of_two(steps)} = {steps:,}" if steps > 1 and math.frexp(steps)[0] == 0.5 else f"{steps:,}"


def _warnings(reading: Equilibrium, averages: Averages) -> Iterator[str]:
    """A line for each reason to doubt the errors of the means, about the worst step size and function."""
    count, paths = averages.average.size, reading.samples
    kurtosis = np.zeros_like(averages.tau) if averages.kurtosis is None else averages.kurtosis
    lengths = averages.kept * averages.spacing / np.maximum(averages.tau, 1e-300)
    likely = float(student(max(paths, BATCHES) - 1, (1 - _SELDOM) ** (1 / count)))
    burnt_in = "the second half of the kept time differs from the first by {} standard errors of that"
    lasting = np.isfinite(averages.tau) & ~np.isfinite(averages.window)
    longer = lasting & (lengths >= LONG_ENOUGH) & (len(averages.lag) > WINDOW)  # else there is none
    for values, bad, doubt in (
        (np.abs(averages.halves), likely, f"burn-in: {burnt_in}; give a longer burn_in and final_time"),
        (-lengths, -LONG_ENOUGH, f"a path has {{}} autocorrelation times, fewer than {LONG_ENOUGH}; run longer"),
        (longer * averages.tau, 0.0, "correlations last longer than they are recorded; take a larger spacing"),
        (
            averages.disagreement(paths),
            APART,
            "standard errors of the mean from paths, autocorrelations and batches differ by a factor of {} more than "
            "by chance; run longer",
        ),
        (few_carry(np.nan_to_num(kurtosis), paths) * 1.0, 0.0, HEAVY),
    ):
        worst = np.where((values > bad) & np.isfinite(values), values, -np.inf)
        if np.isfinite(worst).any():
            i, f = np.unravel_index(worst.argmax(), worst.shape)
            yield f"{averages.functions[f]}, h = {reading.h[i]:g}: {doubt.format(decimal(abs(values[i, f])))}"


def planned(reading: Equilibrium, averages: Averages) -> Iterator[str]:
    """For each function the step size and time for a wanted accuracy.

    A mean over the time t of all paths has the variance 2 tau Var / t; the bias is C h^p, where that was fitted.
    """
    if (wanted := reading.accuracy) is None:
        return
    for f, name in enumerate(averages.functions):
        tau, variance = averages.tau[-1, f], averages.variance[-1, f]
        if not 0 < tau * variance < math.inf:  # true for NaN
            continue
        step, why = step_for(reading, averages, f, wanted)
        each = max(2 * tau * variance / wanted**2 / reading.samples, LONG_ENOUGH * tau)
        length = f"{reading.samples} paths of time {short(float(each))} behind the burn-in, {short(each / step)} steps"
        which = f"{reading.about.label}, {name}: h = {short(step)} ({why})"
        yield f"{which} and {length}, for an accuracy of {short(wanted)}"


def step_for(reading: Equilibrium, averages: Averages, f: int, wanted: float) -> tuple[float, str]:
    """A step size at which the bias of a function is at most `wanted`, and the reason.

    It follows from the fitted bias, or is the largest one at which mean and reference are that close, or the smallest.
    """
    constant, order = averages.constant[f], averages.order[f].order
    if np.isfinite(constant) and np.isfinite(order) and order > 0 and constant != 0:
        return float((wanted / abs(constant)) ** (1 / order)), "by the fitted bias"
    near = np.abs(averages.bias[:, f]) + averages.bias_half[:, f] <= wanted  # false for NaN
    if near.any():
        return float(reading.h[near].max()), "no bias is seen there"
    return float(reading.h[-1]), "the smallest here, its bias is not known"
