"""What a spec may expect of statistics: means and variances at the last time, and deviations from what is known."""

from collections.abc import Iterator, Sequence

import numpy as np

from spi.statistics.claims import Quantity, quantity
from spi.storage.records import INTERVAL

from .results import Quantiles, Statistics


def quantities(readings: Sequence[Statistics]) -> Iterator[Quantity]:
    """For each function its mean and variance at the last time, and the largest deviation in standard errors."""
    for one in readings:
        deviation = one.deviation
        for f, name in enumerate(one.functions):
            half = INTERVAL * one.mean_stderr[f, -1]
            known = np.nan if one.reference is None else one.reference[f, -1]
            yield quantity("mean", one.about, one.mean[f, -1], half, name, expected=known)
            if one.variance is not None and one.variance_stderr is not None:
                half = INTERVAL * one.variance_stderr[f, -1]
                yield quantity("variance", one.about, one.variance[f, -1], half, name)
            if deviation is not None and np.isfinite(deviation[f]).any():
                yield quantity("deviation", one.about, np.nanmax(np.abs(deviation[f])), 0.0, name)
            if one.quantiles:
                yield from _quantiles(one, one.quantiles, f)


def _quantiles(one: Statistics, known: Quantiles, f: int) -> Iterator[Quantity]:
    """The quantiles of a function at the last time, each as that of ``function, level``."""
    for i, level in enumerate(known.level.tolist()):
        value, low, high = (float(each[f, -1, i]) for each in (known.quantile, known.quantile_low, known.quantile_high))
        yield Quantity("quantile", one.about, value, low, high, f"{one.functions[f]}, {level:g}-quantile")
