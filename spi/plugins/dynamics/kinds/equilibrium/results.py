"""The record of means over time."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from spi.plugins.dynamics.kinds.long_paths.results import CASIMIRS, LongRecord, count, kept_casimirs
from spi.plugins.dynamics.statistics.correlation import WINDOW
from spi.printing.tables import Column, Table
from spi.printing.text import HEAVY, decimal, interval_text, short
from spi.statistics.estimators import few_carry
from spi.storage.records import INTERVAL, Order, in_standard_errors, student
from spi.storage.stored import CLAIMED_ORDER, Array, Claimed, Described, array, axis, derived, fact, nested

#: The panels of the figure.
PANELS = ("means", "histogram", "autocorrelation", "heat", "derived", "acceptance", "growth")

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
_OF_PATHS, _OF_GROUPS = ("bias",), ("correlation", "density")
#: The probability by chance of the difference between both halves of the time from which on there is a warning.
_SELDOM = 0.01


def batches_of(values: int) -> int:
    """Number of batches of so many values of a path."""
    return BATCHES if values >= FEW else 4 if values >= 8 else 2


_NAMED = Claimed("equal", is_named=True)


class DerivedQuantities(Described):
    """Quantities that follow from means of functions."""

    quantities: tuple[str, ...] = axis("quantity", name="quantity", column="{}")
    formulas: tuple[str, ...] = fact("what the quantities are")
    value: Array = array("h quantity", "quantity that follows from means", name="derived", claim=_NAMED)
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
    quantities: DerivedQuantities | None = nested(default=None)
    order: tuple[Order, ...] = array("function", "order in the step size of the bias of the mean", claim=CLAIMED_ORDER)
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

    @derived("h function", "mean less the reference", name="average_bias", column="average_bias")
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

    @derived(
        "h function",
        "bias in standard errors",
        column="deviation",
        claim=Claimed("at most", absolute=True, where="has_reference"),
    )
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

    @derived("h function cell", "middle of the cell", column="cell_middle")
    def cell_middle(self) -> Array:
        """(S, F, cells) values of the functions."""
        places = np.arange(self.density.shape[-1]) + 0.5
        return self.cell_low[..., np.newaxis] + self.cell_width[..., np.newaxis] * places

    @derived("h function", "half the interval of the bias of the mean", name="average_bias_half")
    def bias_half(self) -> Array:
        """(S, F) by the factor of the interval of the mean."""
        with np.errstate(divide="ignore", invalid="ignore"):
            factor = np.where(self.stderr == 0, INTERVAL, self.average_half / self.stderr)
            return np.where(self.bias_stderr == 0, 0.0, factor * self.bias_stderr)

    @derived(
        "h function",
        "heat capacity Var H / T^2, or susceptibility Var f / T",
        column="responses",
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

    @derived("function", "exact response", column="response_exact")
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
        """Response proportional to the variance, by name, and the factor; NaN without a temperature.

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


class Equilibrium(LongRecord):
    """Means over time of functions along the paths of one scheme, at several step sizes."""

    headline = ("derived", "average", "casimir_worst", "growth")
    measures = (
        r"The bias of a mean is the mean of $f(y_n)$ over long paths less that under the stationary law; the growth of "
        r"a Casimir error is $p$ in $\mathrm{rms} = C n^p$ after $n$ steps."
    )
    tables = (
        Table("quantity h", [Column("derived", "value (95 %)", form=".5g")], title="quantities that follow"),
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
        CASIMIRS._replace(title="errors of the Casimir functions", instead=kept_casimirs),
    )
    row_axes = ("h", "function")

    averages: Averages
    accuracy: float | None = fact("bias and standard error that are wanted", default=None)

    @property
    def times(self) -> Array | None:
        """(F, S) the autocorrelation times with their intervals, as text; where these begin at 0, the ends alone."""
        if (found := self.estimate("tau")) is None:
            return None
        each = zip(found.value.T.ravel(), found.low.T.ravel(), found.high.T.ravel(), strict=True)
        return np.array([_time_text(*map(float, time)) for time in each]).reshape(found.value.shape[::-1])

    def freedom(self, name: str) -> float:
        """That of the paths for errors of Casimirs, else of the groups of paths, or of few paths batches.

        Autocorrelations and histograms have those of the groups of any number of paths.
        """
        if name in _OF_PATHS:
            return self.samples - 1
        if self.samples >= LEAST_PATHS or name in _OF_GROUPS:
            return super().freedom(name)
        return batches_of(self.averages.kept) - 1

    def remarks(self) -> Iterator[str]:
        """Reasons to doubt the errors of the means, orders of their biases, and what to run for a wanted accuracy."""
        averages = self.averages
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
        for one, averages in ((one, one.averages) for one in readings):
            steps = [(step_for(one, averages, f, wanted), name) for f, name in enumerate(averages.functions)]
            (step, why), name = min(steps)
            each.append(f"{short(step)} with {one.about.label} ({name}: {why})")
        if each:
            yield f"Largest h for means to {short(wanted, '.3g')}: {'; '.join(each)}."

    @classmethod
    def remarks_of_case(cls, readings: Sequence["Equilibrium"]) -> Iterator[str]:
        """Paths, times, and the time of averaging."""
        first, averages = readings[0], readings[0].averages
        yield f"{first.samples} paths of {count(first.steps_each)} steps each at h = {first.h[0]:g}"
        values = f"{averages.kept} values of each path {averages.spacing:g} apart"
        yield f"means over the last {averages.kept * averages.spacing:.6g} of the time, {values}"
        named = zip(averages.functions, averages.texts, strict=True)
        yield from (f"{name}: {text}" for name, text in named if name != text)


Record = Equilibrium


# ---------------------------------------------------------------------------------------------------------------------
# Lines under the tables: paths, warnings about means, orders of their biases, what to run for a wanted accuracy.
# ---------------------------------------------------------------------------------------------------------------------


def _warnings(reading: Equilibrium, averages: Averages) -> Iterator[str]:
    """A line for each reason to doubt the errors of the means, about the worst step size and function."""
    size, paths = averages.average.size, reading.samples
    kurtosis = np.zeros_like(averages.tau) if averages.kurtosis is None else averages.kurtosis
    lengths = averages.kept * averages.spacing / np.maximum(averages.tau, 1e-300)
    likely = float(student(max(paths, BATCHES) - 1, (1 - _SELDOM) ** (1 / size)))
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
