"""Record of statistics."""

from collections.abc import Iterator, Sequence

import numpy as np

from spi.kinds.blocks import Acceptance
from spi.plugins.dynamics.kinds.maps import DensityMap
from spi.printing.tables import Column, Table
from spi.printing.text import HEAVY, decimal, interval_text, joined, short
from spi.statistics.claims import lost_among
from spi.statistics.estimators import few_carry
from spi.storage.records import in_standard_errors
from spi.storage.stored import DIVERGED, Array, Claimed, Described, Estimate, Stored, array, axis, derived, fact, nested

#: What a figure can show: of each function its mean, ..., and behind them matrices of correlations, and maps.
OF_LATTICES = ("structure", "spreading")
OF_TIMES = ("time_correlation", "integral", "spectrum", *OF_LATTICES)
PANELS = ("mean", "difference", "histogram", "variance", "autocorrelation", "correlations", "maps", *OF_TIMES)


#: Of fewer groups of paths there is no standard error.
LEAST_GROUPS = 8

_MOST_TIMES, _MOST_WAVE_VECTORS = 6, 17  # that a table shows


_KNOWN = Claimed("equal", lost="lost")
_MEAN = _KNOWN._replace(expected="reference", symbol=r"\mathrm{E}\,")
_VARIANCE = _KNOWN._replace(symbol=r"\mathrm{Var}\,")


class Quantiles(Described):
    """Quantiles of the paths whose value is finite, from counts in bins that suit the law of the first paths."""

    level: Array = axis("probability of the quantile", column="{:g}-quantile")
    quantile: Array = array("function t level", "quantile", claim=_KNOWN._replace(ends=".4g"))
    quantile_low: Array = array("function t level", "lower end of its 95 % interval, the bin included")
    quantile_high: Array = array("function t level", "upper end of its 95 % interval, the bin included")


class Histogram(Described):
    """Densities in bins of equal width; what lies outside of all of them is counted."""

    bin_low: Array = array("function t", "lower end of the first bin")
    bin_width: Array = array("function t", "width of a bin")
    density: Array = array("function t bin", "density, 1 / (samples width) of each path in the bin")
    density_stderr: Array = array("function t bin", "standard error of the density")
    outside: Array = array("function t", "share of the paths outside of all bins, or not finite")

    @derived("function t bin", "middle of the bin", column="bin_middle")
    def bin_middle(self) -> Array:
        """(F, T, bins) values of the functions."""
        places = np.arange(self.density.shape[-1]) + 0.5
        return self.bin_low[..., np.newaxis] + self.bin_width[..., np.newaxis] * places


class Passages(Described):
    """First times at which conditions are met, up to the last time; NaN for other functions, and of two conditions."""

    time: Array = array("function", "mean of the first time, the last time where it has not come", "time")
    time_stderr: Array = array("function", "standard error of the mean of the first time", "time")
    time_half: Array | None = array(
        "function",
        "half the interval of that mean, with what may be left of the time between looks",
        "time",
        default=None,
    )
    left: Array | None = array("function t", "what may be left of the time between looks in a share", default=None)
    between: float | None = fact("time between two looks at a path", "time", default=None)
    from_t: Array | None = array("until_t", "beginning of an interval of first times", "time", default=None)
    until_t: Array | None = axis("end of an interval of first times", "time", name="until_t", default=None)
    density: Array | None = array("function until_t", "density of the first time in the interval", default=None)
    density_stderr: Array | None = array("function until_t", "standard error of this density", default=None)


