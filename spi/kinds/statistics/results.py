"""What is stored of statistics."""

from collections.abc import Iterator, Sequence
from typing import Annotated

import numpy as np

from spi.kinds.blocks import Acceptance
from spi.statistics.claims import Quantity, lost_among, quantity
from spi.statistics.intervals import student_of_paths
from spi.storage.records import in_standard_errors
from spi.storage.stored import Array, Described, Stored, array, axis, fact, nested

#: The sides of cells of equal area on a sphere, by Archimedes.
SPHERE_SIDES = "y3 / |y|", "longitude"


#: What a figure can show: of each function its mean, ..., and behind them matrices of correlations, and maps.
PANELS = ("mean", "difference", "histogram", "variance", "autocorrelation", "correlations", "maps")


#: Of fewer groups of paths no standard error is told.
LEAST_GROUPS = 8


class Quantiles(Described):
    """Quantiles of the paths whose value is finite, by linear interpolation within bins of equal width."""

    level: Annotated[Array, axis("probability of the quantile")]
    quantile: Annotated[Array, array("function t level", "quantile")]
    quantile_low: Annotated[Array, array("function t level", "lower end of its 95 % interval, the bin included")]
    quantile_high: Annotated[Array, array("function t level", "upper end of its 95 % interval, the bin included")]


class Histogram(Described):
    """Densities in bins of equal width; what lies outside of all of them is counted."""

    bin_low: Annotated[Array, array("function t", "lower end of the first bin")]
    bin_width: Annotated[Array, array("function t", "width of a bin")]
    density: Annotated[Array, array("function t bin", "density, 1 / (samples width) of each path in the bin")]
    density_stderr: Annotated[Array, array("function t bin", "standard error of the density")]
    outside: Annotated[Array, array("function t", "share of the paths outside of all bins, or not finite")]


class Passages(Described):
    """First times at which conditions are seen to be met, up to the last time; NaN for other functions."""

    time: Annotated[Array, array("function", "mean of the first time, the last time where it has not come", "time")]
    time_stderr: Annotated[Array, array("function", "standard error of the mean of the first time", "time")]
    between: Annotated[float | None, fact("time between two looks at a path", "time")] = None
    from_t: Annotated[Array | None, array("until_t", "beginning of an interval of first times", "time")] = None
    until_t: Annotated[Array | None, axis("end of an interval of first times", "time", name="until_t")] = None
    density: Annotated[Array | None, array("function until_t", "density of the first time in the interval")] = None
    density_stderr: Annotated[Array | None, array("function until_t", "standard error of this density")] = None


class DensityMap(Described):
    """Densities in cells of equal size, on a sphere by steradian or of two functions."""

    sides: Annotated[tuple[str, ...], axis("what the cells divide: their rows and their columns", name="side")]
    t: Annotated[Array, axis("time of the map", "time", name="map_t")]
    low: Annotated[Array, array("map_t side", "lower end of the first cell")]
    width: Annotated[Array, array("map_t side", "width of a cell")]
    density: Annotated[Array, array("map_t row column", "share of the paths in the cell, by its area")]
    stderr: Annotated[Array, array("map_t row column", "standard error of the density")]
    outside: Annotated[Array, array("map_t", "share of the paths outside of all cells")]
    law: Annotated[Array | None, array("row column", "the Gibbs law in the cells of a sphere, as a density")] = None

    @property
    def is_sphere(self) -> bool:
        """Whether the cells are those of a sphere."""
        return self.sides == SPHERE_SIDES


