"""What a spec may expect of statistics: what they are at the last time, and deviations from what is known."""

from collections.abc import Iterator, Sequence

import numpy as np

from spi.statistics.claims import Quantity, lost_among, quantity

from .results import Quantiles, Statistics


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