class Structure(Described):
    """Correlations of the sites of a lattice in space and time, by wave vectors q; s_q = sum_j exp(-i q . x_j) s_j."""

    q: Array = axis("length of the path of wave vectors, in units of reciprocal vectors", name="q")
    wave_vector: Array = array("q vector", "wave vector, in units of reciprocal vectors")
    mode: Array = array("q lag", "real part of the correlation of a mode", formula="E s_q(s)^* . s_q(s + t) / N")
    mode_stderr: Array = array("q lag", "standard error of this correlation")
    factor: Array = array("q omega", "structure factor", "time", "integral of exp(i omega t) w(t) C(q, t)")
    factor_stderr: Array = array("q omega", "standard error of the structure factor", "time")
    peak: Array = array("q", "frequency at which the structure factor is largest", "1/time")
    peak_stderr: Array = array("q", "standard error of this frequency", "1/time")
    waves: Array | None = array("q branch", "frequencies of linear waves seen at q", "1/time", default=None)
    waves_of_step: Array | None = array("q branch", "the same of the scheme at its step size", "1/time", default=None)
    corners: tuple[str, ...] | None = axis("name of a corner of the path", name="corner", default=None)
    corner_q: Array | None = array("corner", "place of the corner on the path", default=None)
    distance: Array | None = axis("distance of two sites along the lattice", name="distance", default=None)
    between: Array | None = array(
        "distance lag", "correlation of two sites", formula="E s_0(s) . s_r(s + t)", default=None
    )
    between_stderr: Array | None = array("distance lag", "standard error of this correlation", default=None)


class TimeCorrelations(Described):
    """Correlations of functions at two times of stationary paths, over all first times."""

    lag: Array = axis("time between two values", "time", name="lag")
    omega: Array = axis("angular frequency", "1/time", name="omega")
    correlation: Array = array("function lag", "covariance at two times", formula="Cov(f(s), f(s + t))")
    correlation_stderr: Array = array("function lag", "standard error of the covariance at two times")
    correlation_half: Array | None = array(
        "function lag", "half the interval of the covariance at two times", default=None
    )
    integral: Array = array("function lag", "integral of this covariance from 0 to t", claim=_KNOWN)
    integral_stderr: Array = array("function lag", "standard error of this integral")
    integral_half: Array | None = array("function lag", "half the interval of this integral", default=None)
    spectrum: Array = array("function omega", "spectrum", "", "integral of cos(omega t) w(t) C(t) over all t")
    spectrum_stderr: Array = array("function omega", "standard error of the spectrum")
    spectrum_half: Array | None = array("function omega", "half the interval of the spectrum", default=None)
    rate: Array | None = array(
        "function", "rate of decay of a fit to this covariance", "1/time", claim=_KNOWN, default=None
    )
    rate_stderr: Array | None = array("function", "standard error of this rate", "1/time", default=None)
    rate_half: Array | None = array("function", "half the interval of this rate", "1/time", default=None)
    frequency: Array | None = array(
        "function", "angular frequency of a fit to this covariance", "1/time", claim=_KNOWN, default=None
    )
    frequency_stderr: Array | None = array("function", "standard error of this frequency", "1/time", default=None)
    frequency_half: Array | None = array("function", "half the interval of this frequency", "1/time", default=None)
    structure: Structure | None = nested(prefix="structure_", default=None)

    @derived("function", "covariance at equal times")
    def variance(self) -> Array:
        """(F,) the first of the covariances at two times."""
        return self.correlation[:, 0]

    @derived("function", "half the interval of the covariance at equal times")
    def variance_half(self) -> Array | None:
        """(F,) that of the first covariance; None where it is not known."""
        return None if self.correlation_half is None else self.correlation_half[:, 0]

    @derived("function", "standard error of the covariance at equal times")
    def variance_stderr(self) -> Array:
        """(F,) that of the first covariance."""
        return self.correlation_stderr[:, 0]