class Statistics(Stored):
    """Statistics of functions over the paths of one scheme, at several times."""

    headline = ("mean", "variance", "quantile")

    functions: Annotated[tuple[str, ...], axis("function", name="function")]
    texts: Annotated[tuple[str, ...], fact("what the functions are")]
    t: Annotated[Array, axis("time", "time")]
    mean: Annotated[Array, array("function t", "mean over the paths", formula="E phi(y(t))")]
    mean_stderr: Annotated[Array, array("function t", "standard error of the mean; NaN where it is not known")]
    band: Annotated[
        Array, array("function", "so many standard errors are a band that holds all means at once with 95 %")
    ]
    mean_low: Annotated[Array | None, array("function t", "lower end of the 95 % interval of the mean")] = None
    mean_high: Annotated[Array | None, array("function t", "upper end of the 95 % interval of the mean")] = None
    finite: Annotated[Array | None, array("function t", "share of the paths whose value is finite")] = None
    passages: Annotated[Passages | None, nested(prefix="passage_")] = None
    variance: Annotated[Array | None, array("function t", "variance over the paths")] = None
    variance_stderr: Annotated[Array | None, array("function t", "standard error of the variance")] = None
    covariance: Annotated[Array | None, array("function other t", "covariance of two functions")] = None
    covariance_stderr: Annotated[Array | None, array("function other t", "standard error of the covariance")] = None
    others: Annotated[tuple[str, ...] | None, axis("the other function of a covariance", name="other")] = None
    autocorrelation: Annotated[
        Array | None,
        array("function t", "of the value at `since` with that at t", formula="Cov(f(s), f(t)) / Var f(s)"),
    ] = None
    autocorrelation_stderr: Annotated[
        Array | None, array("function t", "standard error of the autocorrelation, NaN before the time it begins at")
    ] = None
    since: Annotated[Array | None, array("function", "time at which the autocorrelation begins", "time")] = None
    quantiles: Annotated[Quantiles | None, nested()] = None
    histogram: Annotated[Histogram | None, nested()] = None
    density_map: Annotated[DensityMap | None, nested(prefix="map_")] = None
    reference: Annotated[
        Array | None, array("function t", "known mean, or mean of the finer paths; NaN where nothing is known")
    ] = None
    difference: Annotated[Array | None, array("function t", "mean less the reference")] = None
    difference_stderr: Annotated[Array | None, array("function t", "standard error of the difference")] = None
    reference_step: Annotated[float | None, fact("step size of the finer paths, on the same noise", "time")] = None
    acceptance: Annotated[Acceptance | None, array("", "how often flows were accepted")] = None
    panels: Annotated[tuple[str, ...], fact("what the figure of the case shows")] = PANELS
    nonfinite: Annotated[int, fact("diverged paths (NaN or infinity)")]
    step: Annotated[float, fact("step size", "time")]
    samples: Annotated[int, fact("number of paths", column=True)]
    ns_per_step: Annotated[float, fact("time of a step and path, statistics included", "ns")]

    @property
    def interval(self) -> float:
        """Half the width of a 95 % interval in standard errors, by Student's law; NaN of too few paths."""
        return student_of_paths(self.samples, LEAST_GROUPS)

    @property
    def mean_ends(self) -> tuple[np.ndarray, np.ndarray]:
        """(F, T) the ends of the 95 % intervals of the means."""
        if self.mean_low is not None and self.mean_high is not None:
            return self.mean_low, self.mean_high
        half = self.interval * self.mean_stderr
        return self.mean - half, self.mean + half

    @property
    def finite_share(self) -> np.ndarray:
        """(F, T) of the paths, whose value is finite; of files of earlier versions 1 or 0."""
        return np.isfinite(self.mean) * 1.0 if self.finite is None else self.finite

    @property
    def deviation(self) -> np.ndarray | None:
        """(F, T) means less what is known of them, in standard errors; None if nothing is."""
        if self.difference is None or self.difference_stderr is None:
            return None
        return in_standard_errors(self.difference, self.difference_stderr)


Record = Statistics


# ---------------------------------------------------------------------------------------------------------------------
# What a spec may expect of statistics: what they are at the last time, and deviations from what is known.
# ---------------------------------------------------------------------------------------------------------------------


def quantities(readings: Sequence[Statistics]) -> Iterator[Quantity]:
    """For each function what is known at the last time, and the largest deviation; how many paths diverged."""
    for one in readings:
        yield quantity("nonfinite", one.about, one.nonfinite)
        for f, name in enumerate(one.functions):
            lost = "" if np.isfinite(one.mean[f, -1]) else "not finite at the last time"
            for which in _told(one, f):
                value, stderr = getattr(one, which)[f, -1], getattr(one, f"{which}_stderr")[f, -1]
                known = one.reference[f, -1] if which == "mean" and one.reference is not None else np.nan
                half = one.interval * stderr if stderr else 0.0
                found = quantity(which, one.about, value, half, name, expected=known, lost=lost)
                if which == "mean" and np.isfinite(found.value):
                    low, high = (float(end[f, -1]) for end in one.mean_ends)
                    found = found._replace(low=low, high=high)
                yield found
            yield from _deviation(one, f)
            if one.quantiles:
                yield from _quantiles(one, one.quantiles, f, lost)


def _told(one: Statistics, f: int) -> Iterator[str]:
    """What there is of a function at the last time, be it finite or not."""
    yield "mean"
    if one.variance is not None:
        yield "variance"
    if one.since is not None and not np.isnan(one.since[f]):
        yield "autocorrelation"
    if _compared(one, f)[-1]:
        yield "difference"


def _compared(one: Statistics, f: int) -> np.ndarray:
    """(T,) at which times the mean of a function is compared; finer paths are to tell it at all of them."""
    if one.reference is None:
        return np.zeros(len(one.t), bool)
    return np.array((one.reference_step is not None) | ~np.isnan(one.reference[f]))


def _deviation(one: Statistics, f: int) -> Iterator[Quantity]:
    """The largest deviation of a function, without its sign, in standard errors, and at how many times it is lost."""
    at = _compared(one, f)
    if one.deviation is not None and one.difference is not None and at.any():
        values = np.where(one.difference[f] == 0.0, 0.0, np.abs(one.deviation[f]))[at]  # no error without a difference
        largest = np.fmax.reduce(values)
        yield quantity("deviation", one.about, largest, 0.0, one.functions[f], lost=lost_among(values, "times"))


def _quantiles(one: Statistics, known: Quantiles, f: int, lost: str) -> Iterator[Quantity]:
    """The quantiles of a function at the last time, each as that of ``function, level``."""
    for i, level in enumerate(known.level.tolist()):
        value, low, high = (float(each[f, -1, i]) for each in (known.quantile, known.quantile_low, known.quantile_high))
        yield Quantity("quantile", one.about, value, low, high, f"{one.functions[f]}, {level:g}-quantile", lost=lost)
