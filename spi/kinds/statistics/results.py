"""What is stored of statistics."""

from typing import Annotated

import numpy as np

from spi.kinds.solver import Acceptance
from spi.storage.stored import Array, Described, Stored, array, axis, fact, nested


class Quantiles(Described):
    """Quantiles, by linear interpolation within bins of equal width."""

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
    outside: Annotated[Array, array("function t", "share of the paths outside of all bins")]


class Corrected(Described):
    """Shares of passages, extrapolated in the root of the time between two looks at a path."""

    share: Annotated[
        Array, array("function t", "share without the bias of looking at some times only; NaN where not known")
    ]
    share_stderr: Annotated[Array, array("function t", "standard error of the corrected share")]


class Statistics(Stored):
    """Statistics of functions over the paths of one scheme, at several times."""

    functions: Annotated[tuple[str, ...], axis("function", name="function")]
    texts: Annotated[tuple[str, ...], fact("what the functions are")]
    t: Annotated[Array, axis("time", "time")]
    mean: Annotated[Array, array("function t", "mean over the paths", formula="E phi(y(t))")]
    mean_stderr: Annotated[Array, array("function t", "standard error of the mean")]
    band: Annotated[
        Array, array("function", "so many standard errors are a band that holds all means at once with 95 %")
    ]
    corrected: Annotated[Corrected | None, nested(prefix="corrected_")] = None
    variance: Annotated[Array | None, array("function t", "variance over the paths")] = None
    variance_stderr: Annotated[Array | None, array("function t", "standard error of the variance")] = None
    covariance: Annotated[Array | None, array("function other t", "covariance of two functions")] = None
    covariance_stderr: Annotated[Array | None, array("function other t", "standard error of the covariance")] = None
    others: Annotated[tuple[str, ...] | None, axis("the other function of a covariance", name="other")] = None
    quantiles: Annotated[Quantiles | None, nested()] = None
    histogram: Annotated[Histogram | None, nested()] = None
    reference: Annotated[Array | None, array("function t", "what is known of the mean, NaN where nothing is")] = None
    acceptance: Annotated[Acceptance | None, array("", "how often flows were accepted")] = None
    nonfinite: Annotated[int, fact("diverged paths (NaN or infinity)")]
    step: Annotated[float, fact("step size", "time")]
    samples: Annotated[int, fact("number of paths", column=True)]
    ns_per_step: Annotated[float, fact("time of a step and path, statistics included", "ns")]

    @property
    def deviation(self) -> np.ndarray | None:
        """(F, T) means less what is known of them, in standard errors; None if nothing is."""
        if self.reference is None:
            return None
        with np.errstate(divide="ignore", invalid="ignore"):
            return (self.mean - self.reference) / self.mean_stderr


Record = Statistics