class Statistics(Stored):
    """Statistics of functions over the paths of one scheme, at several times."""

    headline = ("mean", "variance", "quantile")
    measures = (
        r"Means, variances and quantiles are those of functions $f(y(t))$ over independent paths; the "
        "mean of a first passage is the fraction of paths that have passed."
    )
    row_axes = ("function", "t")
    tables = (
        Table(
            "q",
            [
                Column(lambda one, _: one.wave_vectors, "wave\nvector"),
                Column(
                    lambda one, _: one.peaks, "peak of the structure\nfactor, omega (95 %)", missing="no peak above 0"
                ),
                Column(lambda one, _: one.frequencies("waves"), "linear\nwaves"),
                Column(lambda one, _: one.frequencies("waves_of_step"), "at this\nstep size"),
            ],
            title="structure factor",
            lines=lambda one: one.shown_wave_vectors,
        ),
        Table(
            "function",
            [
                Column("time_variance", "variance (95 %)"),
                Column("time_integral", "integral of the covariance\nto the last lag (95 %)"),
                Column("time_rate", "rate of decay\n(95 %)"),
                Column("time_frequency", "angular\nfrequency (95 %)"),
            ],
            title="correlations in time",
        ),
        Table(
            "function t",
            [
                Column("mean", "mean (95 %)", form=".4g", always=True),
                Column("some", "finite\nshare", form=".7g"),
                Column("difference", "difference\n(95 %)"),
                Column("deviations", "in std.\nerrors", form=decimal),
                Column("variance", "variance (95 %)"),
                Column("autocorrelation", "autocorrelation (95 %)"),
                Column("quantile", "{}\n(95 %)", over="level", form=".4g"),
            ],
            lines=lambda one: one.shown_places,
        ),
    )

    functions: tuple[str, ...] = axis("function", name="function")
    texts: tuple[str, ...] = fact("what the functions are")
    t: Array = axis("time", "time")
    mean: Array = array("function t", "mean over the paths", formula="E phi(y(t))", claim=_MEAN)
    mean_stderr: Array = array("function t", "standard error of the mean; NaN where it is not known")
    band: Array = array("function", "standard errors in half the width of a band that holds all means with 95 %")
    mean_low: Array | None = array("function t", "lower end of the 95 % interval of the mean", default=None)
    mean_high: Array | None = array("function t", "upper end of the 95 % interval of the mean", default=None)
    finite: Array = array("function t", "share of the paths whose value is finite")
    rounding: Array | None = array(
        "function t", "root mean square change since t = 0 where that is rounding; NaN elsewhere", default=None
    )
    kurtosis: Array | None = array(
        "function t", "kurtosis, from the standard error of the variance; NaN of constants and passages", default=None
    )
    passages: Passages | None = nested(prefix="passage_", default=None)
    variance: Array | None = array("function t", "variance over the paths", claim=_VARIANCE, default=None)
    variance_stderr: Array | None = array("function t", "standard error of the variance", default=None)
    covariance: Array | None = array("function other t", "covariance of two functions", default=None)
    covariance_stderr: Array | None = array("function other t", "standard error of the covariance", default=None)
    others: tuple[str, ...] | None = axis("the other function of a covariance", name="other", default=None)
    autocorrelation: Array | None = array(
        "function t",
        "of the value at `since` with that at t",
        formula="Cov(f(s), f(t)) / Var f(s)",
        claim=_KNOWN._replace(where="is_correlated"),
        default=None,
    )
    autocorrelation_stderr: Array | None = array(
        "function t", "standard error of the autocorrelation, NaN before the time it begins at", default=None
    )
    since: Array | None = array("function", "time at which the autocorrelation begins", "time", default=None)
    quantiles: Quantiles | None = nested(default=None)
    histogram: Histogram | None = nested(default=None)
    density_map: DensityMap | None = nested(prefix="map_", default=None)
    time: TimeCorrelations | None = nested(prefix="time_", default=None)
    reference: Array | None = array("function t", "known mean; NaN where nothing is known", default=None)
    reference_formulas: tuple[str, ...] = fact(
        "formulas of known means in y1 = t; empty where there is none", default=()
    )
    difference: Array | None = array(
        "function t", "mean less the reference", claim=_KNOWN._replace(where="is_compared"), default=None
    )
    difference_stderr: Array | None = array("function t", "standard error of the difference", default=None)
    acceptance: Acceptance | None = array("", "how often flows were accepted", default=None)
    panels: tuple[str, ...] = fact("what the figure of the case shows", default=PANELS)
    nonfinite: int = fact("diverged paths (NaN or infinity)", claim=DIVERGED)
    step: float = fact("step size", "time")
    samples: int = fact("number of paths", column=True)
    ns_per_step: float = fact("time of a step and path, statistics included", "ns")

    def freedom(self, name: str) -> float:
        """As of all records; NaN of too few paths."""
        freedom = super().freedom(name)
        return freedom if freedom + 1 >= LEAST_GROUPS else np.nan

    @property
    def is_constant(self) -> Array:
        """(F,) which functions keep their value up to rounding, on all paths and at all times."""
        if self.rounding is None:
            return np.zeros(len(self.functions), bool)
        known = np.isfinite(self.rounding)
        return known.any(axis=1) & (known | (self.t == 0)).all(axis=1)

    @derived("function t", "share of the paths whose value is finite, if not all are")
    def some(self) -> Array | None:
        """(F, T) None if all values are finite."""
        return self.finite if (self.finite < 1.0).any() else None

    @derived("function t", "deviation from the reference in standard errors", name="deviations", column="deviations")
    def deviation(self) -> Array | None:
        """(F, T) means less what is known of them, in standard errors; None if nothing is."""
        if self.difference is None or self.difference_stderr is None:
            return None
        return in_standard_errors(self.difference, self.difference_stderr)

    @property
    def shown_places(self) -> Iterator[tuple[int, int]]:
        """(function, time) of the lines of a table: of few times, of those with a reference if there are any.

        Of stationary paths, and of what is constant, of the last time alone.
        """
        for f in range(len(self.functions)):
            times = np.arange(len(self.t))
            if self.difference is not None and (there := np.isfinite(self.difference[f])).any():
                times = times[there]
            if self.time is not None or self.is_constant[f]:
                times = times[-1:]
            few = np.unique(np.linspace(len(times) - 1, 0, min(len(times), _MOST_TIMES)).round().astype(int))
            yield from ((f, i) for i in times[few].tolist())

    @property
    def wave_vectors(self) -> list[str] | None:
        """(wave vectors,) their components, as text; None without any, and of a chain, where q says it."""
        if self.time is None or self.time.structure is None or self.time.structure.wave_vector.shape[1] < 2:
            return None
        return [", ".join(f"{component:.4g}" for component in q) for q in self.time.structure.wave_vector]

    @property
    def peaks(self) -> Estimate | None:
        """(wave vectors,) where structure factors are largest; NaN where that is omega = 0, or is not told from it."""
        peaks = self.estimate("structure_peak")
        if peaks is None or self.time is None or self.time.structure is None:
            return None
        central = (self.time.structure.factor.argmax(axis=-1) == 0) | (peaks.low <= 0.0)
        return peaks.map(lambda values: np.where(central, np.nan, values))

    def frequencies(self, name: str) -> list[str] | None:
        """(wave vectors,) frequencies of linear waves, a field of :class:`Structure`, as text; None without any."""
        waves = getattr(self.time and self.time.structure, name, None)
        return None if waves is None else [", ".join(f"{wave + 0.0:.4g}" for wave in branches) for branches in waves]

    @property
    def shown_wave_vectors(self) -> Iterator[tuple[int]]:
        """(wave vector,) of the lines of a table: of few wave vectors along the path."""
        if self.time is not None and self.time.structure is not None:
            count = len(self.time.structure.q)
            few = np.unique(np.linspace(0, count - 1, min(count, _MOST_WAVE_VECTORS)).round().astype(int))
            yield from ((i,) for i in few.tolist())

    @derived("function t", "whether the mean is compared with a reference")
    def is_compared(self) -> Array:
        """(F, T) where a reference is known."""
        return np.zeros(self.mean.shape, bool) if self.reference is None else ~np.isnan(self.reference)

    @derived("function", "whether there is an autocorrelation")
    def is_correlated(self) -> Array:
        """(F,) not of every function there is."""
        return np.zeros(len(self.functions), bool) if self.since is None else ~np.isnan(self.since)

    @derived("function", "why no claim about the last time is confirmed")
    def lost(self) -> Array:
        """(F,) texts, empty of functions with a mean there."""
        return np.where(np.isfinite(self.mean[:, -1]), "", "not finite at the last time")

    @property
    def _deviations(self) -> list[Array]:
        """(compared times,) of each function the modulus of the deviation, 0 without a difference."""
        if self.difference is None or self.deviation is None:
            return [np.zeros(0)] * len(self.functions)
        values = np.where(self.difference == 0.0, 0.0, np.abs(self.deviation))
        return [row[at] for row, at in zip(values, self.is_compared, strict=True)]

    @derived(
        "function",
        "largest deviation from the reference, in standard errors",
        claim=Claimed("at most", "deviation", where="is_ever_compared", lost="deviation_lost"),
    )
    def largest_deviation(self) -> Array:
        """(F,) over all times, without its sign; NaN of functions that are not compared."""
        return np.array([np.fmax.reduce(values, initial=np.nan) for values in self._deviations])

    @derived("function", "whether the mean is compared with a reference at any time")
    def is_ever_compared(self) -> Array:
        """(F,) bool."""
        return np.array([values.size > 0 for values in self._deviations])

    @derived("function", "at how many times the deviation is not finite")
    def deviation_lost(self) -> Array:
        """(F,) texts."""
        return np.array([lost_among(values, "times") for values in self._deviations])

    def _heavy(self) -> Iterator[str]:
        """Functions whose variance few paths carry, with the numbers of times at which they do."""
        if self.kurtosis is None:
            return
        heavy = few_carry(self.kurtosis, self.samples).sum(axis=1)
        counts = zip(self.functions, heavy, np.isfinite(self.kurtosis).sum(axis=1), strict=True)
        yield from (f"{name} at {count} of {known} times" for name, count, known in counts if count)

    def remarks(self) -> Iterator[str]:
        """Values that are not finite, errors that are not known, heavy tails, and passages."""
        if (self.finite < 1.0).any():
            paths = ", and quantiles are those of these paths" if self.quantiles else ""
            yield f"    finite share: of the paths whose value is finite; there is no mean of all{paths}"
        for f in np.flatnonzero(self.is_constant):
            name, change = self.functions[f], float(np.nanmax(self.rounding[f])) if self.rounding is not None else 0.0
            yield f"    {name} is constant up to rounding ({short(change, '.0e')})"
        if np.isnan(self.interval()):
            yield f"    ± ?: fewer than {LEAST_GROUPS} paths tell no errors"
        elif (np.isnan(self.mean_stderr) & np.isfinite(self.mean)).any():
            yield "    ± ?: all paths have the same value, which tells no error"
        if names := joined([*self._heavy()]):
            yield f"    {names}: {HEAVY}"
        if (passages := self.passages) is not None:
            yield "    fractions that have passed: 95 % intervals by Clopper and Pearson"
            if passages.between is not None:
                every = f"{passages.between:.5g}"
                yield f"    passages between observations (every {every}) are allowed for;"
                yield "        what may be left of the time between them is part of these intervals"
            if (numbers := self.estimate("passage_time")) is not None:
                for f in np.flatnonzero(np.isfinite(numbers.value)):
                    mean = interval_text(*(numbers.value[f], (numbers.low[f], numbers.high[f])))
                    others = f"{self.t[-1]:.5g} for paths that have not passed"
                    yield f"    {self.functions[f]}: mean first time {mean} ({others})"

    @classmethod
    def answers(cls, readings: Sequence["Statistics"]) -> Iterator[str]:
        """The means at the last time, of the first scheme."""
        one, means = readings[0], readings[0].estimate("mean")
        if means is not None and means.value.shape[1]:
            numbers = zip(one.functions, *(array[:, -1] for array in means[1:]), strict=True)
            texts = [f"{name} {interval_text(value, (low, high), '.4g')}" for name, value, low, high in numbers]
            yield f"Means at t = {one.t[-1]:g} with {one.about.label}: {'; '.join(texts)}."

    @classmethod
    def remarks_of_case(cls, readings: Sequence["Statistics"]) -> Iterator[str]:
        """Functions, where these have names."""
        for name, text in zip(readings[0].functions, readings[0].texts, strict=True):
            if name != text:
                yield f"{name}: {text}"


Record = Statistics
